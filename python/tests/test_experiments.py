"""What runs take, what they refuse, and that they depend on their own values alone."""

from __future__ import annotations

import doctest
import json
import pickle
from functools import cached_property
from types import FunctionType

import numpy as np
import pytest

import nsdc

from models import BALL, BELT, EXAMPLES


@pytest.mark.parametrize(
    ("values", "error", "text"),
    [
        ({"gg": 1}, TypeError, "did you mean `g`"),
        ({"params": {"w[1]": 1}}, TypeError, "w\\[1\\]"),
        ({"g": "two"}, TypeError, "g: expected a number"),
        ({"g": None}, TypeError, "g: expected a number"),
        ({"g": object()}, TypeError, "g: expected numbers"),
        ({"g": [1.0, 2.0]}, ValueError, "g: expected a number, got one of shape"),
        ({"g": np.nan}, ValueError, "g: nan is not finite"),
        ({"q": np.inf}, ValueError, "q: inf is not finite"),
        ({"g": np.zeros((300, 300))}, ValueError, "g: expected a number"),
        ({"g": 1, "params": {"g": 2}}, TypeError, "`g` is given twice"),
        ({"horison": 3}, TypeError, "did you mean `horizon`"),
        ({"settings": {"metod": "event"}}, TypeError, "no setting"),
        ({"horizon": 1, "settings": {"horizon": 2}}, TypeError, "`horizon` is given twice"),
        ({"params": [("g", 1)]}, TypeError, "params: expected"),
        ({"g": np.ma.masked_array(1.0, mask=True)}, TypeError, "g: .* masked"),
        ({"time_limit": "5"}, TypeError, "time_limit: expected a number"),
        ({"horizon": np.nan}, ValueError, "horizon: nan is not finite"),
        ({"horizon": [1, 2]}, TypeError, "horizon: expected a number"),
        ({"time_limit": -1}, ValueError, "time_limit"),
        ({"g": 10**400}, ValueError, "g: expected numbers that a float can hold"),
        ({"horizon": 10**400}, ValueError, "horizon: expected numbers that a float can hold"),
        ({"horizon": b"1"}, TypeError, "horizon: expected a number or words"),
        ({"settings": "horizon"}, TypeError, "settings: expected values by name"),
        ({"params": {1: 2}}, TypeError, "params: expected a name, got 1"),
        ({"sensitivities": "g"}, TypeError, "sensitivities: expected a list of names"),
        ({"sensitivities": None}, TypeError, "sensitivities: expected a list of names"),
        ({"sensitivities": [1]}, TypeError, "sensitivities: expected a name, got 1"),
        ({"one_sided": "no"}, TypeError, "one_sided: expected True or False"),
        ({"multipliers": 1}, TypeError, "multipliers: expected True or False"),
        ({"every": 0.1, "at": [0.5]}, TypeError, "every, at"),
        ({"at": np.linspace(0, 1, 60_001)}, ValueError, "60001 instants are too many"),
    ],
)
def test_wrong_arguments_are_named(
    ball: nsdc.Experiment, values: dict, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        ball.run(**values)


def test_shapes_are_checked(belt: nsdc.Experiment) -> None:
    with pytest.raises(ValueError, match=r"x: expected an array of shape \(2,\), got one of shape \(3,\)"):
        belt.run(x=[1, 2, 3])
    with pytest.raises(TypeError, match="x: expected numbers of one shape"):
        belt.run(x=[[1, 2], [3]])
    whole = belt.run(x=np.array([0.5, -1.0]))
    entries = belt.run(params={"x[1]": 0.5, "x[ 2 ]": -1})
    assert whole["x"].tolist() == entries["x"].tolist()


def test_names_are_compared_as_in_the_language() -> None:
    # The micro sign of keyboards, which is no Greek letter.
    text = "model m { param µ = 0.5; state x = 1; state µ2 = 0; x' = -µ*x; µ2' = µ; } simulate µs of m { horizon 1; }"
    file = nsdc.loads(text)
    decay = file["µs"]
    assert "µs" in file and "µ2" in decay.run() and 1 not in file
    sweep = decay.sweep(µ=[1, 2])
    assert "µ2" in sweep and sweep["µ2"].tolist() == decay.sweep(µ=[1, 2])["μ2"].tolist()
    assert decay.parameters["µ"].value == decay.parameters["μ"].value == 0.5
    told = [decay.run(params={name: 2}).end["x"] for name in ("µ", "μ")]
    assert told[0] == told[1] == decay.run(µ=2).end["x"]
    assert decay.run(sensitivities=["µ"]).grad.to == ["μ"]
    assert decay.sweep(params={"µ": [1, 2]})["x"].tolist() == decay.sweep(µ=[1, 2])["x"].tolist()
    assert decay.function(["µ"])({"µ": 2})["x"] == told[0]


def test_texts_are_texts() -> None:
    with pytest.raises(TypeError, match="text: expected a text"):
        nsdc.loads(3)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="files: expected a text or bytes as `a.csv`"):
        nsdc.loads("", files={"a.csv": 5})  # type: ignore[dict-item]


