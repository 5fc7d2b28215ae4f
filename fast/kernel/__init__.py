"""What numba compiles: laws, walls, the careful step, the lanes, and the entries that Python calls."""
