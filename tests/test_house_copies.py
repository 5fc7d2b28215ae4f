"""Copies, pickles and other processes keep each number to its last bit, and no error is lost on its way.

mpmath rebuilds a number at the precision of the moment. A proof that is pickled is then a false one.
An example of every public type is copied in every way. All its fields are compared exactly, however deep
they lie.
"""

import concurrent.futures
import copy
import dataclasses
import functools
import importlib
import inspect
import io
import json
import multiprocessing
import pickle
import pkgutil
import re
from argparse import ArgumentParser
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import cloudpickle
import gmpy2
import mpmath
import msgspec
import numpy as np
import pytest

import conformance
import fast
import mushrooms
import reference
import scene
import theory
from conformance import profiles, properties, vectors, verify
from conformance.strategies import HypothesisDraw
from conformance.suite.process import CheckFailure
from mushrooms import lyapunov, orbits
from mushrooms.figures import energies
from mushrooms.interrupts import Interrupt
from scene import geometry
from scene.mpmath_internals import ends

API = Path(__file__).parent.parent / "docs" / "api"
PACKAGES = (scene, reference, fast, theory, conformance, mushrooms)
MOVING_CAP = scene.load("moving-cap")
CAP = scene.Cap(r=1.0)
START = scene.State(0.0, 0.1, 0.3, 1000.0, 700.0)
STEEP = scene.BangBang(((0.0, 1.0), (0.5, 2.0), (1.0, 1.0)))
FEW = {"n_particles": 3, "energy": 1e4, "n_cycles": 1}
MANY_DIGITS = 50


class FortyDigits(mpmath.MPContext):
    """A number system of a caller's own."""

    def __init__(self) -> None:
        super().__init__()
        self.dps = 40


@functools.cache
def proof() -> reference.Collision:
    """Return a proved collision with all that may be asked for."""
    return reference.next_collision(MOVING_CAP, START, 1.0, is_differentiated=True, is_measured=True)


@functools.cache
def orbit() -> orbits.FollowedOrbit:
    return orbits.follow(MOVING_CAP, 40, energy=1e4)[0]


def unpaused() -> fast.Paused:
    return fast.go_on(MOVING_CAP, **FEW)


def read_scene() -> verify.Scene:
    return verify.read_scene(json.loads(json.dumps(scene.to_data(MOVING_CAP))), [verify.WORK])


def started() -> verify.Flight:
    state = verify.State(*map(Fraction, (0.0, 0.1, 0.3, 1000.0, 700.0)), None)
    return verify.start(read_scene(), state, Fraction(1), 128)[0]


def answers() -> verify.Answers:
    """Return a path of one step, whose steps have been read."""
    step = fast.next_collision(MOVING_CAP, START, 1.0)
    wire = json.loads(json.dumps(scene.to_data(MOVING_CAP)))
    head = {"scene": wire, "state": msgspec.to_builtins(START)}
    found = verify.build_answers(head, 1.0, [("step 1", msgspec.to_builtins(step))])
    return found._replace(steps=list(found.steps))


def judged() -> verify.Report:
    report = verify.Report(4.0)
    list(verify.judge_path(answers(), report))
    return report


