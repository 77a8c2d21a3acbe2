"""Programs of AMPL's format through `nsdc.solve_nl`."""

import pathlib

import nsdc
import numpy as np
import pytest

#: minimize (x - 2)^2 + (y - 1)^2 with 0 <= x ⟂ y >= 0: x = 2, y = 0, or x = 0, y = 1, which is worse.
TEXT = """model m { state x = 0; control u[2] in [0, 9] = [1, 0]; x' = 0; }
  optimize o of m { horizon 1; intervals 1; elements 1; scheme radau_iia(1);
    minimize integral((u[1] - 2)^2 + (u[2] - 1)^2); subject to { 0 <= u[1] perp u[2] >= 0; } at intervals; }"""


@pytest.fixture
def problem(tmp_path: pathlib.Path) -> pathlib.Path:
    path = tmp_path / "pair.nl"
    path.write_text(nsdc.loads(TEXT)["o"].emit("nl"))
    return path


def test_a_program_has_its_point_and_certificate(problem: pathlib.Path) -> None:
    for path in (problem, str(problem)):
        solution = nsdc.solve_nl(path)
        assert solution.ok and solution.status == "solved" and solution.problem == "pair"
        assert solution.stationarity in "SB"
        least = min(abs(solution.objective - 1.0), abs(solution.objective - 4.0))
        assert least < 1e-8 and max(solution.violation, solution.complementarity) < 1e-8
        assert any(abs(x - solution.objective**0.5) < 1e-6 or abs(x - 2.0) < 1e-6 for x in solution.x)
        with pytest.raises(ValueError):
            solution.x[0] = 1.0


def test_no_time_is_a_status(problem: pathlib.Path) -> None:
    solution = nsdc.solve_nl(problem, time_limit=1e-9)
    assert solution.status in ("time_limit", "feasible") and not solution.ok
    assert nsdc.solve_nl(problem, tolerance=np.float64(1e-9)).ok


def test_other_starts_find_the_better_minimum(problem: pathlib.Path) -> None:
    one, many = (nsdc.solve_nl(problem, starts=starts) for starts in (1, 20))
    assert abs(many.objective - 1.0) < 1e-8 and one.objective >= many.objective - 1e-12
    for starts, error in [(0, ValueError), (-3, ValueError), (1.5, TypeError), ("2", TypeError)]:
        with pytest.raises(error):
            nsdc.solve_nl(problem, starts=starts)  # type: ignore[arg-type]


def test_wrong_arguments_are_named(problem: pathlib.Path, tmp_path: pathlib.Path) -> None:
    for value, error in [("a", TypeError), (True, TypeError), (-1.0, ValueError), (np.nan, ValueError)]:
        for name in ("tolerance", "time_limit"):
            with pytest.raises(error, match=name):
                nsdc.solve_nl(problem, **{name: value})
    with pytest.raises(TypeError):
        nsdc.solve_nl(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="path"):
        nsdc.solve_nl(b"pair.nl")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="path"):
        nsdc.solve_nl(tmp_path)
    for name in ("none.nl", "-", "-x.nl"):
        with pytest.raises(nsdc.CommandError, match="no such file"):
            nsdc.solve_nl(name)
    text = tmp_path / "text.nl"
    text.write_text(TEXT)
    with pytest.raises(nsdc.CommandError, match="E0801"):
        nsdc.solve_nl(text)