def test_entries_are_given_once(belt: nsdc.Experiment) -> None:
    for params in ({"x[1]": 5}, {"x[1]": 5, "x[ 1]": 6}):
        with pytest.raises(TypeError, match=r"`x\[1\]` is given twice"):
            belt.run(params=params, **({"x": [1, 2]} if len(params) == 1 else {}))


def test_settings_can_be_given_beside_names_of_the_model() -> None:
    text = "model m { param horizon = 1; state method = 1; method' = -horizon; } simulate s of m { horizon 1; }"
    result = nsdc.loads(text)["s"].run(horizon=3, method=2, settings={"horizon": 0.5})
    assert abs(result.end["method"] - 0.5) < 1e-12 and result.time[-1] == 0.5


def test_mistakes_of_models_have_places() -> None:
    file = nsdc.loads("model m { param rate = 1;\n  state x = 1; x' = -rte*x; }\nsimulate s of m { horizon 1; }", "m.nsd")
    with pytest.raises(nsdc.ModelError, match="unknown name `rte`") as told:
        file["s"].run()
    error = told.value
    assert error.code == "E0101" and (error.span.file, error.span.line) == ("m.nsd", 2)
    assert "rate" in error.help
    (fix,) = error.fixes
    assert fix.edits[0].replacement == "rate" and fix.edits[0].span == error.span
    assert "rte" in error._repr_html_() and "m.nsd:2" in str(error)
    assert [one.code for one in file.check()] == ["E0101"]
    assert "E0101" in nsdc.explain("E0101")
    with pytest.raises(KeyError):
        nsdc.explain("E9999")
    with pytest.raises(nsdc.ModelError, match="horizon"):
        nsdc.loads(BALL)["falls"].run(horizon="1 +")
    # A value outside of its range is told with the line of its declaration.
    with pytest.raises(nsdc.ModelError, match="E0504"):
        nsdc.loads(BALL)["falls"].run(e=2)


def test_settings_are_taken(belt: nsdc.Experiment) -> None:
    asked = {"tolerance": 1e-6, "method": "fesd { steps = 8; }", "every": 0.05}
    result = belt.run(horizon="pi/10", x=[2, 0], mu=0.5, speed=1, **asked)
    assert json.loads(result.json)["method"]["name"] == "fesd"
    # x'' = -x + mu as long as it is slower than the belt.
    assert abs(result.time[-1] - np.pi / 10) < 1e-15 and len(result.time) == 8
    assert abs(result.end["x"][0] - (0.5 + 1.5 * np.cos(np.pi / 10))) < 1e-6


