"""A controller: an `optimize` experiment that is solved from one state after another."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._quantities import by_name, finite, given

if TYPE_CHECKING:
    from ._experiment import Experiment


class Controller:
    """An `optimize` experiment as a controller: a state in, controls out.

    >>> import nsdc
    >>> brake = nsdc.loads('''
    ...     model brake { param m = 1; state x = 1; control u in [-9, 9]; x' = u/m; }
    ...     optimize o of brake { horizon 1; intervals 4; minimize integral(u^2); final { x = 0; } }''')["o"]
    >>> c = brake.controller(sample=0.25)
    >>> u, info = c.step({"x": 1})              # from 1 to 0 within a second
    >>> round(float(u["u"]), 6), info["decision"]
    (-1.0, 'cold')
    >>> u, info = c.step({"x": 0.75}, m=2)      # a sample later, and heavier
    >>> round(float(u["u"]), 6), info["decision"]
    (-1.5, 'warm')

    A plan is looked for from the last one, shifted by the time that has passed, and as the experiment does it where that leads
    to no solution; where there is none, the last one goes on: see closed loops in the language reference.
    """

    def __init__(
        self,
        experiment: Experiment,
        sample: float,
        deadline: float | None,
        values: list[tuple[str, float]],
    ) -> None:
        if experiment.kind != "optimize":
            raise TypeError(f"`{experiment.name}` is a `{experiment.kind}`, and chooses no controls")
        (self.sample,) = finite("sample", sample, ()).tolist()
        if not self.sample > 0:
            raise ValueError(f"sample: {sample} is no time between two plans")
        if deadline is not None:
            (deadline,) = finite("deadline", deadline, ()).tolist()
            if not deadline > 0:
                raise ValueError(f"deadline: {deadline} is no time in seconds")
        #: The experiment that is solved.
        self.experiment = experiment
        #: How long a solve may take, in seconds, but for the first one.
        self.deadline = deadline
        self._values = values
        self._time: float | None = None
        # One question at a time: each has its answer.
        self._turn = threading.RLock()
        self._compile([])

    def _compile(self, names: list[str]) -> None:
        """Compiles the experiment with these parameters open; they have the values of the experiment until they are given."""
        rest = [(name, value) for name, value in self._values if name not in names]
        project = self.experiment.file._project
        core = project.controller(self.experiment.name, names, rest, self.deadline)
        found = json.loads(core.names())
        before: _core.Controller | None = getattr(self, "_core", None)
        if before is not None:
            core.remember(before.memory())
        self._core: _core.Controller = core
        #: The parameters that are open.
        self._open = names
        #: The entries of the states that it takes, in their order.
        self.states: list[str] = found["states"]
        #: The entries of the controls that it decides on.
        self.controls: list[str] = found["controls"]
        known = {**dict(self._defaults()), **dict(self._values), **getattr(self, "_last", {})}
        #: The values of what is open.
        self._last: dict[str, float] = {name: known[name] for name in names}

    def _defaults(self) -> list[tuple[str, float]]:
        known = self.experiment.parameters
        return given(known, [(name, one.value) for name, one in known.items()])

    def step(
        self, x: Mapping[str, ArrayLike] | ArrayLike, t: float | None = None, **params: Any
    ) -> tuple[dict[str, NDArray[np.float64]], dict[str, Any]]:
        """The controls from an instant on, by name, and how they were found.

        `x` has states by name, or all entries in the order of `states`; `t` is a sample behind the last step without it.
        Parameters keep their values until others are given; the first step with a parameter compiles the experiment with that
        one open.

        `info` has the `time`, `decision` ("warm", "cold", "feasible", "kept"), `why` where it is one of the last two, `iterations`,
        `solve_s`, and the `plan` that is followed: `time`, `states` and `controls` at the ends of its intervals, `objective`.
        `RuntimeError` where there has never been a plan.
        """
        with self._turn:
            t, entries = self._instant(t), self._entries(x)
            values = self._given(params)
            found = self._core.step(t, entries, [values[name] for name in self._open])
            self._last = values
            return self._told(found)

    def prepare(self, t: float | None = None, **params: Any) -> None:
        """Solves for the next step before its state is measured, from the state that the plan leads to there.

        `feedback` then has the difference between the two states to solve for. `t` and parameters are as for `step`, and hold
        in the feedback. It takes the time that it needs, whatever the deadline is, and what is followed until then stays as it
        is; before the first plan nothing is known of the state, and all is left to the feedback.

        >>> import nsdc
        >>> brake = nsdc.loads('''
        ...     model brake { state x = 1; control u in [-9, 9]; x' = u; }
        ...     optimize o of brake { horizon 1; intervals 4; minimize integral(u^2); final { x = 0; } }''')["o"]
        >>> c = brake.controller(sample=0.25)
        >>> u, info = c.step({"x": 1})
        >>> c.prepare()                             # for a sample later, at 0.75
        >>> u, info = c.feedback({"x": 0.7})        # it is at 0.7
        >>> round(float(u["u"]), 6), info["decision"]
        (-0.7, 'warm')
        """
        with self._turn:
            t, values = self._instant(t), self._given(params)
            self._core.prepare(t, [values[name] for name in self._open])
            self._last = values

    def feedback(
        self, x: Mapping[str, ArrayLike] | ArrayLike
    ) -> tuple[dict[str, NDArray[np.float64]], dict[str, Any]]:
        """The controls from the instant on that was prepared, and how they were found, as `step` has them.

        The plan that was prepared is followed where no better one is found within the deadline. `ValueError` where nothing is
        prepared.
        """
        with self._turn:
            entries = self._entries(x)
            found = self._core.feedback(entries, [self._last[name] for name in self._open])
            return self._told(found)

    def _instant(self, t: float | None) -> float:
        if t is None:
            return 0.0 if self._time is None else self._time + self.sample
        (t,) = finite("t", t, ()).tolist()
        return float(t)

    def _given(self, params: Mapping[str, Any]) -> dict[str, float]:
        """The values of what is open, some of which are others from now on."""
        changed = dict(given(self.experiment.parameters, params.items()))
        new = [name for name in changed if name not in self._open]
        if new:
            self._compile([*self._open, *new])
        return {**self._last, **changed}

    def _told(self, found: str) -> tuple[dict[str, NDArray[np.float64]], dict[str, Any]]:
        info = json.loads(found)
        values, self._time = info.pop("u"), info["time"]
        if values is None:
            why = info["why"] or {}
            raise RuntimeError(f"there is no plan: {why.get('code')}, {why.get('message')}")
        decided = dict(zip(self.controls, values))
        shaped = {
            name: np.array([decided[one] for one in control.entries]).reshape(control.shape)
            for name, control in self.experiment.controls.items()
            if all(one in decided for one in control.entries)
        }
        return shaped, info

    def _entries(self, x: Mapping[str, ArrayLike] | ArrayLike) -> list[float]:
        if not isinstance(x, Mapping):
            return [float(one) for one in finite("x", x, (len(self.states),)).tolist()]
        found = dict(given(self.experiment.states, x.items()))
        missing = [name for name in self.states if name not in found]
        if missing:
            raise TypeError(f"x: `{missing[0]}` is missing")
        chosen = [name for name in found if name not in self.states]
        if chosen:
            raise TypeError(f"x: the experiment chooses the initial value of `{chosen[0]}` itself")
        return [found[name] for name in self.states]

    @property
    def state(self) -> dict[str, Any]:
        """What it remembers: plans, since when, and the values of parameters. It can be pickled, and given to another
        controller of the same experiment."""
        with self._turn:
            return {"memory": self._core.memory(), "time": self._time, "parameters": dict(self._last)}

    @state.setter
    def state(self, state: Mapping[str, Any]) -> None:
        with self._turn:
            memory, time, values = state["memory"], state["time"], state.get("parameters", {})
            time = None if time is None else self._instant(time)
            last = self._given(dict(by_name("parameters", values)))
            self._core.remember(memory)
            self._time, self._last = time, last

    def __repr__(self) -> str:
        return f"<controller {self.experiment.name} of {self.experiment.model}>"
