"""What runs cost from Python: one after the other, beside pydiffsol where it is installed, and as sweeps.

    python python/benches/overhead.py

Errors are those at the end against the closed form of the oscillator: |x| = exp(t - 1), and the angle 2 pi (t - 1) behind the
circle, which it crosses at t = 1. `beside the run` is what a call takes longer than the engine says that it has computed, the
second run included that estimates the error.
"""

import statistics
import sys
import time
from pathlib import Path

import numpy as np

import nsdc

EXAMPLE = Path(__file__).parents[2] / "examples" / "oscillator.nsd"
W, T, X0 = 2 * np.pi, np.pi / 2, np.array([np.exp(-1), 0.0])
EXACT = np.exp(T - 1) * np.array([np.cos(W * (T - 1)), np.sin(W * (T - 1))])
TOLERANCE = 1e-9
#: Runs of a median, and of a sweep.
RUNS, SWEEP = 5000, 100_000


def timed(run):
    """Seconds of each of many calls, and what the last one gave."""
    seconds = []
    for _ in range(RUNS):
        started = time.perf_counter()
        found = run()
        seconds.append(time.perf_counter() - started)
    return seconds, found


def row(name, seconds, x, beside=None):
    error = np.abs(np.asarray(x) - EXACT).max()
    told = "" if beside is None else f"{1e6 * statistics.median(beside):.1f}"
    print(f"| {name} | {1e6 * statistics.median(seconds):.1f} | {told} | {error:.1e} |", flush=True)


def nsdc_runs():
    crossing = nsdc.load(EXAMPLE)["crossing"]
    crossing.run(omega=W, tolerance=TOLERANCE)
    computed = []

    def run():
        result = crossing.run(omega=W, tolerance=TOLERANCE)
        computed.append(result)
        return result

    seconds, last = timed(run)
    assert last.stats["compile_s"] == 0
    beside = [whole - one.stats["solve_s"] for whole, one in zip(seconds, computed)]
    row("nsdc", seconds, last.end["x"], beside)
    seconds, x = timed(lambda: crossing.run(omega=W, tolerance=TOLERANCE).end["x"])
    row("nsdc, with the state at the end", seconds, x)
    return crossing


def pydiffsol_runs():
    """Two systems, since it changes no field at an event: what is done between them is in its time."""
    import pydiffsol

    field = "w {{ {w!r} }} u_i {{ x = x0, y = y0 }} F_i {{ x + s*w*y, -s*w*x + y }} {stop}"
    inputs = "in_i { x0 = 0.0, y0 = 0.0, s = 1.0 } "
    options = {"matrix_type": pydiffsol.nalgebra_dense, "ode_solver": pydiffsol.tsit45}
    stops = ["stop_i { x*x + y*y - 1.0 }", ""]
    inside, outside = (pydiffsol.Ode(inputs + field.format(w=W, stop=stop), **options) for stop in stops)
    for ode in (inside, outside):
        ode.rtol = ode.atol = TOLERANCE

    def run():
        first = inside.solve(np.array([*X0, 1.0]), T)
        t, x = first.ts[-1], np.asarray(first.ys)[:, -1]
        return np.asarray(outside.solve(np.array([*x, -1.0]), T - t).ys)[:, -1]

    row("pydiffsol, tsit45, with the state at the end", *timed(run))


def sweeps(crossing):
    omega = W * np.linspace(0.9, 1.1, SWEEP)
    print("\n| threads | us a run | us a run and thread |\n| --- | --- | --- |")
    taken = {}
    for threads in (1, 2):
        crossing.sweep(omega=omega[:1000], tolerance=TOLERANCE, threads=threads, progress=False)
        started = time.perf_counter()
        sweep = crossing.sweep(omega=omega, tolerance=TOLERANCE, threads=threads, progress=False)
        taken[threads] = (time.perf_counter() - started) / SWEEP
        assert not sweep.failed
        print(f"| {threads} | {1e6 * taken[threads]:.2f} | {1e6 * threads * taken[threads]:.2f} |", flush=True)
    print(f"\nOn two threads {taken[1] / taken[2]:.2f} times as fast as on one.")


print("| run | us | beside the run, us | error |\n| --- | --- | --- | --- |")
crossing = nsdc_runs()
try:
    pydiffsol_runs()
except ImportError:
    print("pydiffsol is not installed", file=sys.stderr)
sweeps(crossing)
