"""Experiments as functions of PyTorch: `backward` goes through runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import torch
from numpy.typing import ArrayLike

from ._function import Function

if TYPE_CHECKING:
    from ._experiment import Experiment


class _Call(torch.autograd.Function):  # type: ignore[misc]
    """Inputs and outputs are tensors in the order of their names."""

    @staticmethod
    def forward(ctx: Any, called: Function, *inputs: Any) -> tuple[Any, ...]:
        arrays = {name: one.detach().cpu().numpy() for name, one in zip(called.inputs, inputs)}

        def tensor(values: Any) -> Any:
            return torch.tensor(values).to(inputs[0])

        if not any(ctx.needs_input_grad):
            return tuple(map(tensor, called(arrays).values()))
        values, jacobian = called.linearized(arrays)
        ctx.n_inputs = len(inputs)
        ctx.save_for_backward(*(tensor(slopes) for row in jacobian.values() for slopes in row.values()))
        return tuple(map(tensor, values.values()))

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, *weights: Any) -> tuple[Any, ...]:
        slopes = ctx.saved_tensors

        def pulled(by: int) -> Any:
            parts = zip(weights, slopes[by :: ctx.n_inputs])
            return sum(torch.tensordot(weight, slope, dims=weight.ndim) for weight, slope in parts)

        return (None, *map(pulled, range(ctx.n_inputs)))


def function(
    experiment: Experiment,
    by: Sequence[str],
    of: Sequence[str] | None = None,
    at: ArrayLike | None = None,
    **asked: Any,
) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """The function that `Experiment.function` is, from a dict of tensors to a dict of tensors of the type of the first one,
    differentiable in reverse mode.

    Runs are in double precision; `torch.float64` keeps it.
    """
    called = Function(experiment, by, of, at, asked)

    def run(inputs: Mapping[str, Any]) -> dict[str, Any]:
        if inputs.keys() != called.inputs.keys():
            raise TypeError(f"expected values of {', '.join(called.inputs)}, got {', '.join(inputs) or 'none'}")
        tensors = [torch.as_tensor(inputs[name]) for name in called.inputs]
        return dict(zip(called.outputs, _Call.apply(called, *tensors)))

    return run
