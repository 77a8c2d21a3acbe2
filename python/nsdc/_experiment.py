"""An experiment of a file."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from . import _core, _sweep
from ._commands import Emitted, command
from ._quantities import Quantities, Quantity, count, finite, given
from ._result import Result

if TYPE_CHECKING:
    from ._file import File
    from ._sweep import Sweep

#: What else runs and sweeps take by name.
KEYWORDS = ("params", "settings", "time_limit", "multipliers", "outputs", "zip", "threads", "seed", "on", "chunk")
#: The settings that a run takes by name, with the words of the language.
SETTINGS = {
    "method": "method",
    "horizon": "horizon",
    "tolerance": "tolerance",
    "every": "output every",
}


class Experiment:
    """An experiment of a file: what `simulate` or `optimize` says.

    >>> import nsdc
    >>> file = nsdc.loads('''
    ...     model decay { param k : 1/s in [0, 10] = 1; state x = 1; x' = -k*x; }
    ...     simulate d of decay { horizon 1; }''')
    >>> d = file["d"]
    >>> d.parameters["k"].value, d.parameters["k"].unit, d.parameters["k"].range
    (1.0, '1/s', (0.0, 10.0))
    >>> round(d.run(k=2, x=3).end["x"], 9)
    0.40600585
    >>> d.run(kk=2)
    Traceback (most recent call last):
    TypeError: `kk` is no parameter, initial value or input; did you mean `k`?
    """

    def __init__(self, file: File, name: str) -> None:
        #: The file that it stands in.
        self.file = file
        #: Its name.
        self.name = name

    @cached_property
    def _description(self) -> dict[str, Any]:
        return dict(json.loads(self.file._project.describe(self.name)))

    @property
    def kind(self) -> str:
        """`simulate` or `optimize`."""
        return str(self._description["kind"])

    @property
    def model(self) -> str:
        """The name of its model."""
        return str(self._description["model"])

    @property
    def doc(self) -> str | None:
        """What the doc comment in front of it says."""
        return self._description["doc"]  # type: ignore[no-any-return]

    @property
    def horizon(self) -> float:
        """The end of the run; of a free horizon, its guess."""
        return float(self._description["horizon"])

    @cached_property
    def parameters(self) -> Quantities:
        """The parameters, those of parts among them, with values, ranges, units and docs."""
        return Quantities(self._description["parameters"])

    @cached_property
    def states(self) -> Quantities:
        """The states, with initial values."""
        return Quantities(self._description["states"])

    @cached_property
    def controls(self) -> Quantities:
        """The controls."""
        return Quantities(self._description["controls"])

    @cached_property
    def inputs(self) -> Quantities:
        """The inputs."""
        return Quantities(self._description["inputs"])

    @cached_property
    def outputs(self) -> Quantities:
        """The outputs."""
        return Quantities(self._description["outputs"])

    @cached_property
    def _known(self) -> dict[str, Quantity]:
        """What a run may be given."""
        return {**self.inputs, **self.controls, **self.states, **self.parameters}

    def _all(self) -> dict[str, Quantity]:
        return {**self._known, **self.outputs}

    @cached_property
    def _units(self) -> dict[str, str]:
        return {name: one.unit for name, one in self._all().items() if one.unit is not None}

    @cached_property
    def _docs(self) -> dict[str, str]:
        return {name: one.doc for name, one in self._all().items() if one.doc is not None}

    def _asked(
        self,
        values: Iterable[tuple[str, Any]],
        settings: Mapping[str, Any],
        time_limit: float | None,
    ) -> _core.Asked:
        """What is asked of a run by name: values, and settings, which are also those among the values that are no names."""
        words, rest = dict(settings), []
        for name, value in values:
            if name in SETTINGS and name not in self._known:
                if name in words:
                    raise TypeError(f"`{name}` is given twice")
                words[name] = value
            else:
                rest.append((name, value))
        for name in words:
            if name not in SETTINGS:
                raise TypeError(f"`{name}` is no setting; there are {', '.join(SETTINGS)}")
        if time_limit is not None:
            (time_limit,) = finite("time_limit", time_limit, ()).tolist()
            if time_limit < 0:
                raise ValueError(f"time_limit: {time_limit} is no time in seconds")
        told = {name: _setting(name, value) for name, value in words.items() if value is not None}
        number = told.get("tolerance")
        tolerance = number if isinstance(number, float) else None
        if tolerance is not None:
            del told["tolerance"]
        return {
            "values": given(self._known, rest, [*SETTINGS, *KEYWORDS]),
            "settings": [(name, f"{SETTINGS[name]} {one}") for name, one in told.items()],
            "tolerance": tolerance,
            "time_limit": time_limit,
        }

    def run(
        self,
        *,
        params: Mapping[str, ArrayLike] | None = None,
        settings: Mapping[str, Any] | None = None,
        time_limit: float | None = None,
        multipliers: bool = False,
        **values: Any,
    ) -> Result:
        """Runs it.

        Keywords are names of parameters, initial values and inputs, with numbers or arrays of their shapes, and the settings
        `method` ("event", "fesd { steps = 20; }"), `horizon`, `tolerance` and `every`, with numbers or with words of the
        language. `params` takes names that are no keywords, such as `motor.k` or `x[2]`, and `settings` those that are also
        names of the model. `time_limit` is in seconds.
        With `multipliers`, the result keeps those of the method.

        What a simulation is compiled to is kept: further runs of the thread with the same settings and values on the same
        sides of zero compile nothing, nor do those with another `tolerance` as a number. What comes of a run depends on its own
        values alone.

        A run that fails is a result whose `status` says so. `ModelError` where the experiment does not compile, `TypeError`
        for unknown names and for what is no number, `ValueError` for wrong shapes and for numbers that are not finite.
        """
        asked = self._asked(_both(values, params), settings or {}, time_limit)
        # A figure of an optimum, or of a fit, has what was found.
        is_drawn = self.kind != "simulate"
        run = self.file._project.run(self.name, asked, multipliers, is_drawn)
        return Result(run, self, asked)

    def prepare(self, **values: Any) -> Experiment:
        """Compiles it for runs that give these values, as the first of them would; the experiment itself."""
        self.run(**{"time_limit": 0, **values})
        return self

    def sweep(
        self,
        *,
        params: Mapping[str, ArrayLike] | None = None,
        settings: Mapping[str, Any] | None = None,
        outputs: Sequence[str] | None = None,
        zip: bool = False,
        threads: int | None = None,
        seed: int | None = None,
        time_limit: float | None = None,
        on: Any = None,
        chunk: int | None = None,
        checkpoint: str | PathLike[str] | None = None,
        progress: bool | None = None,
        **values: Any,
    ) -> Sweep:
        """Runs it at many values: see `Sweep`.

        Keywords with a list or an array in place of a number are axes, all combinations of which are run, the last one
        fastest; with `zip`, values are taken side by side. Others hold in every run, as do settings.
        `outputs` names what is kept of states and outputs at the end; all is without it.
        `seed` is that of the first run, where something is random; that of run k is larger by k.
        `time_limit` is that of each run, in seconds. `threads` is the number of runs at a time: one on every core without it.

        `on` is a `dask.distributed.Client`, or `"ray"`: runs go to the cluster in chunks of 0.5 to 1 s (`chunk` gives the
        number of runs instead). With `checkpoint`, a folder, finished chunks are Parquet files there, and the same call later
        goes on where this one has stopped. Rows are the same whatever engine, chunks and threads are.

        Runs that fail are rows. Ctrl-C keeps what is finished.
        """
        known = [*SETTINGS, *KEYWORDS]
        axes, rest = _sweep.split(self._known, _both(values, params), known)
        asked = self._asked(rest, settings or {}, time_limit)
        plan = _sweep.Plan(self, asked, axes, zip, count("seed", seed, 0))
        engine = _sweep.Engine(
            threads=count("threads", threads, 1),
            on=on,
            chunk=count("chunk", chunk, 1),
            progress=progress,
        )
        return plan.run(engine, outputs, checkpoint)

    def emit(
        self, ir: str = "system", *, params: Mapping[str, ArrayLike] | None = None, **values: Any
    ) -> Emitted:
        """A form of the lowering, as `nsdc emit --ir` prints it: `system`, `dcs`, `mpcc`, `nl`, .., or `tex`, which a notebook
        shows as mathematics; with values of parameters and initial values."""
        found = given(self._known, _both(values, params))
        sets = [f"--set={name}={value!r}" for name, value in found]
        text = command(self.file, "emit", self.name, f"--ir={ir}", *sets)
        return Emitted(text, ir)

    def __repr__(self) -> str:
        return f"<{self.kind} {self.name} of {self.model}>"

    def _repr_html_(self) -> str:
        parts = [f"<b>{html.escape(f'{self.kind} {self.name} of {self.model}')}</b>"]
        parts += [f"<p>{html.escape(self.doc)}</p>"] if self.doc else []
        for title in ("parameters", "states", "controls", "inputs", "outputs"):
            quantities: Quantities = getattr(self, title)
            parts += [f"<div>{title}{quantities._repr_html_()}</div>"] if quantities else []
        return "".join(parts)


def _both(
    values: Mapping[str, Any], params: Mapping[str, Any] | None
) -> list[tuple[str, Any]]:
    """What is given by keywords, and by names."""
    if params is not None and not isinstance(params, Mapping):
        raise TypeError(f"params: expected values by name, got {params!r}")
    return [*values.items(), *(params or {}).items()]


def _setting(name: str, value: Any) -> float | str:
    """A setting as a number, or in the words of the language."""
    if isinstance(value, str):
        return value
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number or words of the language, got {value!r}") from None
    if not abs(number) < float("inf"):
        raise ValueError(f"{name}: {value} is not finite")
    return number
