"""Controllers, and closed loops in files, against closed forms."""

import math
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import nsdc

TEXT = """
model brake { param m = 1; state x = 1; control u in [-9, 9]; x' = u/m; }
model plant { state x = 1; control u = 0; x' = u; }
optimize o of brake { horizon 1; intervals 4; minimize integral(u^2); final { x = 0; } }
simulate s of brake { with { u = 0; } horizon 1; }
mpc l of plant { controller o; sample 0.25; horizon 1; }
"""


@pytest.fixture
def controller() -> nsdc.Controller:
    return nsdc.loads(TEXT)["o"].controller(sample=0.25)


def test_steps_have_the_closed_form(controller: nsdc.Controller) -> None:
    """From x to 0 within a second: u = -m x, whatever x and m are."""
    assert (controller.states, controller.controls) == (["x"], ["u"])
    x = 1.0
    for k in range(8):
        u, info = controller.step({"x": x}, 0.25 * k)
        assert u["u"].shape == ()
        assert math.isclose(u["u"], -x, abs_tol=1e-8)
        assert info["decision"] == ("cold" if k == 0 else "warm")
        assert info["plan"]["time"][0] == 0.25 * k
        assert np.allclose(info["plan"]["states"]["x"], x * np.linspace(1, 0, 5), atol=1e-8)
        x += 0.25 * float(u["u"])
    for m in (1.0, 2.0, 0.5):
        u, _ = controller.step([x], m=m)
        assert math.isclose(u["u"], -m * x, abs_tol=1e-8)
    # It keeps its value.
    u, _ = controller.step([x])
    assert math.isclose(u["u"], -0.5 * x, abs_tol=1e-8)


def test_state_is_handed_on(controller: nsdc.Controller) -> None:
    controller.step([1.0])
    other = nsdc.loads(TEXT)["o"].controller(sample=0.25)
    other.state = pickle.loads(pickle.dumps(controller.state))
    one, other_one = controller.step([0.5]), other.step([0.5])
    assert one[0] == other_one[0]
    assert other_one[1]["decision"] == "warm"
    longer = nsdc.loads(TEXT.replace("intervals 4", "intervals 5"))["o"].controller(sample=0.25)
    with pytest.raises(ValueError, match="another controller"):
        longer.state = controller.state


def test_feedback_has_the_closed_form(controller: nsdc.Controller) -> None:
    """u = -m x from the state that is measured, wherever the prepared plan leads; what is prepared is handed on."""
    with pytest.raises(ValueError, match="nothing is prepared"):
        controller.feedback([1.0])
    controller.prepare(0.5)
    u, info = controller.feedback([1.0])
    assert math.isclose(u["u"], -1.0, abs_tol=1e-8)
    assert (info["decision"], info["plan"]["time"][0]) == ("cold", 0.5)
    for k, x in enumerate((0.75, 0.3, -0.8)):
        controller.prepare(m=2)
        state = pickle.loads(pickle.dumps(controller.state))
        other = nsdc.loads(TEXT)["o"].controller(sample=0.25, m=2)
        other.state = state
        for one in (controller, other):
            u, info = one.feedback({"x": x})
            assert math.isclose(u["u"], -2 * x, abs_tol=1e-8)
            assert (info["decision"], info["plan"]["time"][0]) == ("warm", 0.75 + 0.25 * k)
    # A step makes what was prepared old.
    controller.prepare()
    controller.step([0.1])
    with pytest.raises(ValueError, match="nothing is prepared"):
        controller.feedback([0.1])


def test_threads_have_their_own_answers(controller: nsdc.Controller) -> None:
    with ThreadPoolExecutor(4) as threads:
        states = [0.1 * k for k in range(1, 21)]
        found = threads.map(lambda x: controller.step([x], 0.0), states)
        assert np.allclose([float(u["u"]) for u, _ in found], [-x for x in states], atol=1e-7)


def test_wrong_models_are_errors_of_models() -> None:
    wrong = nsdc.loads(TEXT.replace("x' = u/m;", "x' = v;"))
    with pytest.raises(nsdc.ModelError) as error:
        wrong["o"].controller(sample=0.25)
    assert error.value.code == "E0101"


def test_what_has_no_plan_says_so(controller: nsdc.Controller) -> None:
    """Beyond 9 nothing comes to 0 within a second by |u| ≤ 9: without a plan that is an error, and behind one it goes on."""
    with pytest.raises(RuntimeError, match="E0715"):
        controller.step([10.0])
    controller.step([1.0])
    u, info = controller.step([10.0])
    assert math.isclose(u["u"], -1.0, abs_tol=1e-8)
    assert (info["decision"], info["why"]["code"]) == ("kept", "E0715")


def test_what_is_refused() -> None:
    file = nsdc.loads(TEXT)
    with pytest.raises(TypeError, match="simulate"):
        file["s"].controller(sample=1)
    with pytest.raises(ValueError, match="sample"):
        file["o"].controller(sample=0)
    controller = file["o"].controller(sample=0.25)
    with pytest.raises(TypeError, match="missing"):
        controller.step({})
    with pytest.raises(ValueError, match="x"):
        controller.step([1.0, 2.0])
    with pytest.raises(ValueError):
        controller.step([math.nan])


def test_what_changes_with_time_is_refused() -> None:
    changing = nsdc.loads(TEXT.replace("x' = u/m;", "x' = u/m + sin(3*time);"))
    with pytest.raises(ValueError, match="time begins at 0 in every plan"):
        changing["o"].controller(sample=0.25)


def test_free_initial_values_are_not_given() -> None:
    freed = nsdc.loads(TEXT.replace("final { x = 0; } }", "initial { x free in [-1, 1]; } }"))
    controller = freed["o"].controller(sample=0.25)
    assert controller.states == []
    with pytest.raises(TypeError, match="chooses the initial value of `x`"):
        controller.step({"x": 1})


def test_a_step_that_fails_changes_nothing(controller: nsdc.Controller) -> None:
    """Neither a parameter beside a wrong state, nor one that cannot stay open."""
    controller.step([1.0])
    with pytest.raises(ValueError, match="x"):
        controller.step([1.0, 2.0], m=2)
    u, info = controller.step([0.5])
    assert math.isclose(u["u"], -0.5, abs_tol=1e-8)
    assert info["decision"] == "warm"
    powers = TEXT.replace("param m = 1;", "param m = 1; param k = 2;").replace("u/m;", "u/m - x^k;")
    file = nsdc.loads(powers)
    one, other = (file["o"].controller(sample=0.25) for _ in range(2))
    with pytest.raises((ValueError, nsdc.ModelError)):
        one.step([1.0], k=3)
    assert one.step([1.0])[0] == other.step([1.0])[0]
    assert one.step([0.5], m=2)[0] == other.step([0.5], m=2)[0]


def test_loops_of_files_are_results() -> None:
    result = nsdc.loads(TEXT)["l"].run()
    assert result.ok
    # Each plan has a second more: x' = -x is held over each quarter of one.
    assert math.isclose(result.end["x"], 0.75**4, abs_tol=1e-8)
    assert result.mpc is not None
    assert [one["decision"] for one in result.mpc["samples"]] == ["cold", "warm", "warm", "warm"]
    assert result.mpc["times_s"]["first"] > 0