# An example of each public type, by the name under which it stands in the documentation.
EXAMPLES: dict[str, Any] = {
    "scene.BangBang": lambda: STEEP,
    "scene.Cap": lambda: scene.Cap(r=STEEP),
    "scene.Collision": lambda: fast.next_collision(MOVING_CAP, START, 1.0),
    "scene.Constant": lambda: MOVING_CAP.laws["slope"],
    "scene.Fourier": lambda: scene.Fourier(1.0, 2.0, cos=(0.1,), sin=(0.3,)),
    "scene.Horizon": lambda: fast.next_collision(MOVING_CAP, START, 1e-9),
    "scene.Law": lambda: MOVING_CAP.laws["r"],
    "scene.Mushroom": lambda: MOVING_CAP,
    "scene.Rejected": lambda: scene.Rejected("no scene"),
    "scene.State": lambda: START,
    "scene.Stem": lambda: scene.Stem(w=0.1, h=STEEP),
    "scene.Undecided": lambda: scene.Undecided("too close"),
    "scene.Undefined": lambda: scene.Undefined("corner"),
    "scene.geometry.TableAt": lambda: geometry.table_at(FortyDigits(), MOVING_CAP, 0.3),
    "reference.Collision": proof,
    "reference.answers.ProvedCollision": proof,
    "reference.Enclosure": lambda: proof().dt,
    "reference.Horizon": lambda: reference.next_collision(MOVING_CAP, START, 1e-9),
    "reference.answers.ProvedHorizon": lambda: reference.next_collision(MOVING_CAP, START, 1e-9),
    "reference.Moment": lambda: proof().after,
    "reference.Trajectory": lambda: reference.trajectory(MOVING_CAP, START, 3, is_differentiated=True),
    "fast.Collisions": lambda: fast.trajectory(MOVING_CAP, START, 5),
    "fast.Ensemble": lambda: fast.simulate(MOVING_CAP, **FEW),
    "fast.FineTrajectory": lambda: fast.fine_trajectory(CAP, scene.State(0.0, 0.1, 0.3, 1.0, 0.7), 3),
    "fast.Flow": lambda: fast.flow(MOVING_CAP, [START], 0.1),
    "fast.Paused": unpaused,
    "fast.Reached": lambda: fast.follow(MOVING_CAP, START, "capture"),
    "theory.CaptureCurve": lambda: theory.capture_curve(MOVING_CAP, 9),
    "theory.Caustic": lambda: theory.caustics(scene.load("fixed-cap-anticlockwise"), 30),
    "theory.ChaoticZone": lambda: theory.chaotic_zone(MOVING_CAP, [0.1, 0.2]),
    "theory.Cycle": lambda: theory.Cycle.of(MOVING_CAP, MANY_DIGITS),
    "theory.Energies": lambda: theory.energies(MOVING_CAP),
    "theory.FiniteEnergy": lambda: theory.at_energy(MOVING_CAP, 1e5),
    "theory.Limit": lambda: theory.extrapolate([1.0, 2.0, 3.0], [1.0, 1.5, 1.7], [0.1, 0.1, 0.1]),
    "theory.PowerFit": lambda: theory.fit_power([1.0, 2.0, 3.0], [1.0, 1.5, 1.7], [0.1, 0.1, 0.1]),
    "theory.Prediction": lambda: theory.predict(MOVING_CAP, MANY_DIGITS),
    "theory.Rarity": lambda: theory.rarity(MOVING_CAP, MANY_DIGITS),
    "theory.Rates": lambda: theory.frozen_rates(MOVING_CAP),
    "theory.Sum": lambda: theory.sum_of_cycles(MOVING_CAP, 3),
    "theory.Volumes": lambda: theory.volumes_at(FortyDigits(), MOVING_CAP, 0.3),
    "conformance.vectors.Certified": lambda: vectors.load()[0].expect[0].steps,
    "conformance.vectors.Expectation": lambda: vectors.load()[0].expect,
    "conformance.vectors.File": lambda: vectors.manifest().files,
    "conformance.vectors.Manifest": vectors.manifest,
    "conformance.vectors.Vector": lambda: vectors.load()[:3],
    "conformance.strategies.HypothesisDraw": lambda: HypothesisDraw(max),
    "conformance.properties.MeasuredStep": lambda: properties.measure_step(
        fast.next_collision, MOVING_CAP, START, 1.0, 1e-9
    ),
    "conformance.profiles.Statistic": lambda: profiles.Statistic("mean", 0.1, 0.2, 0.3, 4, 0, 0.5),
    "mushrooms.orbits.FollowedOrbit": orbit,
    "mushrooms.orbits.Section": lambda: orbit().section(),
    "mushrooms.orbits.Slot": lambda: orbits.boundary(MOVING_CAP),
    "mushrooms.orbits.Stretch": lambda: orbits.stretches(geometry.rounded(MOVING_CAP, 0.3)),
    "mushrooms.lyapunov.Stretching": lambda: lyapunov.stretching(orbit()),
    "mushrooms.figures.energies.Gathered": lambda: energies.gathered(np.linspace(-1.0, 1.0, 50)),
    # Numbers without a type of ours: a function that takes `digits` gives them.
    "theory.capture_rate_at": lambda: theory.capture_rate_at(MOVING_CAP, [0.5, 3.0], MANY_DIGITS),
    "theory.caustics": lambda: theory.caustics(scene.load("fixed-cap-anticlockwise"), 30),
    "theory.cdf_at": lambda: theory.cdf_at(MOVING_CAP, ["0.1"], MANY_DIGITS),
    "theory.cumulants": lambda: theory.cumulants(MOVING_CAP, 3, MANY_DIGITS),
    "theory.density_at": lambda: theory.density_at(MOVING_CAP, ["0.1"], MANY_DIGITS),
    "theory.mean_of": lambda: theory.mean_of(MOVING_CAP, lambda s: s * s, MANY_DIGITS),
    "theory.moments": lambda: theory.moments(MOVING_CAP, 3, MANY_DIGITS),
    "theory.predict": lambda: theory.predict(MOVING_CAP, MANY_DIGITS).sd_of_mean(7),
    "theory.rarity": lambda: theory.rarity(MOVING_CAP, MANY_DIGITS),
    "theory.unbiased_mean": lambda: theory.unbiased_mean(MOVING_CAP, MANY_DIGITS),
    "reference.next_collision": lambda: proof().dt.lo,
    "reference.trajectory": lambda: [proof().after.x.hi, proof().margins],
    # Records that a caller filled with numbers of his own.
    "an enclosure of your own": lambda: reference.Enclosure(FortyDigits().pi / 3, FortyDigits().pi / 2),
    "a prediction of your own": lambda: theory.predict(MOVING_CAP)._replace(m1=-FortyDigits().sqrt(2)),
    "not numbers": lambda: reference.Enclosure(FortyDigits().ninf, FortyDigits().nan),
    # The verifier: whole numbers and fractions.
    "conformance.verify.Interval": lambda: verify.pi(300),
    "conformance.verify.Jet": lambda: verify.Jet(verify.pi(128), verify.pi(128), verify.pi(128)),
    "conformance.verify.Leg": lambda: verify.read_law(json.loads(msgspec.json.encode(STEEP)))[0].legs,
    "conformance.verify.Law": lambda: verify.read_law(json.loads(msgspec.json.encode(STEEP))),
    "conformance.verify.Scene": read_scene,
    "conformance.verify.Clock": lambda: started().clock,
    "conformance.verify.State": lambda: verify.State(*map(Fraction, (0.0, 0.1, 0.3, 1.0, 0.7)), None),
    "conformance.verify.Flight": started,
    "conformance.verify.Truth": lambda: verify.find_truth(read_scene(), started().state, Fraction(1)),
    "conformance.verify.Answers": lambda: answers(),
    "conformance.verify.Report": lambda: judged(),
    "conformance.verify.Tally": lambda: judged().tallies["x"],
    "conformance.verify.Verdict": lambda: verify.Verdict("proved"),
    "conformance.verify.Step": lambda: next(verify.walk(read_scene(), started().state, Fraction(1), 128)),
}


