"""Optimal control problems through nosnoc (FESD, Scholtes' homotopy, IPOPT): a line of JSON per run.

The first argument is {"problem": .., "intervals": .., "elements": .., "nodes": ..}. Times leave out what is set up once
per problem. nosnoc keeps IPOPT's options at class level, so every run has a copy of its own.
"""

import contextlib
import copy
import io
import json
import sys
import time

import numpy as np

ASKED = json.loads(sys.argv[1])


def slider(ca, nosnoc):
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    c1, c2 = x[0] + 0.15 * x[1] ** 2, 0.05 * x[0] ** 3 + x[1]
    first = ca.horzcat(ca.vertcat(x[2] - 1, 0, u), ca.vertcat(x[2] + 1, 0, u))
    second = ca.horzcat(ca.vertcat(0, x[3] - 1, 0, 0), ca.vertcat(0, x[3] + 1, 0, 0))
    sign = np.array([[1], [-1]])
    model = nosnoc.NosnocModel(
        x=x, F=[first, second], S=[sign, sign], c=[c1, c2], u=u,
        x0=np.array([2 * np.pi / 3, np.pi / 3, 0, 0]),
    )
    far = np.array([np.inf, np.inf, 2, 2])
    ocp = nosnoc.NosnocOcp(
        lbu=-10 * np.ones(2), ubu=10 * np.ones(2), lbx=-far, ubx=far,
        f_q=ca.dot(u, u) + ca.dot(x[2:], x[2:]), g_terminal=x[:2] + np.array([np.pi / 6, np.pi / 4]),
    )
    return model, ocp, 4.0


def turbo(ca, nosnoc):
    x, u, T = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("T")
    slow, fast = T * ca.vertcat(x[1], u), T * ca.vertcat(x[1], 3 * u)
    model = nosnoc.NosnocModel(
        x=x, F=[ca.horzcat(slow, fast)], S=[np.array([[-1], [1]])], c=[x[1] - 10], u=u, v_global=T, x0=np.zeros(2)
    )
    limit = np.array([np.inf, ASKED["limit"]])
    ocp = nosnoc.NosnocOcp(
        lbu=-5 * np.ones(1), ubu=5 * np.ones(1), lbx=-limit, ubx=limit, f_terminal=T, g_terminal=x - np.array([200, 0]),
        lbv_global=np.ones(1), ubv_global=100 * np.ones(1), v_global_guess=np.array([10.0]),
    )
    return model, ocp, 1.0


def motor(ca, nosnoc):
    x, u = ca.SX.sym("x", 5), ca.SX.sym("u")
    m1, m2, k, R, L, K, F = 1.03, 0.56, 2400, 2, 2e-3, 12, 2.1
    field = lambda s: ca.vertcat(
        x[1], (k * (x[2] - x[0]) + K * x[4] - s * F) / m1, x[3], -k * (x[2] - x[0]) / m2, (-K * x[1] - R * x[4] + u) / L
    )
    model = nosnoc.NosnocModel(
        x=x, F=[ca.horzcat(field(1), field(-1))], S=[np.array([[1], [-1]])], c=[x[1]], u=u, x0=np.zeros(5)
    )
    end = np.array([0.01, 0, 0.01, 0, 0])
    ocp = nosnoc.NosnocOcp(lbu=-5 * np.ones(1), ubu=5 * np.ones(1), f_q=u**2, g_terminal=x - end)
    return model, ocp, 0.08


