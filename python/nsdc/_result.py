"""What came of a run."""

from __future__ import annotations

import html
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._dense import Dense
from ._errors import Diagnostic, RunError, diagnostics
from ._figure import Figure
from ._gradient import Gradient
from ._quantities import entries, fixed, named, plain_name, real, rows, shaped_like

if TYPE_CHECKING:
    import pandas
    import pyarrow
    import xarray

    from ._experiment import Experiment


#: What results are written as.
FORMATS = (".json", ".csv", ".svg", ".parquet", ".nc", ".mat")


class Event(NamedTuple):
    """Something that happened at an instant.

    >>> import nsdc
    >>> relay = nsdc.loads("model m { state x = 1; x' = -sign(x); } simulate s of m { horizon 2; }")["s"]
    >>> (event,) = relay.run().events
    >>> event.time, event.kind, event.before, event.after
    (1.0, 'enter_sliding', 'above(x)', 'sliding(x)')
    """

    time: float
    #: `crossing`, `jump`, `stick`, ..
    kind: str
    #: On which surface, contact or jump.
    surface: str
    #: The mode before.
    before: str
    #: The mode after.
    after: str


class Mode(NamedTuple):
    """An interval of time without a change of mode.

    >>> import nsdc
    >>> relay = nsdc.loads("model m { state x = 1; x' = -sign(x); } simulate s of m { horizon 2; }")["s"]
    >>> for mode in relay.run().modes:
    ...     print(mode.start, mode.end, mode.mode)
    0.0 1.0 above(x)
    1.0 2.0 sliding(x)
    """

    start: float
    end: float
    #: Regions and sliding surfaces.
    mode: str


class Reported(NamedTuple):
    """A state, output or control of a run."""

    #: `states`, `outputs` or `controls`.
    kind: str
    shape: tuple[int, ...]
    #: Its entries at the last instant; none where there is no instant.
    end: NDArray[np.float64]


def _plain_names(names: Iterable[Any]) -> dict[str, str]:
    """Names of letters, digits and underscores of ASCII, which begin with a letter, each another one."""
    found: dict[str, str] = {}
    for name in map(str, names):
        plain = found.get(name, plain_name(name))
        while name not in found and plain in found.values():
            plain += "_"
        found[name] = plain
    return found


