"""A chain of rubbing blocks: each slips or sticks, and one event function ends a mode."""

import numpy as np
from measure import PROBLEM, available, measure, powers

N, T = PROBLEM["blocks"], PROBLEM["horizon"]
STIFFNESS, GRIP = PROBLEM["k"] / PROBLEM["m"], PROBLEM["mu"] * PROBLEM["g"]
X0 = np.array(PROBLEM["start"])
# The springs' accelerations are PULL q.
PULL = np.zeros((N, N))
for i in range(N - 1):
    PULL[i, i] -= STIFFNESS
    PULL[i, i + 1] += STIFFNESS
    PULL[i + 1, i + 1] -= STIFFNESS
    PULL[i + 1, i] += STIFFNESS


def automaton(integrate):
    """`integrate(field, matrix, inside, t, x)` goes on until a number of `inside` is negative."""
    t, x = 0.0, X0.copy()
    sign = np.sign(x[N:])
    while True:
        slips = sign != 0.0
        matrix = np.zeros((2 * N, 2 * N))
        matrix[:N, N:] = np.diag(slips.astype(float))
        matrix[N:, :N] = PULL * slips[:, None]
        constant = np.concatenate([np.zeros(N), -GRIP * sign])
        # Speeds of what slips, and what is left of the grip on what sticks.
        def inside(x):
            return np.where(slips, sign * x[N:], GRIP - np.abs(PULL @ x[:N]))

        t, x, early = integrate(lambda x: matrix @ x + constant, matrix, inside, t, x)
        if not early:
            return x
        i = int(np.argmin(inside(x) / np.where(slips, np.abs(x[N:]).max() + 1e-300, GRIP)))
        pull = PULL[i] @ x[:N]
        sign[i] = 0.0 if slips[i] and abs(pull) <= GRIP else np.sign(pull)
        # A speed of zero would be found as the next event.
        x[N + i] = 1e-15 * sign[i]


def scipy_run(method, tolerance):
    from scipy.integrate import solve_ivp

    def integrate(field, matrix, inside, t, x):
        def event(t, x):
            return inside(x).min()

        event.terminal, event.direction = True, -1.0
        options = {"jac": matrix} if method in ("Radau", "BDF") else {}
        if method == "LSODA":
            options = {"jac": lambda t, x: matrix}
        r = solve_ivp(
            lambda t, x: field(x), (t, T), x, method=method, rtol=tolerance, atol=tolerance, events=event, **options
        )
        return r.t[-1], r.y[:, -1].copy(), r.status == 1

    return automaton(integrate)


def cvode_run(method, tolerance):
    from sksundae.cvode import CVODE

    def integrate(field, matrix, inside, t, x):
        def rate(t, x, out):
            out[:] = field(x)

        def events(t, x, out):
            out[:] = inside(x)

        def jacobian(t, x, out, JJ):
            JJ[:] = matrix

        events.terminal, events.direction = [True] * N, [-1] * N
        solver = CVODE(
            rate, jacfn=jacobian, eventsfn=events, num_events=N,
            method=method, rtol=tolerance, atol=tolerance, max_num_steps=100000,
        )
        r = solver.solve([t, T], x)
        return r.t[-1], r.y[-1].copy(), r.status == 2

    return automaton(integrate)


for method in ("RK45", "DOP853", "LSODA", "Radau", "BDF"):
    last = 7 if method in ("Radau", "BDF") else 13
    measure("scipy", method, powers(3, last), lambda tolerance: scipy_run(method, tolerance))
if available("sksundae"):
    for method in ("Adams", "BDF"):
        measure("CVODE", method, powers(3, 14), lambda tolerance: cvode_run(method, tolerance))
