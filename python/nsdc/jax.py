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
    rows_like = tuple(jax.ShapeDtypeStruct(shape, jnp.result_type(int)) for shape in ((), called.instants))

    def shapes(names: Mapping[str, tuple[int, ...]]) -> dict[str, jax.ShapeDtypeStruct]:
        return {name: jax.ShapeDtypeStruct(shape, jnp.result_type(float)) for name, shape in names.items()}

    def run(call: Callable[..., Any], like: Any, inputs: Mapping[str, Any], *more: Any) -> Any:
        """Calls back with arrays that have the inputs' shapes, and more, and axes of `jax.vmap` in front of them."""

        def back(inputs: Mapping[str, ArrayLike], *more: Any) -> Any:
            arrays = {name: np.asarray(value, dtype=float) for name, value in inputs.items()}
            name, first = next(iter(arrays.items()))
            batch = first.shape[: first.ndim - len(called.inputs[name])]
            whole = (arrays, *more)

            def row(k: tuple[int, ...]) -> Any:
                return call(*jax.tree.map(lambda value: np.asarray(value)[k], whole))

            found = list(_pool(os.getpid()).map(row, np.ndindex(batch))) if batch else [row(())]

            def stacked(like: Any, *leaves: Any) -> Any:
                return np.reshape(np.array(leaves, dtype=like.dtype), batch + like.shape)

            return jax.tree.map(stacked, like, *found)

        return jax.pure_callback(back, like, inputs, *more, vmap_method="broadcast_all")

    @jax.custom_vjp  # type: ignore[untyped-decorator]
    def values(inputs: Mapping[str, Any]) -> Any:
        return run(called, shapes(called.outputs), inputs)

    def forward(inputs: Mapping[str, Any]) -> Any:
        # By what somebody differentiates; the others need not have a derivative.
        asked = [name for name, one in inputs.items() if one.perturbed]
        plain = {name: one.value for name, one in inputs.items()}
        if not asked:
            return run(called, shapes(called.outputs), plain), (plain, (), {})

        def valued(inputs: Values) -> Any:
            return called.valued(inputs, asked)

        values, rows = run(valued, (shapes(called.outputs), rows_like), plain)
        # Names are those of leaves that are not there.
        return values, (plain, rows, dict.fromkeys(asked))

    def backward(kept: tuple[Values, Any, Mapping[str, None]], weights: Mapping[str, Any]) -> Any:
        plain, rows, asked = kept
        told = {name: one for name, one in weights.items() if not isinstance(one, SymbolicZero)}
        found = {by: jnp.zeros(shape) for by, shape in called.inputs.items()}
        if asked and told:

            def pulled(inputs: Values, rows: Any, weights: Values) -> Any:
                return called.pulled(inputs, rows, weights, asked)

            found |= run(pulled, shapes({by: called.inputs[by] for by in asked}), plain, rows, told)
        return (found,)

    values.defvjp(forward, backward, symbolic_zeros=True)

    def checked(inputs: Mapping[str, Any]) -> dict[str, Any]:
        called.check(inputs)
        arrays = {name: jnp.asarray(value, dtype=float) for name, value in inputs.items()}
        for name, value in arrays.items():
            if value.shape != called.inputs[name]:
                raise ValueError(f"{name}: expected shape {called.inputs[name]}, got {value.shape}")
        return dict(values(arrays))

    return checked
