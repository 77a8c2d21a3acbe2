"""The oscillator, stopped at the circle and started again in the other field."""

from pathlib import Path

import numpy as np
from measure import PROBLEM, available, measure, powers

EXAMPLE = Path(__file__).parents[3] / "examples" / "oscillator.nsd"
W, T = 2 * np.pi, PROBLEM["horizon"]
X0 = PROBLEM["start"]
FIELDS = [np.array([[1, W], [-W, 1]]), np.array([[1, -W], [W, 1]])]


def scipy_run(method, tolerance):
    from scipy.integrate import solve_ivp

    def circle(t, x):
        return x[0] * x[0] + x[1] * x[1] - 1.0

    circle.terminal = True
    t, x = 0.0, X0
    for side, sign in enumerate((1.0, -1.0)):
        options = {"jac": FIELDS[side]} if method == "Radau" else {}
        if method == "LSODA":
            options = {"jac": lambda t, x: FIELDS[side]}
        result = solve_ivp(
            lambda t, x: [x[0] + sign * W * x[1], x[1] - sign * W * x[0]],
            (t, T), x, method=method, rtol=tolerance, atol=tolerance,
            events=circle if side == 0 else None, **options,
        )
        t, x = result.t[-1], result.y[:, -1]
    return x


def cvode_run(method, tolerance):
    from sksundae.cvode import CVODE

    def circle(t, x, e):
        e[0] = x[0] * x[0] + x[1] * x[1] - 1.0

    circle.terminal = [True]
    t, x = 0.0, X0
    for side, sign in enumerate((1.0, -1.0)):
        def field(t, x, rate):
            rate[0] = x[0] + sign * W * x[1]
            rate[1] = x[1] - sign * W * x[0]

        def jacobian(t, x, rate, matrix):
            matrix[:] = FIELDS[side]

        events = {"eventsfn": circle, "num_events": 1} if side == 0 else {}
        solver = CVODE(field, jacfn=jacobian, method=method, rtol=tolerance, atol=tolerance, max_num_steps=100000, **events)
        result = solver.solve([t, T], x)
        t, x = result.t[-1], result.y[-1]
    return x


def diffsol(method):
    import pydiffsol as ds

    model = """
    in_i {{ x0 = 0.0, y0 = 0.0, s = 1.0 }}
    w {{ {w!r} }}
    u_i {{ x = x0, y = y0 }}
    F_i {{ x + s*w*y, -s*w*x + y }}
    {stop}
    """
    options = {"matrix_type": ds.nalgebra_dense, "ode_solver": getattr(ds, method)}
    inside = ds.Ode(model.format(w=float(W), stop="stop_i { x*x + y*y - 1.0 }"), **options)
    outside = ds.Ode(model.format(w=float(W), stop=""), **options)

    def run(tolerance):
        for ode in (inside, outside):
            ode.rtol = ode.atol = tolerance
        result = inside.solve(np.array([X0[0], X0[1], 1.0]), T)
        t, x = result.ts[-1], np.asarray(result.ys)[:, -1]
        return np.asarray(outside.solve(np.array([x[0], x[1], -1.0]), T - t).ys)[:, -1]

    return run


def nsdc_run():
    import nsdc

    crossing = nsdc.load(EXAMPLE)["crossing"]
    return lambda tolerance: crossing.run(omega=W, tolerance=tolerance).end["x"]


for method in ("RK45", "DOP853", "LSODA"):
    measure("scipy", method, powers(3, 13), lambda tolerance: scipy_run(method, tolerance))
if available("sksundae"):
    for method in ("Adams", "BDF"):
        measure("CVODE", method, powers(3, 14), lambda tolerance: cvode_run(method, tolerance))
if available("pydiffsol"):
    for method in ("tsit45", "bdf"):
        measure("diffsol", method, powers(3, 14), diffsol(method))
if available("nsdc"):
    # With its estimate of the error, which is a second run.
    measure("nsdc", "in Python", powers(3, 13), nsdc_run())
