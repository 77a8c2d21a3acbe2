"""Threads, signals, forks and panics."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from models import BELT, EXAMPLES

import nsdc

#: Runs for hours.
ENDLESS = "model m { state x = 1; state y = 0; x' = -y; y' = x + 0.1*sign(x); } simulate s of m { horizon 1e9; }"
#: Solves for minutes, in threads of its own.
STARTS = """model m {
  state x[4] = [1, 0, 0, 0]; control u[2] in [-9, 9];
  x' = [x[2], u[1] - sign(x[2]), x[4], u[2] - sign(x[1])*x[4]];
}
optimize o of m { horizon 3; intervals 30; elements 3; minimize integral(dot(u, u)); final { x = 0; } starts 100; }"""
#: Runs for minutes, in threads of its own.
NOISE = """model m { state x = 1; state v = 0; x' = v; v' = -x - sign(v - 0.3*sin(3*time)); }
simulate s of m { horizon 300; perturb every 0.1 by gauss(0.01); runs 10000; }"""


def test_importing_imports_little() -> None:
    """Neither NumPy nor anything else that is not there without it; what is used brings what it needs."""
    code = """
import nsdc, sys
print([m for m in ('numpy', 'pandas', 'xarray', 'pyarrow', 'matplotlib', 'distributed', 'ray') if m in sys.modules])
assert nsdc.check("model m { state x = 1; x' = 0; }") == []
print([m for m in ('pandas', 'xarray', 'pyarrow', 'matplotlib', 'distributed', 'ray') if m in sys.modules])
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["[]", "[]"]


def test_names_are_those_of_the_types() -> None:
    stub = (Path(nsdc.__file__).with_suffix(".pyi")).read_text()
    typed = [name.split(" as ")[1] for line in stub.splitlines() for name in line.split(" import ")[1].split(", ")]
    assert sorted(typed) == nsdc.__all__
    assert all(getattr(nsdc, name) is not None for name in nsdc.__all__)
    assert set(nsdc.__all__) <= set(dir(nsdc))
    with pytest.raises(AttributeError, match="laod"):
        nsdc.laod  # type: ignore[attr-defined]  # noqa: B018


def test_other_threads_go_on() -> None:
    ticks, ends = 0, threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not ends.is_set():
            ticks += 1
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    before = ticks
    result = nsdc.loads(ENDLESS)["s"].run(time_limit=0.5)
    during = ticks - before
    ends.set()
    thread.join()
    assert result.status == "time_limit" and during > 10


def test_threads_run_at_the_same_time() -> None:
    file = nsdc.loads(BELT)
    values = np.linspace(0.1, 0.9, 8)
    expected = [file["pulls"].run(mu=mu).end["x"].tolist() for mu in values]
    found: dict[int, list] = {}

    def work(thread: int) -> None:
        found[thread] = [file["pulls"].run(mu=mu).end["x"].tolist() for mu in values]

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(one == expected for one in found.values()) and len(found) == 4


@pytest.mark.parametrize(
    "call",
    [
        f"nsdc.loads({ENDLESS!r})['s'].run()",
        f"nsdc.loads({ENDLESS!r})['s'].run(method='fesd {{ steps = 1000000; }}', horizon=1e5)",
        f"nsdc.loads({ENDLESS!r})['s'].run(method='adaptive')",
        f"[e.run() for e in nsdc.load({str(EXAMPLES / 'sliding_ocp.nsd')!r}).experiments.values()]",
        f"nsdc.loads({STARTS!r})['o'].run()",
        f"nsdc.loads({NOISE!r})['s'].run()",
        f"nsdc.verify(nsdc.loads({ENDLESS!r})['s'])",
    ],
    ids=["events", "elements", "adaptive", "optimum", "starts", "runs", "command"],
)
def test_an_interrupt_ends_a_run(call: str) -> None:
    code = f"""
import nsdc, time, threading, os, signal
# Jobs in the background ignore it.
signal.signal(signal.SIGINT, signal.default_int_handler)
def stop():
    time.sleep(1.0)
    global sent
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=stop, daemon=True).start()
try:
    # However long one run takes: `adaptive` ends after so many steps.
    while True:
        {call}
except KeyboardInterrupt:
    print("interrupted", time.monotonic() - sent)
"""
    told = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert told.stdout.startswith("interrupted"), told.stderr[-2000:]


def test_an_interrupted_sweep_keeps_what_is_finished(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    belt = nsdc.loads(BELT)["pulls"]
    # Jobs in the background ignore it.
    known = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, known))
    begun = threading.Event()

    def show(_: object, done: int) -> None:
        if done:
            begun.set()

    monkeypatch.setattr("nsdc._progress.Bar.show", show)

    def stop() -> None:
        begun.wait()
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=stop)
    thread.start()
    with pytest.warns(UserWarning, match="interrupted after"):
        sweep = belt.sweep(mu=np.linspace(0.1, 0.9, 200_000))
    thread.join()
    done = sweep.status == "solved"
    assert 0 < done.sum() < 200_000 and np.isfinite(sweep["x"][done]).all()
    assert np.isnan(sweep["x"][sweep.status == ""]).all()


def _ends(queue: multiprocessing.Queue) -> None:
    queue.put(nsdc.loads(BELT)["pulls"].sweep(mu=[0.1, 0.5])["x"].tolist())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_fork_after_a_sweep_does_not_hang() -> None:
    expected = nsdc.loads(BELT)["pulls"].sweep(mu=[0.1, 0.5])["x"].tolist()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_ends, args=(queue,))
    process.start()
    assert queue.get(timeout=30) == expected
    process.join(timeout=10)
    assert process.exitcode == 0


def test_a_panic_is_an_exception() -> None:
    with pytest.raises(nsdc.InternalError, match="on purpose"):
        nsdc._core._panic()
    assert nsdc.loads(BELT)["pulls"].run(horizon=0.1).ok


def test_the_command_is_there() -> None:
    told = subprocess.run([sys.executable, "-m", "nsdc", "--version"], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == f"nsdc {nsdc.__version__}"
    wrong = subprocess.run([sys.executable, "-m", "nsdc", "run", "nowhere.nsd"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 1 and "nowhere.nsd" in wrong.stderr