def test_runs_depend_on_their_own_values_alone() -> None:
    """Whatever was run before, and in whatever order: the very same numbers."""
    rng = np.random.default_rng(5)
    for text, name, draws in (
        # Some are refused.
        (BALL, "falls", {"g": (1, 20), "e": (0.1, 1.5), "q": (0.1, 2)}),
        (BELT, "pulls", {"mu": (-1, 1), "speed": (-0.5, 0.5)}),
    ):
        points = [{k: rng.uniform(*span) for k, span in draws.items()} for _ in range(6)]
        points += [{**points[0], list(draws)[0]: 0.0}, {list(draws)[0]: points[1][list(draws)[0]]}]

        def told(file: nsdc.File, point: dict) -> object:
            try:
                result = file[name].run(**point)
            except nsdc.ModelError as error:
                return error.code
            return result.time.tolist(), [result[one].tolist() for one in result]

        alone = [told(nsdc.loads(text), point) for point in points]
        for order in (range(len(points)), reversed(range(len(points)))):
            file = nsdc.loads(text)
            found = {k: told(file, points[k]) for k in order}
            assert [found[k] for k in range(len(points))] == alone
        assert ("E0504" in alone) == (text == BALL)


#: A swing that is pushed.
PUSHED = """model m { param a = 0.5; state x = 1; state v = 0; x' = v; v' = -sin(x) + a*sin(time) - 0.1*sign(v); }
  simulate s of m { horizon 5; }"""


#: A heater with memory, and a diode beside it, whose current is found by its conditions.
HEATED = """model m { state x = 19; algebraic z = 0.1; switch on = hysteresis(x, on = 18, off = 20, start = 1);
    0 <= z perp z + 19 - x >= 0; x' = 15*on - z - x/2; }
  simulate s of m { horizon 5; }"""


@pytest.mark.parametrize("text", [BELT, PUSHED, HEATED], ids=["autonomous", "forced", "memory"])
def test_other_tolerances_compile_nothing(text: str) -> None:
    """And what comes of them does not depend on what was run before."""

    def experiment() -> nsdc.Experiment:
        return next(iter(nsdc.loads(text).experiments.values()))

    kept = experiment()
    for k, tolerance in enumerate([1e-6, 1e-9, None, 1e-7]):
        found = kept.run(tolerance=tolerance)
        alone = experiment().run(tolerance=tolerance)
        assert (found.stats["compile_s"] == 0) == (k > 0) and alone.stats["compile_s"] > 0
        assert found.time.tolist() == alone.time.tolist()
        assert all(found[name].tolist() == alone[name].tolist() for name in found)
        compiled = experiment().run(tolerance=None if tolerance is None else str(tolerance))
        assert all(np.abs(found.end[name] - compiled.end[name]).max() < 1e-5 for name in found)


@pytest.mark.parametrize("rate", ["floor(time/30)", "pulse(time, 50, 0.9)", "mod(time, 40)", "sin(time)", "1"])
@pytest.mark.parametrize("told", ["", "output every 0.5; "])
def test_a_horizon_that_is_given_is_that_of_the_model(rate: str, told: str) -> None:
    text = f"model m {{ state x = 0; x' = {rate} - x; output y = floor(time); }} simulate s of m {{ {told}horizon 20; }}"
    kept = nsdc.loads(text)["s"]
    for horizon in (20.0, 100.0, 3.0, 5.5, 49.0):
        given = kept.run(horizon=horizon)
        fresh = nsdc.loads(text.replace("horizon 20", f"horizon {horizon}"))["s"].run()
        assert given.time.tolist() == fresh.time.tolist()
        assert all(given[name].tolist() == fresh[name].tolist() for name in ("x", "y"))


def test_what_is_told_twice_is_told_by_its_name() -> None:
    text = "model m { state q = 1; state v = 0; q' = v; v' = -q; } simulate s of m { horizon 1; output v, v, q; }"
    told = nsdc.loads(text)["s"].run()
    assert all(told[name][-1] == told.end[name] for name in ("q", "v"))


