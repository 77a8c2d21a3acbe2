"""Commands of the command line on a file in memory."""

from __future__ import annotations

import html
import os
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from . import _core
from ._figure import Figure

if TYPE_CHECKING:
    from ._experiment import Experiment
    from ._file import File


class CommandError(RuntimeError):
    """A command has nothing to say but what is wrong: `code` is its exit code, `text` what it has printed.

    >>> import nsdc
    >>> rest = nsdc.loads("model rest { state x = 1; x' = 0; } simulate r of rest { horizon 1; }")["r"]
    >>> try:
    ...     rest.emit("mosel")
    ... except nsdc.CommandError as error:
    ...     print(error.code, "mosel" in error.text)
    64 True
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(code, text)
        self.code = code
        self.text = text

    def __str__(self) -> str:
        return self.text


class Emitted(str):
    """A form of a model as text; TeX shows itself as mathematics."""

    ir: str

    def __new__(cls, text: str, ir: str) -> Emitted:
        made = super().__new__(cls, text)
        made.ir = ir
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return str(self), self.ir

    def _repr_latex_(self) -> str | None:
        """What a notebook typesets; none of other forms."""
        if self.ir != "tex":
            return None
        formulas = re.findall(r"\\\[(.*?)\\\]|\$\$(.*?)\$\$", self, flags=re.DOTALL)
        body = "\n".join("$$" + "".join(formula) + "$$" for formula in formulas)
        return body or f"$${self}$$"


class Report(str):
    """What a command prints, with its figures by name, which show themselves in a notebook."""

    figures: dict[str, Figure]
    #: Whether the exit code of the command was that of success.
    ok: bool

    def __new__(cls, text: str, figures: dict[str, Figure], ok: bool) -> Report:
        made = super().__new__(cls, text)
        made.figures, made.ok = figures, ok
        return made

    def __getnewargs__(self) -> tuple[str, dict[str, Figure], bool]:  # type: ignore[override]
        return str(self), self.figures, self.ok

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        figures = "".join(figure.svg for figure in self.figures.values())
        return f"<div>{figures}<pre>{html.escape(self)}</pre></div>"


def command(file: File, name: str, *args: str) -> str:
    """What a command prints about a file; `CommandError` where it fails."""
    return str(report(file, name, *args))


def report(file: File, name: str, *args: str, plot: str | None = None) -> Report:
    """What a command prints about a file, with the figures that it writes for `--plot` and this name."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        drawn = [] if plot is None else [f"--plot={place / plot}"]
        line = ["nsdc", name, str(_written(file, place)), *args, *drawn]
        code, out, err = _core.main(line, True, False, False, 100)
        if not out:
            raise CommandError(code, err.decode(errors="replace").replace(f"{folder}/", ""))
        figures = {path.stem: path.read_text(encoding="utf-8") for path in sorted(place.glob("*.svg"))}
        drawn_figures = {stem: Figure(svg) for stem, svg in figures.items()}
        return Report(out.decode(errors="replace"), drawn_figures, code == 0)


def _written(file: File, folder: Path) -> Path:
    """The path of a copy of a file, as it was read, with what it uses, in a folder."""
    # Folders above it stay within.
    inner = folder.joinpath(*["_"] * 16)

    def place(name: str) -> Path:
        path = Path(os.path.normpath(inner / name.lstrip("/")))
        if not path.is_relative_to(folder) or path == inner:
            raise ValueError(f"`{name}` is no name of a file beside others")
        return path

    for name, content in file._project.files():
        path = place(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return place(file.path)


def order(experiment: Experiment, *options: str) -> Report:
    """`nsdc order`: the errors of the methods over their steps, with figures of errors over steps and over time.

    `options` are those of the command line. `CommandError` where the experiment does not compile, or has no reference.

    >>> import nsdc
    >>> text = "model decay { state x = 1; x' = -x; } simulate d of decay { horizon 1; method fesd { steps = 4; } }"
    >>> report = nsdc.order(nsdc.loads(text)["d"])
    >>> report.ok, [figure.svg[:4] for figure in report.figures.values()]
    (True, ['<svg', '<svg'])
    """
    return report(experiment.file, "order", experiment.name, *options, plot="order")


def modes(
    experiment: Experiment, over: Mapping[str, tuple[float, float]], *options: str
) -> Report:
    """`nsdc modes`: the sliding modes of a nonlinear switch over one state or two, with the figure.

    `over` has the least and the largest value of each by the names of entries, in the units of the states; `options` are
    those of the command line. `CommandError` where the experiment does not compile, or has no such switch.

    >>> import nsdc
    >>> file = nsdc.loads('''
    ...     model hidden {
    ...       state x = 0.9; state y = 0.05;
    ...       switch s = sign(y) sliding nonlinear;
    ...       x' = 2*s^2 - 1; y' = 2*s^2 - s - x;
    ...     }
    ...     simulate slides of hidden { horizon 1; }''')
    >>> report = nsdc.modes(file["slides"], over={"x": (-1, 4)})
    >>> report.ok, list(report.figures)
    (True, ['modes'])
    """
    ranges = [f"--over={name}={low!r}:{high!r}" for name, (low, high) in over.items()]
    return report(experiment.file, "modes", experiment.name, *ranges, *options, plot="modes.svg")


def verify(experiment: Experiment, *options: str) -> Report:
    """`nsdc verify`: whether all methods and lowerings agree on it; `ok` says so.

    `options` are those of the command line. `CommandError` where the experiment does not compile.

    >>> import nsdc
    >>> nsdc.verify(nsdc.loads("model rest { state x = 1; x' = -x; } simulate r of rest { horizon 1; }")["r"]).ok
    True
    """
    return report(experiment.file, "verify", experiment.name, *options)
