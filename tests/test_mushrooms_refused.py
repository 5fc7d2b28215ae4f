"""Bad input to any command: one line that says what must hold, exit code 2, and nothing written."""

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
from support.faulty_servers import command
from support.refusals import assert_refused

import conformance
import fast

MOVING_CAP = """\
table = "mushroom"
r = 1.0
h = 1.0
slope = 0.0
[w]
kind = "fourier"
mean = 0.6
omega = 1.0
cos = [0.4]
"""
SHORT = 'nu = {kind = "fourier", mean = 0.5, period = 1e-308, cos = [0.1]}'
SLOW = 'nu = 0.5\nr = {kind = "fourier", mean = 1e308, period = 1e308, cos = [1e307]}'
PAIRS = "E0,E1\n1e4,2e4\n1e4,3e4\n"
TWICE = '{"scene": {"table": "cap", "r": 1.0}, "steps": [], "steps": []}'
# Files that a command finds one folder above.
FILES = {
    "file.txt": "kept",
    "too-wide.toml": MOVING_CAP.replace("[0.4]", "[0.4000001]"),
    "nan.toml": MOVING_CAP.replace("h = 1.0", "h = nan"),
    "unknown-key.toml": "depth = 1.0\n" + MOVING_CAP,
    "not-toml.toml": "table = ",
    "short.toml": f'table = "mushroom"\nr = 1.0\nh = 1.0\n{SHORT}\n',
    "huge.toml": 'table = "mushroom"\nr = 1.7e308\nh = 1e300\nnu = 0.5\n',
    "slow.toml": f'table = "mushroom"\nh = 1e300\n{SLOW}\n',
    "good.csv": PAIRS,
    "e.txt": "x",
    "no.parquet": "x",
    "no.zarr": "x",
    "brace.json": "{",
    "empty.json": "{}",
    "twice.json": TWICE,
}
# Ensembles that are none, and why; and trajectories.
ENSEMBLES = {
    "": "column 'E1' is missing",
    "E0,E1": "0 energies, must be 2 or more",
    "E0,E1 1e4,2e4": "1 energies, must be 2 or more",
    "E0,x 1e4,2e4 1e4,3e4": "column 'E1' is missing, as is 's'; it has E0, x",
    "E1,E1 1e4,2e4 1e4,3e4": "column 'E1' stands twice",
    "N,E1 1e4,2e4 1e4,3e4": "column 'E0' is missing, and so is --energy",
    "E0,E1 1e4,2e4 1e4,north": "ensemble.csv':3: E1 = 'north', must be a finite number",
    "E0,E1 1e4,0x1p": "E1 = '0x1p'",
    "E0,E1,t_in 1e4,2e4,1 1e4,x": "2 cells, must be 3",
    "E0,E1 -1,2 -1,3": "E0 = -1.0, must be finite and > 0",
    "E0,E1 nan,2 nan,3": "E0 = nan, must be finite and > 0",
    "E0,E1 1e4,2e4 1e5,2e5": "E0 takes several values, 10000 and 100000 among them",
    "E0,E1,captured 1e4,2e4,2 1e4,2e4,0": "captured = 2.0, must be 0 or 1",
    "E0;E1 1e4;2e4 1e4;3e4": "its columns are separated by semicolons, must be by commas",
    "E0|E1 1e4|2e4": "separated by bars",
    "E0\tE1 1e4\t2e4": "separated by tabs",
    "E0,E1 10000,5,20000,5 10000,5,20000,7": "4 cells, must be 2 as in the first row; numbers must have",
    'E0,E1 "1,5","2,5" "1,5","2,5"': "E0 = '1,5', must be a finite number, with a decimal point",
    "E0,E1,t_in 1e4,2e4,99 1e4,3e4,98": "t_in = 98 to 99, must be in the cycle",
}
TRAJECTORIES = {
    "t,x,y,vx 0,0,0,1": "column 'vy' is missing",
    "t,x,y,vx,vy 0,0,0,1,2": "column 'wall' is missing",
    "t,x,y,vx,vy,wall 0,0,0,1,up,": "steps.csv':2: vy = 'up', must be a finite number",
    "t,x,y,vx,vy,wall 0,0,0,1,1, 1,0,0,1,1,": "steps.csv':3: wall is empty, must be the wall that was hit",
    "t,x,y,vx,vy,wall 0,0,0,1,1, 1,0,0,1,1,roof": "steps.csv':3: wall is 'roof', must be",
    "t;x;y;vx;vy;wall 0;0;0;1;1;": "separated by semicolons",
}

