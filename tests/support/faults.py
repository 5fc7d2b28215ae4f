"""The one table of faulty steppers: the check that refuses each, the verdict, the fault."""

import math
from functools import partial
from itertools import count
from operator import eq, gt, itemgetter

from support.faulty_readers import (
    answer_by,
    as_fortran_reads,
    at_bad_lines,
    by_laws,
    crash,
    everywhere,
    excused,
    filled_in,
    first_parts,
    fleeing,
    in_a,
    in_the_mouth,
    last_bit_varies,
    leaving_slowly,
    letting,
    loose,
    minus_is_below,
    nameless,
    near_by,
    nearly_one_period,
    number_of,
    offering,
    on_a_longer,
    one_of_two,
    passes_samples,
    refusing,
    refusing_starts,
    rounded,
    scene_by,
    scenes_refused_for,
    slower,
    strictly_off,
    take_hints,
    unchecked,
    unknown_wall,
    values_alone,
    whole,
    wide_by_ranges,
    without,
    without_wall,
    wrong_after_bad_lines,
)
from support.faulty_steppers import (
    FLOW,
    OPEN,
    PATH,
    STEP,
    Fault,
    after_hits,
    asked,
    beside_its_wall,
    both,
    captured_as,
    clock,
    dead_time,
    each,
    early,
    elsewhere,
    fewer,
    horizon_at_once,
    impatient,
    late_speed,
    leaking,
    leaving_out,
    losing_stays,
    mend,
    on,
    once,
    one_bad_spoils_all,
    one_too_few,
    other_mouth,
    other_slope,
    particles_by,
    remembered,
    repeated,
    room_for,
    same_time_for_all,
    slowed,
    straight_on,
    swapping,
    tired,
    to_and_fro,
    turned,
    wide_edge,
    wrong_order,
)

