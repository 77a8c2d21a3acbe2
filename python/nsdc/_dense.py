"""The solution between the instants of rows: polynomials that follow each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._quantities import count, real

#: Polynomials of a run that is accurate to its tolerance say little of derivatives that are higher.
HIGHEST = 4


@dataclass(frozen=True)
class Dense:
    """Pieces of m states; piece k is a polynomial in t - starts[k] from starts[k] to ends[k]."""

    #: The names of the entries of states, shape (m,).
    names: list[str]
    #: Shape (n,).
    starts: NDArray[np.float64]
    #: Shape (n,).
    ends: NDArray[np.float64]
    #: Constant terms first, zeros behind the last; shape (n, m, degree + 1).
    coefficients: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        names: list[str],
        ends: list[NDArray[np.float64]],
        counts: NDArray[np.int64],
        flat: NDArray[np.float64],
    ) -> Dense:
        """Pieces with `counts` coefficients a state, one behind the other."""
        degree = int(counts.max(initial=0))
        coefficients = np.zeros((len(counts), len(names), degree))
        place = 0
        for k, count in enumerate(counts):
            size = len(names) * count
            coefficients[k, :, :count] = flat[place : place + size].reshape(len(names), count)
            place += size
        return cls(names, ends[0], ends[1], coefficients)

    def at(self, time: ArrayLike, derivative: int, side: str) -> NDArray[np.float64]:
        """States or their derivatives at instants: the shape of `time`, and (m,) behind it.

        Where two pieces meet, `side` says which one counts: `left` the one before, `right` the one behind.
        """
        instants = real("time", time)
        if side not in ("left", "right"):
            raise ValueError(f"side: expected 'left' or 'right', got {side!r}")
        derivative = count("derivative", derivative, 0) or 0
        if derivative > HIGHEST:
            raise ValueError(f"derivative: expected 0 to {HIGHEST}, which are as good as the run, got {derivative}")
        if not len(self.starts):
            raise ValueError("this method knows its solution at the instants of rows alone")
        first, last = self.starts[0], self.ends[-1]
        if not np.all((first <= instants) & (instants <= last)):
            raise ValueError(f"time: the run is known from {first} to {last}")
        place = np.searchsorted(self.starts, instants, side="left" if side == "left" else "right")
        place = np.clip(place - 1, 0, len(self.starts) - 1)
        coefficients = self.coefficients
        for _ in range(derivative):
            powers = np.arange(1, coefficients.shape[-1])
            coefficients = coefficients[..., 1:] * powers
        offset = (instants - self.starts[place])[..., np.newaxis]
        found = np.zeros((*instants.shape, len(self.names)))
        for k in range(coefficients.shape[-1] - 1, -1, -1):
            found = found * offset + coefficients[place, :, k]
        return found
