"""What the figures say, in the form of `artists.said`: title, names of the axes and legend of each panel."""

CLAIMS = {
    "D1": [
        "moving-cap@1e5x#, # particles | cycles n | P(E_n < E0) | theory at this energy, drawn | "
        "theory at infinite energy | exp(-# n) | simulation, ± 1 standard error",
    ],
    "L3": [
        " | angle of the place on the arc / π, from the right end | "
        "sin φ; φ: from the arc's normal, clockwise > 0 | edge |sin φ| = nu, nu = # | "
        "captured, # hits | free, # hits",
        "frozen-mushroom: 6 particles from E0 = # | place along the boundary, anticlockwise | "
        "sine of the angle to the wall's normal, anticlockwise > 0 | captured, # collisions | "
        "free, # collisions",
    ],
    "L4": [
        " | 1/v | |nu(t_out) - nu(t_in)| | root mean square | slope 1",
        "moving-cap@1e8 | v (nu(t_out) - nu(t_in)) | density",
    ],
    "L5": [
        "moving-cap@1e7 | t / T | mean ln(E/E0), not captured so far | theory, eq. (dE) | "
        "simulation, ± 1 standard error",
        "moving-cap@1e7 | t / T | share in the chaotic zone | theory, eq. (ps) | "
        "simulation, ± 1 standard error",
        "fixed-cap-anticlockwise@1e9 | t / T | mean ln(E/E0), not captured so far | "
        "theory, eq. (dE) | simulation, ± 1 standard error",
        "fixed-cap-anticlockwise@1e9 | t / T | share in the chaotic zone | theory, eq. (ps) | "
        "simulation, ± 1 standard error",
    ],
    "M2": [
        "fixed cap, anticlockwise | half-width w | depth h",
        "fixed cap, anticlockwise | V_ell / V_cap | V_cap / V",
        "moving cap | V_ell / V_cap | V_cap / V | 0/6 | 1/6 | 2/6 | 3/6 | 4/6 | 5/6",
    ],
    "M7": [
        " | E0 | width of the uncaptured peak of ln(E1/E0) | as printed, E0^(1/4) | "
        "moving cap: exponent -# ± # | c = 0: exponent -# ± #",
    ],
    "M9": [
        "mean of ln(E1/E0) | E0 |  | theory, infinite E0 | # + # E0^(-1/2) | simulation, ± 1 standard error",
        "share never captured | E0 | ",
        "mean of exp(-s/2) | E0 | ",
    ],
    "N5": [
        " | time of capture, t_in | ln(E1/E0), theory | largest: # at t = # | never captured: -#",
    ],
    "X1": [
        "fixed-cap-anticlockwise, E0 = $#^{9}$, # particles |  | density",
        "fixed-cap-clockwise, E0 = $#^{9}$, # particles |  | density",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error | simulation | "
        "theory at this energy, peak # wide | theory, captured, sharp | theory, never captured",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error | simulation | "
        "theory at this energy, peak # wide | theory, captured, sharp | theory, never captured",
    ],
    "X2": [
        "moving-cap, E0 = $#^{6}$, # particles |  | density",
        "moving-cap, E0 = $#^{7}$, # particles |  | density",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error | simulation | "
        "theory at this energy, peak # wide | theory, captured, sharp | theory, never captured",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error | simulation | "
        "theory at this energy, peak # wide | theory, captured, sharp | theory, never captured",
    ],
    "X3": [
        "moving-cap@1e7 | time of capture | density | simulation | theory, eq. (ps)",
        "fixed-cap-anticlockwise@1e9 | time of capture | density",
        "fixed-cap-clockwise@1e9 | time of capture | density",
    ],
    "X4": [
        "n = #, E0 = $#^{5}$, # particles | (1/#) ln(E_#/E0) | density | simulation | "
        "sums of n cycles, by theory | Gaussian",
        "n = #, E0 = $#^{5}$, # particles | (1/#) ln(E_#/E0) | density",
        "n = #, E0 = $#^{5}$, # particles | (1/#) ln(E_#/E0) | density | simulation | "
        "sums of n cycles, by theory | Gaussian",
        "n = #, E0 = $#^{5}$, # particles | (1/#) ln(E_#/E0) | density",
    ],
    "X5": [
        "ergodic, E0 = $#^{7}$, # particles |  | density",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error | simulation | "
        "theory at this energy, peak # wide | theory, never captured",
    ],
    "X6": [
        " | ln(E1/E0) of the never captured, from theory's | density | tilted stem | "
        "upright stem | Gaussian, tilted stem's width",
        " | ln(E1/E0) of the never captured, from theory's | density",
    ],
    "X7": [
        "retraced-arc, the way there | V_ell / V_cap | V_cap / V | captures | releases",
        " |  |  | as in X1",
    ],
}