PLACE = ("x", "y", "vx", "vy")
EXCUSES = {
    "loose-on-walls": loose(1e-2),
    "loose-by-1e-5": loose(1e-5),
    "a-tenth-outside": near_by(0.1),
    "little-outside": near_by(2.0**-16),
    "slowly-into-walls": slower(0.01),
    "fleeing-a-faster-wall": fleeing,
    "named-beyond-others": lambda _, state, why: state["wall"] is not None and "beyond wall" in why,
    "arc-below-the-mouth": in_a("mushroom", on_a_longer("arc")),
    "sides-above-the-mouth": in_a("mushroom", on_a_longer("left", "right")),
    "arc-below-a-cap": in_a("cap", on_a_longer("arc")),
    "sinking-through-the-mouth": lambda at, state, why: "moves into it" in why and in_the_mouth(at, state),
    "nameless-through-the-base": lambda _, state, __: state["wall"] is None and bool(state["y"] == 0),
    "outside-left": in_a("mushroom", near_by(math.inf, "left")),
}
RULES = {
    "w-up-to-r": "w <= r",
    "nu-up-to-1": "nu <= 1",
    "sides-apart": "w > h slope",
    "one-period": "share one period",
    "closed-knots": "no jumps",
}
KEYS = {
    "first-parts": first_parts,
    "without-omega": without("omega"),
    "without-period": without("period"),
    "without-sines": without("sin"),
    "by-knot-values": values_alone,
}
# What refuses each: the check, its verdict, the fault.
FAULTS: dict[str, tuple[str, str, Fault]] = {
    "absent-is-arc": ("spelling", "fail", asked(filled_in, STEP, name="wall", value="arc")),
    "absent-is-arc-in-paths": ("spelling", "fail", asked(filled_in, PATH, name="wall", value="arc")),
    "absent-is-arc-in-flows": ("spelling", "fail", asked(filled_in, FLOW, name="wall", value="arc")),
    "nameless-only": ("spelling", "fail", refusing(lambda request: "name" in request["scene"])),
    "as-fortran-reads": ("spelling", "fail", asked(as_fortran_reads)),
    "crash-at-bad-lines": ("malformed-lines", "crashed", at_bad_lines(crash)),
    "guess-at-bad-lines": ("malformed-lines", "fail", at_bad_lines(lambda: {"seq": None, **OPEN})),
    "wrong-after-bad-lines": ("malformed-lines", "fail", partial(wrong_after_bad_lines, upset=[])),
    "take-hints": ("extra-fields", "fail", take_hints),
    "minus-is-below": ("minus-zero", "fail", asked(minus_is_below)),
    # Caches.
    **{
        f"remembering-{n}-digits": ("changed-questions", "fail", on(STEP, answer_by, key=rounded(n), book={}))
        for n in (6, 9, 12, 15)
    },
    "answers-without-wall": ("changed-questions", "fail", on(STEP, answer_by, key=without_wall, book={})),
    **{
        f"scenes-{name}": ("changed-questions", "fail", asked(scene_by, STEP, key=by_laws(key), book={}))
        for name, key in KEYS.items()
    },
    "paths-by-first-parts": (
        "changed-questions",
        "fail",
        asked(scene_by, PATH, key=by_laws(first_parts), book={}),
    ),
    "flows-by-first-parts": (
        "changed-questions",
        "fail",
        asked(scene_by, FLOW, key=by_laws(first_parts), book={}),
    ),
    "scenes-by-name": (
        "changed-questions",
        "fail",
        asked(scene_by, key=lambda scene: scene.get("name") or scene, book={}),
    ),
    "scenes-without-depth": (
        "changed-questions",
        "fail",
        asked(scene_by, key=without("h", "slope"), book={}),
    ),
    "scenes-without-names": (
        "changed-questions",
        "fail",
        asked(scene_by, STEP, key=by_laws(without(), are_named=False), book={}),
    ),
    # Flows.
    "one-bad-spoils-all": ("many-particles", "fail", on(FLOW, one_bad_spoils_all)),
    "bad-ones-last": (
        "many-particles",
        "fail",
        on(
            FLOW,
            lambda _, found: {
                **found,
                "states": sorted(found["states"], key=lambda part: part["outcome"] == "rejected"),
            },
        ),
    ),
    "no-bad-ones": (
        "many-particles",
        "wrong-format",
        on(
            FLOW,
            lambda _, found: {**found, "states": [s for s in found["states"] if s["outcome"] == "horizon"]},
        ),
    ),
    "stays-of-the-lost": (
        "many-particles",
        "wrong-format",
        on(FLOW, each("rejected", lambda _, part, __: part.update(captured=[0.0, 1.0]))),
    ),
    "first-time-for-all": ("many-particles", "fail", asked(same_time_for_all, FLOW)),
    **{f"room-for-{n}": ("many-particles", "fail", on(FLOW, room_for, n=n)) for n in (64, 256, 500, 2000)},
    "particles-without-time": (
        "many-particles",
        "fail",
        on(FLOW, particles_by, key=itemgetter(*PLACE, "wall")),
    ),
    "particles-without-wall": ("many-particles", "fail", on(FLOW, particles_by, key=itemgetter("t", *PLACE))),
    "particles-by-place": (
        "many-particles",
        "fail",
        on(FLOW, particles_by, key=itemgetter("t", "x", "y", "wall")),
    ),
    "particles-by-9-digits": ("many-particles", "fail", on(FLOW, particles_by, key=rounded(9))),
    "swapped-now-and-then": ("many-particles", "fail", on(FLOW, swapping, numbers=count(1))),
    **{
        f"captured-in-blocks-of-{n}": (
            "many-particles",
            "fail",
            losing_stays(lambda i, m, n=n: m > n and i >= m - m % n),
        )
        for n in (16, 32, 64, 100)
    },
    "captured-up-to-100": ("many-particles", "fail", losing_stays(lambda i, _: i >= 100)),
    "never-captured": ("edges", "fail", captured_as(lambda *_: None)),
    "captured-from-the-start": (
        "edges",
        "fail",
        captured_as(lambda _, stay, __: [stay[0] - 0.1 * (stay[1] - stay[0]), stay[1]]),
    ),
    "captured-to-the-end": (
        "edges",
        "fail",
        captured_as(lambda request, stay, _: [stay[0], request["t_end"]]),
    ),
    **{
        f"edge-wider-by-{part:g}": ("edges", "fail", on(FLOW, wide_edge, by_part=part))
        for part in (1e-4, 1e-6, 2.0**-25)
    },
    "without-slope-in-flows": ("hits", "fail", asked(other_slope, FLOW, change=lambda _: 0.0)),
    "frozen-after-50": ("long-paths", "fail", on(FLOW, after_hits, n=50, change=slowed)),
    **{
        f"straight-after-{n}": ("long-flow", "fail", on(FLOW, after_hits, n=n, change=straight_on))
        for n in (1000, 2000, 4000)
    },
    "leaking-in-flows": (
        "long-flow",
        "fail",
        on(FLOW, each("horizon", lambda _, part, __: turned(part, 1.001))),
    ),
    "open-flows": (
        "many-particles",
        "declined",
        on(FLOW, lambda _, found: {**found, "states": [OPEN] * len(found["states"])}),
    ),
    "open-paths": (
        "long-paths",
        "declined",
        on(PATH, lambda _, found: {**found, "steps": [*found["steps"][:1], OPEN][: len(found["steps"])]}),
    ),
    # Hits and paths.
    "one-too-few": ("long-paths", "fail", on(PATH, one_too_few)),
    **{
        f"tired-at-{n}": ("long-paths", "fail", on(PATH, tired, after=n)) for n in (50, 450, 1000, 2000, 4000)
    },
    "without-slope-in-paths": ("hits", "fail", asked(other_slope, PATH, change=lambda _: 0.0)),
    "faster-after-1000": ("long-paths", "fail", on(PATH, each("collision", late_speed))),
    "faster-late-steps": ("late-starts", "fail", on(STEP, each("collision", late_speed))),
    "leaking": ("long-paths", "fail", on(PATH, each("collision", leaking, part=1e-10))),
    "spiralling": ("long-paths", "fail", on(PATH, each("collision", leaking, angle=1e-10))),
    "leaking-before-it-is-open": ("long-paths", "fail", on(PATH, mend)),
    "horizon-at-once": ("long-paths", "fail", on(PATH, horizon_at_once)),
    "standing-at-a-wall": ("long-paths", "fail", on(PATH, repeated)),
    "pressing-at-a-wall": ("long-paths", "fail", on(PATH, repeated, factor=-1.0)),
    "at-twice-the-time": (
        "long-paths",
        "fail",
        on(PATH, each("collision", lambda _, step, __: step.update(t=2 * step["t"]))),
    ),
    "beside-its-wall": ("long-paths", "fail", on(PATH, each("collision", beside_its_wall))),
    "one-at-least": (
        "endings",
        "fail",
        asked(lambda request: request.update(collisions=request.get("collisions") or 1), PATH),
    ),
    "undefined-left-out": ("endings", "fail", on(PATH, leaving_out, outcome="undefined")),
    "horizon-left-out": ("endings", "fail", on(PATH, leaving_out, outcome="horizon")),
    "corners-for-all-reasons": (
        "endings",
        "fail",
        lambda request, answer: (
            {**found, "reason": "corner"}
            if (found := answer(request)).get("outcome") == "undefined"
            else found
        ),
    ),
    **{
        f"ties-within-{near:g}-by-order": ("edges", "fail", on(STEP, wrong_order, near=near))
        for near in (1e-4, 1e-8, 2.0**-31)
    },
    **{
        f"mouths-below-{near:g}-shut": (
            "edges",
            "fail",
            asked(other_mouth, change=lambda w, near=near: w * 1e-9 if w < near else w),
        )
        for near in (1e-3, 1e-5, 2.0**-31)
    },
    **{
        f"mouths-above-{1 - near:g}-whole": (
            "edges",
            "fail",
            asked(other_mouth, change=lambda w, near=near: 1.0 if w > 1 - near else w),
        )
        for near in (1e-3, 1e-5, 2.0**-31)
    },
    **{
        f"slopes-from-{-steep:g}-on": (
            "edges",
            "fail",
            asked(other_slope, change=lambda slope, steep=steep: max(slope, -steep)),
        )
        for steep in (1.0, 16.0, 32.0)
    },
    "dead-time-of-1e-9": ("edges", "fail", on(STEP, dead_time, part=1e-9)),
    **{f"impatient-after-{n}": ("waiting", "fail", on(STEP, impatient, periods=n)) for n in (512, 1000)},
    # Bad input, and good.
    **{name: ("bad-states", "fail", excused(excuse, STEP)) for name, excuse in EXCUSES.items()},
    "no-time-no-check": ("bad-states", "fail", unchecked(eq, STEP)),
    "loose-paths": ("bad-states", "fail", excused(loose(1e-2), PATH)),
    "loose-flows": ("bad-states", "fail", excused(loose(1e-2), FLOW)),
    "late-is-arrived": ("bad-states", "fail", unchecked(gt, FLOW)),
    "at-the-end-unchecked": ("bad-states", "fail", unchecked(eq, FLOW)),
    "no-base-in-the-mouth": ("bad-states", "fail", refusing_starts(in_the_mouth)),
    "no-base-in-the-mouth-of-paths": ("bad-states", "fail", refusing_starts(in_the_mouth, PATH)),
    **{
        f"strictly-on-{wall}": ("bad-states", "fail", refusing_starts(strictly_off(wall)))
        for wall in ("arc", "base", "left", "floor")
    },
    "refusing-slow-ones": ("bad-states", "fail", refusing_starts(leaving_slowly)),
    "scenes-unchecked": ("bad-scenes", "fail", scenes_refused_for("fails by")),
    **{
        f"scenes-without-{name}": ("bad-scenes", "fail", scenes_refused_for(word))
        for name, word in RULES.items()
    },
    **{f"scenes-by-{n}-samples": ("bad-scenes", "fail", letting(passes_samples, n=n)) for n in (1, 64)},
    "periods-to-9-digits": ("bad-scenes", "fail", letting(nearly_one_period)),
    "scenes-by-ranges": ("bad-scenes", "fail", refusing(wide_by_ranges)),
    "unknown-wall-as-null": ("bad-requests", "fail", asked(unknown_wall)),
    **{
        f"absent-{name}-as-0": ("bad-requests", "fail", asked(filled_in, name=name, value=0.0))
        for name in ("t", "x", "y", "vx", "vy")
    },
    "true-as-1": ("bad-requests", "fail", everywhere(lambda value: 1.0 if value is True else value)),
    "texts-as-numbers": ("bad-requests", "fail", everywhere(number_of)),
    "collisions-rounded": ("bad-requests", "fail", asked(whole)),
    "omega-before-period": ("bad-requests", "fail", asked(one_of_two)),
    # Clocks.
    "fewer": ("time-steps", "fail", partial(fewer, most=8)),
    "elsewhere": ("time-steps", "fail", on("time", elsewhere)),
    "fewer-of-many": ("time-clock", "fail", partial(fewer, most=100)),
    "no-time": ("time-clock", "fail", clock(lambda said: [0] * len(said))),
    "a-tenth": ("time-clock", "fail", clock(lambda said: [n // 10 for n in said])),
    "tenfold": ("time-clock", "fail", clock(lambda said: [10 * n for n in said])),
    "constant": ("time-clock", "fail", once(lambda _, __, repeat: [1000] * repeat)),
    "by-the-piece": ("time-clock", "fail", once(lambda n, _, repeat: [500 * n] * repeat)),
    "once-for-all": ("time-clock", "fail", once(lambda n, _, repeat: [10_000_000 + n] * repeat)),
    "remembering": ("time-clock", "fail", once(remembered)),
}
# Errors that do not add up, others that vectors let pass, and manners: these are no faults. The checks asked.
HARMLESS: dict[str, tuple[str | tuple[str, ...], Fault]] = {
    "to and fro": ("promise", on(PATH, each("collision", to_and_fro))),
    "coarse": ("promise", both(partial(offering, profile=STEP), on(STEP, early, part=1e-12))),
    "coarser": ("promise", both(partial(offering, profile=STEP), on(STEP, early, part=3e-10))),
    "steps alone": ("promise", partial(offering, profile=STEP)),
    "flows alone": ("promise", partial(offering, profile=FLOW)),
    "last bit varies": (("property", "promise"), on((STEP, PATH, FLOW), last_bit_varies, numbers=count(1))),
    "names no walls and keeps no flight times": (
        ("property/energy", "promise/hits", "promise/spelling", "promise/endings"),
        nameless,
    ),
}
