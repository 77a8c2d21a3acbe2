"""Sweeps against closed forms, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from models import BALL, BELT

import nsdc

DECAY = """model decay { param k = 1; param c[2] = [1, 2]; state x = 1; state y[2] = [0, 0];
             x' = -k*x; y' = c; output twice = 2*x; }
           simulate d of decay { horizon 1; }"""


@pytest.fixture
def decay() -> nsdc.Experiment:
    return nsdc.loads(DECAY)["d"]


def test_ends_have_the_shape_of_the_axes(decay: nsdc.Experiment) -> None:
    k, x = np.linspace(0.5, 2, 4), np.array([1.0, 3.0, -2.0])
    sweep = decay.sweep(k=k, x=x, params={"c[2]": 5.0})
    exact = np.exp(-k)[:, None] * x
    assert sweep.shape == (4, 3) and sweep.ok and not sweep.failed
    assert np.abs(sweep["x"] - exact).max() < 1e-8
    assert np.abs(sweep["twice"] - 2 * exact).max() < 1e-8
    assert np.abs(sweep["y"] - np.array([1, 5])).max() < 1e-12 and sweep["y"].shape == (4, 3, 2)
    assert np.array_equal(sweep["y[2]"], sweep["y"][..., 1])
    data = sweep.to_xarray()
    assert data["twice"].dims == ("k", "x") and data["twice"].sel(k=2.0, x=3.0) == sweep["twice"][3, 1]
    table = sweep.to_pandas()
    assert len(table) == 12 and table["x at end"].tolist() == sweep["x"].reshape(-1).tolist()
    assert sweep.plot()._repr_svg_().startswith("<svg") and "12 of 12" in sweep._repr_html_()


def test_values_side_by_side(decay: nsdc.Experiment) -> None:
    k, x = np.array([0.5, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])
    sweep = decay.sweep(k=k, x=x, zip=True, outputs=["twice"])
    assert sweep.names == ["twice"] and sweep.shape == (3,)
    assert np.abs(sweep["twice"] - 2 * x * np.exp(-k)).max() < 1e-8
    assert sweep.to_xarray()["k"].dims == ("run",)
    for one in (sweep, decay.sweep(k=k)):
        assert one._repr_html_().count("<svg") == 1 and "3 of 3" in one._repr_html_()


def test_rows_are_those_of_runs_and_of_any_number_of_threads() -> None:
    belt = nsdc.loads(BELT)["pulls"]
    mu = np.linspace(-0.4, 0.8, 13)
    one, two = (belt.sweep(mu=mu, threads=threads) for threads in (1, 2))
    for name in ("x[1]", "x[2]"):
        assert one[name].tolist() == two[name].tolist()
    for k, value in enumerate(mu):
        alone = belt.run(mu=value)
        assert alone.status == one.status[k] and len(alone.events) == one.events[k]
        if alone.ok:
            assert np.abs(alone.end["x"] - one["x"][k]).max() < 1e-9


def test_failed_runs_are_rows() -> None:
    grows = nsdc.loads("model m { state x = 1; x' = x^2; } simulate s of m { horizon 2; }")["s"]
    sweep = grows.sweep(x=[0.25, 1.0])
    assert sweep.status.tolist() == ["solved", "numerical_failure"] and not sweep.ok
    # x = x(0)/(1 - x(0) t)
    assert abs(sweep["x"][0] - 0.5) < 1e-8 and np.isnan(sweep["x"][1])
    (failed,) = sweep.failed
    assert failed["x"] == 1.0 and failed["status"] == "numerical_failure" and failed["code"].startswith("E07")
    # What does not compile for some values is a row as well.
    refused = nsdc.loads(BALL)["falls"].sweep(e=[0.5, 3.0])
    assert refused.status.tolist() == ["solved", "refused"] and refused.codes[1] == "E0504"


def test_rows_depend_on_their_own_values_alone() -> None:
    """Whatever else is on the axis, what is refused among it."""
    ball = nsdc.loads(BALL)["falls"]
    whole = ball.sweep(e=[3.0, 0.9, 0.3, 0.0, 0.7])
    assert whole.status.tolist() == ["refused"] + 4 * ["solved"]
    for k, e in enumerate(whole.axes["e"]):
        if k:
            assert ball.sweep(e=[e])["v"][0] == whole["v"][k]
    with pytest.raises(nsdc.ModelError, match="E0504"):
        ball.sweep(e=[3.0, 4.0])


def test_names_of_columns_are_kept_apart() -> None:
    text = "model m { param status = 1; state events = 1; events' = -status; } simulate s of m { horizon 1; }"
    sweep = nsdc.loads(text)["s"].sweep(status=[1.0, 2.0])
    table = sweep.to_pandas()
    assert table["status"].tolist() == [1, 2] and table["status of run"].tolist() == 2 * ["solved"]
    assert table["events"].tolist() == [0, 0] and np.allclose(table["events at end"], [0, -1])
    assert sweep.to_xarray()["events at end"].dims == ("status",)
    assert list(sweep) == ["events"] and "events" in sweep


def test_settings_hold_in_every_run(decay: nsdc.Experiment) -> None:
    sweep = decay.sweep(k=[1.0, 2.0], horizon=0.5, method="fesd")
    assert np.abs(sweep["x"] - np.exp(-0.5 * np.array([1, 2]))).max() < 1e-8


def test_seeds_belong_to_rows() -> None:
    walk = nsdc.loads(
        """model m { param k = 1; state x = 0; x' = -k*x; }
        simulate s of m { horizon 1; perturb every 0.1 by sphere(0.1) seed 7; }"""
    )
    sweep = walk["s"].sweep(k=[1.0] * 4, seed=3)
    assert len(set(sweep["x"].tolist())) == 4
    shifted = walk["s"].sweep(k=[1.0] * 3, seed=4)
    assert shifted["x"].tolist() == sweep["x"][1:].tolist()
    same = walk["s"].sweep(k=[1.0] * 3)
    assert len(set(same["x"].tolist())) == 1


@pytest.mark.parametrize(
    ("values", "error", "text"),
    [
        ({}, TypeError, "needs an axis"),
        ({"k": 1}, TypeError, "needs an axis"),
        ({"k": []}, ValueError, "k: the axis has no values"),
        ({"k": [1, np.nan]}, ValueError, "k: .* is not finite"),
        ({"k": ["a"]}, TypeError, "k: expected numbers"),
        ({"kk": [1]}, TypeError, "did you mean `k`"),
        ({"k": [[1, 2]]}, ValueError, "k: expected the values of an axis"),
        ({"y": [[1, 2]]}, ValueError, r"axes are entries"),
        ({"k": [1, 2], "x": [1], "zip": True}, ValueError, "one length"),
        ({"k": [1], "outputs": ["z"]}, TypeError, "z"),
        ({"k": [1], "outputs": ["y[7]"]}, TypeError, "y"),
        ({"k": [1], "outputs": "x"}, TypeError, "outputs: expected a list"),
        ({"k": [1, 2], "params": {"k": 3}}, TypeError, "`k` is given twice"),
        ({"k": [1, 2], "params": {"k": [3]}}, TypeError, "`k` is given twice"),
        ({"c": [1, 2], "params": {"c[1]": [3]}}, TypeError, "given twice"),
        ({"k": [1], "seed": 1.5}, TypeError, "seed: expected a whole number"),
        ({"k": [1], "threads": "2"}, TypeError, "threads: expected a whole number"),
        ({"k": [1], "threads": 0}, ValueError, "threads"),
        ({"k": [1], "chunk": 0}, ValueError, "chunk"),
        ({"k": np.ones(4000), "x": np.ones(4000)}, ValueError, "too large"),
        ({"k": [1], "on": "spark"}, TypeError, "on: expected"),
        ({"k": [1], "zip": "no"}, TypeError, "zip: expected True or False"),
        ({"k": [1], "outputs": [1]}, TypeError, "outputs: expected a name"),
        ({"k": [1], "outputs": ["k"]}, TypeError, "`k` is no state or output"),
        ({"k": [1], "seed": 2**64}, ValueError, "seed: expected 0 or more"),
        ({"k": [1], "checkpoint": ""}, ValueError, "checkpoint"),
    ],
)
def test_wrong_axes_are_named(
    decay: nsdc.Experiment, values: dict, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        decay.sweep(**values)


def test_a_sweep_goes_on_where_it_stopped(decay: nsdc.Experiment, tmp_path, monkeypatch) -> None:
    pytest.importorskip("pyarrow")
    k = np.linspace(0.1, 3, 40)
    whole = decay.sweep(k=k)
    computed: list[tuple[int, int]] = []
    stops: int | None = 3
    rows = nsdc._sweep.Plan.rows

    def counted(plan, first, last, threads, heard):
        if len(computed) == stops:
            raise KeyboardInterrupt
        computed.append((first, last))
        return rows(plan, first, last, threads, heard)

    monkeypatch.setattr(nsdc._sweep.Plan, "rows", counted)
    with pytest.warns(UserWarning, match="interrupted after 21 of 40"):
        first = decay.sweep(k=k, chunk=7, checkpoint=tmp_path)
    assert first["x"][:21].tolist() == whole["x"][:21].tolist() and np.isnan(first["x"][21:]).all()
    stops = None
    second = decay.sweep(k=k, chunk=7, checkpoint=tmp_path)
    assert computed == [(0, 7), (7, 14), (14, 21), (21, 28), (28, 35), (35, 40)]
    assert second["x"].tolist() == whole["x"].tolist() and second.status.tolist() == whole.status.tolist()
    for other in ({"k": k[:-1]}, {"k": k, "time_limit": 5}, {"k": k, "outputs": ["x"]}):
        with pytest.raises(ValueError, match="another sweep"):
            decay.sweep(**other, checkpoint=tmp_path)
    (tmp_path / "sweep.json").write_text("")
    with pytest.raises(ValueError, match="sweep.json"):
        decay.sweep(k=k, checkpoint=tmp_path)
