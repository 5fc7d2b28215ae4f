"""The fast stepper with one line of its kernels changed, in a process or a module of its own."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from numba import njit
from numba.core.dispatcher import Dispatcher

import fast
from fast.kernel import lane_laws, records, rows
from fast.kernel.arithmetic import fma
from support.from_python import from_python

HOUSE = Path(fast.__file__).parent.parent


def value_of(folder: Path, module: str, expression: str, file: str = "", old: str = "", new: str = "") -> Any:
    """Evaluate an expression on a copy of the fast stepper in which `old` stands no more in `file`.

    Args:
        folder: an empty folder for the copy.
        module: a test module whose names the expression uses.
        expression: Python source, of a value that JSON holds.
        file: a file of fast/kernel/; none to run the honest kernels in the same manner.
        old: its text to replace, found exactly once.
        new: what to put there.
    """
    shutil.copytree(HOUSE / "fast", folder / "fast", ignore=shutil.ignore_patterns("__pycache__"))
    if file:
        source = (folder / "fast" / "kernel" / file).read_text("utf-8")
        assert source.count(old) == 1, (file, old, source.count(old))
        (folder / "fast" / "kernel" / file).write_text(source.replace(old, new), "utf-8")
    paths = [str(folder), str(HOUSE), str(HOUSE / "tests")]
    # Not compiled: for some steps that takes longer than the steps themselves, and the bits are the same.
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(paths)}
    program = f"import json\nfrom {module} import *\nprint(json.dumps({expression}))"
    command = [sys.executable, "-W", "ignore", "-c", program]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@njit(error_model="numpy")
def fused(a: Any, b: Any, c: Any) -> Any:
    """Return `fma` as compiled code computes it. numba inlines `fma`, so its arguments are written out."""
    return fma(a, b, c)


def faulty_lanes(*changes: str) -> ModuleType:
    """Return the loops with texts in them replaced (old, new, old, new, ...); pools are lists there.

    The loops run as plain Python, which takes less time than to compile them and gives the same bits; what
    they call that takes no pool is compiled, once for all faults.
    """
    folder = HOUSE / "fast" / "kernel"
    sources = {name: (folder / name).read_text("utf-8") for name in ("lanes.py", "lane_laws.py")}
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert any(old in source for source in sources.values()), old
        sources = {name: source.replace(old, new) for name, source in sources.items()}
    module = ModuleType("faulty_lanes")
    for name, source in sources.items():  # the last one's functions replace those that the first imports
        exec(compile(source, name, "exec"), module.__dict__)
    for name, found in (vars(records) | vars(rows)).items():
        vars(module).setdefault(name, found)
    names = [each.__name__ for each in (module, lane_laws, records, rows)]
    for name, found in list(vars(module).items()):
        function = found.py_func if isinstance(found, Dispatcher) else found
        place = getattr(function, "__module__", None)
        if isinstance(function, FunctionType) and place in names:
            # What it calls is looked up among the faulty ones.
            setattr(module, name, FunctionType(function.__code__, vars(module)))
        elif isinstance(function, FunctionType) and place.startswith("fast.kernel."):
            setattr(module, name, from_python(found))
        elif isinstance(found, np.integer):
            setattr(module, name, int(found))
    plain = {n: int(v) if isinstance(v, np.integer) else v for n, v in vars(rows).items()}
    vars(module).update(rows=SimpleNamespace(**plain), fma=fused, widest_registers=lambda: None)
    return module
