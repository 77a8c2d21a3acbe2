"""Sweeps: an experiment at many values, on all cores or on a cluster."""

from __future__ import annotations

import hashlib
import html
import json
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._chunks import Folder, Rows, in_chunks
from ._figure import Figure
from ._progress import Bar
from ._quantities import Quantity, entry, finite, named, names, real

if TYPE_CHECKING:
    import pandas
    import xarray

    from ._experiment import Experiment


@dataclass(frozen=True)
class Engine:
    """Where runs go."""

    threads: int | None
    on: Any
    chunk: int | None
    progress: bool | None


def split(
    known: Mapping[str, Quantity], values: Iterable[tuple[str, Any]], settings: Iterable[str]
) -> tuple[dict[str, NDArray[np.float64]], list[tuple[str, Any]]]:
    """Axes by the names of entries, and what holds in every run."""
    axes: dict[str, NDArray[np.float64]] = {}
    rest: list[tuple[str, Any]] = []
    for name, value in values:
        quantity = known.get(name)
        if quantity is None and name in settings:
            rest.append((name, value))
            continue
        numbers = real(name, value)
        if quantity is not None and quantity.shape and numbers.ndim != len(quantity.shape):
            one = quantity.entries[0]
            raise ValueError(f'{name}: axes are entries, as in `params={{"{one}": ..}}`')
        if numbers.ndim == len(quantity.shape if quantity is not None else ()):
            rest.append((name, value))
            continue
        own = name if quantity is not None else entry(known, name, settings)
        if own in axes:
            raise TypeError(f"`{own}` is given twice")
        axes[own] = _axis(name, numbers)
    if not axes:
        raise TypeError("a sweep needs an axis: a list or an array in place of a number")
    twice = axes.keys() & {re.sub(r"\s", "", name) for name, _ in rest}
    twice |= {own for own in axes for name, _ in rest if own.startswith(f"{name}[")}
    if twice:
        raise TypeError(f"`{min(twice)}` is given twice")
    return axes, rest


