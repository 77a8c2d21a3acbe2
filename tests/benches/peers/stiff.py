"""A relay behind a fast filter: x' = z - s, w' = -w + s, z' = L (a sin t - z), s in sign(x)."""

import numpy as np
from measure import PROBLEM, available, measure, powers

A, L, T = PROBLEM["amplitude"], PROBLEM["rate"], PROBLEM["horizon"]
X0 = np.array(PROBLEM["start"])


def mode(sign):
    """Field, its matrix, and what is positive while the mode lasts."""
    if sign == 0.0:
        matrix = np.array([[0.0, 0, 0], [0, -1, 1], [0, 0, -L]])
        field = lambda t, x: np.array([0.0, x[2] - x[1], L * (A * np.sin(t) - x[2])])
        return field, matrix, lambda x: 1.0 - abs(x[2])
    matrix = np.array([[0.0, 0, 1], [0, -1, 0], [0, 0, -L]])
    field = lambda t, x: np.array([x[2] - sign, sign - x[1], L * (A * np.sin(t) - x[2])])
    return field, matrix, lambda x: sign * x[0]


def automaton(integrate):
    t, x, sign = 0.0, X0.copy(), 1.0
    while True:
        t, x, early = integrate(*mode(sign), t, x)
        if not early:
            return x
        sign = 0.0 if sign != 0.0 and abs(x[2]) <= 1.0 else np.sign(x[2])
        # A start on the surface would be found as the next event.
        x[0] = 1e-15 * sign


def scipy_run(method, tolerance):
    from scipy.integrate import solve_ivp

    def integrate(field, matrix, inside, t, x):
        event = lambda t, x: inside(x)
        event.terminal, event.direction = True, -1.0
        jacobian = (lambda t, x: matrix) if method == "LSODA" else matrix
        r = solve_ivp(field, (t, T), x, method=method, rtol=tolerance, atol=tolerance, events=event, jac=jacobian)
        return r.t[-1], r.y[:, -1].copy(), r.status == 1

    return automaton(integrate)


def cvode_run(tolerance):
    from sksundae.cvode import CVODE

    def integrate(field, matrix, inside, t, x):
        def rate(t, x, out):
            out[:] = field(t, x)

        def events(t, x, out):
            out[0] = inside(x)

        def jacobian(t, x, out, JJ):
            JJ[:] = matrix

        events.terminal, events.direction = [True], [-1]
        solver = CVODE(
            rate, jacfn=jacobian, eventsfn=events, num_events=1,
            method="BDF", rtol=tolerance, atol=tolerance, max_num_steps=100000,
        )
        r = solver.solve([t, T], x)
        return r.t[-1], r.y[-1].copy(), r.status == 2

    return automaton(integrate)


for method, last in (("LSODA", 12), ("Radau", 10), ("BDF", 9)):
    measure("scipy", method, powers(3, last), lambda tolerance: scipy_run(method, tolerance))
if available("sksundae"):
    measure("CVODE", "BDF", powers(3, 13), cvode_run)
