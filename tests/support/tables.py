"""Small tables that many tests share, simple enough for answers by hand; hard cases stand on some, too."""

from scene import BangBang, Cap, Fourier, Mushroom, Stem

CIRCLE = Cap(r=1.0)
BOX = Stem(w=1.0, h=1.0)
STATIC = Mushroom(r=1.0, h=1.0, w=0.5)
# A floor that comes up at constant acceleration 16, h = 2 - 8 t^2 until t = 1/4, then
# h = 1 + 8 (t - 1/2)^2 until t = 3/4, then 2 - 8 (t - 1)^2: down again.
LIFT = Stem(w=1.0, h=BangBang(knots=((0.0, 2.0), (0.5, 1.0), (1.0, 2.0))))

BREATHING = Cap(r=Fourier(mean=1.0, omega=1.0, sin=(0.25,)))
# The width leaps from 0.01 to 0.9 within 2e-16 of the second event, at t = 2^110.
LEAP = Mushroom(
    r=1.0,
    h=1.0,
    w=BangBang(
        knots=((0.0, 0.01), (1.6097936544959741, 0.01), (1.6097936544959743, 0.9), (5.6, 0.9), (16.0, 0.01))
    ),
)
