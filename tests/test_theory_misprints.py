"""What the paper prints, evaluated as printed: secs. 4.1 and 4.2."""

from __future__ import annotations

import math

import pytest

from scene import Fourier, Mushroom, load
from theory import predict


def test_the_printed_protocol_of_the_moving_cap_gains_nothing() -> None:
    # nu = 1 - c sin^2 t, not t / 2: at t and pi - t radius, stem and mouth are the same. With the printed
    # slope the stem would close (the catalogue's moving-cap-as-printed is refused): upright it does not.
    printed = Mushroom(
        r=Fourier(mean=1.0, omega=1.0, sin=(0.5,)),
        h=Fourier(mean=1.0, omega=1.0, sin=(-0.5,)),
        nu=Fourier(mean=0.6, omega=1.0, cos=(0.0, 0.4)),
    )
    found = predict(printed, digits=4)
    assert (found.m1, found.sd, found.log_e_nc) == (0, 0, 0)
    assert 0 < found.p_nc < 1


@pytest.mark.parametrize(
    ("name", "n_particles", "printed", "n_sigma"),
    [
        ("fixed-cap-anticlockwise", 100_000, 0.0027, 3),
        ("fixed-cap-clockwise", 100_000, 0.0034, 3),
        ("moving-cap", 25_000, 0.0033, 1),
    ],
)
def test_the_printed_error_bars_are_three_and_one_standard_errors(
    name: str, n_particles: int, printed: float, n_sigma: int
) -> None:
    # Measured widths exceed the adiabatic ones a little; no other whole number of sigmas comes near.
    standard_error = float(predict(load(name), digits=6).sd) / math.sqrt(n_particles)
    assert round(printed / standard_error) == n_sigma
    assert printed == pytest.approx(n_sigma * standard_error, rel=0.05)
