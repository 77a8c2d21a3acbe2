"""Results against closed forms, and against what the command line writes."""

from __future__ import annotations

import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import nsdc

from models import EXAMPLES

#: Runs that take more than two seconds of a core in a development build.
LONG = {
    ("around_ellipse", "across"),
    ("ball_pile", "settles"),
    ("box", "lap"),
    ("place_disc", "place"),
    ("sledge", "straight"),
    ("tanks", "level"),
    ("throw_and_catch", "frozen"),
}
FILES = {path.stem: nsdc.load(path) for path in sorted(EXAMPLES.glob("*.nsd"))}


def command(*args: str) -> str:
    """What the command line writes to standard output."""
    _, out, _ = nsdc._core.main(["nsdc", *args], True, False, False, 100)
    return out.decode()


def without_seconds(text: str) -> Any:
    def kept(told: dict) -> dict:
        return {name: value for name, value in told.items() if not name.endswith("_s")}

    return json.loads(text, object_hook=kept)


@pytest.mark.parametrize(
    ("stem", "name"),
    [(stem, name) for stem, file in FILES.items() for name in file if (stem, name) not in LONG],
)
def test_examples_have_the_numbers_of_the_command_line(stem: str, name: str, tmp_path: Path) -> None:
    experiment, figure = FILES[stem][name], tmp_path / "figure.svg"
    told = without_seconds(command("run", experiment.file.path, name, "--json", "-", "--plot", str(figure)))
    assert ElementTree.parse(figure).getroot().tag.endswith("svg")
    result = experiment.run()
    assert without_seconds(result.json) == told
    assert result.time.tolist() == told["time"]
    for kind in ("states", "outputs", "controls"):
        for one, values in told[kind].items():
            assert result[one].tolist() == values
    if experiment.kind == "simulate":
        # What is kept for further runs is what was compiled for the first.
        assert without_seconds(experiment.run().json) == told


def test_a_ball_falls_as_it_does(ball: nsdc.Experiment) -> None:
    result = ball.run(g=2, q=0.25, v=0, horizon=0.9)
    assert result.ok and result.raise_for_status() is result
    # It strikes after 1/2 second with 1 m/s, and goes on with 1/2 m/s.
    (bounce,) = result.events
    assert bounce.kind == "jump" and abs(bounce.time - 0.5) < 1e-12
    for side, speed in (("left", -1.0), ("right", 0.5)):
        assert abs(result(bounce.time, side=side)["v"] - speed) < 1e-11
    instants = np.linspace(0.55, 0.85, 5)
    after = instants - 0.5
    assert np.abs(result(instants)["q"] - (0.5 * after - after**2)).max() < 1e-12
    assert np.abs(result(instants, derivative=1)["q"] - result(instants)["v"]).max() < 1e-12
    assert np.abs(result(instants, derivative=2)["q"] + 2).max() < 1e-11
    assert abs(result.end["q"] - 0.04) < 1e-12 and abs(result.end["v"] + 0.3) < 1e-12
    # The instant of the bounce has two rows.
    (place,) = np.flatnonzero(np.diff(result.time) == 0)
    assert abs(result["energy"][place + 1] / result["energy"][place] - 0.25) < 1e-11


def test_values_are_views(belt: nsdc.Experiment) -> None:
    result = belt.run()
    assert np.shares_memory(result["x"], result["x"]) and np.shares_memory(result["x"], result["x[2]"])
    assert result["x"].shape == (len(result.time), 2)
    for values in (result.time, result["x"], result["x[1]"]):
        assert not values.flags.writeable and not values.flags.owndata
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1
    second = result["x[2]"]
    kept = second.copy()
    del result
    assert np.array_equal(second, kept)
    with pytest.raises(KeyError, match="x"):
        belt.run()["x[3]"]


def test_rows_are_made_when_they_are_read(ball: nsdc.Experiment) -> None:
    """By whichever thread comes first; the end is that of the rows, whether these have been read or not."""
    result, other = ball.run(), ball.run()
    ends = result.end
    with ThreadPoolExecutor(8) as pool:
        read = list(pool.map(lambda name: result[name], 4 * result.names))
    assert all(np.shares_memory(one, result[name]) for one, name in zip(read, 4 * result.names))
    for name, values in ends.items():
        assert values == result[name][-1] == other[name][-1] == result.end[name]


def test_what_is_outside_of_a_run_is_not_known(ball: nsdc.Experiment) -> None:
    result = ball.run()
    for time in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="time"):
            result(time)
    with pytest.raises(ValueError, match="side"):
        result(0.5, side="up")
    with pytest.raises(ValueError, match="derivative"):
        result(0.5, derivative=-1)
    none = nsdc._dense.Dense.of(["x"], [np.zeros(0)] * 2, np.zeros(0, dtype=int), np.zeros(0))
    with pytest.raises(ValueError, match="rows alone"):
        none.at(0.5, 0, "right")


