"""Experiments as functions of PyTorch: `backward` goes through runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from typing import TYPE_CHECKING, Any

import torch
from numpy.typing import ArrayLike

from ._function import Function

if TYPE_CHECKING:
    from ._experiment import Experiment


class _Call(torch.autograd.Function):  # type: ignore[misc]
    """Inputs and outputs are tensors in the order of their names."""

    @staticmethod
    def forward(ctx: Any, called: Function, dtype: Any, *inputs: Any) -> tuple[Any, ...]:
        pairs = zip(called.inputs, inputs)
        # Copies, as tensors may change before it goes backward.
        arrays = {name: one.detach().to("cpu", torch.float64, copy=True).numpy() for name, one in pairs}

        def tensor(values: Any) -> Any:
            return torch.tensor(values, dtype=dtype, device=inputs[0].device)

        needed = zip(called.inputs, ctx.needs_input_grad[2:])
        ctx.asked = [name for name, is_needed in needed if is_needed]
        if not ctx.asked:
            return tuple(map(tensor, called(arrays).values()))
        values, rows = called.valued(arrays, ctx.asked)
        ctx.pulled, ctx.tensor = partial(called.pulled, arrays, rows), tensor
        ctx.names = list(called.outputs), list(called.inputs)
        return tuple(map(tensor, values.values()))

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, *weights: Any) -> tuple[Any, ...]:
        outputs, inputs = ctx.names
        pairs = zip(outputs, weights)
        arrays = {name: one.detach().to("cpu", torch.float64).numpy() for name, one in pairs}
        found = ctx.pulled(arrays, ctx.asked)
        slopes = (ctx.tensor(found[by]) if by in found else None for by in inputs)
        return (None, None, *slopes)


def function(
    experiment: Experiment,
    by: Sequence[str],
    of: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    **asked: Any,
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """The function that `Experiment.function` is, from a dict of tensors to a dict of tensors, differentiable in reverse mode
    by `backward` and `torch.autograd`.

    Runs are in double precision, which `torch.float64` keeps: values have the type that the inputs have together, or the default
    one where that has no fractions.
    """
    called = Function(experiment, by, of, at, **asked)

    def run(inputs: Mapping[str, Any]) -> dict[str, Any]:
        called.check(inputs)
        tensors = [torch.as_tensor(inputs[name]) for name in called.inputs]
        types = [tensor.dtype for tensor in tensors if tensor.is_floating_point()]
        dtype = reduce(torch.promote_types, types) if types else torch.get_default_dtype()
        return dict(zip(called.outputs, _Call.apply(called, dtype, *tensors)))

    return run
