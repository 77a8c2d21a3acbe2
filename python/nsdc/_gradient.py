"""The derivatives of a run by parameters and initial values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._quantities import rows


class Moves(NamedTuple):
    """The instants of events, and how they move.

    >>> import nsdc
    >>> relay = nsdc.loads("model m { state x = 2; x' = -sign(x); } simulate s of m { horizon 3; }")["s"]
    >>> moves = relay.run(sensitivities=["x"]).grad.events
    >>> moves.time.round(9), moves.by.round(9)
    (array([2.]), array([[1.]]))
    """

    #: The instants, shape (k,).
    time: NDArray[np.float64]
    #: Their derivatives, shape (k, d); not a number where they are not known.
    by: NDArray[np.float64]


class Gradient(Mapping[str, NDArray[np.float64]]):
    """The derivatives of states, outputs and controls by d numbers, at the n instants of a run.

    >>> import nsdc
    >>> ball = nsdc.loads('''
    ...     model ball {
    ...       param g = 2; param e = 0.5;
    ...       state q = 1; state v = 0;
    ...       q' = v; v' = -g;
    ...       jump floor when q <= 0 and v < 0 { v := -e*v; }
    ...     }
    ...     simulate falls of ball { horizon 1.5; }''')
    >>> r = ball["falls"].run(sensitivities=["g", "q"])
    >>> r.grad.to
    ['g', 'q at 0']

    It strikes after √(2q/g), and the speed behind that is e √(2qg) - g (t - √(2q/g)):

    >>> r.grad.events.by.round(9)
    array([[-0.25,  0.5 ]])
    >>> r.grad["v"].shape == (*r.time.shape, 2), r.grad.end["v"].round(9)
    (True, array([-0.75,  1.5 ]))
    """

    def __init__(self, run: _core.Run) -> None:
        directions = run.directions()
        #: By what: `mu`, `x[1] at 0`.
        self.to = [to for to, _ in directions]
        #: The instants from which on the derivatives are not known, shape (d,): infinite where they are known to the end.
        self.until = np.array([np.inf if time is None else time for _, time in directions])
        #: The instants of events, with their derivatives.
        self.events = _moves(run, len(directions))
        self._values: dict[str, NDArray[np.float64]] = {}
        for place, (_, name, *_) in enumerate(run.end()):
            columns = [run.derivatives(d, place) for d in range(len(directions))]
            self._values[name] = np.stack(columns, axis=-1)
            self._values[name].flags.writeable = False

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The derivatives of a state, output or control: shape (n, d), (n, 3, d) or (n, 3, 3, d); not a number where they are
        not known."""
        return rows(self._values, name, behind=1)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    @property
    def end(self) -> dict[str, NDArray[np.float64]]:
        """The derivatives at the last instant, by name: shape (d,), (3, d) or (3, 3, d)."""
        return {name: values[-1] for name, values in self._values.items() if len(values)}

    def __repr__(self) -> str:
        return f"<derivatives of {', '.join(self)} by {', '.join(self.to)}>"


def _moves(run: _core.Run, n_directions: int) -> Moves:
    columns = [run.moves(direction) for direction in range(n_directions)]
    return Moves(columns[0][0], np.stack([by for _, by in columns], axis=-1))