def test_settings_without_a_meaning_are_refused() -> None:
    kept = nsdc.loads(BELT)["pulls"]
    for wrong in ({"horizon": -1.0}, {"tolerance": 2.0}):
        with pytest.raises(nsdc.ModelError):
            kept.run(**wrong)


def test_instants_that_are_asked_for_are_within_the_horizon() -> None:
    text = BELT.replace("horizon 20;", "horizon 20; output at [1, 10];")
    pulls = nsdc.loads(text)["pulls"]
    assert pulls.run(horizon=15).time.tolist() == [1, 10, 15]
    with pytest.raises(nsdc.ModelError, match="between 0 and the horizon"):
        pulls.run(horizon=5)
    assert pulls.run().time.tolist() == [1, 10, 20]


def test_open_parameters_have_the_result_of_compiled_ones() -> None:
    """Two roads: a parameter that stays open, and its number in the text."""
    for mu in (0.2, 0.9):
        opened = nsdc.loads(BELT)["pulls"].run(mu=mu)
        fixed = nsdc.loads(BELT.replace("mu = 0.6", f"mu = {mu}"))["pulls"].run()
        assert np.abs(opened.end["x"] - fixed.end["x"]).max() < 1e-9
        assert [event.kind for event in opened.events] == [event.kind for event in fixed.events]
        assert opened.parameters["mu"] == mu


def test_forms_and_commands_are_shown(ball: nsdc.Experiment) -> None:
    assert "v" in ball.emit("system") and ball.emit()._repr_latex_() is None
    tex = ball.emit("tex")
    assert tex._repr_latex_().startswith("$$")
    assert pickle.loads(pickle.dumps(tex)).ir == "tex"
    above = "use ../parts/decay.{decay}; simulate s of decay { horizon 1; }"
    parts = {"../parts/decay.nsd": "model decay { state x = 1; x' = -x; }"}
    file = nsdc.loads(above, "main.nsd", files=parts)
    assert "der(x)" in file["s"].emit()
    report = nsdc.verify(file["s"])
    assert report.ok and "roads agree" in report and pickle.loads(pickle.dumps(report)) == report


def test_names_are_helped() -> None:
    file = nsdc.loads(BALL)
    with pytest.raises(KeyError, match="did you mean `falls`"):
        file["fals"]
    assert "falls" in file and list(file.experiments) == ["falls"] and file.models == ["ball"]
    with pytest.raises(OSError, match="nowhere.nsd"):
        nsdc.load("nowhere.nsd")


def test_the_figure_of_the_readme_is_that_of_its_model() -> None:
    crossing = nsdc.load(EXAMPLES / "oscillator.nsd")["crossing"]
    assert crossing.run().plot().svg == (EXAMPLES / "oscillator.svg").read_text()
    readme = (EXAMPLES.parent / "README.md").read_text()
    code = readme.split("```python\n")[1].split("```")[0]
    exec(code.replace("examples/", f"{EXAMPLES}/"), {})


def test_notebooks_show_figures(ball: nsdc.Experiment) -> None:
    result = ball.run()
    shown = result._repr_html_()
    assert shown.count("<svg") == 1 and "<details>" in shown
    assert result.plot()._repr_svg_() in shown
    assert "m/s^2" in ball._repr_html_() and "falls" in ball.file._repr_html_()
    with pytest.raises(ValueError, match="svg"):
        result.plot().save("figure.png")


@pytest.mark.parametrize("name", [name for name in nsdc.__all__ if name != "__version__"])
def test_public_names_have_examples(name: str) -> None:
    """Which are doctests, so that they run."""
    public = getattr(nsdc, name)
    assert doctest.DocTestParser().get_examples(public.__doc__)
    members = vars(public).items() if isinstance(public, type) else []
    undescribed = [
        member
        for member, value in members
        if not member.startswith("_") and isinstance(value, (FunctionType, property, cached_property))
        if not value.__doc__
    ]
    assert undescribed == []
