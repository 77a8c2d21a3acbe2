"""Compares what CasADi reads from an AMPL file with values and derivatives at a point.

    python read_nl.py PROGRAM.nl POINT.json

CasADi's reader knows no complementarity rows: here they become free rows, and their bodies are compared.
"""
import json
import os
import sys
import tempfile

import casadi as ca
import numpy as np

program, point = sys.argv[1:]
lines = open(program).read().split("\n")
head = [line.split("#")[0].split() for line in lines[:10]]
n, m = int(head[1][0]), int(head[1][1])
start = lines.index("r") + 1
right = np.zeros(m)
for row in range(m):
    words = lines[start + row].split()
    if words[0] == "5":
        lines[start + row] = "3"
    else:
        right[row] = float(words[1])
lines[2] = " " + " ".join(head[2][:2])
with tempfile.NamedTemporaryFile("w", suffix=".nl", delete=False) as file:
    file.write("\n".join(lines))
builder = ca.NlpBuilder()
builder.import_nl(file.name, {"verbose": False})
os.unlink(file.name)

x = ca.vertcat(*builder.x)
rows = ca.vertcat(*builder.g, builder.f)
functions = ca.Function("rows", [x], [rows, ca.jacobian(rows, x)])
expected = json.load(open(point))
values, jacobian = (np.array(value) for value in functions(expected["x"]))
wanted = np.append(np.array(expected["rows"]) + right, expected["objective"])
derivatives = np.zeros((m + 1, n))
for row, entries in enumerate(expected["jacobian"]):
    for column, entry in entries:
        derivatives[row, column] = entry


def error(found, wanted):
    return float(np.max(np.abs(found - wanted) / (1 + np.abs(wanted)), initial=0))


errors = error(values.ravel(), wanted), error(jacobian, derivatives)
print(f"{n} columns, {m} rows: values differ by {errors[0]:.1e}, derivatives by {errors[1]:.1e}")
sys.exit(0 if max(errors) <= 1e-12 else 1)
