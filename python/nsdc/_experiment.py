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
from ._controller import Controller
from ._function import Function, Pullback, Values
from ._quantities import (
    ENTRY, Quantities, Quantity, both, by_name, count, entry, finite, flag, given, names, real
)
from ._result import Result

if TYPE_CHECKING:
    from ._file import File
    from ._sweep import Sweep

#: What else runs and sweeps take by name.
KEYWORDS = ("params", "settings", "sensitivities", "one_sided", "time_limit", "multipliers", "outputs", "zip", "threads", "seed", "on", "chunk")
#: The settings that a run takes by name, with the words of the language.
SETTINGS = {
    "method": "method",
    "horizon": "horizon",
    "tolerance": "tolerance",
    "every": "output every",
    "at": "output at",
}

#: How many characters a setting in words may have: instants become such.
LONGEST = 1 << 20


class Experiment:
    """An experiment of a file: what `simulate`, `optimize`, `fit` or `mpc` says.

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
        """`simulate`, `optimize`, `fit` or `mpc`."""
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
        settings: Mapping[str, Any] | None,
        time_limit: float | None,
    ) -> _core.Asked:
        """What is asked of a run by name: values, and settings, which are also those among the values that are no names."""
        words, rest = dict(by_name("settings", {} if settings is None else settings)), []
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
        if words.get("every") is not None and words.get("at") is not None:
            raise TypeError("every, at: rows are at multiples of a time or at instants, not both")
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
        sensitivities: Sequence[str] = (),
        one_sided: bool = False,
        time_limit: float | None = None,
        multipliers: bool = False,
        **values: Any,
    ) -> Result:
        """Runs it.

        Keywords are names of parameters, initial values and inputs, with numbers or arrays of their shapes, and the settings
        `method` ("event", "fesd { steps = 20; }"), `horizon`, `tolerance`, `every` and `at`, the instants of rows, with numbers
        or with words of the language. `params` takes names that are no keywords, such as `motor.k` or `x[2]`, and `settings`
        those that are also names of the model. `time_limit` is in seconds.
        With `multipliers`, the result keeps those of the method. `sensitivities` names parameters and states, whole or by
        entry: by these parameters, and by the initial values of these states, the run is differentiated, see `Result.grad`.
        Where a run has no derivative by one of them, `one_sided` adds those from below and from above.

        What a simulation is compiled to is kept: further runs of the thread with the same settings and values on the same
        sides of zero compile nothing, nor do those with another `tolerance` as a number. What comes of a run depends on its own
        values alone.

        A run that fails is a result whose `status` says so. `ModelError` where the experiment does not compile, `TypeError`
        for unknown names and for what is no number, `ValueError` for wrong shapes and for numbers that are not finite.
        """
        asked = self._asked(both(values, params), settings, time_limit)
        sides = " one_sided" if flag("one_sided", one_sided) else ""
        return self._run(asked, names("sensitivities", sensitivities), flag("multipliers", multipliers), sides=sides)

    def _run(
        self,
        asked: _core.Asked,
        sensitivities: Sequence[str],
        multipliers: bool = False,
        weights: list[tuple[str, list[float]]] | None = None,
        sides: str = "",
    ) -> Result:
        if len(sensitivities):
            statement = ("sensitivities", self._sensitivity(sensitivities) + sides)
            asked = {**asked, "settings": [*asked["settings"], statement]}
        # A figure of an optimum, or of a fit, has what was found.
        is_drawn = self.kind != "simulate"
        run = self.file._project.run(self.name, asked, weights, (multipliers, is_drawn))
        return Result(run, self, asked)

    def _sensitivity(self, by: Sequence[str]) -> str:
        """The statement that asks for derivatives by parameters and by initial values."""
        known = {**self.parameters, **self.states}

        def sensed(name: str) -> str:
            plain = name.removesuffix(" at 0")
            is_start = plain != name
            if plain not in known:
                plain = entry(known, plain, kind="parameter or initial value")
            is_start |= ENTRY.sub(r"\g<base>", plain) in self.states
            return f"{plain} at 0" if is_start else plain

        return f"sensitivity to {', '.join(map(sensed, by))}"

    def prepare(self, **values: Any) -> Experiment:
        """Compiles it for runs that give these values, as the first of them would; the experiment itself."""
        self.run(**{"time_limit": 0, **values})
        return self

    def function(
        self,
        by: Sequence[str],
        of: Sequence[str] | None = None,
        at: ArrayLike | None = None,
        **asked: Any,
    ) -> Function:
        """Its states, outputs and controls as a function of parameters and initial values, with derivatives: see `Function`.

        `by` names parameters and states, whole or by entry, and `of` what the function gives, all that is reported without it:
        at the end, or at the m instants `at`, behind what jumps there. The rest is as for `run`, and holds whenever the
        function is called, but for what it is given then.
        """
        return Function(self, by, of, at, **asked)

    def controller(
        self,
        sample: float,
        deadline: float | None = None,
        *,
        params: Mapping[str, ArrayLike] | None = None,
        **values: Any,
    ) -> Controller:
        """An `optimize` experiment as a controller, which is solved from one state after another: see `Controller`.

        `sample` is the time from one plan to the next, and `deadline` how long a solve may take, in seconds; values of
        parameters hold in all plans, unless a step gives others.
        """
        return Controller(self, sample, deadline, given(self.parameters, both(values, params)))

    def vjp(
        self,
        by: Sequence[str],
        of: Sequence[str] | None = None,
        at: ArrayLike | None = None,
        **asked: Any,
    ) -> tuple[Values, Pullback]:
        """The values of `function` where parameters and initial values are as the experiment or `asked` has them, and a
        function that takes a sensitivity of something to these values, by name, to its gradient by what `by` names: in one
        pass back through a run, whose time hardly grows with the number of these.

        >>> import nsdc
        >>> decay = nsdc.loads("model m { param k = 1; state x = 2; x' = -k*x; } simulate d of m { horizon 1; }")["d"]
        >>> values, pull = decay.vjp(["k", "x"])
        >>> {name: round(float(one), 9) for name, one in pull({"x": 1}).items()}
        {'k': -0.735758882, 'x': 0.367879441}
        """
        return self.function(by, of, at, **asked).vjp({})

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
        axes, rest = _sweep.split(self._known, both(values, params), known)
        asked = self._asked(rest, settings, time_limit)
        plan = _sweep.Plan(self, asked, axes, flag("zip", zip), count("seed", seed, 0))
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
        found = given(self._known, both(values, params))
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


def _setting(name: str, value: Any) -> float | str:
    """A setting as a number, or in the words of the language."""
    if isinstance(value, str):
        return value
    if name == "at":
        numbers = real(name, value)
        if numbers.ndim != 1 or not len(numbers):
            raise ValueError(f"at: expected instants, got an array of shape {numbers.shape}")
        told = f"[{', '.join(map(repr, finite(name, numbers, numbers.shape).tolist()))}]"
        if len(told) > LONGEST:
            raise ValueError(f"at: {len(numbers)} instants are too many for rows; `r(t)` has the states at any number of them")
        return told
    try:
        is_number = real(name, value).ndim == 0
    except TypeError:
        is_number = False
    if not is_number:
        raise TypeError(f"{name}: expected a number or words of the language, got {value!r}")
    return float(finite(name, value, ())[0])
