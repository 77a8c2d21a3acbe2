"""Experiments as functions of JAX: `jax.grad`, `jax.vjp`, `jax.jit` and `jax.vmap` go through runs.

Runs are in double precision: `jax.config.update("jax_enable_x64", True)` lets JAX keep it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from numpy.typing import ArrayLike

from ._function import Function, Values

if TYPE_CHECKING:
    from ._experiment import Experiment


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """The threads of a process, which keep what they have compiled; there are none of those behind a fork."""
    has_affinity = hasattr(os, "sched_getaffinity")
    return ThreadPoolExecutor(len(os.sched_getaffinity(process)) if has_affinity else os.cpu_count())


def function(
    experiment: Experiment,
    by: Sequence[str],
    of: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    **asked: Any,
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """The function that `Experiment.function` is, from a dict of arrays to a dict of arrays, differentiable in reverse mode.

    >>> import jax, nsdc, nsdc.jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> relay = nsdc.loads('''
    ...     model relay { param a = 0.5; state x = 1; x' = -a - sign(x); }
    ...     simulate s of relay { horizon 1; }''')["s"]
    >>> f = nsdc.jax.function(relay, ["a", "x"], at=[0.25, 0.5])
    >>> slope = jax.grad(lambda a: f({"a": a, "x": 1.0})["x"][0])(0.5)
    >>> round(float(slope), 9)
    -0.25

    Under `jax.vmap` runs go to all cores.
    """
    called = Function(experiment, by, of, at, **asked)

    def shapes(names: Mapping[str, tuple[int, ...]]) -> dict[str, jax.ShapeDtypeStruct]:
        return {name: jax.ShapeDtypeStruct(shape, jnp.result_type(float)) for name, shape in names.items()}

    def run(call: Callable[[Values], Any], like: Any, inputs: Mapping[str, Any]) -> Any:
        """Calls back with arrays that have the inputs' shapes, and axes of `jax.vmap` in front of them."""

        def back(inputs: Mapping[str, ArrayLike]) -> Any:
            arrays = {name: np.asarray(value, dtype=float) for name, value in inputs.items()}
            name, first = next(iter(arrays.items()))
            batch = first.shape[: first.ndim - len(called.inputs[name])]
            rows = [{name: value[k] for name, value in arrays.items()} for k in np.ndindex(batch)]
            found = list(_pool(os.getpid()).map(call, rows)) if batch else [call(rows[0])]

            def stacked(like: Any, *leaves: Any) -> Any:
                return np.reshape(np.array(leaves, dtype=like.dtype), batch + like.shape)

            return jax.tree.map(stacked, like, *found)

        return jax.pure_callback(back, like, inputs, vmap_method="broadcast_all")

    @jax.custom_vjp  # type: ignore[untyped-decorator]
    def values(inputs: Mapping[str, Any]) -> Any:
        return run(called, shapes(called.outputs), inputs)

    def forward(inputs: Mapping[str, Any]) -> Any:
        # By what somebody differentiates; the others need not have a derivative.
        asked = [name for name, one in inputs.items() if one.perturbed]
        slopes = {
            name: shapes({by: shape + called.inputs[by] for by in asked})
            for name, shape in called.outputs.items()
        }
        plain = {name: one.value for name, one in inputs.items()}
        if not asked:
            return run(called, shapes(called.outputs), plain), slopes

        def linearized(inputs: Values) -> Any:
            return called.linearized(inputs, asked)

        return run(linearized, (shapes(called.outputs), slopes), plain)

    def backward(slopes: Mapping[str, Mapping[str, Any]], weights: Mapping[str, Any]) -> Any:
        def pulled(by: str) -> Any:
            parts = (
                jnp.tensordot(weight, slopes[name][by], axes=jnp.ndim(weight))
                for name, weight in weights.items()
                if by in slopes[name] and not isinstance(weight, SymbolicZero)
            )
            return sum(parts, start=jnp.zeros(called.inputs[by]))

        return ({by: pulled(by) for by in called.inputs},)

    values.defvjp(forward, backward, symbolic_zeros=True)

    def checked(inputs: Mapping[str, Any]) -> dict[str, Any]:
        called.check(inputs)
        arrays = {name: jnp.asarray(value, dtype=float) for name, value in inputs.items()}
        for name, value in arrays.items():
            if value.shape != called.inputs[name]:
                raise ValueError(f"{name}: expected shape {called.inputs[name]}, got {value.shape}")
        return dict(values(arrays))

    return checked
