"""Scenes by name: those of the catalogue, and those that only the audit of the paper needs."""

from scene.laws import BangBang, Fourier
from scene.load import catalogue, load
from scene.tables import Mushroom, Scene


def _fixed_cap(period: float, w: dict[float, float], h: dict[float, float], name: str) -> Mushroom:
    """Return a cap at rest over a stem that goes through values by time, as in sec. 4.1."""
    half_width, depth = (BangBang((*knots.items(), (period, knots[0]))) for knots in (w, h))
    return Mushroom(r=1.0, h=depth, w=half_width, slope=0.04016414896719182, name=name)


_SWINGING = Fourier(1.0, 1.0, (), (0.3,))
# Scenes that are no part of the catalogue.
SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        # One parameter moves, the rest stand still (X7, C12, C13).
        Mushroom(r=1.0, h=1.0, nu=Fourier(0.6, 1.0, (0.4,)), slope=0.1111, name="only-mouth"),
        Mushroom(r=Fourier(1.0, 1.0, (-0.3,)), h=1.0, w=0.6, slope=0.1111, name="only-radius"),
        Mushroom(r=1.0, h=_SWINGING, nu=0.6, slope=0.1111, name="only-depth"),
        Mushroom(r=1.0, h=1.0, nu=0.6, slope=Fourier(0.2, 1.0, (), (0.1,)), name="only-slope"),
        # The mouth keeps its share of the cap: nobody is captured or released (C12).
        Mushroom(r=_SWINGING, h=Fourier(1.0, 1.0, (0.4,)), nu=0.6, slope=0.1111, name="flux-free"),
        # At rest, its sides upright (L3).
        Mushroom(r=1.0, h=1.0, w=0.5, name="frozen-untilted"),
        # The loop of fixed-cap-anticlockwise, its legs not as long as one another (C3).
        _fixed_cap(
            1.0,
            {0: 1, 0.15: 0.3, 0.55: 0.3, 0.75: 1},
            {0: 6, 0.15: 6, 0.55: 2, 0.75: 2},
            name="fixed-cap-other-legs",
        ),
        # Two turns, each on another loop in another time: shapes return only more or less (C10).
        _fixed_cap(
            2.0,
            {
                0: 1,
                0.3125: 0.3,
                0.5: 0.3,
                0.6875: 0.98,
                0.9375: 0.98,
                1.25: 0.25,
                1.59375: 0.25,
                1.8125: 1,
            },
            {0: 6, 0.3125: 6, 0.5: 2, 0.6875: 2, 0.9375: 5.5, 1.25: 5.5, 1.59375: 1.9, 1.8125: 1.9},
            name="fixed-cap-irregular",
        ),
    )
}


def is_scene(name: str) -> bool:
    """Tell whether this is the name of a scene of SCENES or of the catalogue."""
    return name in SCENES or name in catalogue()


def scene_named(name: str) -> Scene:
    """Return one of SCENES, or what `scene.load` knows.

    Raises:
        InvalidScene: there is none, or it is not valid.
    """
    return SCENES[name] if name in SCENES else load(name)
