"""Numbers by which compiled baselines know walls, tables and laws; the same as in `baselines.c`."""

ARC, BASE, LEFT, RIGHT, FLOOR, NONE = range(6)
CAP, STEM, MUSHROOM = range(3)
CONSTANT, FOURIER, BANG_BANG = range(3)
R, WIDTH, FACTOR, H, SLOPE = range(5)  # rows of the laws; the half width of the mouth is WIDTH times FACTOR
