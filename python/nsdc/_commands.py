"""Commands of the command line on a file in memory."""

from __future__ import annotations

import html
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
    """A command has ended with an exit code that is no success; `text` is what it has printed."""

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

    def _repr_latex_(self) -> str | None:
        """What a notebook typesets; none of other forms."""
        if self.ir != "tex":
            return None
        formulas = re.findall(r"\\\[(.*?)\\\]|\$\$(.*?)\$\$", self, flags=re.DOTALL)
        body = "\n".join("$$" + "".join(formula) + "$$" for formula in formulas)
        return body or f"$${self}$$"


class Report(str):
    """What a command prints, with its figures by name; the first one shows itself in a notebook."""

    figures: dict[str, Figure]

    def __new__(cls, text: str, figures: dict[str, Figure]) -> Report:
        made = super().__new__(cls, text)
        made.figures = figures
        return made

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
        return Report(out.decode(errors="replace"), drawn_figures)


def _written(file: File, folder: Path) -> Path:
    """The path of a file for commands: that of the disk, or a copy in a folder."""
    if file._is_disk and not file._is_pickled:
        return Path(file.path)
    for name, content in file._project.files():
        place = folder / name.lstrip("/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    return folder / file.path.lstrip("/")


def order(experiment: Experiment, *options: str) -> Report:
    """`nsdc order`: the errors of the methods over their steps, with figures of errors over steps and over time."""
    return report(experiment.file, "order", experiment.name, *options, plot="order")


def modes(
    experiment: Experiment, over: Mapping[str, tuple[float, float]], *options: str
) -> Report:
    """`nsdc modes`: the sliding modes of a nonlinear switch over one state or two, with the figure."""
    ranges = [f"--over={name}={low!r}:{high!r}" for name, (low, high) in over.items()]
    return report(experiment.file, "modes", experiment.name, *ranges, *options, plot="modes.svg")


def verify(experiment: Experiment, *options: str) -> str:
    """`nsdc verify`: whether all methods and lowerings agree on it."""
    return command(experiment.file, "verify", experiment.name, *options)
