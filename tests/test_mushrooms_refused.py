"""Bad input to any command is one line on stderr that names it, with exit code 2; nothing is written."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
from support.faulty_servers import command
from support.refusals import assert_refused

import conformance

STEPPER = shlex.join([sys.executable, str(Path(conformance.__file__).parent / "harness/python/stepper.py")])
ONE = "simulate moving-cap --particles 5 --energy 1"
STORED = "simulate moving-cap --particles 5 --energy 100 --out out"
PLOT = "simulate moving-cap --particles 60 --energy 1e4 --plot"
SEEDS = "0 to 18446744073709551615"
NOTHING = "would change nothing here"
# A command and what the refusal must say.
REFUSED: list[Any] = [
    ("", ["command"]),
    ("bogus", ["bogus"]),
    # numbers out of bounds
    (f"{STORED} --particles 0", ["'--particles': 0,", "1 to 10000000000"]),
    (f"{STORED} --particles 10000000001", ["'--particles': 10000000001,", "1 to 10000000000"]),
    (f"{ONE} --particles 100000001", ["--particles = 100000001", "1 to 100000000;"]),
    (f"{STORED} --energy -1", ["'--energy': -1.0,", "> 0"]),
    (f"{STORED} --energy 0", ["'--energy': 0.0,", "> 0"]),
    (f"{STORED} --energy nan", ["'--energy': nan,", "finite"]),
    (f"{STORED} --energy inf", ["'--energy': inf,", "finite"]),
    (f"{STORED} --cycles 0", ["'--cycles': 0,", ">= 1"]),
    (f"{STORED} --seed -1", ["'--seed': -1,", SEEDS]),
    (f"{STORED} --seed 18446744073709551616", ["'--seed': 18446744073709551616,", SEEDS]),
    (f"{STORED} --threads 0", ["'--threads': 0,", ">= 1"]),
    (f"{STORED} --block 0", ["'--block': 0, must be 1 to 1048576"]),
    (f"{STORED} --block 1e29", ["must be 1 to 1048576"]),
    (f"{STORED} --max-seconds 0", ["'--max-seconds': 0.0,", "> 0"]),
    (f"{ONE} --threads 999", ["threads = 999"]),
    ("theory moving-cap --digits 0", ["'--digits': 0,", "1 to 1000"]),
    ("theory moving-cap --digits 1001", ["'--digits': 1001,", "1 to 1000"]),
    ("theory moving-cap --energy 0", ["'--energy': 0.0,"]),
    ("audit --seed -1", ["'--seed': -1,", SEEDS]),
    ("audit --threads 0", ["'--threads': 0,"]),
    ("bench --quick --seed -1", ["'--seed': -1,"]),
    ("attack --cases 0", ["'--cases': 0,", "1 to"]),
    (f"check --timeout 0 -- {STEPPER}", ["'--timeout': 0.0,"]),
    (f"check --timeout nan -- {STEPPER}", ["'--timeout': nan,"]),
    (f"check --total 0 -- {STEPPER}", ["'--total': 0.0,"]),
    (f"check --restarts -1 -- {STEPPER}", ["'--restarts': -1,"]),
    (f"check --seed -1 -- {STEPPER}", ["'--seed': -1,"]),
    ("ask fresh/1 --seed -1", ["'--seed': -1,"]),
    ("draw moving-cap --growth --cycles 0", ["'--cycles': 0,", "1 to 10000"]),
    ("draw moving-cap --trajectory --energy 0", ["'--energy': 0.0,", "> 0"]),
    ("draw moving-cap --trajectory --collisions 0", ["'--collisions': 0,", "1 to 1000000"]),
    ("draw moving-cap --map --particles 1001", ["'--particles': 1001,", "1 to 1000"]),
    ("draw moving-cap --lyapunov --collisions 9", ["collisions = 9", ">= 32"]),
    ("draw moving-cap --section --energy 1e308", ["energy = 1e+308", "2^800"]),
    ("draw moving-cap --seed -1", ["'--seed': -1,"]),
    (f"{PLOT} a.svg --particles 1", ["--particles = 1, must be >= 2"]),
    (
        "simulate moving-cap --particles 1e8 --energy 1 --block 2 --out a",
        ["--block = 2: 100000000 particles", "least 100"],
    ),
    # no numbers
    *((f"{ONE} --particles {n}", ["--particles", n]) for n in ("1e400", "1.5", "1e-1", "nan", "inf", "0x10")),
    *(
        (f"theory moving-cap --digits {n}", ["--digits", "whole"])
        for n in ("many", "1e1000000", "-1e999999999")
    ),
    *((f"{ONE} --energy={x}", ["--energy", f"{x!r} is not a number"]) for x in ("x", "1,5", "0x10", "--")),
    (f"{ONE} --max-seconds=1,5", ["--max-seconds", "'1,5' is not a number"]),
    ("draw moving-cap --trajectory --collisions 1.5", ["--collisions", "1.5"]),
    # empty
    ("draw moving-cap --out ''", ["--out is empty, must have a value"]),
    ("draw moving-cap --out=", ["--out is empty, must have a value"]),
    (f"{ONE} --out ' '", ["--out is empty, must have a value"]),
    ("bench --table ''", ["--table is empty, must have a value"]),
    ("export '' --to a.csv", ["an argument is empty, must have a value"]),
    # missing, or no such thing
    ("theory", ["SCENE"]),
    ("theory nowhere", ["nowhere"]),
    ("theory nowhere.toml", ["nowhere.toml", "No such file"]),
    ("theory moving-cap-as-printed", ["w > h slope"]),
    ("theory fermi-ulam", []),
    ("simulate moving-cap --energy 1", ["--particles"]),
    ("scenes --toml", ["--toml needs NAME"]),
    ("audit --only X2,X99", ["X99", "M1", "L7"]),
    *(
        (f"audit --only '{ids}'", ["--only ", why])
        for ids, why in (("", "empty"), (" ", "empty"), (",,", "name a claim"))
    ),
    *(
        (f"{ONE} --out a --phases '{phases}'", ["--phases "])
        for phases in ("", "a", "0.5,0.25", "0", "0.5,1", "0.5,", "nan", "0.5;0.6")
    ),
    ("attack --family none", ["--family = 'none'", "knot-at-event"]),
    ("bench --quick -- ./no-such-stepper", ["no-such-stepper"]),
    pytest.param(f"bench --quick -- {sys.executable} -c 'print(1)'", ["python"], marks=pytest.mark.deep),
    ("bench --table absent.json", ["absent.json"]),
    ("check", ["COMMAND"]),
    ("check -- ./no-such-stepper", ["no-such-stepper"]),
    ("check --level hard -- true", ["level = 'hard'", "core, extended, stress"]),
    (f"check --groups moving-cap,no-such -- {STEPPER}", ["must be one of"]),
    ("check --groups , -- true", ["--groups = ','"]),
    (f"check --known-failures absent.txt -- {STEPPER}", ["absent.txt"]),
    ("ask", ["ID"]),
    ("ask no-such/1", ["ID = 'no-such/1'"]),
    ("ask fresh/1", ["--seed"]),
    ("ask fresh/999 --seed 1", ["ID = 'fresh/999'"]),
    ("ask moving-cap/3 -- ./no-such-stepper", ["no-such-stepper"]),
    (f"ask moving-cap/3 -- {shlex.join(command('other-protocol'))}", ["does not speak protocol 1"]),
    ("verify none.json", ["cannot be read"]),
    # files that cannot be, or of no such kind
    ("draw moving-cap --out picture.jpeg", ["picture.jpeg", ".svg"]),
    ("draw moving-cap --out nowhere/picture.svg", ["nowhere/picture.svg", "No such"]),
    ("draw moving-cap --section --out a.gif", ["a.gif", ".svg, .png, .pdf"]),
    ("draw moving-cap --export a.txt", ["a.txt", ".csv, .parquet"]),
    (f"{PLOT} a.pdf", [".svg, .png"]),
    (f"check --json report.txt -- {STEPPER}", [".json"]),
    (f"check --badge badge.png -- {STEPPER}", [".svg"]),
    (f"check --json r.json --summary r.json -- {STEPPER}", ["asked for twice"]),
    (f"check --html no/such/folder/r.html -- {STEPPER}", ["cannot be written"]),
    # options that need another, or that nothing would heed
    (f"{ONE} --resume", ["--resume needs --out"]),
    (f"{ONE} --max-seconds 1", ["--max-seconds needs --out"]),
    (f"{ONE} --dask tcp://here:1", ["--dask needs --out"]),
    (f"{ONE} --block 8", ["--block needs --out"]),
    (f"{ONE} --phases 0.5", ["--phases needs --out"]),
    ("scenes moving-cap --toml --json", ["--toml and --json"]),
    ("bench --workload all", ["--workload = 'all'", "needs --table"]),
    ("bench --table a.json --quick", ["--quick", "--table measures nothing"]),
    ("draw moving-cap --seed 1", ["--seed = 1", NOTHING, "the picture of the walls has no particles"]),
    ("draw moving-cap --energy 1", ["--energy = 1.0", "no particles"]),
    ("draw moving-cap --trajectory --particles 3", ["--particles = 3", "--section, --map"]),
    ("draw moving-cap --export a.csv --particles 3", ["--particles = 3"]),
    ("draw moving-cap --map --phase 0.5", ["--phase = 0.5", "--section"]),
    ("draw moving-cap --growth --collisions 99", ["--collisions = 99", "--cycles"]),
    ("draw frozen-mushroom --section --phase 0.5", ["phase = 0.5", "stand still"]),
]


@pytest.mark.parametrize(("line", "words"), REFUSED)
def test_bad_input_is_one_line_and_nothing_is_written(command_line, tmp_path, monkeypatch, line, words):
    monkeypatch.chdir(tmp_path)
    assert_refused(command_line(*shlex.split(line)), *words)
    assert list(tmp_path.iterdir()) == []
