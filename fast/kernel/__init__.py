"""What numba compiles: laws, walls, the scalar step, the SIMD lanes, and the functions that Python calls."""