def documented_modules() -> dict[str, Any]:
    """Return the modules of which the documentation lists every name, and the verifier."""
    text = "".join(page.read_text("utf-8") for page in sorted(API.glob("*.md")))
    names = re.findall(r"automodule:: (\S+)", text)
    return {name: importlib.import_module(name) for name in [*names, "fast", "conformance.verify"]}


def public_names() -> dict[str, Any]:
    """Return all that users import, by its full name."""
    found = {}
    for module_name, module in documented_modules().items():
        defined = vars(module).items()
        own = [name for name, value in defined if getattr(value, "__module__", "") == module_name]
        for name in getattr(module, "__all__", own):
            if not name.startswith("_"):
                found[f"{module_name}.{name}"] = getattr(module, name)
    return found


def all_errors() -> list[type]:
    """Return every error that a module of ours defines."""
    for package in PACKAGES:
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)
    found, waiting = [], [BaseException]
    while waiting:
        kinds = waiting.pop().__subclasses__()
        waiting += kinds
        found += [kind for kind in kinds if kind.__module__.split(".")[0] in {p.__name__ for p in PACKAGES}]
    return sorted(set(found), key=lambda kind: (kind.__module__, kind.__name__))


# What an error is made with that takes other arguments than one text.
ERRORS = {
    CheckFailure: lambda: CheckFailure("timed-out", "no answer within 1 s"),
    Interrupt: Interrupt,  # in another process it has no listener
}


def error(kind):
    return ERRORS[kind]() if kind in ERRORS else kind("r = -1.0, must be > 0")


def number_token(number: Any) -> str | None:
    """Describe a number of many digits exactly; None for anything else."""
    if hasattr(number, "_mpi_"):
        return "interval of " + " to ".join(str(tuple(map(str, end))) for end in ends(number))
    if isinstance(getattr(number, "context", None), mpmath.MPContext):
        parts = [number.real, number.imag]
        finite = [part for part in parts if number.context.isfinite(part)]
        return f"mpf {[part.as_integer_ratio() if part in finite else str(part) for part in parts]}"
    if isinstance(number, gmpy2.mpfr | gmpy2.mpc | gmpy2.mpz | gmpy2.mpq):
        return f"gmpy2 {number!r} {gmpy2.to_binary(number).hex()}"
    return None


