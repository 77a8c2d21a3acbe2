"""Time and error of other solvers, a line of JSON per run on standard output.

A script gets its problem as JSON in its first argument, with the exact final state in `exact`.
Times are medians, and leave out what is compiled once per model.
"""

import json
import signal
import statistics
import sys
import time

import numpy as np

PROBLEM = json.loads(sys.argv[1])
EXACT = np.array(PROBLEM["exact"])


# Seconds after which a run counts as one that never ends: a mode may follow a mode without progress.
LONGEST = 5


class Expired(BaseException):
    """Nothing that a solver would take for an error of its own."""


def expire(*_):
    raise Expired(f"still running after {LONGEST} s")


signal.signal(signal.SIGALRM, expire)


def measure(solver, method, tolerances, run, budget=0.5):
    """Runs at each tolerance until repetitions have taken `budget` seconds; what fails is left out."""
    for tolerance in tolerances:
        signal.alarm(LONGEST)
        try:
            error = float(np.linalg.norm(np.asarray(run(tolerance)) - EXACT))
            signal.alarm(0)
            times = []
            while not times or sum(times) < LONGEST and len(times) < 3 or (sum(times) < budget and len(times) < 101):
                started = time.perf_counter()
                run(tolerance)
                times.append(time.perf_counter() - started)
        except (Exception, Expired) as failure:  # What a solver cannot do is no row of the table.
            signal.alarm(0)
            print(f"{solver} {method} at {tolerance}: {failure}", file=sys.stderr)
            continue
        row = {"solver": solver, "method": method, "error": error, "seconds": statistics.median(times)}
        print(json.dumps(row), flush=True)


def available(name):
    """Whether a package is there; says so where it is not."""
    try:
        __import__(name)
    except ImportError:
        print(f"{name} is not installed", file=sys.stderr)
        return False
    return True


def powers(first, last):
    return [10.0**-k for k in range(first, last + 1)]