def cart(ca, nosnoc):
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    m1, m2, l, g, F = 1, 0.1, 1, 9.81, 2
    cos, sin = ca.cos(x[1]), ca.sin(x[1])
    mass = ca.vertcat(ca.horzcat(m1 + m2, m2 * l * cos), ca.horzcat(m2 * l * cos, m2 * l**2))
    force = lambda s: ca.vertcat(u + m2 * l * sin * x[3] ** 2 - s * F, -m2 * g * l * sin)
    field = lambda s: ca.vertcat(x[2:], ca.inv(mass) @ force(s))
    model = nosnoc.NosnocModel(
        x=x, F=[ca.horzcat(field(1), field(-1))], S=[np.array([[1], [-1]])], c=[x[2]], u=u, x0=np.array([1.0, 0, 0, 0])
    )
    off = x - ca.DM([0, np.pi, 0, 0])
    quadratic = lambda weights: ca.sum1(ca.DM(weights) * off**2)
    far = np.array([5, np.inf, np.inf, np.inf])
    ocp = nosnoc.NosnocOcp(
        lbu=-30 * np.ones(1), ubu=30 * np.ones(1), lbx=-far, ubx=far,
        f_q=quadratic([10, 100, 1, 1]) + u**2, f_terminal=quadratic([500, 100, 10, 10]),
    )
    return model, ocp, 5.0


def tanks(ca, nosnoc):
    x, w = ca.SX.sym("x", 3), ca.SX.sym("w", 4)
    k, H = 0.1, 0.5

    def field(second, third):
        out1 = k * w[1] * ca.sqrt(x[0] - (x[1] - H if second else 0))
        out2 = k * w[2] * ca.sqrt(x[1] - (x[2] - H if third else 0))
        return ca.vertcat(k * w[0] - out1, out1 - out2, out2 - k * w[3] * ca.sqrt(x[2]))

    modes = ca.horzcat(*[field(a, b) for a in (True, False) for b in (True, False)])
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    model = nosnoc.NosnocModel(
        x=x, F=[modes], S=[signs], c=[ca.vertcat(x[1] - H, x[2] - H)], u=w, x0=0.1 * np.ones(3)
    )
    ocp = nosnoc.NosnocOcp(lbu=0.25 * np.ones(4), ubu=1.25 * np.ones(4), u_guess=0.5 * np.ones(4), f_q=ca.sum1((x - 0.75) ** 2))
    return model, ocp, 100.0


def options(nosnoc, end):
    o = nosnoc.NosnocOpts()
    o.opts_casadi_nlp = copy.deepcopy(nosnoc.NosnocOpts.opts_casadi_nlp)
    for key in ("tol", "dual_inf_tol", "compl_inf_tol"):
        o.opts_casadi_nlp["ipopt"][key] = None
    o.opts_casadi_nlp["ipopt"].pop("mu_target", None)
    o.print_level = 0
    o.n_s, o.N_stages, o.N_finite_elements = ASKED["nodes"], ASKED["intervals"], ASKED["elements"]
    o.terminal_time = end
    o.comp_tol = o.sigma_N = 1e-9
    o.homotopy_update_slope = 0.1
    o.step_equilibration = nosnoc.StepEquilibrationMode[ASKED.get("equilibration", "HEURISTIC_MEAN")]
    o.rho_h = ASKED.get("weight", 1.0)
    return o


def main():
    try:
        import casadi as ca
        import nosnoc
    except ImportError:
        print("nosnoc is not installed", file=sys.stderr)
        return
    model, ocp, end = globals()[ASKED["problem"]](ca, nosnoc)
    with contextlib.redirect_stdout(io.StringIO()):
        solver = nosnoc.NosnocSolver(options(nosnoc, end), model, ocp)
        started = time.perf_counter()
        result = solver.solve()
        seconds = time.perf_counter() - started
    objective = float(result["cost_val"])
    if ASKED["problem"] == "tanks":
        # With one node nosnoc 0.2.0 leaves out the cost of every other element.
        states = np.array(result["x_list"])
        objective = float((((states - 0.75) ** 2).sum(1) * np.ravel(result["time_steps"])).sum())
    row = {
        "solver": "nosnoc",
        "status": str(result.get("status", "")),
        "objective": objective,
        "seconds": seconds,
        "iterations": int(np.sum(result["nlp_iter"])),
        "complementarity": float(solver.problem.comp_res(result["w_sol"], solver.p_val)),
    }
    print(json.dumps(row), flush=True)


main()