def fields(value: Any) -> dict[str, Any]:
    """Return the fields of an object, however it keeps them."""
    # What a struct finds when it is asked is found anew by its copy (test_scene_load).
    found = {} if isinstance(value, msgspec.Struct) else dict(getattr(value, "__dict__", {}))
    for kind in type(value).__mro__:
        given = kind.__dict__.get("__slots__", ())
        names = [given] if isinstance(given, str) else given
        found |= {name: getattr(value, name) for name in names if hasattr(value, name)}
    if isinstance(value, msgspec.Struct):
        found |= {name: getattr(value, name) for name in value.__struct_fields__}
    return found | ({"args": value.args} if isinstance(value, BaseException) else {})


def leaves(value: Any, path: str = "", above: tuple[int, ...] = ()) -> list[tuple[str, str]]:
    """List what a value holds, by where it stands, exactly."""
    token = number_token(value)
    if token is not None:
        return [(path, token)]
    if isinstance(value, mpmath.MPContext):
        return [(path, f"{value.prec} bits")]
    if id(value) in above:
        return [(path, "again")]
    if isinstance(value, np.ndarray) and value.dtype != object:
        return [(path, f"{value.dtype} {value.shape} {value.tobytes().hex()}")]
    if isinstance(value, float | complex | np.generic):
        return [(path, f"{type(value).__name__} {value!r}")]
    if value is None or isinstance(value, str | bytes | int | Fraction):
        return [(path, repr(value))]
    if callable(value) and hasattr(value, "__qualname__"):
        return [(path, value.__qualname__)]
    if isinstance(value, dict):
        parts = {f"[{key!r}]": part for key, part in value.items()}
    elif isinstance(value, tuple | list | np.ndarray):
        parts = {f"[{i}]": part for i, part in enumerate(value)}
    elif isinstance(value, set | frozenset):
        parts = {f"[{i}]": part for i, part in enumerate(sorted(value, key=repr))}
    else:
        parts = {f".{name}": part for name, part in fields(value).items() if not name.startswith("__")}
    found = [(path, type(value).__qualname__)]
    for name, part in parts.items():
        found += leaves(part, path + name, (*above, id(value)))
    return found


def pickled(protocol: int, value: Any) -> Any:
    return pickle.loads(pickle.dumps(value, protocol))


def pickled_in_python(value: Any) -> Any:
    """Pickle as joblib does: with the pickler that is written in Python."""
    out = io.BytesIO()
    pickle._Pickler(out, 4).dump(value)
    return pickle.loads(out.getvalue())


def sent_by_dask(value: Any) -> Any:
    protocol = pytest.importorskip("distributed.protocol", reason="distributed is not installed")
    return protocol.deserialize(*protocol.serialize(value))


def rebuilt(given: BaseException) -> BaseException:
    """Make an error again as pickle does when distributed, which changes that, is not imported."""
    kind, arguments, *state = given.__reduce__()
    found = kind(*arguments)
    found.__dict__.update(*state)
    return found


WAYS: dict[str, Any] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{f"pickle {protocol}": functools.partial(pickled, protocol) for protocol in range(6)},
    "pickle in Python": pickled_in_python,
    "cloudpickle": lambda value: cloudpickle.loads(cloudpickle.dumps(value)),
    "dask": sent_by_dask,
    "twice": lambda value: copy.deepcopy(pickled(5, value)),
}


def differences(value: Any, way: Any) -> list[str]:
    """List where a copy is not what it is a copy of."""
    found, expected = leaves(way(value)), leaves(value)
    if len(found) != len(expected):
        return [f"{len(found)} values, not {len(expected)}"]
    return [f"{a}: {b}" for a, b in zip(expected, found, strict=True) if a != b]


def test_there_is_an_example_of_every_public_type():
    """A type without one, or a function that takes `digits`, is the next to lose its numbers."""
    names = public_names()
    assert len(names) > 150
    classes = {name: value for name, value in names.items() if inspect.isclass(value)}
    # A parser of options holds no result.
    types = {n for n, kind in classes.items() if not issubclass(kind, BaseException | ArgumentParser)}
    precise = {
        name
        for name, value in names.items()
        if inspect.isfunction(value) and name.startswith(("reference.", "theory."))
        if "digits" in inspect.signature(value).parameters
    }
    assert (types | precise) - set(EXAMPLES) == set()
    assert {name for name in EXAMPLES if "." in name} - set(names) - {
        "reference.answers.ProvedCollision",
        "reference.answers.ProvedHorizon",
    } == set()


