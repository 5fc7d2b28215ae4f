"""The checks: what is asked of an implementation beside the vectors, in one table.

Each has one form (`checks.form`): a name, what it asks, how it judges, and of which profiles. Exact
symmetries (`properties`), statistics (`flows`) and the rules of the protocol stand side by side; each is
asked of every profile that is offered. CONTRIBUTING.md says how one is added.
"""

from collections.abc import Iterator
from functools import partial

from conformance import properties
from conformance.cases.draw import Draw
from conformance.suite.checks import bad_input, flows, path_judge, paths, spelling, timing
from conformance.suite.checks.form import QUESTIONS, Implementation, Question, SuiteCheck, run_check
from conformance.suite.session import AnswerLine, Session
from scene import Scene, State, transforms
from scene.protocol.messages import PROFILES

__all__ = ["Implementation", "SuiteCheck", "checks_of", "judge", "questions", "run_check"]

GROUPS = ("property", "profile", "promise")
EXACT = ("mirror", "scaling-of-lengths", "scaling-of-times", "static-limit")  # to the bit, as a rule
OF_HITS = ("angular-momentum", "symplectic")  # which a flow does not tell
N_SYMMETRIES = 12


def moments(draw: Draw, profile: str, *, is_idle: bool = False) -> Iterator[Question]:
    """Draw scenes and states for the exact symmetries, and times to the end; a flow meets a few walls.

    With `is_idle` the tables are at rest, and their constants are written as laws.
    """
    for _ in range(N_SYMMETRIES):
        scene, state = paths.draw_start(draw)
        scene = transforms.idle(transforms.frozen(scene, state.t)) if is_idle else scene
        span = path_judge.crossing(scene, state)
        yield scene, state, state.t + span * (draw.between(0.25, 2.0) if profile == "flow" else 16.0)


def _symmetric(name: str, side: Implementation, scene: Scene, state: State, t_end: float) -> bool:
    """Hold an implementation to an exact symmetry: bit for bit, or else to rounding."""
    check = properties.PROPERTIES[name]
    if name not in EXACT:
        return check(side, scene, state, t_end)
    try:
        return check(side, scene, state, t_end, is_exact=True)
    except AssertionError:
        return check(side, scene, state, t_end, is_exact=False)


def _symmetry(name: str) -> SuiteCheck:
    asks = partial(moments, is_idle=name == "static-limit")  # which needs laws, though its tables are at rest
    profiles = QUESTIONS[:2] if name in OF_HITS else QUESTIONS
    return SuiteCheck(f"property/{name}", asks, partial(_symmetric, name), profiles)


SYMMETRIES = tuple(_symmetry(name) for name in properties.PROPERTIES)
RULES = (
    SuiteCheck("promise/hits", paths.usual, path_judge.follow),
    SuiteCheck("promise/edges", paths.edges, path_judge.follow),
    SuiteCheck("promise/changed-questions", paths.changed, path_judge.follow),
    SuiteCheck("promise/long-paths", paths.long, path_judge.follow),
    SuiteCheck("promise/late-starts", paths.late, path_judge.follow),
    SuiteCheck("promise/waiting", paths.waiting, path_judge.follow),
    SuiteCheck("promise/long-flow", flows.returning, flows.arrive, ("flow",)),
    SuiteCheck("promise/many-particles", flows.crowds, flows.together, ("flow",)),
    SuiteCheck("promise/endings", flows.endings, flows.end_as_due),
    SuiteCheck("promise/spelling", spelling.spellings, spelling.same),
    SuiteCheck("promise/minus-zero", spelling.zeros, spelling.same),
    SuiteCheck("promise/malformed-lines", spelling.bad_lines, spelling.passed_over),
    SuiteCheck("promise/extra-fields", spelling.further_fields, spelling.ignored_or_refused),
    SuiteCheck("promise/bad-requests", bad_input.bad_requests, bad_input.refuse, PROFILES),
    SuiteCheck("promise/bad-states", bad_input.bad_states, bad_input.refuse),
    SuiteCheck("promise/bad-scenes", bad_input.bad_scenes, bad_input.refuse),
    SuiteCheck("promise/time-steps", timing.questions, timing.same_steps, ("time",)),
    SuiteCheck("promise/time-clock", timing.questions, timing.honest_clock, ("time",)),
)


def checks_of(level: str = "core") -> list[SuiteCheck]:
    """Return the checks of a level."""
    return [*SYMMETRIES, *flows.ensemble_checks(level), *RULES]


def judge(implementation: list[str] | AnswerLine, name: str, profile: str, *asked: object) -> None:
    """Put one question of a check to an implementation: its command, or a function that answers lines."""
    with Session(implementation) as session:
        session.start()
        _named(name).judges(Implementation(session, profile), *asked)


def questions(name: str, profile: str) -> object:
    """Return a Hypothesis strategy of a check's questions."""
    from hypothesis import strategies as st

    return st.integers(0, 2**64 - 1).flatmap(
        lambda seed: st.sampled_from(list(_named(name).asks(Draw(str(seed)), profile)))
    )


def _named(name: str) -> SuiteCheck:
    return next(check for check in checks_of() if check.name == name)
