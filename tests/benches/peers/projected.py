"""Projected dynamics and a rectifier through nosnoc (FESD, Scholtes' homotopy, IPOPT).

Its models are piecewise smooth systems, so a set is kept by a field behind its boundary that points back: sliding is the
projection. The bridge has one region for each sign of the voltage, with the currents of the diodes that conduct there.
nosnoc keeps IPOPT's options at class level, so every run has a copy of its own.
"""

import contextlib
import copy
import io

import numpy as np
from measure import PROBLEM, available, measure

# Algebraic states come after the two others.
X0, T = np.array(PROBLEM["start"][:2]), PROBLEM["horizon"]
IS_BRIDGE = PROBLEM["problem"] == "bridge"
# The bridge switches sixteen times, the others once or twice.
STEPS = (25, 40, 60) if IS_BRIDGE else (1, 2, 3, 4, 6, 8, 16, 32)
NODES, ELEMENTS = ((3, 4), 3) if IS_BRIDGE else ((2, 3, 4), 2)


def disc(ca, x):
    field = ca.vertcat(x[1] + 1, -x[0] - 0.2 * x[1])
    return [field, field - 2 * x], 1 - ca.dot(x, x), X0, T


def turn(ca, x):
    field = ca.vertcat(x[1], -x[0])
    return [field, field + ca.vertcat(0, 4)], x[1] + 1, X0, T


def bridge(ca, x):
    # In units in which the voltage starts at 1 and turns with the frequency 1: with others nosnoc solves few steps.
    loss = np.sqrt(PROBLEM["L"] / PROBLEM["C"]) / PROBLEM["R"]
    forth = ca.vertcat(-x[1] - loss * x[0], x[0])
    back = ca.vertcat(-x[1] + loss * (-x[0]), x[0])
    return [forth, back], x[0], X0 / scale(), T / np.sqrt(PROBLEM["L"] * PROBLEM["C"])


def scale():
    return X0[0] * np.array([1.0, np.sqrt(PROBLEM["C"] / PROBLEM["L"])]) if IS_BRIDGE else np.ones(2)


def looper(ca, nosnoc, n_nodes, n_steps, tolerance):
    x = ca.SX.sym("x", 2)
    fields, surface, x0, end = globals()[PROBLEM["problem"]](ca, x)
    model = nosnoc.NosnocModel(x=x, F=[ca.horzcat(*fields)], S=[np.array([[1], [-1]])], c=[surface], x0=x0)
    o = nosnoc.NosnocOpts()
    o.opts_casadi_nlp = copy.deepcopy(nosnoc.NosnocOpts.opts_casadi_nlp)
    for key in ("tol", "dual_inf_tol", "compl_inf_tol"):
        o.opts_casadi_nlp["ipopt"][key] = None
    o.opts_casadi_nlp["ipopt"].pop("mu_target", None)
    o.print_level = 0
    o.n_s, o.N_finite_elements, o.terminal_time = n_nodes, ELEMENTS, end / n_steps
    o.comp_tol = o.sigma_N = o.tol_ipopt = tolerance
    # Quicker than its defaults.
    o.homotopy_update_rule, o.sigma_0 = nosnoc.HomotopyUpdateRule.SUPERLINEAR, 0.1
    solver = nosnoc.NosnocSolver(o, model)
    guess = solver.problem.w0.copy()

    def run():
        solver.problem.w0 = guess.copy()
        with contextlib.redirect_stdout(io.StringIO()):
            loop = nosnoc.NosnocSimLooper(solver, x0.copy(), n_steps, print_level=0)
            loop.run()
        # Some steps end without success; the error says what they are worth.
        return loop.get_results()["X_sim"][-1] * scale()

    return run


if available("nosnoc"):
    import casadi as ca
    import nosnoc

    for nodes in NODES:
        for tolerance in (1e-7, 1e-9):
            runs = {}
            for steps in STEPS:
                with contextlib.redirect_stdout(io.StringIO()):
                    runs[steps] = looper(ca, nosnoc, nodes, steps, tolerance)
            measure("nosnoc", f"{nodes} nodes, {tolerance:.0e}", list(runs), lambda steps: runs[steps](), budget=0.3)
