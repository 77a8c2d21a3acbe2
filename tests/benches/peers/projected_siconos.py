"""Projected dynamics and a rectifier in steps of time by Siconos: Moreau's catching-up with θ = γ = 1/2, and with θ = 1.

The whole loop runs in its C++; functions of nonlinear relations are C, compiled here.
"""

import os
import subprocess
import tempfile

import numpy as np
from measure import PROBLEM, available, measure

# Algebraic states come after the two others.
X0, T = PROBLEM["start"][:2], PROBLEM["horizon"]

# 1 - |x|² >= 0
DISC = """
#define ARGUMENTS double t, unsigned nx, double *x, unsigned nl, double *l
void h(ARGUMENTS, double *y, unsigned nz, double *z) { y[0] = 1 - x[0]*x[0] - x[1]*x[1]; }
void g(ARGUMENTS, double *r, unsigned nz, double *z) { r[0] = -2*x[0]*l[0]; r[1] = -2*x[1]*l[0]; }
void hx(ARGUMENTS, double *c, unsigned nz, double *z) { c[0] = -2*x[0]; c[1] = -2*x[1]; }
void hl(ARGUMENTS, double *d, unsigned nz, double *z) { d[0] = 0; }
void gl(ARGUMENTS, double *b, unsigned nz, double *z) { b[0] = -2*x[0]; b[1] = -2*x[1]; }
void gx(ARGUMENTS, double *k, unsigned nz, double *z) { k[0] = k[3] = -2*l[0]; k[1] = k[2] = 0; }
"""


def compiled(source):
    folder = tempfile.mkdtemp()
    with open(os.path.join(folder, "relation.c"), "w") as file:
        file.write(source)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", "relation.so", "relation.c"], cwd=folder, check=True)
    return os.path.join(folder, "relation.so")


def disc(sk):
    system = sk.FirstOrderLinearDS(X0, np.array([[0, 1], [-1, -0.2]]), np.array([1.0, 0]))
    relation = sk.FirstOrderNonLinearR()
    for operator, function in (
        ("h", "h"), ("g", "g"), ("Jachx", "hx"), ("Jachlambda", "hl"), ("Jacglambda", "gl"), ("Jacgx", "gx"),
    ):
        getattr(relation, f"setCompute{operator}Function")(LIBRARY, function)
    return system, relation, 1


def turn(sk):
    system = sk.FirstOrderLinearDS(X0, np.array([[0.0, 1], [-1, 0]]))
    relation = sk.FirstOrderLinearTIR(np.array([[0.0, 1]]), np.array([[0.0], [1]]))
    relation.setePtr(np.array([1.0]))
    return system, relation, 1


def bridge(sk):
    R, L, C = (PROBLEM[name] for name in "RLC")
    system = sk.FirstOrderLinearDS(X0, np.array([[0, -1 / C], [1 / L, 0]]))
    relation = sk.FirstOrderLinearTIR(
        np.array([[0.0, 0], [0, 0], [-1, 0], [1, 0]]), np.array([[0, 0, -1 / C, 1 / C], [0, 0, 0, 0]])
    )
    relation.setDPtr(np.array([[1 / R, 1 / R, -1, 0], [1 / R, 1 / R, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]]))
    return system, relation, 4


def simulated(sk, theta, steps):
    system, relation, n_pairs = globals()[PROBLEM["problem"]](sk)
    interaction = sk.Interaction(sk.ComplementarityConditionNSL(n_pairs), relation)
    model = sk.NonSmoothDynamicalSystem(0, T)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    grid, method, problem = sk.TimeDiscretisation(0, T / steps), sk.EulerMoreauOSI(theta, theta), sk.LCP()
    simulation = sk.TimeStepping(model, grid, method, problem)
    if PROBLEM["problem"] == "disc":
        simulation.setNewtonOptions(sk.SICONOS_TS_NONLINEAR)
        simulation.setNewtonTolerance(1e-9)
    else:
        simulation.setNewtonOptions(sk.SICONOS_TS_LINEAR)
    simulation.setWarnOnNonConvergence(False)
    simulation.initialize()
    if PROBLEM["problem"] == "bridge":
        # The force of the start: without it θ = 1/2 has order 1.
        system.setR(np.array([-X0[0] / (PROBLEM["R"] * PROBLEM["C"]), 0.0]))
        system.swapInMemory()
    simulation.run()
    return np.array(system.x())


if available("siconos.kernel"):
    import siconos.kernel as sk

    LIBRARY = compiled(DISC) if PROBLEM["problem"] == "disc" else None
    for theta in (0.5, 1.0):
        grids = [25 * 2**k for k in range(12)]
        measure("Siconos", f"theta {theta}", grids, lambda steps: simulated(sk, theta, steps), budget=0.3)
