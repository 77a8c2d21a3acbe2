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

from importlib import import_module

# Each name comes with its first use, and NumPy with it: importing the package costs next to nothing.
_MODULES = {
    "_commands": "CommandError modes order verify",
    "_controller": "Controller",
    "_core": "__version__",
    "_errors": "DerivativeError Diagnostic Edit Fix InternalError ModelError RunError Span",
    "_experiment": "Experiment",
    "_figure": "Figure",
    "_file": "File check explain load loads",
    "_function": "Function",
    "_gradient": "Gradient Moves",
    "_magic": "load_ipython_extension",
    "_programs": "Solution solve_nl",
    "_quantities": "Quantities Quantity",
    "_result": "Event Mode Result",
    "_sweep": "Sweep",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
