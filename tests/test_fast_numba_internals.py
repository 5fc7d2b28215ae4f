"""What we use of numba's inside has the meaning that we rely on: each name, on functions of a line."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest
from numba import config, njit, types

from fast.kernel import numba_internals as inside

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled without the compiler")
REAL, REALS = types.float64, types.float64[::1]


def double(x):
    return 2.0 * x


def first(numbers):
    view = numbers[1:]
    return view[0]


def llvm(function, signature):
    function.compile(signature)
    return function.inspect_llvm(function.signatures[0])


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """Make functions that numba keeps in a folder, each as a new process would."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    return lambda: njit(cache=True)(double)


def test_an_entry_says_what_it_is_compiled_for():
    entry = njit(double)
    assert not inside.is_compiled(entry, (REAL,))
    entry(1.0)
    assert inside.is_compiled(entry, (REAL,))
    assert not inside.is_compiled(entry, (types.int64,))
    assert inside.returned_type(entry, (REAL,)) == REAL
    assert inside.returned_type(entry, (REAL,)) != types.int64


def test_a_function_of_ours_is_asked_when_an_entry_is_called_and_not_compiled():
    entry, asked = njit(double), []
    honest = entry.compile

    def watched(signature):
        asked.append(signature)
        return honest(signature)

    inside.compile_with(entry, watched)
    assert entry(1.5) == entry(1.5) == 3.0
    assert asked == [(REAL,)]


def test_the_folder_and_its_hits_and_misses_are_told(kept, tmp_path):
    assert inside.cache_folder(njit(double)) is None
    entry = kept()
    folder = inside.cache_folder(entry)
    assert folder is not None
    assert tmp_path in folder.parents
    assert not inside.is_newly_compiled(entry, (REAL,))
    entry.compile((REAL,))
    assert inside.is_newly_compiled(entry, (REAL,))
    assert not inside.is_loaded(entry)
    assert {path.suffix for path in folder.iterdir()} == {".nbi", ".nbc"}
    again = kept()
    again.compile((REAL,))
    assert inside.is_loaded(again)
    assert not inside.is_newly_compiled(again, (REAL,))


@pytest.mark.parametrize("is_kept", [False, True])
def test_what_lies_at_an_address_is_called_with_a_tuple(kept, is_kept):
    """It is called as numba calls it: with an array, a float and an integer, for a tuple."""
    signature = types.Tuple((REAL, types.int64))(REALS, REAL, types.int64)
    call = inside.caller_by_address(signature)

    def pick(numbers, factor, i):
        return numbers[i] * factor, i + 1

    entry = njit(cache=is_kept)(pick)
    entry.compile(signature.args)
    address = inside.address_of(entry, signature.args)
    assert isinstance(address, int)
    caller = njit(lambda at, numbers, factor, i: call(at, (numbers, factor, i)))
    assert caller(address, np.array([1.0, 2.0, 4.0]), 0.5, 2) == (2.0, 3)


def test_an_entry_is_called_without_a_look_at_the_types_of_its_arguments():
    entry = njit(double)
    entry.compile((REAL,))
    function = inside.function_of(entry, (REAL,))
    assert function(1.5) == 3.0
    assert function(2) == 4.0  # an integer is converted: the entry is not compiled for it
    assert not inside.is_compiled(entry, (types.int64,))


def test_no_wrapper_for_c_is_made_and_no_reference_counted():
    plain = llvm(njit(first), (REALS,))
    assert "cfunc." in plain
    assert "cfunc." not in llvm(njit(**inside.UNWRAPPED)(first), (REALS,))

    def leave(numbers):
        return numbers

    assert "NRT_incref" in llvm(njit(leave), (REALS,))
    assert "NRT_incref" not in llvm(njit(**inside.UNCOUNTED)(leave), (REALS,))


def test_the_widest_registers_are_asked_for():
    def ask(x):
        inside.widest_registers()
        return x

    asking = llvm(njit(ask), (REAL,))
    assert '"prefer-vector-width"="512"' in asking
    assert "alignstack(64)" in asking
    assert "prefer-vector-width" not in llvm(njit(double), (REAL,))


def test_each_name_is_tested_here():
    source = ast.parse(Path(__file__).read_text("utf-8"))
    used = {node.attr for node in ast.walk(source) if isinstance(node, ast.Attribute)}
    ours = {name for name, found in vars(inside).items() if inspect.isfunction(found)}
    assert ours - {"numba_intrinsic"} | {"UNWRAPPED", "UNCOUNTED"} <= used | {"intrinsic"}