def is_error(kind):
    return issubclass(kind, BaseException)


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_copy_keeps_every_number(name):
    value = EXAMPLES[name]()
    ways = set(WAYS)
    if name.startswith("conformance.verify."):  # classes with slots: Python refuses the first two protocols
        ways -= {"pickle 0", "pickle 1"}
    assert {way: found for way in ways if (found := differences(value, WAYS[way]))} == {}


def test_what_is_computed_with_a_copy_is_as_precise():
    """A number brings its number system along, with the precision that was set."""
    found = theory.predict(MOVING_CAP, MANY_DIGITS)
    cycle = theory.Cycle.of(MOVING_CAP, MANY_DIGITS)
    cycle.ctx.prec = 333
    for way in WAYS.values():
        again = way(found)
        assert again.strings(MANY_DIGITS) == found.strings(MANY_DIGITS)
        assert again.sd_of_mean(7) == found.sd_of_mean(7)
        assert again.m1.context is again.sd.context
        copied = way(cycle)
        assert copied.t_out(0.4) == cycle.t_out(0.4)
        assert copied.ctx is copied.period.context
        assert copied.ctx.prec == 333


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_another_process_gives_back_every_number(method):
    """A pool sends the examples there and back; copies are also made there."""
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this system has no {method}")
    values = {name: EXAMPLES[name]() for name in EXAMPLES}
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context(method)) as pool:
        found = pool.submit(copy.deepcopy, values).result()
        errors = pool.submit(copy.copy, [error(kind) for kind in all_errors()]).result()
        refusal = pool.submit(scene.load, "nowhere").exception()
    assert differences(values, lambda _: found) == []
    assert [type(each) for each in errors] == all_errors()
    assert isinstance(refusal, scene.BadInput)


@pytest.mark.parametrize("kind", all_errors(), ids=lambda kind: f"{kind.__module__}.{kind.__name__}")
def test_an_error_passes_from_process_to_process(kind):
    """An error that cannot be rebuilt leaves a pool waiting for ever."""
    given = error(kind)
    for way in (*WAYS.values(), rebuilt):
        found = way(given)
        assert (type(found), str(found)) == (kind, str(given))
        assert differences(given, way) == []


class Careless(NamedTuple):
    """A public type that nobody has thought of: a number of mpmath's as it is."""

    number: Any


@dataclasses.dataclass
class Hidden:
    """One that keeps such a number in a private field of a private object."""

    _deep: Any


class Slotted:
    """One that keeps it in a slot."""

    __slots__ = ("number",)

    def __init__(self, number: Any) -> None:
        self.number = number


class Talkative(Exception):  # noqa: N818
    """An error whose constructor takes other arguments than it hands on."""

    def __init__(self, field: str, value: float) -> None:
        super().__init__(f"{field} = {value}")


def third() -> Any:
    return FortyDigits().mpf(1) / 3


PLANTED = {
    "a named tuple": lambda: Careless(third()),
    "in a list": lambda: [{"deep": (third(),)}],
    "a private field": lambda: Hidden({1: Careless(third())}),
    "a slot": lambda: Slotted(third()),
    "an array of numbers": lambda: np.array([third(), third()]),
    "an interval": lambda: interval_system().mpf(1) / 3,
    "a complex number": lambda: FortyDigits().mpc(third(), third()),
}


def interval_system() -> Any:
    system = type(mpmath.iv)()
    system.prec = 200
    return system


@pytest.mark.parametrize("fault", PLANTED)
@pytest.mark.parametrize("way", ["deepcopy", "pickle 5", "pickle in Python", "cloudpickle", "dask"])
def test_a_type_that_loses_numbers_would_be_seen(fault, way):
    assert differences(PLANTED[fault](), WAYS[way]) != []


def test_an_error_that_cannot_be_rebuilt_would_be_seen():
    with pytest.raises(TypeError):
        differences(Talkative("r", -1.0), rebuilt)


def test_a_public_type_without_an_example_would_be_seen(monkeypatch):
    monkeypatch.setattr(theory, "Careless", Careless, raising=False)
    monkeypatch.setattr(theory, "__all__", [*theory.__all__, "Careless"])
    with pytest.raises(AssertionError, match=r"theory\.Careless"):
        test_there_is_an_example_of_every_public_type()
