"""Coulomb's belt, with its three modes and their changes worked out by hand."""

import numpy as np
from measure import PROBLEM, available, measure, powers

C, T = PROBLEM["c"], PROBLEM["horizon"]
X0 = np.array(PROBLEM["start"])


def automaton(slip, stick):
    """From mode to mode: slip(t, x, sign) and stick(t, x) return where they end, and whether early."""
    t, x, mode = 0.0, X0.copy(), "slip"
    sign = 1.0
    while True:
        if mode == "slip":
            # A speed of zero would be found as the next event.
            x[1] = x[1] if abs(x[1]) > 1e-14 else 1e-14 * sign
            t, x, early = slip(t, x, sign)
            if not early:
                return x
            pull = -x[0] + C
            x[1] = 0.0
            if abs(pull) <= 1.0:
                mode = "stick"
            else:
                sign = 1.0 if pull > 1.0 else -1.0
        else:
            t, x, early = stick(t, x)
            if not early:
                return x
            mode, sign = "slip", 1.0


def scipy_run(method, tolerance):
    from scipy.integrate import solve_ivp

    options = {"method": method, "rtol": tolerance, "atol": tolerance}

    def slip(t, x, sign):
        def stops(t, x):
            return sign * x[1]

        stops.terminal, stops.direction = True, -1.0
        r = solve_ivp(lambda t, x: [x[1] - 1.0, -sign - x[0] - C * (x[1] - 1.0)], (t, T), x, events=stops, **options)
        return r.t[-1], r.y[:, -1].copy(), r.status == 1

    def stick(t, x):
        def released(t, x):
            return x[0] - (C - 1.0)

        released.terminal, released.direction = True, -1.0
        r = solve_ivp(lambda t, x: [-1.0, 0.0], (t, T), x, events=released, **options)
        return r.t[-1], r.y[:, -1].copy(), r.status == 1

    return automaton(slip, stick)


def diffsol(method):
    import pydiffsol as ds

    options = {"matrix_type": ds.nalgebra_dense, "ode_solver": getattr(ds, method)}
    slipping = ds.Ode(
        f"""
        in_i {{ x0 = 2.4, v0 = 1.0, s = 1.0 }}
        u_i {{ x = x0, v = v0 }}
        F_i {{ v - 1.0, -s - x - {C!r}*(v - 1.0) }}
        stop_i {{ v }}
        """,
        **options,
    )
    sticking = ds.Ode(
        f"""
        in_i {{ x0 = 0.0 }}
        u_i {{ x = x0 }}
        F_i {{ -1.0 }}
        stop_i {{ x - ({C!r} - 1.0) }}
        """,
        **options,
    )

    def run(tolerance):
        for ode in (slipping, sticking):
            ode.rtol = ode.atol = tolerance

        def slip(t, x, sign):
            r = slipping.solve(np.array([x[0], x[1], sign]), T - t)
            t += r.ts[-1]
            return t, np.asarray(r.ys)[:, -1].copy(), t < T - 1e-12

        def stick(t, x):
            r = sticking.solve(np.array([x[0]]), T - t)
            t += r.ts[-1]
            return t, np.array([np.asarray(r.ys)[0, -1], 0.0]), t < T - 1e-12

        return automaton(slip, stick)

    return run


for method in ("RK45", "DOP853", "LSODA"):
    measure("scipy", method, powers(3, 13), lambda tolerance: scipy_run(method, tolerance))
if available("pydiffsol"):
    for method in ("tsit45", "bdf"):
        measure("diffsol", method, powers(3, 14), diffsol(method))
