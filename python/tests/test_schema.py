"""What programs read of `nsdc` obeys the schemas of `compiler/schema`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from models import EXAMPLES, ROOT

# Every optional field is in one of these.
ALL = """
model ball { state h = 1; state v = 0; h' = v;
  mechanics h, v { mass = 1; force = -9.81; contact floor { gap = h; restitution = 0.5; } } }
model lag { state x = 0.5; state u = 0; x' = u; u' = (-sign(x) - u)/0.01; }
model tank { state M[2, 2] = [1, 2; 3, 4]; M' = -M; param p in [0, 2] = 1; output n = M[1, 1]; }
model drive { param p in [0, 2] = 1; state x = 1; control u in [-1, 1] = 0; x' = p*u; }
model noise { state x = 0; x' = -x; }
model block { state x = 1; state v = -1; x' = v; v' = 1.2 - s;
  switch s = sign(v) sliding nonlinear; hidden on s { v' += -2*pi*s*(1 - s^2); } }
model blows { state x = 1; x' = x^2; }
simulate bounces of ball { horizon 1; }
simulate chatters of lag { horizon 2; tolerance 1e-3; method event { max_events = 200000; } on chattering slide; }
simulate empties of tank { horizon 1; }
simulate shakes of noise { horizon 1; perturb every 0.1 by sphere(0.1) seed 1; runs 3; }
simulate slips of block { horizon 4; }
simulate fails of blows { horizon 2; }
fit suits of noise { horizon 2; data "noise.csv" { x -> x weight 10; } initial { x free; } loss huber(1); }
optimize goes of drive { horizon 1; intervals 3; free { p; } subject to { x >= -5; }
  minimize final((x - 0.2)^2) + integral(u^2); }
"""


def schema(name: str) -> Draft202012Validator:
    text = json.loads((ROOT / f"compiler/schema/{name}.json").read_text())
    Draft202012Validator.check_schema(text)
    return Draft202012Validator(text)


def obeys(name: str, *args: str) -> list[dict[str, Any]]:
    """The objects that a command writes, one on each line, all of which obey a schema."""
    command = [sys.executable, "-m", "nsdc", *args, "--json", "-"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    found = [json.loads(line) for line in ran.stdout.splitlines()]
    assert found, ran.stderr
    for value in found:
        assert [error.message for error in schema(name).iter_errors(value)] == []
    return found


def test_runs(tmp_path: Path) -> None:
    path = tmp_path / "all.nsd"
    path.write_text(ALL)
    (tmp_path / "noise.csv").write_text("time,x\n0,1.1\n0.5,\n1,0.4\n1.5,0.2\n9,0\n")
    found = obeys("run", "run", str(path))
    path = tmp_path / "element.nsd"
    path.write_text("model m { state x = 1; x' = -sign(x); } simulate s of m { horizon 2; method fesd; }")
    found += obeys("run", "run", str(path), "--multipliers")
    for field in ["optimum", "ensemble", "fit", "averaged", "multipliers"]:
        assert any(field in run for run in found), field
    events = [event for run in found for event in run.get("events", [])]
    assert any("sliding" in event for event in events)
    # A field that nobody has written down is found.
    assert not schema("run").is_valid(found[0] | {"more": None})


def test_diagnostics(tmp_path: Path) -> None:
    path = tmp_path / "wrong.nsd"
    path.write_text("model m { state x = 1; x' = clipp(x)\n state y = 0; y' = 1; let c = x - x; }")
    obeys("check", "check", str(path))


@pytest.mark.parametrize(
    ("command", "name"),
    [("test", "oscillator.nsd"), ("verify", "oscillator.nsd"), ("verify", "tutorial_ocp.nsd"), ("solve", "two_minima.nl")],
)
def test_examples(command: str, name: str) -> None:
    obeys(command, command, str(EXAMPLES / name))


def test_sweeps() -> None:
    obeys("sweep", "sweep", str(EXAMPLES / "oscillator.nsd"), "crossing", "--over", "x[2]=[0.1, 0.2]")
