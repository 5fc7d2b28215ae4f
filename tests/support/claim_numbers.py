"""What the comparisons of the audit's claims must compare, by their words: from samples and theory alone.

Each figure is written down here a second time, with numpy, so that a slip in `mushrooms/audit/claims` is a
difference. The bands are those that the claims state: errors of the theory of finite energy, and what is seen
late.
"""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from mpmath import fp

import theory
from mushrooms.audit.claims.finite_energy import DRAWN_SEED, summed
from mushrooms.audit.runs import RUNS, Sample, scene_of
from mushrooms.audit.tolerances import N_SIGMA
from scene import load
from scene.laws import law_of

N_DRAWN = 100_000  # as the tests have it
INFINITE = 1e40
# By claim, how many of its comparisons are written down here, at least.
CLAIMS = {
    "M3": 2, "M5": 2, "M6": 8, "M7": 10, "M8": 2, "M9": 12, "M11": 2, "X1": 16, "X2": 10, "X4": 8, "X5": 4,
    "X6": 2, "X7": 6, "X8": 8, "C1": 3, "C3": 4, "C5": 4, "C9": 1, "C10": 4, "C12": 3, "C13": 1, "C14": 3,
    "D1": 3, "L2": 4, "L3": 2, "L4": 1, "L5": 20, "L6": 20, "I1": 5,
}  # fmt: skip
Wanted = dict[str, float]


def mean(x: Any) -> Wanted:
    """Return the mean and its standard error."""
    return {"value": float(np.mean(x)), "error": float(np.std(x, ddof=1) / len(x) ** 0.5)}


def share(x: Any) -> Wanted:
    """Return a share and its error, with two more of each kind."""
    n = len(x) + 4
    p = (np.sum(x) + 2) / (len(x) + 4)
    return {"value": float(np.mean(x)), "error": float((p * (1 - p) / n) ** 0.5)}


def spread(x: Any) -> Wanted:
    """Return the standard deviation and its error, from the fourth moment."""
    c = np.asarray(x) - np.mean(x)
    error = ((np.mean(c**4) - np.mean(c**2) ** 2) / len(c)) ** 0.5 / (2 * np.std(c))
    return {"value": float(np.std(c, ddof=1)), "error": float(error)}


def ratio(a: Wanted, b: Wanted) -> Wanted:
    """Return a ratio of independent numbers."""
    relative = math.hypot(a["error"] / a["value"], b["error"] / b["value"])
    return {"value": a["value"] / b["value"], "error": a["value"] / b["value"] * relative}


def free(sample: Sample) -> Any:
    """Tell which particles have no capture interval in the first cycle."""
    return np.isnan(sample.t_in[:, 0]).all(axis=1)


def free_until(sample: Sample, t: float) -> Any:
    """Tell which were not captured before a time."""
    return ~(np.fmin.reduce(sample.t_in[:, 0], axis=1) <= t)


def power(x: Any, rows: list[Wanted], *orders: float) -> Wanted:
    """Fit log y = a + p log x, with further powers beside it, by weighted least squares."""
    log_x = np.log(x)
    y = np.log([row["value"] for row in rows])
    weight = np.array([row["value"] / row["error"] for row in rows])
    columns = np.column_stack([np.ones_like(log_x), log_x, *(np.asarray(x) ** order for order in orders)])
    found = np.linalg.lstsq(columns * weight[:, None], y * weight, rcond=None)[0]
    covariance = np.linalg.inv((columns * weight[:, None] ** 2).T @ columns)
    return {"value": float(found[1]), "error": float(covariance[1, 1] ** 0.5)}


