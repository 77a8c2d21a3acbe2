"""An experiment as a function of parameters and initial values, with its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import DerivativeError
from ._quantities import ENTRY, Quantity, both, by_name, entry, finite, given, names, real, rows

if TYPE_CHECKING:
    from ._experiment import Experiment
    from ._result import Result

#: Arrays by name.
Values = dict[str, NDArray[np.float64]]
#: Derivatives by what is differentiated, and by what it is differentiated by: of the shape of the one, and behind it the other's.
Jacobian = dict[str, Values]
#: How many rows a run has, and the places of values among them.
Rows = tuple[int, NDArray[np.intp]]
#: From derivatives of a number by what a function gives, by name, to its derivatives by what the function takes.
Pullback = Callable[[Mapping[str, ArrayLike]], Values]


class Function:
    """What an experiment gives, as a function of some of its parameters and initial values.

    It takes and gives arrays by name. What it is not given is as in the experiment.

    >>> import nsdc
    >>> relay = nsdc.loads('''
    ...     model relay { param a = 0.5; state x = 1; x' = -a - sign(x); }
    ...     simulate s of relay { horizon 1; }''')["s"]
    >>> f = relay.function(["a", "x"], at=[0.25, 0.5])
    >>> f({"x": 2})["x"]
    array([1.625, 1.25 ])
    >>> values, jacobian = f.linearized({"x": 2})
    >>> jacobian["x"]["a"]
    array([-0.25, -0.5 ])

    Where `stop when` ends a run, the values at the end move with the instant at which it does, and so do derivatives:

    >>> fall = nsdc.loads('''
    ...     model fall { param g = 8; state q = 1; state v = 0; q' = v; v' = -g; }
    ...     simulate s of fall { horizon 2; stop when q <= 0; }''')["s"]
    >>> _, jacobian = fall.function(["g"], ["v"]).linearized({})  # v = -√(2 g)
    >>> float(jacobian["v"]["g"].round(9))
    -0.25

    `RunError` where a run does not end as `solved`, and `DerivativeError` where a derivative is not known, as those of outputs
    where `stop when` has ended a run.
    """

    def __init__(
        self,
        experiment: Experiment,
        by: Sequence[str],
        of: Sequence[str] | None = None,
        at: ArrayLike | None = None,
        *,
        params: Mapping[str, ArrayLike] | None = None,
        settings: Mapping[str, Any] | None = None,
        time_limit: float | None = None,
        **values: Any,
    ) -> None:
        by, of = names("by", by), None if of is None else names("of", of)
        known = {**experiment.parameters, **experiment.states}
        reported = {**experiment.states, **experiment.outputs, **experiment.controls}
        settings = dict(by_name("settings", {} if settings is None else settings))
        self._at = None if at is None else real("at", at)
        if self._at is not None:
            if self._at.ndim != 1 or not len(self._at):
                raise ValueError(f"at: expected instants, got an array of shape {self._at.shape}")
            if "at" in settings:
                raise TypeError("`at` is given twice")
            settings["at"] = self._at
        self._experiment = experiment
        self._asked = experiment._asked(both(values, params), settings, time_limit)
        #: What it takes, with shapes.
        self.inputs = {name: _shape(known, name, "parameter or initial value") for name in by}
        instants = () if self._at is None else self._at.shape
        #: What it gives, with shapes.
        self.outputs = {
            name: instants + _shape(reported, name, "state, output or control")
            for name in (reported if of is None else of)
        }
        #: The shape of its values' rows.
        self.instants = instants
        #: What it gives, or gives an entry of, with shapes.
        self._whole = {one: reported[one].shape for one in (_whole(reported, name) for name in self.outputs)}
        if not self.inputs or not self.outputs:
            raise ValueError("by, of: expected one name or more")
        # What is named twice.
        given(known, [(name, np.zeros(shape)) for name, shape in self.inputs.items()])
        if len(self.inputs) < len(by):
            raise TypeError(f"`{next(name for name in by if list(by).count(name) > 1)}` is given twice")

    def check(self, names: Collection[str]) -> None:
        """`TypeError` where these are not all of the inputs and nothing else."""
        if set(names) != self.inputs.keys():
            raise TypeError(f"expected values of {', '.join(self.inputs)}, got {', '.join(names) or 'none'}")

    def _run(
        self,
        inputs: Mapping[str, ArrayLike],
        sensitivities: Sequence[str],
        weights: Mapping[str, NDArray[np.float64]] | None = None,
    ) -> Result:
        told = by_name("inputs", inputs)
        for name, _ in told:
            if name not in self.inputs:
                raise TypeError(f"`{name}` is none of {', '.join(self.inputs)}")
        values = {**dict(self._asked["values"]), **dict(given(self._experiment._known, told))}
        asked: _core.Asked = {**self._asked, "values": list(values.items())}
        flat = None if weights is None else [(name, one.ravel().tolist()) for name, one in weights.items()]
        return self._experiment._run(asked, sensitivities, weights=flat).raise_for_status()

    def _values(self, result: Result) -> tuple[Values, Rows]:
        """The values, those behind what jumps at their instants, with their rows."""
        count = len(result.time)
        places = np.array(count - 1)
        if self._at is not None:
            places = np.searchsorted(result.time, self._at, side="right") - 1
            if np.any(places < 0) or np.any(result.time[places] != self._at):
                raise ValueError("at: instants outside of the run")
        return {name: np.array(result[name][places]) for name in self.outputs}, (count, places)

    def _some(self, by: Collection[str] | None) -> dict[str, tuple[int, ...]]:
        """These inputs, or all, with shapes."""
        some = list(self.inputs) if by is None else names("by", by)
        for name in some:
            if name not in self.inputs:
                raise TypeError(f"by: `{name}` is none of {', '.join(self.inputs)}")
        return {name: shape for name, shape in self.inputs.items() if name in some}

    def _is_stopped(self, result: Result) -> bool:
        """Whether the values are those of an instant at which `stop when` has ended the run."""
        return self._at is None and bool(result.events) and result.events[-1].kind == "stop"

    def _moved(self, result: Result, name: str) -> NDArray[np.float64]:
        """How the value of a state at the end of a run moves with the instant that ends it: x' dt/dp."""
        whole = _whole(self._experiment.states, name)
        if whole not in self._experiment.states:
            raise DerivativeError(result, f"`{name}` is no state: where `stop when` ends a run, those alone have derivatives")
        last = result.time[-1:]
        rates = {whole: result(last, derivative=1, side="left")[whole]}
        moved: NDArray[np.float64] = np.multiply.outer(rows(rates, name)[0], result.grad.events.by[-1])
        return moved

    def __call__(self, inputs: Mapping[str, ArrayLike]) -> Values:
        """The values, where it is given these."""
        values, _ = self._values(self._run(inputs, ()))
        return values

    def linearized(
        self, inputs: Mapping[str, ArrayLike], by: Collection[str] | None = None
    ) -> tuple[Values, Jacobian]:
        """The values and all derivatives there, `jacobian["x"]["mu"]` of x by mu; or the derivatives by some inputs alone."""
        return self._linearized(inputs, self._some(by), self.outputs)

    def _linearized(
        self,
        inputs: Mapping[str, ArrayLike],
        shapes: dict[str, tuple[int, ...]],
        of: Collection[str],
    ) -> tuple[Values, Jacobian]:
        """The values, and derivatives of some of them by some inputs, which have these shapes."""
        result = self._run(inputs, list(shapes))
        values, (_, places) = self._values(result)
        ends = np.cumsum([np.prod(shape, dtype=int) for shape in shapes.values()])
        jacobian: Jacobian = {}
        is_stopped = self._is_stopped(result)
        for name in of:
            shape, derivatives = self.outputs[name], result.grad[name][places]
            if is_stopped:
                derivatives = derivatives + self._moved(result, name)
            if not np.all(np.isfinite(derivatives)):
                raise DerivativeError(result)
            parts = zip(shapes.items(), np.split(derivatives, ends[:-1], axis=-1))
            jacobian[name] = {one: part.reshape(shape + own) for (one, own), part in parts}
        return values, jacobian

    def valued(
        self, inputs: Mapping[str, ArrayLike], by: Collection[str] | None = None
    ) -> tuple[Values, Rows]:
        """The values, with the rows from which `pulled` pulls them back to the inputs, or to some of them."""
        # The derivative of nothing costs nothing, and its run has the rows of one with weights.
        return self._values(self._run(inputs, list(self._some(by)), {}))

    def pulled(
        self,
        inputs: Mapping[str, ArrayLike],
        rows_of: Rows,
        weights: Mapping[str, ArrayLike],
        by: Collection[str] | None = None,
    ) -> Values:
        """From derivatives of a number by values, of which `valued` has told the rows, to those by the inputs, or by some."""
        (count, places), shapes = rows_of, self._some(by)
        spread = {name: np.zeros((int(count), *shape)) for name, shape in self._whole.items()}
        told: Values = {}
        for name, one in by_name("weights", weights):
            if name not in self.outputs:
                raise TypeError(f"`{name}` is none of {', '.join(self.outputs)}")
            shape = self.outputs[name]
            told[name] = finite(name, one, shape).reshape(shape)
            np.add.at(rows(spread, name), places, told[name])
        weighed = {name: one for name, one in spread.items() if one.any()}
        result = self._run(inputs, list(shapes), weighed)
        if self._is_stopped(result):
            return self._summed(inputs, told, shapes)
        gradient = result._of_run().gradient()
        if gradient is None or not np.all(np.isfinite(gradient)):
            raise DerivativeError(result)
        ends = np.cumsum([np.prod(shape, dtype=int) for shape in shapes.values()])
        parts = zip(shapes.items(), np.split(gradient, ends[:-1]))
        return {name: part.reshape(shape) for (name, shape), part in parts}

    def _summed(
        self,
        inputs: Mapping[str, ArrayLike],
        weights: Values,
        shapes: dict[str, tuple[int, ...]],
    ) -> Values:
        """The derivatives of a weighed sum, from those of what has weights."""
        weighed = {name: one for name, one in weights.items() if one.any()}
        _, jacobian = self._linearized(inputs, shapes, weighed)
        found = {name: np.zeros(shape) for name, shape in shapes.items()}
        for of, one in weighed.items():
            for name in found:
                found[name] += np.tensordot(one, jacobian[of][name], axes=one.ndim)
        return found

    def vjp(self, inputs: Mapping[str, ArrayLike]) -> tuple[Values, Pullback]:
        """The values, and what takes derivatives of a number by them to its derivatives by the inputs, in a run and a pass back
        through it for all inputs together.

        >>> import nsdc
        >>> decay = nsdc.loads("model m { param k = 1; state x = 2; x' = -k*x; } simulate d of m { horizon 1; }")["d"]
        >>> values, pull = decay.function(["k", "x"]).vjp({"x": 1})
        >>> {name: round(float(one), 9) for name, one in pull({"x": 1}).items()}
        {'k': -0.367879441, 'x': 0.367879441}

        `DerivativeError` comes from where it pulls back.
        """
        inputs = {name: real(name, value) for name, value in by_name("inputs", inputs)}
        values, rows_of = self.valued(inputs)

        def pull(weights: Mapping[str, ArrayLike]) -> Values:
            return self.pulled(inputs, rows_of, weights)

        return values, pull


def _whole(known: Mapping[str, Quantity], name: str) -> str:
    """The name of a quantity, or of that of which it is the name of an entry."""
    match = None if name in known else ENTRY.match(name)
    return match["base"] if match else name


def _shape(known: Mapping[str, Quantity], name: str, kind: str) -> tuple[int, ...]:
    """The shape of a quantity or of an entry."""
    if name in known:
        return known[name].shape
    entry(known, name, kind=kind)
    return ()