def test_both_sides_of_a_jump_at_the_start_are_known() -> None:
    text = """model m { state x = 1; state n = 0; x' = 1; n' = 0; jump j when x >= 1 { x := 0; n := n + 1; } }
    simulate s of m { horizon 0.5; }"""
    result = nsdc.loads(text)["s"].run()
    assert [float(result(0.0, side=side)["x"]) for side in ("left", "right")] == [1.0, 0.0]
    assert result["x"][:2].tolist() == [1.0, 0.0]


def test_a_failed_run_is_a_result() -> None:
    grows = nsdc.loads("model m { state x = 1; x' = x^2; } simulate s of m { horizon 2; }")["s"]
    result = grows.run()
    assert not result.ok and result.status == "numerical_failure"
    (error,) = [one for one in result.warnings if one.severity == "error"]
    assert error.code.startswith("E07") and error.span.line == 1
    with pytest.raises(nsdc.RunError, match="numerical_failure") as told:
        result.raise_for_status()
    assert told.value.result is result
    assert 0 < result.time[-1] < 1.0001


def test_everything_can_be_pickled(ball: nsdc.Experiment, tmp_path: Path) -> None:
    (tmp_path / "fall.nsd").write_text("model fall { state v = 0; v' = -2; }")
    main = tmp_path / "main.nsd"
    main.write_text("use ./fall.{fall}; simulate s of fall { horizon 1; }")
    file = nsdc.load(main)
    taken = pickle.dumps(file)
    experiment = pickle.dumps(file["s"])
    main.unlink()
    (tmp_path / "fall.nsd").unlink()
    for found in (pickle.loads(taken)["s"], pickle.loads(experiment)):
        assert abs(found.run().end["v"] + 2) < 1e-12
    result = ball.run(g=5)
    again = pickle.loads(pickle.dumps(result))
    for name in result:
        assert np.array_equal(result[name], again[name]) and not again[name].flags.writeable
    assert again.json == result.json and again.events == result.events
    assert again._repr_html_() == result._repr_html_()
    assert np.array_equal(again([0.1, 0.6])["q"], result([0.1, 0.6])["q"])


def test_other_formats_have_the_same_numbers(belt: nsdc.Experiment, tmp_path: Path) -> None:
    result = belt.run()
    table = result.to_pandas()
    assert table.index.tolist() == result.time.tolist()
    assert table["x[2]"].tolist() == result["x"][:, 1].tolist()
    data = result.to_xarray()
    assert data["x"].dims == ("time", "x_1") and np.array_equal(data["x"], result["x"])
    assert data.attrs["status"] == "solved"
    pyarrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    assert pyarrow.table(result)["x[1]"].to_pylist() == result["x[1]"].tolist()
    for name in ("r.json", "r.csv", "r.svg", "r.parquet", "r.mat", "r.nc"):
        result.save(tmp_path / name)
    assert json.loads((tmp_path / "r.json").read_text())["time"] == result.time.tolist()
    found = pyarrow.parquet.read_table(tmp_path / "r.parquet")
    assert found["time"].to_pylist() == result.time.tolist()
    import scipy.io
    import xarray

    assert np.array_equal(scipy.io.loadmat(tmp_path / "r.mat")["x"], result["x"])
    with xarray.open_dataset(tmp_path / "r.nc") as found:
        assert np.array_equal(found["x"], result["x"])
    with pytest.raises(ValueError, match="xlsx"):
        result.save(tmp_path / "r.xlsx")


def test_files_have_names_that_they_can_have(tmp_path: Path) -> None:
    import scipy.io
    import xarray

    text = "model m { state φ[2] = [1, 2]; φ' = [0, 0]; state ä = 3; ä' = 0; state _1x = 4; _1x' = 0; state phi = 5; phi' = 0; }"
    result = nsdc.loads(text + " simulate s of m { horizon 1; }")["s"].run()
    result.save(tmp_path / "r.mat")
    found = scipy.io.loadmat(tmp_path / "r.mat")
    assert {name for name in found if not name.startswith("__")} == {"time", "phi", "a", "x1x", "phi_"}
    assert np.array_equal(found["phi"], result["φ"]) and np.all(found["phi_"] == 5)
    result.save(tmp_path / "r.nc")
    with xarray.open_dataset(tmp_path / "r.nc") as data:
        name = "φ" if "φ" in data else "phi"
        assert np.array_equal(data[name], result["φ"])