PICTURES = {
    "energy": [
        "moving-cap: # collisions from E0 = # | t / T | ln(E/E0)",
        "this particle | theory with these captures | theory, never captured | captured",
    ],
    "energy in a cap": [
        "breathing-circle: # collisions from E0 = # | t / T | ln(E/E0)",
        "this particle | theory",
    ],
    "growth": [
        "moving-cap, E0 = $#^{6}$, # particles | cycle of the walls | ln(E/E0) | "
        "single particles | ± 1 sd of one | theory, m1 = # a cycle | theory ± its sd | mean",
        "after the first cycle | s = ln(E1/E0) | density | simulation | theory at this energy, peak # wide",
    ],
    "histogram": [
        "moving-cap, E0 = $#^{6}$, # particles\n(# of them never free, or lost: left out) |  | density",
        " | s = ln(E1/E0) | (sim. − theory)\n/ error",
        "simulation | theory at this energy, peak # wide | theory, never captured",
    ],
    "histogram at high energies": [
        "a scene, E0 = $#^{6}$, # particles | s = ln(E1/E0) | density",
        "simulation | theory, captured, at high energies | theory, never captured",
    ],
    "loops": [
        " | narrowest mouth w / r | $m_1$ per cycle | anticlockwise, depth at most 1 r | "
        "clockwise, depth at most 1 r | supremum, depth at most 1 r",
    ],
    "map": [
        "moving-cap: 4 particles from E0 = # | place along the boundary, anticlockwise | "
        "sine of the angle to the wall's normal, anticlockwise > 0",
        "captured, # collisions | free, # collisions",
    ],
    "map of a cap": [
        "breathing-circle: # collisions from E0 = # | place along the boundary, anticlockwise | "
        "sine of the angle to the wall's normal, anticlockwise > 0",
        "# collisions",
    ],
    "path": [
        "moving-cap: # collisions from E0 = # | x [length] | y [length] | walls at the end | "
        "walls at the start | start",
        " |  | collision",
    ],
    "path at rest": [
        "a table: 9 collisions from E0 = # | x [length] | y [length] | walls at the start | start",
        " |  | collision",
    ],
    "phases": [
        " | phase of the stem ahead of the cap / π | amplitude of radius and depth / mean",
        " |  | $m_1$ per cycle",
    ],
    "section": [
        "moving-cap: 4 particles from E0 = # | "
        "angle of the place on the arc / π, from the right end | "
        "sin φ; φ: from the arc's normal, clockwise > 0",
        "edge |sin φ| = nu, nu = # to 1 | captured, # hits | free, # hits",
    ],
    "section at a phase": [
        "moving-cap: 4 particles from E0 = #, at t/T = # | "
        "angle of the place on the arc / π, from the right end | "
        "sin φ; φ: from the arc's normal, clockwise > 0",
        "edge |sin φ| = nu, nu = # | free, 4 hits",
    ],
    "section of a stem": [
        "fermi-ulam: # collisions from E0 = # | phase t/T of the hit of a moving floor | "
        "vy after the hit [length/time]",
    ],
    "section of a stem at a phase": [
        "fermi-ulam: # collisions from E0 = #, at t/T = # | y [length] | vy [length/time]",
    ],
}
