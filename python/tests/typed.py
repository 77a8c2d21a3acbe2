"""A sample of what users write, for a type checker in strict mode."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import nsdc


def heights(file: nsdc.File, gravity: float) -> NDArray[np.float64]:
    """The heights of a ball over time."""
    result: nsdc.Result = file["falls"].run(g=gravity, x=[0.0, 1.0], params={"motor.k": 2})
    if not result.ok:
        result.raise_for_status()
    bounces: list[float] = [event.time for event in result.events if event.kind == "jump"]
    first: float = bounces[0]
    left: NDArray[np.float64] = result(first, side="left")["v"]
    return result["q"] + left


def table(experiment: nsdc.Experiment) -> list[str]:
    """The codes of runs that failed."""
    sweep: nsdc.Sweep = experiment.sweep(mu=np.linspace(0, 1, 3), speed=[0.1], outputs=["x"])
    shape: tuple[int, ...] = sweep.shape
    assert shape == (3, 1)
    return [str(one["code"]) for one in sweep.failed]


def places(text: str) -> list[tuple[int, str | None]]:
    """The lines of mistakes, with what to do about them."""
    found: list[nsdc.Diagnostic] = nsdc.check(text)
    return [(one.span.line, one.help) for one in found if one.span is not None]
