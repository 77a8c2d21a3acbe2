"""Hybrid and nonsmooth models as they stand in a paper: simulation by events, optimal control, sweeps.

>>> import nsdc
>>> file = nsdc.loads('''
...     model oscillator {
...       param omega = 1;
...       state x = 1; state v = 0;
...       x' = v; v' = -sign(x) - omega^2*x;
...     }
...     simulate cycles of oscillator { horizon 10; }''')
>>> result = file["cycles"].run(omega=0.5)
>>> result.ok, result["x"].shape == result.time.shape
(True, True)
"""

from ._commands import CommandError, modes, order, verify
from ._controller import Controller
from ._core import __version__
from ._errors import DerivativeError, Diagnostic, Edit, Fix, InternalError, ModelError, RunError, Span
from ._experiment import Experiment
from ._figure import Figure
from ._file import File, check, explain, load, loads
from ._function import Function
from ._gradient import Gradient, Moves
from ._magic import load_ipython_extension
from ._quantities import Quantities, Quantity
from ._result import Event, Mode, Result
from ._sweep import Sweep

__all__ = [
    "CommandError",
    "Controller",
    "DerivativeError",
    "Diagnostic",
    "Edit",
    "Event",
    "Experiment",
    "Figure",
    "File",
    "Fix",
    "Function",
    "Gradient",
    "InternalError",
    "Mode",
    "ModelError",
    "Moves",
    "Quantities",
    "Quantity",
    "Result",
    "RunError",
    "Span",
    "Sweep",
    "__version__",
    "check",
    "explain",
    "load",
    "load_ipython_extension",
    "loads",
    "modes",
    "order",
    "verify",
]