STEPPER = shlex.join([sys.executable, str(Path(conformance.__file__).parent / "harness/python/stepper.py")])
ONE = "simulate moving-cap --particles 5 --energy 1"
STORED = "simulate moving-cap --particles 5 --energy 100 --out out"
PLOT = "simulate moving-cap --particles 60 --energy 1e4 --plot"
BENCH = Path(__file__).parent.parent / "docs" / "bench" / "bench.json"
SEEDS = "0 to 18446744073709551615"
NOTHING = "would change nothing here"
AUDIT = "audit --scene moving-cap --out report --ensemble"
BROKEN = {"too-wide": "w <= r", "nan": "h = nan", "unknown-key": "depth", "not-toml": "TOML"}
UNDRAWABLE = {
    "short": "period = 1e-308, must be",
    "huge": "scene.r = 1.7e+308, must be",
    "slow": "scene.r = 1.1e+308",
}
# A command, what the refusal must say, and files of its own: their lines, with blanks between.
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
    (f"{ONE} --threads 999999", ["threads = 999999"]),
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
    ("scenes --toml", ["--toml needs NAME", "moving-cap"]),
    ("scenes nowhere", ["moving-cap"]),
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
    pytest.param((f"bench --quick -- {sys.executable} -c 'print(1)'", ["python"]), marks=pytest.mark.deep),
    ("bench --table absent.json", ["absent.json"]),
    (f"bench --table {BENCH} --workload nowhere", ["workload = 'nowhere'", "moving-cap-1e7"]),
    ("check", ["COMMAND"]),
    ("check -- ./no-such-stepper", ["no-such-stepper"]),
    ("check --level hard -- true", ["level = 'hard'", "core, extended, stress"]),
    (f"check --groups moving-cap,no-such -- {STEPPER}", ["must be one of"]),
    ("check --groups , -- true", ["--groups = ','"]),
    (f"check --known-failures absent.txt -- {STEPPER}", ["absent.txt"]),
    (
        f"check --corpus 1.3 -- {STEPPER}",
        ["corpus", "'1.3'", "earlier release", "1.4", "1.0, 1.1, 1.2, 1.3, 1.4"],
    ),
    (f"check --corpus 2.0 -- {STEPPER}", ["corpus", "'2.0'", "does not exist", "1.4"]),
    ("ask", ["ID"]),
    ("ask no-such/1", ["ID = 'no-such/1'"]),
    ("ask fresh/1", ["--seed"]),
    ("ask fresh/999 --seed 1", ["ID = 'fresh/999'"]),
    ("ask moving-cap/3 -- ./no-such-stepper", ["no-such-stepper"]),
    (f"ask moving-cap/3 -- {shlex.join(command('other-protocol'))}", ["does not speak protocol 1"]),
    ("verify none.json", ["none.json: No such file"]),
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
    (f"{ONE} --resume", ["--resume", "needs --out"]),
    (f"{ONE} --max-seconds 1", ["--max-seconds", "needs --out"]),
    (f"{ONE} --dask tcp://here:1", ["--dask", "needs --out"]),
    (f"{ONE} --block 8", ["--block", "needs --out"]),
    (f"{ONE} --phases 0.5", ["--phases", "needs --out"]),
    (f"{ONE} --max-collisions 9", ["--max-collisions = 9", "needs --out"]),
    *(
        (f"check {files} {more}", [given, NOTHING, "questions and answers are in files"])
        for files in ("--questions asked.jsonl", "--questions asked", "--answers ../good.csv")
        for more, given in (
            ("-- true", "COMMAND = ['true']"),
            ("--groups step", "--groups = 'step'"),
            ("--known-failures known.txt", "--known-failures = known.txt"),
        )
    ),
    ("check --questions asked.jsonl --json r.json", ["r.json", NOTHING, "nothing is graded yet"]),
    ("check --questions asked.txt", ["--questions = 'asked.txt', must end in .jsonl, or be a folder"]),
    ("check --questions ..", ["--questions = '..' is not empty, must be a new folder"]),
    ("check --questions asked.jsonl --level hard", ["level = 'hard'", "core, extended, stress"]),
    ("check --answers absent.jsonl", ["answers 'absent.jsonl' cannot be read: No such file"]),
    ("scenes moving-cap --toml --json", ["--toml and --json"]),
    ("bench --workload all", ["--workload = 'all'", "needs --table"]),
    ("bench --table a.json --quick", ["--quick", "--table measures nothing"]),
    ("bench --table a.json -- true", ["COMMAND = ['true']", "--table measures nothing"]),
    ("draw moving-cap --seed 1", ["--seed = 1", NOTHING, "the picture of the walls has no particles"]),
    *(
        (f"draw moving-cap --{name} 1", [f"--{name} = 1", NOTHING, "no particles"])
        for name in ("energy", "collisions", "cycles")
    ),
    ("draw moving-cap --trajectory --particles 3", ["--particles = 3", "--section, --map"]),
    ("draw moving-cap --export a.csv --particles 3", ["--particles = 3"]),
    ("draw moving-cap --map --phase 0.5", ["--phase = 0.5", "--section"]),
    ("draw moving-cap --growth --collisions 99", ["--collisions = 99", "--cycles"]),
    ("draw frozen-mushroom --section --phase 0.5", ["phase = 0.5", "stand still"]),
    # files that hold no scene, or one that no figure holds; no ensemble, no trajectory
    *(
        (f"{line} ../{name}.toml {more}", [word])
        for line, more in (("theory", ""), ("simulate", "--particles 1 --energy 1 --out a"), ("draw", ""))
        for name, word in BROKEN.items()
    ),
    *(
        (f"draw ../{name}.toml {kind} --out picture.svg", [word, "1e-100 to 1e+100 in a picture"])
        for kind in ("", "--trajectory", "--export path.csv")
        for name, word in UNDRAWABLE.items()
    ),
    (f"{AUDIT} ../missing.csv", ["No such file"]),
    ("draw .", ["run '.': it holds no ensemble.zarr: nothing was stored there"]),
    ("export . --to a.csv", ["nothing was stored there"]),
    (f"{AUDIT} ../e.txt", ["must be a .csv or .parquet file"]),
    (f"{AUDIT} ../no.parquet", ["Parquet"]),
    (f"{AUDIT} ../no.zarr", ["is no Zarr group"]),
    (f"{AUDIT} ../good.csv --energy 7", ["0 energies, must be 2 or more"]),
    (f"{AUDIT} ../good.csv --energy 0", ["'--energy': 0.0, must be finite and > 0"]),
    (f"{AUDIT} ../good.csv --energy-unit eV", ["--energy-unit = 'eV', must be one of v2/2, v2"]),
    (f"{AUDIT} ../good.csv --time-unit s", ["--time-unit = 's', must be one of scene, cycles"]),
    (f"{AUDIT} ../good.csv --particles 1", ["--particles = 1, must be at least the 2 rows"]),
    (f"{AUDIT} ../good.csv --scene nowhere", ["nowhere"]),
    (f"{AUDIT} ../good.csv --scene frozen-mushroom", ["must be a mushroom that moves"]),
    (f"{AUDIT} ../good.csv --scene breathing-circle", ["must be a mushroom that moves"]),
    *(
        (f"{AUDIT} ../good.csv {given}", [f"{said} {NOTHING}", "an --ensemble is audited"])
        for given, said in (
            ("--full", "--full"),
            ("--only X2", "--only = 'X2'"),
            ("--threads 2", "--threads = 2"),
            ("--resume", "--resume"),
            ("--commands", "--commands"),
        )
    ),
    *(
        (f"audit {given}", [f"{said} {NOTHING}", "there is no --ensemble"])
        for given, said in (
            ("--scene moving-cap", "--scene = 'moving-cap'"),
            ("--backwards a.csv", "--backwards = a.csv"),
            ("--energy 1", "--energy = 1.0"),
            ("--energy-unit v2", "--energy-unit = 'v2'"),
            ("--time-unit cycles", "--time-unit = 'cycles'"),
            ("--particles 9", "--particles = 9"),
        )
    ),
    ("audit --ensemble ../good.csv", ["needs --scene"]),
    *((f"{AUDIT} ../ensemble.csv", [word], {"ensemble.csv": text}) for text, word in ENSEMBLES.items()),
    *(
        ("verify ../steps.csv --scene moving-cap", [word], {"steps.csv": text})
        for text, word in TRAJECTORIES.items()
    ),
    ("verify ../good.csv", ["needs --scene"]),
    ("verify ../brace.json", ["Expecting"]),
    ("verify ../empty.json", ["scene"]),
    ("verify ../twice.json", ["a key comes twice"]),
    # output on or below a file
    *(
        (f"{line} --out ../file.txt{below}", ["file.txt", "folder"])
        for line in ("simulate moving-cap --particles 5 --energy 100", "audit")
        for below in ("", "/sub")
    ),
    ("draw moving-cap --out ../file.txt/a.svg", ["file.txt", "a.svg"]),
]


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_nothing_is_written(command_line, tmp_path, monkeypatch, case):
    line, words, *more = case
    texts = {name: "\n".join(text.split(" ")) for files in more for name, text in files.items()}
    for name, text in {**FILES, **texts}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setattr(fast, "go_on", None)
    assert_refused(command_line(*shlex.split(line)), *words)
    assert list(Path.cwd().iterdir()) == []
    assert (tmp_path / "file.txt").read_text() == "kept"