class Numbers:
    """The comparisons by claim and words."""

    def __init__(self, sample: Callable[[str], Sample], predict: Callable[..., Any]) -> None:
        self.sample = sample
        self._predict = predict

    def limit(self, run: str) -> Any:
        """Return the theory of infinite energy."""
        return self._predict(scene_of(RUNS[run]), 12)

    def at(self, run: str, energy: float | None = None) -> theory.FiniteEnergy:
        """Return the theory of finite energy."""
        return theory.at_energy(scene_of(RUNS[run]), energy or RUNS[run].energy)

    def of(self, claim: str, what: str) -> Wanted | None:
        """Return the fields of a check that are known here, None if there are none."""
        for pattern, name in FORMS:
            if found := re.fullmatch(pattern, what):
                wanted = getattr(self, name)(*found.groups())
                if wanted is not None:
                    return dict(wanted)
        special = getattr(self, f"of_{claim}", None)
        return None if special is None else special(what)

    def less_bias(self, run: str, found: Wanted, of: Callable[[Any], float], error: str) -> Wanted:
        """Return a figure less what finite energy adds to it."""
        bias = of(self.at(run)) - of(self.at(run, INFINITE))
        band = getattr(self.at(run).theory_error, error)
        return {**found, "value": found["value"] - bias, "band": band}

    def growth(self, run: str, end: str = "") -> Wanted:
        """The mean of log E1/E0."""
        expected = 0.0 if end else float(self.limit(run).m1)
        s = self.sample(run).s[:, 0]
        return {**self.less_bias(run, mean(s), lambda f: f.mean_s, "mean_s"), "expected": expected}

    def escape(self, run: str) -> Wanted:
        """The share never captured, of those that take part."""
        one = self.sample(run)
        found = share(free(one)[one.takes_part])
        return {
            **self.less_bias(run, found, lambda f: f.p_nc, "p_nc"), "expected": float(self.limit(run).p_nc)
        }  # fmt: skip

    def peak(self, run: str) -> Wanted:
        """The mean energy of the never captured."""
        one = self.sample(run)
        found = self.less_bias(run, mean(one.s[free(one), 0]), lambda f: f.peak[0], "peak_mean")
        return {**found, "expected": float(self.limit(run).log_e_nc)}

    def width(self, run: str) -> Wanted:
        """The width of their peak."""
        one = self.sample(run)
        sigma = self.at(run).peak[1] ** 0.5
        band = sigma * self.at(run).theory_error.variance / 2
        return {**spread(one.s[free(one), 0]), "expected": sigma, "band": band}

    def inverse(self, run: str) -> Wanted:
        """The mean of E0/E1."""
        found = mean(np.exp(-self.sample(run).s[:, 0]))
        return {
            **self.less_bias(run, found, lambda f: float(f.mean_of_exp(-1)), "mean_s"), "expected": 1.0
        }  # fmt: skip

    def bars(self, run: str, count: str) -> Wanted:
        """M6: some sigma_N of the paper's number of particles."""
        n = 25_000 if run.startswith("moving") else 100_000
        s = self.sample(run).s[:, 0]
        found = spread(s)
        k = int(count) / n**0.5
        error = found["error"] * (1 + len(s) / n) ** 0.5
        return {"value": k * found["value"], "error": k * error, "band": 5e-5}

    def of_M6(self, what: str) -> Wanted | None:
        """M6: the paper's mean beside ours."""
        run = what.partition(":")[0]
        bar, printed = {
            "fixed-cap-anticlockwise@1e9": (0.0027 / 3, 0.0463),
            "fixed-cap-clockwise@1e9": (0.0034 / 3, 0.0537),
            "moving-cap@1e7": (0.0033, 0.1213),
        }[run]  # fmt: skip
        found = mean(self.sample(run).s[:, 0])
        return {
            "value": found["value"],
            "error": math.hypot(found["error"], bar),
            "expected": printed,
            "band": 5e-5,
        }

    def of_M3(self, what: str) -> Wanted:
        """M3: E goes as a power of r in the cap."""
        one = self.sample("moving-cap@1e7")
        scene = load("moving-cap")
        first, last = (2 * math.pi * k / 16 for k in (7, 9))
        begin = np.fmin.reduce(one.t_in[:, 0], axis=1)
        end = np.fmin.reduce(one.t_out[:, 0], axis=1)
        inside = (begin < first) & (end > last)
        change = one.phase_s[inside, 0, 8] - one.phase_s[inside, 0, 6]
        rise = math.log(scene.laws["r"].value(fp, last) / scene.laws["r"].value(fp, first))
        band = 2 * float(scene.laws["r"].bounds().slope) / (2e7) ** 0.5 / abs(rise)
        return {**mean(-change / rise), "expected": 2.0 if "r²" in what else 1.0, "band": band}

    def extra_variance(self, run: str) -> Wanted:
        """M5: the variance beyond that of infinite energy."""
        found = spread(self.sample(run).s[:, 0])
        sharp = float(self.limit(run).sd)
        error = found["error"] * (1 + self.sample(run).n / 100_000) ** 0.5
        here = self.at(run)
        left = self.at(run).theory_error
        return {
            "value": found["value"] ** 2 - sharp**2,
            "error": 2 * found["value"] * error,
            "expected": here.variance_s - self.at(run, INFINITE).variance_s,
            "band": left.variance * here.peak[1] + 2 * sharp * left.captured_mean,
        }

    def of_M7(self, what: str) -> Wanted | None:
        """M7: the exponents of the widths."""
        label = what.partition(":")[0]
        runs = {
            "moving cap": [f"moving-cap@1e{k}" for k in (6, 7, 8)],
            "c = 0": [f"ergodic@1e{k}" for k in (5, 6, 7)],
            "fixed cap, anticlockwise": ["fixed-cap-anticlockwise@1e7", "fixed-cap-anticlockwise@1e9"],
            "fixed cap, clockwise": ["fixed-cap-clockwise@1e7", "fixed-cap-clockwise@1e9"],
        }[label]
        energies = [RUNS[run].energy for run in runs]
        rows = []
        for run in runs:
            s = self.sample(run).s[free(self.sample(run)), 0]
            rows.append(spread((2 * RUNS[run].energy) ** 0.5 * np.exp(s / 2) if "speeds" in what else s))
        theirs = [
            {"value": self.at(run).peak[1] ** 0.5, "error": self.at(run).peak[1] ** 0.5} for run in runs
        ]
        reach = math.log(energies[-1] / energies[0])
        band = (
            abs(power(energies, theirs)["value"] + 0.25) + self.at(runs[0]).theory_error.variance / 2 / reach
        )
        return {**power(energies, rows), "expected": -0.25 if "-1/4" in what else 0.25, "band": band}

    def of_M8(self, what: str) -> Wanted | None:
        """M8: the drift and the width of c = 0."""
        if what.startswith("its standard deviation"):
            return self.width("ergodic@1e7")
        if not what.startswith("mean of s"):
            return None
        found = self.at("ergodic@1e7")
        s = self.sample("ergodic@1e7").s[:, 0]
        return {**mean(s), "expected": found.mean_s, "band": found.theory_error.mean_s}

    def of_M9(self, what: str) -> Wanted | None:
        """M9: the means against the energy."""
        m1 = float(self.limit("moving-cap@1e3").m1)
        if what.startswith("moving-cap@1e3"):
            return {**mean(self.sample("moving-cap@1e3").s[:, 0]), "expected": m1, "band": 0.0}
        runs = [f"moving-cap@1e{k}" for k in range(4, 9)]
        rows = [mean(self.sample(run).s[:, 0]) for run in runs]
        weight = [1 / row["error"] for row in rows]
        slow = np.array([RUNS[run].energy for run in runs]) ** -0.5
        columns = np.column_stack([np.ones(5), slow]) * np.array(weight)[:, None]
        found, bent = (
            np.linalg.lstsq(columns, np.array(y) * weight, rcond=None)[0][0]
            for y in ([row["value"] for row in rows], [self.at(run).mean_s for run in runs])
        )
        left = abs(bent - self.at(runs[0], INFINITE).mean_s) + self.at(runs[0]).theory_error.mean_s
        error = float(np.linalg.inv(columns.T @ columns)[0, 0] ** 0.5)
        return {"value": float(found), "error": error, "expected": m1, "band": left}

    def less_added(self, run: str) -> Wanted:
        """M9: the mean less the predicted bias."""
        return self.growth(run)

    def half(self, run: str) -> Wanted | None:
        """M9: the mean of exp(-s/2)."""
        found = mean(np.exp(-self.sample(run).s[:, 0] / 2))
        band = self.at(run).theory_error.mean_s / 2
        return {**found, "expected": float(theory.unbiased_mean(load("moving-cap"))), "band": band}

    def of_M11(self, what: str) -> Wanted | None:
        """M11: who loses and who gains while the stem grows."""
        one = self.sample("fixed-cap-clockwise@1e9")
        if "free lose" in what:
            return mean(one.phase_s[free(one), 0, 3] - one.phase_s[free(one), 0, 5])
        return mean(one.s[~free(one), 0]) if "come out ahead" in what else None

    def of_X2(self, what: str) -> Wanted | None:
        """X2: the paper's share, and the narrower peak."""
        low = self.sample("moving-cap@1e6")
        high = self.sample("moving-cap@1e7")
        if "38.78" in what:
            found = share(free(high)[high.takes_part])
            return {**found, "error": math.hypot(found["error"], 0.00308), "expected": 0.3878, "band": 5e-5}
        if "narrower" in what:
            found = ratio(spread(high.s[free(high), 0]), spread(low.s[free(low), 0]))
            return {"value": 1 - found["value"], "error": found["error"]}
        return None

    def of_X5(self, what: str) -> Wanted | None:
        """X5: c = 0."""
        s = self.sample("ergodic@1e7").s[:, 0]
        found = self.at("ergodic@1e7")
        left = found.theory_error
        if what.startswith("mean of log"):
            return self.growth("ergodic@1e7", "0")
        if what == "mean of E0/E1":
            return {**mean(np.exp(-s)), "expected": float(found.mean_of_exp(-1)), "band": left.mean_s}
        if "shrinks" in what:
            before = self.at("ergodic@1e6")
            theirs = (found.peak[1] / before.peak[1]) ** 0.5
            band = theirs * (left.variance + before.theory_error.variance) / 2
            earlier = spread(self.sample("ergodic@1e6").s[:, 0])
            return {**ratio(spread(s), earlier), "expected": theirs, "band": band}
        return None

    def of_X6(self, what: str) -> Wanted | None:
        """X6: how much wider the peak over the upright stem is."""
        if "wider" not in what:
            return None
        wide, narrow = (self.sample(run) for run in ("untilted@1e6", "moving-cap@1e6"))
        return ratio(spread(wide.s[free(wide), 0]), spread(narrow.s[free(narrow), 0]))

    def twice(self, run: str) -> Wanted:
        """X7: the share captured in both windows."""
        p_nc = float(self.limit(run).p_nc)
        here = self.at(run)
        both = np.isfinite(self.sample(run).t_in[:, 0]).sum(axis=1) == 2
        band = here.theory_error.p_nc + abs(here.p_nc - p_nc)
        return {**share(both), "expected": (1 - p_nc**0.5) ** 2, "band": band}

    def both_peaks(self, first: str) -> Wanted:
        """X8: the sum of the peaks of a cycle and its reverse."""
        other = {"fixed-cap-anticlockwise@1e9": "fixed-cap-clockwise@1e9"}.get(
            first, "moving-cap-reversed@1e6"
        )
        a, b = self.peak(first), self.peak(other)
        error = math.hypot(a["error"], b["error"])
        return {
            "value": a["value"] + b["value"],
            "error": error,
            "expected": 0.0,
            "band": a["band"] + b["band"],
        }

    def grows(self, run: str) -> Wanted:
        """X8: the mean of log E1/E0."""
        return mean(self.sample(run).s[:, 0])

    def energy_grows(self, run: str) -> Wanted:
        """X8: the mean of E1/E0."""
        return mean(np.exp(self.sample(run).s[:, 0]))

    def of_X4(self, what: str) -> Wanted | None:
        """X4: sums of n cycles."""
        run, n, figure = re.fullmatch(r"(\S+), n = (\d+): (.*)", what).groups()
        k = int(n)
        sums = summed(run, int(n))
        total, m1, variance = (
            self.sample(run).s[:, k - 1],
            *map(float, theory.cumulants(load("moving-cap"), 3)[1:3]),
        )
        z, drawn = ((x - sums.mean) / sums.sd for x in (total, sums.values))
        left = self.at(run).theory_error
        if figure.startswith("mean"):
            found = mean(total)
            return {
                "value": (found["value"] - sums.mean) / k + m1, "error": found["error"] / k, "expected": m1,
                "band": left.mean_s + N_SIGMA * sums.sd / N_DRAWN**0.5 / k,
            }  # fmt: skip
        if figure.startswith("standard"):
            found = spread(total)
            more = abs(1 - k * variance / sums.sd**2) * left.variance / 2
            return {
                "value": found["value"] / k, "error": found["error"] / k, "expected": sums.sd / k,
                "band": (more + N_SIGMA / (2 * N_DRAWN) ** 0.5) * sums.sd / k,
            }  # fmt: skip
        if figure.startswith("share"):
            mine = share(np.abs(z) < 1)
            its = share(np.abs(drawn) < 1)
        elif figure.startswith("skewness"):
            mine = mean(z**3)
            its = mean(drawn**3)
        else:
            return None
        return {**mine, "expected": its["value"], "band": N_SIGMA * its["error"]}

    def of_C1(self, what: str) -> Wanted | None:
        """C1: correlations of cycles, and how the spread grows."""
        run = "moving-cap@1e5x30"
        mine = np.diff(self.sample(run).s, axis=1, prepend=0.0)
        drawn = np.diff(self.at(run).draw(30, N_DRAWN // 30, DRAWN_SEED), axis=1, prepend=0.0)
        if "correlation" in what:
            apart = 1 if "one apart" in what else 2
            a, b = (np.corrcoef(x[:, :-apart].ravel(), x[:, apart:].ravel())[0, 1] for x in (mine, drawn))
            errors = [x[:, apart:].size ** -0.5 for x in (mine, drawn)]
            return {"value": a, "error": errors[0], "expected": b, "band": N_SIGMA * errors[1]}
        a, b = (ratio(spread(x.sum(axis=1)), spread(x[:, 0])) for x in (mine, drawn))
        return {**a, "expected": b["value"], "band": N_SIGMA * b["error"]}

    def of_C5(self, what: str) -> Wanted | None:
        """C5: the mean speed gained in a cycle, and how it doubles."""
        run, _, figure = what.partition(": ")
        if run not in RUNS:
            return None
        one = self.sample(run)
        v = (2e4) ** 0.5 * np.exp(np.column_stack([np.zeros(one.n), one.s]) / 2)
        half = v[:, 60] - v[:, 0]
        whole = v[:, 120] - v[:, 0]
        if figure == "mean speed gained in a cycle":
            return mean(whole / 120)
        r = whole.mean() / half.mean()
        error = mean((whole - r * half) / half.mean())["error"] / r / math.log(2)
        return {"value": math.log2(r), "error": error, "expected": 1.0}

    def of_C9(self, what: str) -> Wanted:
        """C9: the share of the captured that gain."""
        one = self.sample("moving-cap@1e7")
        here = self.at("moving-cap@1e7")
        gains = one.s[~free(one), 0]
        return {**share(gains > 0), "expected": 1 - float(here.captured_cdf(np.zeros(1))[0])}

    def without_growth(self, run: str) -> Wanted:
        """C12 and C13: the mean of exp(-s/2)."""
        one = self.sample(run)
        return {**mean(np.exp(-one.s[one.takes_part, 0] / 2)), "expected": 1.0, "band": 0.0}

    def of_C14(self, what: str) -> Wanted:
        """C14: what a third of the cycles adds to log E."""
        k = 10 * int(what.partition("part ")[2][0])
        s = np.pad(self.sample("moving-cap@1e5x30").s, ((0, 0), (1, 0)))
        return mean((s[:, k] - s[:, k - 10]) / 10)

    def loss(self, run: str, n: str) -> Wanted:
        """D1: the share with less energy after n cycles."""
        k = int(n)
        left = self.at(run).theory_error.mean_s
        values = summed(run, k).values
        its = share(values < 0)
        near = np.mean(np.abs(values) < 0.05) / 0.1
        band = N_SIGMA * its["error"] + near * k * left
        return {**share(self.sample(run).s[:, k - 1] < 0), "expected": its["value"], "band": band}

    def cap_change(self, run: str) -> Any:
        """Return the change of log(E V_cap) of the captured from phase 7/16 to 9/16."""
        one = self.sample(run)
        r = load("moving-cap").r
        first, last = (2 * math.pi * k / 16 for k in (7, 9))
        begin = np.fmin.reduce(one.t_in[:, 0], axis=1)
        end = np.fmin.reduce(one.t_out[:, 0], axis=1)
        inside = (begin < first) & (end > last)
        cap = 2 * math.log(law_of(r).value(fp, last) / law_of(r).value(fp, first))
        return one.phase_s[inside, 0, 8] - one.phase_s[inside, 0, 6] + cap

    def volume_change(self, run: str, phase: float) -> float:
        """Return log V(t) / V(0)."""
        scene = scene_of(RUNS[run])
        now, start = (theory.volumes_at(fp, scene, scene.period * p) for p in (phase, 0.0))
        return math.log((now.v_cap + now.v_stem) / (start.v_cap + start.v_stem))

    def of_L2(self, what: str) -> Wanted | None:
        """L2: what is invariant, and how far."""
        ladder = [f"moving-cap@1e{k}" for k in range(4, 9)]
        ergodic = [f"ergodic@1e{k}" for k in range(4, 8)]
        if what.startswith("moving-cap@1e7"):
            arc = float(load("moving-cap").laws["r"].bounds().slope)
            return {**mean(self.cap_change("moving-cap@1e7")), "expected": 0.0, "band": 2 * arc / 2e7**0.5}
        if what.startswith("log(E V_cap)"):
            rows = [spread(self.cap_change(run)) for run in ladder]
            return {**power([RUNS[run].energy for run in ladder], rows, -0.5), "expected": -0.5}
        changes = [self.sample(run).phase_s[:, 0, 3] + self.volume_change(run, 0.5) for run in ergodic]
        if what.startswith("c = 0"):
            rows = [spread(change) for change in changes]
            return {**power([RUNS[run].energy for run in ergodic], rows, -0.5), "expected": -0.25}
        drift = float(self.at("ergodic@1e7").zone([math.pi])[1][0]) / 4
        found = mean(changes[-1])
        band = self.at("ergodic@1e7").theory_error.mean_s
        return {**found, "value": found["value"] - drift, "expected": 0.0, "band": band}

    def stays(self, name: str) -> Wanted:
        """L3: the particles that never meet the stem."""
        run = f"{name}@1e8"
        now = theory.volumes_at(fp, scene_of(RUNS[run]), 0.0)
        island = now.v_ell / (now.v_cap + now.v_stem)
        return {**share(self.sample(run).stem_hits == 0), "expected": island, "band": 1e-3}

    def of_L4(self, what: str) -> Wanted | None:
        """L4: nu at release less nu at capture."""
        if not what.startswith("nu("):
            return None
        runs = [f"moving-cap@1e{k}" for k in range(4, 9)]
        rows = []
        for run in runs:
            one = self.sample(run)
            t_in, t_out = (t[~free(one), 0, 0] for t in (one.t_in, one.t_out))
            gap = mean((0.4 * (np.cos(t_out) - np.cos(t_in))) ** 2)
            root = gap["value"] ** 0.5
            rows.append({"value": root, "error": gap["error"] / (2 * root)})
        return {**power([RUNS[run].energy for run in runs], rows, -0.5), "expected": -0.5}

    def late(self, run: str) -> float:
        """Return the longest time between hits of the arc."""
        return float(2 * scene_of(RUNS[run]).laws["r"].bounds().highest) / (2 * RUNS[run].energy) ** 0.5

    def zone_energy(self, run: str, phase: str) -> Wanted:
        """L5: mean log E of those not captured so far."""
        one = self.sample(run)
        t = scene_of(RUNS[run]).period * float(phase)
        k = RUNS[run].phases.index(float(phase))
        now, before = (float(self.at(run).zone([x])[0][0]) for x in (t, t - self.late(run)))
        band = self.at(run).theory_error.peak_mean + abs(now - before)
        return {**mean(one.phase_s[free_until(one, t), 0, k]), "expected": now, "band": band}

    def zone_share(self, run: str, phase: str) -> Wanted:
        """L6: the share in the chaotic zone."""
        one = self.sample(run)
        t = scene_of(RUNS[run]).period * float(phase)
        inside = ((one.t_in[:, 0] <= t) & (t < one.t_out[:, 0])).any(axis=1)
        return {"value": float(1 - inside.mean())}


RUN = r"(\S+@\S+)"
FORMS = (
    (rf"{RUN}: mean of log E1/E0, less its bias -?[\d.]+(, is 0)?", "growth"),
    (rf"{RUN}: share never captured, less its bias -?[\d.]+", "escape"),
    (rf"{RUN}: mean log E1/E0 of the never captured, less its bias -?[\d.]+", "peak"),
    (rf"{RUN}: width of the peak of the never captured", "width"),
    (rf"{RUN}: width, predicted by frozen tables", "width"),
    (rf"{RUN}: simulation, less its bias -?[\d.]+", "inverse"),
    (rf"{RUN}: (\d) sigma_N", "bars"),
    (rf"{RUN}: variance of s beyond the adiabatic one, at T = 1", "extra_variance"),
    (rf"{RUN}: mean of s, less the predicted bias [\d.e-]+", "less_added"),
    (rf"{RUN}: mean of exp\(-s/2\)", "half"),
    (rf"{RUN}: share captured in both of its windows", "twice"),
    (rf"{RUN} and its reverse: sum of the peaks, less their biases", "both_peaks"),
    (rf"{RUN}: mean of log E1/E0 grows, beyond its bias", "grows"),
    (rf"{RUN}: mean of E1/E0 grows", "energy_grows"),
    (rf"{RUN}: mean of exp\(-s/2\), which finite energy leaves at 1", "without_growth"),
    (rf"{RUN}: share with less energy after (\d+) cycles", "loss"),
    (r"(frozen-\S+): particles that never meet the stem's walls", "stays"),
    (rf"{RUN}: mean log E/E0 at phase ([\d.]+)", "zone_energy"),
    (rf"{RUN}: share in the chaotic zone at phase ([\d.]+)", "zone_share"),
)