def _columns(rows: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Columns of a table, one for each entry."""
    columns: dict[str, NDArray[np.float64]] = {}
    for name, values in rows.items():
        flat = values.reshape(len(values), -1)
        columns.update(zip(entries(name, values.shape[1:]), flat.T))
    return columns


class Result:
    """What came of a run, whether it was solved or not.

    >>> import nsdc
    >>> ball = nsdc.loads('''
    ...     model ball {
    ...       param g : m/s^2 = 9.81; param e = 0.5;
    ...       state q : m = 1; state v : m/s = 0;
    ...       q' = v; v' = -g;
    ...       jump floor when q <= 0 m and v < 0 m/s { v := -e*v; }
    ...     }
    ...     simulate falls of ball { horizon 1; }''')
    >>> r = ball["falls"].run(g=2)
    >>> r.status, r.ok, [event.kind for event in r.events]
    ('solved', True, ['jump'])

    `r["q"]` has a row for each instant of `r.time`; an instant stands twice where something jumps.

    >>> len(r["q"]) == len(r.time), r["q"].flags.writeable
    (True, False)

    Between rows the solution is known, too, from both sides of a jump:

    >>> float(r(0.5)["q"]), float(r(1.0, side="left")["v"]), float(r(1.0)["v"])
    (0.75, -2.0, 1.0)
    """

    def __init__(
        self, run: _core.Run, experiment: Experiment, asked: _core.Asked
    ) -> None:
        self._run: _core.Run | None = run
        self._experiment = experiment
        self._asked = asked

    # What a run has in memory stays there until somebody asks for it; a pickled result has it all.

    def _of_run(self) -> _core.Run:
        if self._run is None:
            raise AttributeError("a pickled result has no more than what was kept of it")
        return self._run

    @cached_property
    def _summary(self) -> dict[str, Any]:
        return dict(json.loads(self._of_run().summary()))

    @cached_property
    def time(self) -> NDArray[np.float64]:
        """The instants of rows, shape (n,): ascending, twice where something jumps."""
        return self._of_run().time

    @cached_property
    def _reported(self) -> dict[str, Reported]:
        told = self._of_run().end()
        return {name: Reported(kind, tuple(shape), fixed(end)) for kind, name, shape, end in told}

    @cached_property
    def _values(self) -> dict[str, NDArray[np.float64]]:
        run = self._of_run()
        return {name: run.values(place) for place, (_, name, *_) in enumerate(run.end())}

    @cached_property
    def _dense(self) -> Dense:
        return Dense.of(*self._of_run().pieces())

    @cached_property
    def _gradient(self) -> Gradient | None:
        run = self._of_run()
        return Gradient(run) if run.directions() else None

    @property
    def grad(self) -> Gradient:
        """The derivatives that `run` was asked for by `sensitivities`, or the experiment by `sensitivity to`: `grad["x"]` has
        the shape of `r["x"]`, and behind it that of what it is differentiated by. `ValueError` where none was asked for."""
        if self._gradient is None:
            raise ValueError('no derivatives were asked for: run it with `sensitivities=["mu", ..]`')
        return self._gradient

    @cached_property
    def report(self) -> str:
        """The report that `nsdc run` prints."""
        return self._of_run().text()

    @cached_property
    def _messages(self) -> tuple[str, str]:
        return self._of_run().messages()

    @cached_property
    def _svg(self) -> str:
        run = self._of_run()
        if run.figure is not None:
            return run.figure
        return self._experiment.file._project.draw(self._experiment.name, self._asked, run)

    @cached_property
    def json(self) -> str:
        """The object that `nsdc run --json` writes."""
        return self._of_run().json()

    @cached_property
    def csv(self) -> str:
        """The table that `nsdc run --csv` writes."""
        return self._of_run().csv()

    def __getstate__(self) -> dict[str, Any]:
        kept = ["_summary", "time", "_reported", "_values", "_dense", "report", "_messages", "_svg"]
        kept += ["json", "csv", "_gradient"]
        state = {name: getattr(self, name) for name in kept}
        return {**state, "_run": None, "_experiment": self._experiment, "_asked": self._asked}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        ends = (one.end for one in self._reported.values())
        for values in [self.time, *self._values.values(), *ends]:
            values.flags.writeable = False

    @property
    def names(self) -> list[str]:
        """What there are values of: states, outputs, controls."""
        return list(self._reported)

    def __iter__(self) -> Iterator[str]:
        return iter(self._reported)

    def __len__(self) -> int:
        return len(self._reported)

    def keys(self) -> list[str]:
        """The names, so that `dict(result)` has all values."""
        return self.names

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and named("name", name) in self._reported

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """The values of a state, output or control, or of an entry: shape (n,), (n, 3) or (n, 3, 3).

        A read-only view without a copy; `x[1]` is the first entry of `x`, as in the language.
        """
        return rows(self._values, name)

    def __call__(
        self, time: ArrayLike, derivative: int = 0, side: str = "right"
    ) -> dict[str, NDArray[np.float64]]:
        """States, or their derivatives up to the fourth, at any instants of the run, by name.

        Each has the shape of `time`, and that of the state behind it. At an instant where something jumps, `side` says which
        value is meant: `left` the one before, `right` the one behind. `ValueError` outside of the run, and for methods that
        know their solution at the instants of rows alone.
        """
        dense = self._dense
        found = dense.at(time, derivative, side)
        columns = dict(zip(dense.names, np.moveaxis(found, -1, 0)))
        states = self._experiment.states
        gathered: dict[str, NDArray[np.float64]] = {}
        for name, state in states.items():
            if all(entry in columns for entry in state.entries):
                stacked = [columns[entry] for entry in state.entries]
                shape = found.shape[:-1] + state.shape
                gathered[name] = np.stack(stacked, axis=-1).reshape(shape)
        return gathered

    @property
    def end(self) -> dict[str, float | NDArray[np.float64]]:
        """Values at the last instant, by name: floats, or arrays."""
        return {
            name: shaped_like(one.end, one.shape)
            for name, one in self._reported.items()
            if one.end.size == math.prod(one.shape)
        }

    @cached_property
    def events(self) -> list[Event]:
        """What happened, in order of time."""
        return [
            Event(one["time"], one["kind"], one["surface"], one["from"], one["to"])
            for one in self._summary["events"]
        ]

    @cached_property
    def modes(self) -> list[Mode]:
        """The modes that follow each other."""
        return [Mode(one["from"], one["to"], one["mode"]) for one in self._summary["modes"]]

    @cached_property
    def status(self) -> str:
        """How it ended: `solved`, `feasible`, `locally_infeasible`, `unbounded`, `iteration_limit`, `time_limit`, `canceled`
        or `numerical_failure`."""
        return str(self._summary["status"]) if self._run is None else self._run.status

    @property
    def ok(self) -> bool:
        """Whether it ended as `solved`."""
        return self.status == "solved"

    def raise_for_status(self) -> Result:
        """The result itself; `RunError` where it did not end as `solved`."""
        if not self.ok:
            raise RunError(self)
        return self

    @property
    def error_estimate(self) -> float | None:
        """Estimate of the global error, relative to the magnitude of each state."""
        return self._summary["error_estimate"]  # type: ignore[no-any-return]

    @cached_property
    def warnings(self) -> list[Diagnostic]:
        """Warnings, and what ended the run early, with their places in the model."""
        return diagnostics(self._messages[0])

    @property
    def objective(self) -> float | None:
        """The value of the cost of an `optimize`."""
        return self._summary["objective"]  # type: ignore[no-any-return]

    @property
    def certificate(self) -> dict[str, Any]:
        """What is known about the result, as the language reference has it."""
        return dict(self._summary["certificate"])

    @property
    def optimum(self) -> dict[str, Any] | None:
        """How an optimum was found, and what a simulation says about it; none of a simulation."""
        return self._summary.get("optimum")

    @property
    def free(self) -> dict[str, float]:
        """The values that an optimization or a fit found for its free parameters."""
        found = self.optimum or self.fit or {}
        return dict(found.get("free", {}))

    @property
    def fit(self) -> dict[str, Any] | None:
        """What measurements say of parameters: `estimates`, `covariance`, residuals; none of other experiments."""
        return self._summary.get("fit")

    @property
    def mpc(self) -> dict[str, Any] | None:
        """What the controller of a closed loop did: `samples` with decisions and plans, `times_s`; none of other experiments."""
        return self._summary.get("mpc")

    @property
    def constraints(self) -> list[dict[str, Any]]:
        """The constraints of an optimization: `value`, `relation`, `bound`, where it holds, and its `multiplier`, none where
        the optimum has no derivative by its bound."""
        return list((self.optimum or {}).get("constraints", []))

    @property
    def multipliers(self) -> dict[str, Any] | None:
        """Multipliers over time, where `run` was asked for them and the method has them: `time`, and each by its name. Those
        of an optimum are with its `constraints`."""
        found = json.loads(self.json).get("multipliers")
        if found is None:
            return None
        values = {name: np.array(values) for name, values in found["values"].items()}
        return {"time": np.array(found["time"]), **values}

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters with the values that it ran with."""
        return dict(self._summary["parameters"])

    @property
    def stats(self) -> dict[str, Any]:
        """What it cost: steps, events, iterations, evaluations, seconds."""
        return dict(self._summary["stats"])

    def _rows(self, at: ArrayLike | None) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
        """Instants and values at them: all that is reported at those of rows, or states at others."""
        if at is None:
            return self.time, self._values
        time = real("at", at)
        if time.ndim != 1 or not len(time):
            raise ValueError(f"at: expected instants, got an array of shape {time.shape}")
        return time, self(time)

    def _units(self, names: Iterable[str]) -> dict[str, str]:
        units = self._experiment._units
        return {name: units[name] for name in names if name in units}

    def _attributes(self) -> dict[str, Any]:
        """Settings and marks of quality, as attributes of other formats."""
        told = {
            "experiment": self._experiment.name,
            "model": self._experiment.model,
            "method": self._summary["method"]["name"],
            "status": self.status,
            "error_estimate": self.error_estimate,
            "objective": self.objective,
        }
        return {name: value for name, value in told.items() if value is not None}

    def to_pandas(self, at: ArrayLike | None = None) -> pandas.DataFrame:
        """A table with a row for each instant, and a column for each entry; units are in `attrs`.

        With `at`, n instants of the run, it has the states there, behind what jumps. `ValueError` outside of the run.
        """
        import pandas

        time, rows = self._rows(at)
        table = pandas.DataFrame(_columns(rows), index=pandas.Index(time, name="time"))
        table.attrs = {**self._attributes(), "units": self._units(rows)}
        return table

    def to_xarray(self, at: ArrayLike | None = None) -> xarray.Dataset:
        """A data set over `time`, with units, docs and settings as attributes.

        An instant stands twice where something jumps. With `at`, n instants of the run, it has the states there, behind what
        jumps. `ValueError` outside of the run.
        """
        import xarray

        time, rows = self._rows(at)
        units, docs = self._experiment._units, self._experiment._docs
        kinds = {name: one.kind for name, one in self._reported.items()}

        def variable(name: str, values: NDArray[np.float64]) -> xarray.Variable:
            dims = ["time", *(f"{name}_{k}" for k in range(1, values.ndim))]
            attrs = {"units": units.get(name), "long_name": docs.get(name), "kind": kinds.get(name, "states")}
            known = {key: value for key, value in attrs.items() if value is not None}
            return xarray.Variable(dims, values, known)

        variables = {name: variable(name, values) for name, values in rows.items()}
        return xarray.Dataset(variables, {"time": time}, self._attributes())

    def to_arrow(self) -> pyarrow.Table:
        """A table of Arrow, whose columns share memory with the result where entries are scalars."""
        import pyarrow

        described = {k.encode(): json.dumps(v).encode() for k, v in self._attributes().items()}
        described[b"units"] = json.dumps(self._units(self)).encode()
        columns = {"time": self.time, **_columns(self._values)}
        return pyarrow.table(columns).replace_schema_metadata(described)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def save(self, path: str | PathLike[str]) -> None:
        """Writes it to a file: `.json` and `.csv` as the command line does, `.parquet`, `.nc`, `.mat`, and `.svg` its figure.

        The file is replaced whole, or not at all. Where a format has no names with other letters than those of ASCII, `φ` is
        `phi`.
        """
        path = Path(path)
        if path.suffix not in FORMATS:
            raise ValueError(f"a result is written as {', '.join(FORMATS)}, not as `{path.suffix}`")
        written = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        try:
            self._write(written)
            os.replace(written, path)
        finally:
            written.unlink(missing_ok=True)

    def _write(self, path: Path) -> None:
        if path.suffix in (".json", ".csv"):
            text = self.json + "\n" if path.suffix == ".json" else self.csv
            path.write_text(text, encoding="utf-8", newline="")
        elif path.suffix == ".svg":
            self.plot().save(path)
        elif path.suffix == ".parquet":
            import pyarrow.parquet

            pyarrow.parquet.write_table(self.to_arrow(), path)
        elif path.suffix == ".nc":
            table = self.to_xarray()
            try:
                table.to_netcdf(path)
            except UnicodeEncodeError:
                # Files of version 3, which are written where the library of version 4 is missing.
                table.rename(_plain_names([*table.variables, *table.dims])).to_netcdf(path)
        else:
            import scipy.io

            plain = _plain_names(["time", *self._values])
            rows = {"time": self.time, **self._values}
            scipy.io.savemat(path, {plain[name]: values for name, values in rows.items()})

    def plot(self, *names: str, ax: Any = None) -> Any:
        """Its figure, as `nsdc run --plot` draws it; with `names` or `ax`, lines of matplotlib: the axes."""
        if not names and ax is None:
            return Figure(self._svg)
        import matplotlib.pyplot

        ax = matplotlib.pyplot.gca() if ax is None else ax
        for name in names or self.names:
            values = self[name].reshape(len(self.time), -1)
            labels = entries(name, self[name].shape[1:])
            ax.plot(self.time, values, label=labels if len(labels) > 1 else labels[0])
        ax.set_xlabel("time")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        size = f"{len(self.time)} rows of {', '.join(self.names)}"
        return f"<{self._experiment.name}: {self.status}, {size}, {len(self.events)} events>"

    def _repr_html_(self) -> str:
        folded = html.escape(self.report)
        opened = "" if self.ok else " open"
        told = html.escape(self._messages[1])
        report = f"<details{opened}><summary>report</summary><pre>{folded}{told}</pre></details>"
        return f"<div>{self._svg}{report}</div>"
