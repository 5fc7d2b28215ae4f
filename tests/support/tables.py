"""Small tables that many tests share, simple enough for answers by hand; hard cases stand on some, too."""

from conformance.cases.grazing_and_stem_cases import BOX, CIRCLE, LIFT, STATIC
from scene import BangBang, Cap, Fourier, Mushroom

__all__ = ["BOX", "BREATHING", "CIRCLE", "LEAP", "LIFT", "STATIC"]

BREATHING = Cap(r=Fourier(mean=1.0, omega=1.0, sin=(0.25,)))
# The width leaps from 0.01 to 0.9 within 2e-16 of the second event, at t = 2^110.
LEAP = Mushroom(
    r=1.0,
    h=1.0,
    w=BangBang(
        knots=((0.0, 0.01), (1.6097936544959741, 0.01), (1.6097936544959743, 0.9), (5.6, 0.9), (16.0, 0.01))
    ),
)