def _axis(name: str, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    if numbers.ndim != 1:
        raise ValueError(f"{name}: expected the values of an axis, got an array of shape {numbers.shape}")
    if not len(numbers):
        raise ValueError(f"{name}: the axis has no values")
    return finite(name, numbers, numbers.shape)


@dataclass(frozen=True)
class Plan:
    """What is run; it can be pickled."""

    experiment: Experiment
    asked: _core.Asked
    axes: dict[str, NDArray[np.float64]]
    is_zipped: bool
    seed: int | None
    outputs: tuple[str, ...] | None = None

    def __getstate__(self) -> dict[str, Any]:
        of = {"file": self.experiment.file, "name": self.experiment.name}
        return {**self.__dict__, "experiment": of}

    def __setstate__(self, state: dict[str, Any]) -> None:
        of = state["experiment"]
        self.__dict__.update({**state, "experiment": of["file"][of["name"]]})

    @property
    def shape(self) -> tuple[int, ...]:
        """The numbers of values of the axes; of values side by side, their number."""
        lengths = tuple(len(values) for values in self.axes.values())
        return lengths[:1] if self.is_zipped else lengths

    def points(self, first: int, last: int) -> _core.Points:
        """Some points by their numbers."""
        seed, part = self.seed, slice(None)
        if self.is_zipped or len(self.axes) == 1:
            # Rows depend on their own values alone: others need not be sent.
            seed = None if seed is None else seed + first
            part, first, last = slice(first, last), 0, last - first
        axes = [(name, values[part].tolist()) for name, values in self.axes.items()]
        return {"axes": axes, "zip": self.is_zipped, "first": first, "last": last, "seed": seed}

    def rows(
        self, first: int, last: int, threads: int | None, heard: Callable[[int], None] | None
    ) -> Rows:
        """Runs some points here."""
        project, name = self.experiment.file._project, self.experiment.name
        found = project.sweep(name, self.asked, self.points(first, last), threads, heard)
        return Rows.of(found, self.outputs)

    @cached_property
    def key(self) -> str:
        """What all rows depend on, as a number of 256 bits."""

        def hashed(content: bytes) -> str:
            return hashlib.sha256(content).hexdigest()

        told = {
            "version": _core.__version__,
            "files": sorted((name, hashed(text)) for name, text in self.experiment.file._project.files()),
            "experiment": self.experiment.name,
            "asked": self.asked,
            "axes": [(name, hashed(values.tobytes())) for name, values in self.axes.items()],
            "zip": self.is_zipped,
            "seed": self.seed,
            "outputs": self.outputs,
        }
        return hashed(json.dumps(told, sort_keys=True).encode())

    def run(
        self,
        engine: Engine,
        outputs: Sequence[str] | None,
        checkpoint: str | PathLike[str] | None,
    ) -> Sweep:
        """All points."""
        if self.is_zipped and len({len(values) for values in self.axes.values()}) > 1:
            lengths = ", ".join(f"{name} has {len(values)}" for name, values in self.axes.items())
            raise ValueError(f"zip takes axes of one length, but {lengths}")
        plan = self._keeping(outputs)
        count = math.prod(plan.shape)
        bar = Bar(self.experiment.name, count, engine.progress)
        try:
            if engine.on is None and checkpoint is None:
                rows = plan.rows(0, count, engine.threads, bar.show)
            else:
                folder = None if checkpoint is None else Folder(checkpoint, plan.key)
                rows = in_chunks(plan, count, engine, folder, bar)
        finally:
            bar.end()
        if np.all(rows.status == "refused"):
            # What is wrong with all points is told once, with its place.
            project, name = self.experiment.file._project, self.experiment.name
            project.refuse(name, self.asked, plan.points(0, count))
        if rows.is_interrupted:
            done = sum(status != "" for status in rows.status)
            warnings.warn(f"the sweep was interrupted after {done} of {count} runs", stacklevel=3)
        return Sweep(plan, rows)

    def _keeping(self, outputs: Sequence[str] | None) -> Plan:
        """With the names of what is kept, which are known."""
        if outputs is None:
            return self
        known = {**self.experiment.states, **self.experiment.outputs}
        kept = [re.sub(r"\s", "", name) for name in names("outputs", outputs)]
        for name in kept:
            if name not in known:
                entry(known, name, kind="state or output")
        return replace(self, outputs=tuple(kept))


class Sweep:
    """What a sweep has come to.

    >>> import nsdc
    >>> file = nsdc.loads('''
    ...     model decay { param k = 1; state x = 1; x' = -k*x; }
    ...     simulate d of decay { horizon 1; }''')
    >>> sweep = file["d"].sweep(k=[1, 2], x=[1, 2, 3])
    >>> sweep.shape, sweep["x"].round(4).tolist()
    ((2, 3), [[0.3679, 0.7358, 1.1036], [0.1353, 0.2707, 0.406]])
    >>> sweep.ok, sweep.failed
    (True, [])
    """

    def __init__(self, plan: Plan, rows: Rows) -> None:
        self._plan = plan
        self._rows = rows

    @property
    def axes(self) -> dict[str, NDArray[np.float64]]:
        """The values of the axes, by name."""
        return dict(self._plan.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """That of values: an entry for each axis; one where values were taken side by side."""
        return self._plan.shape

    @property
    def names(self) -> list[str]:
        """The entries of which there are values at the end."""
        return list(self._rows.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows.names)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and named("name", name) in self._rows.names

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The values at the end of a state or output, or of an entry: the shape of the sweep, and that of the quantity behind
        it; NaN where a run did not come to its end."""
        names, name = self._rows.names, named("name", name)
        if name in names:
            return self._shaped(self._rows.ends[:, names.index(name)])
        known = {**self._plan.experiment.states, **self._plan.experiment.outputs}
        quantity = known.get(name)
        if quantity is None or any(one not in names for one in quantity.entries):
            raise KeyError(f"{name}; there are {', '.join(names) or 'no values'}")
        places = [names.index(one) for one in quantity.entries]
        return self._rows.ends[:, places].reshape(self.shape + quantity.shape)

    def _shaped(self, values: NDArray[Any]) -> NDArray[Any]:
        return values.reshape(self.shape)

    @property
    def status(self) -> NDArray[np.str_]:
        """How each run ended: `solved`, ..; `refused` where the experiment does not compile with its values, and empty where
        there was no run."""
        return self._shaped(self._rows.status)

    @property
    def codes(self) -> NDArray[np.str_]:
        """The code of why each did not end as it should, or of its first warning; empty where there is none."""
        return self._shaped(self._rows.codes)

    @property
    def events(self) -> NDArray[np.int64]:
        """How many events there were; -1 where there was no run."""
        return self._shaped(self._rows.events)

    @property
    def error_estimate(self) -> NDArray[np.float64]:
        """Estimates of the errors at the end, which is all that rows have: those of `Result.error_estimate` are of all rows of
        a run."""
        return self._shaped(self._rows.error_estimates)

    @property
    def objective(self) -> NDArray[np.float64]:
        """Values of costs; NaN where there are none."""
        return self._shaped(self._rows.objectives)

    @property
    def missed(self) -> NDArray[np.int64]:
        """How many expectations of the experiment do not hold; -1 where it has none, or the run has no end."""
        return self._shaped(self._rows.missed)

    @property
    def ok(self) -> bool:
        """Whether all runs ended as `solved`."""
        return bool(np.all(self._rows.status == "solved"))

    @property
    def failed(self) -> list[dict[str, Any]]:
        """The values of runs that did not end as `solved`, with `status` and `code`."""
        failed = np.flatnonzero(self._rows.status != "solved")
        columns = self._coordinates()
        return [
            {
                **{name: float(values[k]) for name, values in columns.items()},
                "status": str(self._rows.status[k]),
                "code": str(self._rows.codes[k]),
            }
            for k in failed
        ]

    def _coordinates(self) -> dict[str, NDArray[np.float64]]:
        """The values of the axes, run by run."""
        axes = self._plan.axes
        if self._plan.is_zipped:
            return dict(axes)
        grid = np.meshgrid(*axes.values(), indexing="ij")
        return {name: values.reshape(-1) for name, values in zip(axes, grid)}

    def _columns(self) -> dict[str, NDArray[Any]]:
        """What is known of each run, run by run; a name that an axis or one of these columns has gets ` at end`."""
        rows = self._rows
        told: dict[str, NDArray[Any]] = {"status": rows.status, "code": rows.codes}
        behind: dict[str, NDArray[Any]] = {}
        if not np.all(np.isnan(rows.objectives)):
            behind["objective"] = rows.objectives
        behind |= {"events": rows.events, "error_estimate": rows.error_estimates}
        if not np.all(rows.missed == -1):
            behind["missed"] = rows.missed
        taken = {*self.axes, *told, *behind}
        for k, name in enumerate(rows.names):
            told[f"{name} at end" if name in taken else name] = rows.ends[:, k]
        # An axis keeps its name.
        all_told = {**told, **behind}
        return {f"{name} of run" if name in self.axes else name: of for name, of in all_told.items()}

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each run: axes, `status`, `code`, values at the end, `events`, `error_estimate`."""
        import pandas

        return pandas.DataFrame({**self._coordinates(), **self._columns()})

    def to_xarray(self) -> xarray.Dataset:
        """A data set over the axes; over `run` where values were taken side by side."""
        import xarray

        units = self._plan.experiment._units
        dims = ["run"] if self._plan.is_zipped else list(self._plan.axes)

        def variable(dims: list[str], name: str, values: NDArray[Any]) -> xarray.Variable:
            unit = units.get(name.removesuffix(" at end").split("[")[0])
            return xarray.Variable(dims, values, {} if unit is None else {"units": unit})

        axes = self._plan.axes.items()
        coordinates = {
            name: variable(["run"] if self._plan.is_zipped else [name], name, values)
            for name, values in axes
        }
        columns = self._columns().items()
        variables = {name: variable(dims, name, self._shaped(values)) for name, values in columns}
        return xarray.Dataset(variables, coordinates, {"experiment": self._plan.experiment.name})

    def plot(self) -> Figure:
        """Values at the end over one axis, or maps over two. `ValueError` for more."""
        plan, rows = self._plan, self._rows
        if len(self.shape) > 2:
            raise ValueError("a figure has one axis or two")
        ends = (rows.names, rows.ends.reshape(-1).tolist(), rows.objectives.tolist())
        project, name = plan.experiment.file._project, plan.experiment.name
        points = plan.points(0, len(rows.status))
        return Figure(project.draw_sweep(name, plan.asked, points, ends))

    def __repr__(self) -> str:
        solved = int(np.sum(self._rows.status == "solved"))
        axes = ", ".join(f"{name} ({len(values)})" for name, values in self._plan.axes.items())
        return f"<sweep of {self._plan.experiment.name} over {axes}: {solved} of {len(self._rows.status)} solved>"

    def _repr_html_(self) -> str:
        figure = self.plot().svg if len(self.shape) <= 2 else ""
        return f"<div>{figure}<pre>{html.escape(repr(self))}</pre></div>"