def test_files_are_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import scipy.io

    result = nsdc.loads("model m { state x = 1; x' = 0; } simulate s of m { horizon 1; }")["s"].run()
    path = tmp_path / "r.mat"
    path.write_text("before")

    def fails(path: Path, values: object) -> None:
        Path(path).write_text("half")
        raise OSError("the disk is full")

    monkeypatch.setattr(scipy.io, "savemat", fails)
    with pytest.raises(OSError, match="full"):
        result.save(path)
    assert path.read_text() == "before" and list(tmp_path.iterdir()) == [path]


def test_high_derivatives_are_refused(ball: nsdc.Experiment) -> None:
    result = nsdc.loads("model m { state x = 1; x' = -2*x; } simulate s of m { horizon 1; }")["s"].run()
    for order in range(5):
        assert result(0.5, derivative=order)["x"] == pytest.approx((-2) ** order * np.exp(-1), rel=1e-7)
    for order, error in [(5, ValueError), (10**12, ValueError), (-1, ValueError), (1.5, TypeError)]:
        with pytest.raises(error, match="derivative"):
            result(0.5, derivative=order)
    with pytest.raises(TypeError, match="time: expected a number"):
        result("0.5")


def test_units_and_docs_are_kept(ball: nsdc.Experiment) -> None:
    assert ball.doc == "A ball that is let go." and ball.kind == "simulate"
    g = ball.parameters["g"]
    assert (g.value, g.unit, g.doc, g.range) == (9.81, "m/s^2", "On Earth.", (0.0, 100.0))
    assert list(ball.states) == ["q", "v"] and list(ball.outputs) == ["energy"]
    data = ball.run().to_xarray()
    assert data["q"].attrs["units"] == "m" and ball.run().to_pandas().attrs["units"]["v"] == "m/s"


def test_states_are_told_at_instants_of_ones_own(ball: nsdc.Experiment) -> None:
    result, instants = ball.run(g=2), np.array([0.1, 0.25, 0.5])
    table, data = result.to_pandas(at=instants), result.to_xarray(at=instants)
    # It falls for a second.
    assert table.index.tolist() == data["time"].to_numpy().tolist() == instants.tolist()
    assert np.abs(table["q"].to_numpy() - (1 - instants**2)).max() < 1e-12
    assert np.array_equal(data["q"], table["q"]) and data["q"].attrs["units"] == "m"
    assert list(table) == list(data) == ["q", "v"] and list(table.attrs["units"]) == ["q", "v"]
    for wrong in (2.0, [0.5, 2.0]):
        with pytest.raises(ValueError, match="at: expected|time: the run"):
            result.to_pandas(at=wrong)


def test_optima_are_told() -> None:
    tutorial = nsdc.load(EXAMPLES / "tutorial_ocp.nsd")["tutorial"]
    result = tutorial.run()
    # From the equation of its switch, as the file has it.
    assert abs(result.objective - 1.523772775374957) < 1e-9
    assert result.certificate and result.optimum["confirmation"] == "confirmed"
    assert [one["bound"] for one in result.constraints] == [-5, 5, -5, 5]
    assert "<svg" in result._repr_html_()
    leak = nsdc.load(EXAMPLES / "choices_ocp.nsd")
    freed = next(one for one in leak.experiments.values() if one.run().free)
    assert abs(freed.run().free["leak"] - 2) < 1e-6


def test_multipliers_are_kept_where_they_are_asked_for(belt: nsdc.Experiment) -> None:
    result = belt.run(horizon=1, method="fesd { steps = 4; }", multipliers=True)
    multipliers = result.multipliers
    assert multipliers is not None and len(multipliers) > 1
    assert all(len(values) == len(multipliers["time"]) for values in multipliers.values())
    assert belt.run(horizon=1, method="fesd { steps = 4; }").multipliers is None


def test_fits_are_those_of_a_regression() -> None:
    text = """model line { param a = -1; state x = 0; x' = a; }
        fit f of line { horizon 2; data "data.csv" { x -> y; } free { a; } initial { x free; } }"""
    file = nsdc.loads(text, files={"data.csv": "time,y\n0,2.1\n1,-1.1\n2,-3.9\n"})
    result = file["f"].run()
    times, values = np.array([0.0, 1.0, 2.0]), np.array([2.1, -1.1, -3.9])
    (slope, start), covariance = np.polyfit(times, values, 1, cov="unscaled")
    squares = float(np.sum((start + slope * times - values) ** 2))
    assert result.status == "solved" and result.fit is not None
    assert result.free == pytest.approx({"a": slope, "x at 0": start}, abs=1e-7)
    # One degree of freedom.
    np.testing.assert_allclose(result.fit["covariance"], squares * covariance, atol=1e-7)
    assert abs(result["x"][-1] - (start + 2 * slope)) < 1e-7
    # Values that are given are where the search begins.
    assert file["f"].run(a=5).free == pytest.approx(result.free, abs=1e-6)
    assert "<circle" in result._repr_html_()
