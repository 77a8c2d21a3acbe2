"""Derivatives of runs against closed forms, and through JAX and PyTorch against differences."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import nsdc

#: x falls with a + 1, then slides at 0.
RELAY = """
model relay { param a = 0.5; state x = 1; x' = -a - sign(x); }
simulate settles of relay { horizon 1; }
"""
OSCILLATOR = """
model oscillator {
  param omega = 1; param c = 0.1;
  state x[2] = [1, 0];
  output energy = dot(x, x)/2;
  x[1]' = x[2]; x[2]' = -omega^2*x[1] - c*sign(x[2] - 0.3);
}
simulate cycles of oscillator { horizon 3; tolerance 1e-11; }
"""


@pytest.fixture
def oscillator() -> nsdc.Experiment:
    return nsdc.loads(OSCILLATOR, "oscillator.nsd")["cycles"]


def test_a_ball_is_differentiated(ball: nsdc.Experiment) -> None:
    result = ball.run(g=2, q=1, v=0, horizon=1.5, sensitivities=["g", "q"])
    gradient = result.grad
    assert gradient.to == ["g", "q at 0"] and np.all(np.isinf(gradient.until))
    # It strikes at t* = √(2q/g), and moves with e √(2qg) - g (t - t*) behind that, e = 1/2.
    assert gradient.events.time == pytest.approx([1], abs=1e-11)
    assert gradient.events.by == pytest.approx(np.array([[-0.25, 0.5]]), abs=1e-10)
    behind = result.time > 1
    since = result.time[behind] - 1
    by_g = 0.25 - since - 0.5
    by_q = 0.5 * np.ones_like(since) + 1
    assert gradient["v"].shape == (*result.time.shape, 2)
    assert gradient["v"][behind] == pytest.approx(np.stack([by_g, by_q], axis=-1), abs=1e-10)
    assert gradient.end["v"] == pytest.approx(np.array([-0.75, 1.5]), abs=1e-10)
    with pytest.raises(ValueError, match="read-only"):
        gradient["v"][0] = 0
    with pytest.raises(KeyError, match="there are q, v"):
        gradient["w"]


def test_entries_and_outputs_are_differentiated(oscillator: nsdc.Experiment) -> None:
    result = oscillator.run(sensitivities=["x[1]", "c"], at=[0, 1.5, 3], c=0, horizon=3)
    gradient = result.grad
    assert gradient.to == ["x[1] at 0", "c"] and result.time.tolist() == [0, 1.5, 3]
    t = result.time
    assert gradient["x"].shape == (3, 2, 2)
    assert gradient["x[1]"][:, 0] == pytest.approx(np.cos(t), abs=1e-9)
    assert gradient["x"][:, 1, 0] == pytest.approx(-np.sin(t), abs=1e-9)
    # x is (cos t, -sin t), whose energy is 1/2 whatever the phase is.
    assert gradient["energy"][:, 0] == pytest.approx(np.ones(3), abs=1e-9)


def test_both_sides_of_a_kink_are_told() -> None:
    starts = nsdc.loads("model m { state x = 0; x' = if x >= 0 then 2 else 1; } simulate s of m { horizon 1; }")["s"]
    assert np.isnan(starts.run(sensitivities=["x"]).grad.end["x"]).all()
    gradient = starts.run(sensitivities=["x"], one_sided=True).grad
    assert gradient.to == ["x at 0", "x at 0 from below", "x at 0 from above"]
    # From below it is -x(0) late, and goes on with 2.
    assert gradient.end["x"][1:] == pytest.approx([2, 1], abs=1e-9)
    assert gradient.until[1:].tolist() == [np.inf, np.inf]


def test_a_result_keeps_its_derivatives(ball: nsdc.Experiment) -> None:
    result = ball.run(sensitivities=["g"])
    kept = pickle.loads(pickle.dumps(result)).grad
    assert kept.to == ["g"] and np.array_equal(kept["q"], result.grad["q"])
    with pytest.raises(ValueError, match="sensitivities"):
        ball.run().grad
    with pytest.raises(ValueError, match="sensitivities"):
        pickle.loads(pickle.dumps(ball.run())).grad


@pytest.mark.parametrize(
    ("names", "error", "match"),
    [
        (["gg"], TypeError, "did you mean `g`"),
        ("g", TypeError, "a list of names"),
        (["g", "g"], nsdc.ModelError, "E0531"),
        (["g at 0"], nsdc.ModelError, "E0530|E0527|no sensitivity"),
        (["energy"], TypeError, "no parameter or initial value"),
        (["g; horizon 3"], TypeError, "no parameter or initial value"),
    ],
)
def test_wrong_names_are_told(ball: nsdc.Experiment, names: list[str], error: type, match: str) -> None:
    with pytest.raises(error, match=match):
        ball.run(sensitivities=names)


def test_a_function_gives_values_and_derivatives() -> None:
    relay = nsdc.loads(RELAY)["settles"]
    f = relay.function(["a", "x"], at=[0.25, 0.5])
    assert f.inputs == {"a": (), "x": ()} and f.outputs == {"x": (2,)}
    values, pull = f.vjp({"a": 0.25, "x": 2})
    assert values["x"] == pytest.approx([2 - 1.25 / 4, 2 - 1.25 / 2], abs=1e-11)
    pulled = pull({"x": [1, 10]})
    assert pulled["a"] == pytest.approx(-0.25 - 5) and pulled["x"] == pytest.approx(11)
    # At the end it slides.
    values, pull = relay.vjp(["a", "x"])
    assert abs(values["x"]) < 1e-12 and abs(pull({"x": 1})["x"]) < 1e-12
    with pytest.raises(ValueError, match="expected an array of shape"):
        f.vjp({})[1]({"x": 1})
    for wrong in ({"by": []}, {"by": ["b"]}, {"by": "a"}, {"by": ["a"], "of": ["y"]}, {"by": ["a"], "at": 1}):
        with pytest.raises((TypeError, ValueError)):
            relay.function(**wrong)
    with pytest.raises(TypeError, match="none of a"):
        f({"b": 1})
    for by, asked in ((["a", "a"], {}), (["a"], {"at": [1], "settings": {"at": [1]}}), (["a"], {"sensitivities": ["x"]})):
        with pytest.raises(TypeError):
            relay.function(by, **asked)
    with pytest.raises((ValueError, nsdc.ModelError)):
        relay.function(["a"], at=[2])({})


def test_a_second_gradient_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it is weighed with, and wherever it is, on the same sides of zero: x(1) = x(0) exp(-k)."""
    decay = nsdc.loads("model m { param k = 1; state x = 2; x' = -k*x; } simulate d of m { horizon 1; tolerance 1e-12; }")["d"]
    seconds = []
    run = nsdc.Experiment._run

    def spied(*asked: object, **rest: object) -> nsdc.Result:
        result = run(*asked, **rest)  # type: ignore[arg-type]
        seconds.append(result.stats["compile_s"])
        return result

    monkeypatch.setattr(nsdc.Experiment, "_run", spied)
    f = decay.function(["k", "x"])
    for k, x in ((0.5, 3), (1.5, 1)):
        values, pull = f.vjp({"k": k, "x": x})
        for weight in (1, -2):
            found = pull({"x": weight})
            assert found["k"] == pytest.approx(-weight * x * np.exp(-k)) and found["x"] == pytest.approx(weight * np.exp(-k))
        _, jacobian = f.linearized({"k": k, "x": x})
        assert jacobian["x"]["x"] == pytest.approx(np.exp(-k))
    assert seconds[0] > 0 and len(seconds) == 8 and not any(seconds[1:])


def test_what_pulls_back_keeps_its_inputs() -> None:
    decay = nsdc.loads("model m { param k = 1; state x[2] = [1, 2]; x' = -k*x; } simulate d of m { horizon 1; }")["d"]
    start = np.array([1.0, 2.0])
    inputs = {"k": 1.0, "x": start}
    _, pull = decay.function(["k", "x"]).vjp(inputs)
    before = pull({"x": [1, 1]})
    start[:] = [10, 20]
    inputs["k"] = 3.0
    behind = pull({"x": [1, 1]})
    assert before["k"] == pytest.approx(-3 * np.exp(-1)) and behind["k"] == before["k"]


def test_inputs_replace_what_is_asked_for_otherwise(oscillator: nsdc.Experiment) -> None:
    for by, asked, given in (
        (["x[1]"], {"x": [3, 4]}, {"x[1]": 1}),
        (["x"], {"params": {"x[1]": 5}}, {"x": [1, 4]}),
    ):
        f = oscillator.function(by, ["x"], at=[0], **asked)
        assert f(given)["x"].tolist() == [[1, 4]]


def test_what_has_no_derivative_is_an_error() -> None:
    # A start on the surface.
    relay = nsdc.loads(RELAY)["settles"]
    _, pull = relay.vjp(["x"], x=0)
    with pytest.raises(nsdc.DerivativeError, match="W0735"):
        pull({"x": 1})
    assert pull({"x": 0})["x"] == 0
    with pytest.raises(nsdc.DerivativeError, match="W0735"):
        relay.function(["x"]).linearized({"x": 0})
    with pytest.raises(nsdc.RunError):
        relay.vjp(["a"], time_limit=0)
    # Of two, that which has one is not told without the other.
    _, pull = relay.vjp(["a", "x"], x=0)
    with pytest.raises(nsdc.DerivativeError, match="sensitivity to `x at 0`"):
        pull({"x": 1})


def test_what_stops_moves_with_its_instant() -> None:
    """A ball falls to the floor: v = -√(2 g q) there, after √(2 q/g)."""
    fall = nsdc.loads("""
        model fall { param g = 9.81; state q = 1; state v[2] = [0, 0]; output e = v[1]^2; q' = v[1]; v' = [-g, 1]; }
        simulate s of fall { horizon 2; stop when q <= 0; }""")["s"]
    f, time = fall.function(["g", "q"], ["v", "v[1]"]), np.sqrt(2 / 9.81)
    exact = {"g": np.array([-np.sqrt(1 / 2 / 9.81), -time / 2 / 9.81]), "q": np.array([-np.sqrt(9.81 / 2), time / 2])}
    _, jacobian = f.linearized({})
    _, pull = f.vjp({})
    for by, slope in exact.items():
        assert jacobian["v"][by] == pytest.approx(slope, rel=1e-9)
        assert jacobian["v[1]"][by] == pytest.approx(slope[0], rel=1e-9)
    pulled = pull({"v": [2, 3], "v[1]": 1})
    for by, slope in exact.items():
        assert pulled[by] == pytest.approx(3 * slope[0] + 3 * slope[1], rel=1e-9)
    # Before that, instants are fixed.
    _, early = fall.function(["g"], ["v[1]"], at=[0.1]).linearized({})
    assert early["v[1]"]["g"] == pytest.approx([-0.1])
    # An output reads more than states.
    values, pull = fall.vjp(["g"])
    assert values["e"] == pytest.approx(2 * 9.81)
    with pytest.raises(nsdc.DerivativeError, match="`e` is no state"):
        pull({"e": 1})


def test_arguments_of_functions_are_named(ball: nsdc.Experiment) -> None:
    f = ball.function(["g"], ["q"])
    _, pull = f.vjp({})
    for call, text in [
        (lambda: f([]), "inputs: expected values by name"),
        (lambda: f.vjp(None), "inputs: expected values by name"),
        (lambda: pull(None), "weights: expected values by name"),
        (lambda: f.linearized({}, by=["zz"]), "by: `zz`"),
        (lambda: ball.function([1]), "by: expected a name"),
        (lambda: ball.function(["g"], at=[0.5], every=0.1), "every, at"),
    ]:
        with pytest.raises(TypeError, match=text):
            call()


def test_pulling_back_is_the_transpose_of_derivatives(oscillator: nsdc.Experiment, ball: nsdc.Experiment) -> None:
    random = np.random.default_rng(1)
    functions = [
        oscillator.function(["omega", "c", "x"], ["x", "energy", "x[2]"], at=[0, 1, 1, 3]),
        ball.function(["g", "q"], ["q", "v"], g=2, horizon=1.5, tolerance=1e-12),
    ]
    for f in functions:
        values, jacobian = f.linearized({})
        same, pull = f.vjp({})
        for _ in range(2):
            weights = {name: random.normal(size=shape) for name, shape in f.outputs.items()}
            found = pull(weights)
            for by, shape in f.inputs.items():
                terms = [weights[name].ravel() @ jacobian[name][by].reshape(weights[name].size, -1) for name in weights]
                assert found[by].shape == shape
                assert found[by].ravel() == pytest.approx(sum(terms), rel=1e-8, abs=1e-8)
        for name, value in values.items():
            assert same[name] == pytest.approx(value, abs=1e-11)


def test_many_parameters_have_a_gradient() -> None:
    # x' = -Σ k_i x / n: every entry has the derivative -x(1)/n.
    n = 60
    text = f"model m {{ param k[{n}] = ones({n}); state x = 2; x' = -sum(k)/{n}*x; }} simulate s of m {{ horizon 1; tolerance 1e-11; }}"
    values, pull = nsdc.loads(text)["s"].vjp(["k", "x"])
    found = pull({"x": 3})
    assert found["k"] == pytest.approx(np.full(n, -3 * float(values["x"]) / n), abs=1e-9)
    assert found["x"] == pytest.approx(3 * np.exp(-1), abs=1e-9)


def test_jax_goes_through_runs(
    ball: nsdc.Experiment, oscillator: nsdc.Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    jax = pytest.importorskip("jax")
    from jax.test_util import check_grads

    import nsdc.jax

    jax.config.update("jax_enable_x64", True)
    f = nsdc.jax.function(oscillator, ["omega", "c", "x"], at=[1, 3])
    inputs = {"omega": 1.1, "c": 0.2, "x": np.array([1.0, 0.1])}
    check_grads(f, (inputs,), order=1, modes=["rev"])
    bounced = nsdc.jax.function(ball, ["g", "q"], ["q", "v"], g=2, horizon=1.5, tolerance=1e-11)
    check_grads(bounced, ({"g": 2.0, "q": 0.9},), order=1, modes=["rev"])

    def height(g: float, q: float) -> float:
        return bounced({"g": g, "q": q})["q"]

    heights = np.linspace(0.5, 1, 5)
    slopes = jax.jit(jax.vmap(jax.grad(height, argnums=(0, 1)), in_axes=(None, 0)))(2.0, heights)
    for k, q in enumerate(heights):
        _, pull = ball.vjp(["g", "q"], ["q"], g=2, q=q, horizon=1.5, tolerance=1e-11)
        for name, slope in zip(("g", "q"), slopes):
            assert slope[k] == pytest.approx(pull({"q": 1})[name], abs=1e-9)
    # One pass back for all, from what is weighed of whole values, without numbers from elsewhere.
    with monkeypatch.context() as patch:
        patch.setattr(nsdc._function.Function, "linearized", None)
        both = jax.vmap(jax.grad(lambda q, w: height(2.0, q) * w))(heights, heights)
    assert both == pytest.approx(np.asarray(slopes[1]) * heights, abs=1e-9)
    # At rest on the surface there is a derivative by a alone.
    relay = nsdc.jax.function(nsdc.loads(RELAY)["settles"], ["a", "x"])
    assert abs(jax.grad(lambda a: relay({"a": a, "x": 1.0})["x"])(0.5)) < 1e-12
    with pytest.raises(Exception, match="W0735"):
        jax.grad(lambda x: relay({"a": 0.5, "x": x})["x"])(0.0)
    with pytest.raises(TypeError, match="expected values of g, q"):
        bounced({"g": 2.0})
    with pytest.raises(ValueError, match="expected shape"):
        bounced({"g": np.ones(2), "q": 1.0})


def test_torch_goes_through_runs(ball: nsdc.Experiment, oscillator: nsdc.Experiment) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not among the requirements of tests")
    import nsdc.torch

    def tensor(*values: float) -> object:
        return torch.tensor(values if len(values) > 1 else values[0], dtype=torch.float64, requires_grad=True)

    f = nsdc.torch.function(oscillator, ["omega", "x"], ["x", "energy"], at=[1, 3])

    def flat(omega: object, x: object) -> tuple[object, ...]:
        return tuple(f({"omega": omega, "x": x}).values())

    assert torch.autograd.gradcheck(flat, (tensor(1.1), tensor(1, 0.1)))
    whole = f({"omega": 1, "x": [1, 2]})["x"]
    assert whole.dtype == torch.get_default_dtype() and not torch.equal(whole, whole.round())
    # What changes behind a run does not change its derivatives.
    start = tensor(1, 0.5)
    energy = f({"omega": tensor(1.1), "x": start})["energy"]
    (slope,) = torch.autograd.grad(energy[1], start, retain_graph=True)
    with torch.no_grad():
        start.add_(1)
    assert torch.equal(torch.autograd.grad(energy[1], start)[0], slope)
    bounced = nsdc.torch.function(ball, ["g"], ["q"], horizon=1.5, tolerance=1e-11)
    assert torch.autograd.gradcheck(lambda g: bounced({"g": g})["q"], (tensor(2),))
