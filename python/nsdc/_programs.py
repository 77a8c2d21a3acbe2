"""Mathematical programs with complementarity constraints in AMPL's `.nl` format."""

from __future__ import annotations

import json
import operator
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._commands import CommandError


@dataclass(frozen=True)
class Solution:
    """What came of a program: minimize F(x) subject to constraints and 0 <= G(x) ⟂ H(x) >= 0.

    >>> import nsdc, pathlib, tempfile
    >>> text = "model m { state x = 1; control u in [0, 1] = 0; x' = u; } optimize o of m { horizon 1; minimize final(x); }"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "o.nl")
    ...     _ = path.write_text(nsdc.loads(text)["o"].emit("nl"))
    ...     solution = nsdc.solve_nl(path, starts=1)
    >>> solution.status, round(solution.objective, 6), solution.violation < 1e-8
    ('solved', 1.0, True)
    """

    #: The name of the file, without its folder and ending.
    problem: str
    #: `solved`, or why there is no solution; the words are those of `Result.status`.
    status: str
    #: F(x), in the sense of the file.
    objective: float
    #: The point, shape (n,), read-only.
    x: NDArray[np.float64] = field(compare=False)
    #: Names of the variables, where a file `.col` beside it has them.
    names: tuple[str, ...] | None
    #: What is proven: `S` and `B` exclude descent to first order, `M`, `C`, `A` and `W` are weaker, or `none`.
    stationarity: str
    #: The largest violation of a constraint or a bound.
    violation: float
    #: The largest |min(G, H)|.
    complementarity: float
    #: Times in seconds and counts.
    stats: dict[str, Any] = field(repr=False, compare=False)

    @property
    def ok(self) -> bool:
        """Whether it is solved."""
        return self.status == "solved"


def solve_nl(
    path: str | os.PathLike[str],
    *,
    tolerance: float | None = None,
    time_limit: float | None = None,
    starts: int | None = None,
) -> Solution:
    """`nsdc solve`: solves a file `.nl`, text or binary, of AMPL or Pyomo, with complementarity conditions or without.

    `tolerance` is what the optimality error has to reach, `time_limit` is in seconds. Local minima are looked for from
    `starts` points, that of the file first, or without it from as many as a small program has time for. A program that is not solved is a
    result with another status. `CommandError` where the file cannot be read, or holds what is not solved.

    >>> import nsdc, pathlib, tempfile
    >>> text = '''model m { state x = 1; control u in [-1, 1] = 0; x' = u - sign(x); }
    ...   optimize o of m { horizon 1; intervals 2; minimize integral(u^2) + final((x - 2)^2); }'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "o.nl")
    ...     _ = path.write_text(nsdc.loads(text)["o"].emit("nl"))
    ...     solution = nsdc.solve_nl(path)
    >>> solution.ok, round(solution.objective, 6), solution.stationarity, solution.x.shape
    (True, 2.0, 'S', (82,))
    """
    place = os.fspath(path)
    if not isinstance(place, str):
        raise TypeError(f"path: a string or a path, not {place!r}")
    if os.path.isdir(place):
        raise ValueError(f"path: `{place}` is a folder; a file is solved")
    # A dash alone would be standard input.
    place = "./-" if place == "-" else place
    options = [] if tolerance is None else [f"--tolerance={_number('tolerance', tolerance)!r}"]
    options += [] if time_limit is None else [f"--time-limit={_number('time_limit', time_limit)!r}"]
    if starts is not None:
        count = operator.index(starts)
        if count < 1:
            raise ValueError(f"starts: 1 or more, not {starts!r}")
        options.append(f"--starts={count}")
    line = ["nsdc", "solve", "--json=-", *options, "--", place]
    code, out, err = _core.main(line, True, False, False, 100)
    if not out:
        raise CommandError(code, err.decode(errors="replace"))
    found = json.loads(out)
    x = np.array([np.nan if value is None else value for value in found["x"]], dtype=float)
    x.flags.writeable = False
    names = found.get("names")
    number = _finite_or_nan
    return Solution(
        problem=found["problem"],
        status=found["status"],
        objective=number(found["objective"]),
        x=x,
        names=None if names is None else tuple(names),
        stationarity=found["certificate"]["stationarity"],
        violation=number(found["constraint_violation"]),
        complementarity=number(found["complementarity_min"]),
        stats=found["stats"],
    )


def _number(name: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name}: a number, not {value!r}")
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name}: positive and finite, not {value!r}")
    return float(value)


def _finite_or_nan(value: float | None) -> float:
    return float("nan") if value is None else float(value)
