"""Commands of the command line on a file in memory."""

from __future__ import annotations

import re
import tempfile
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
    """What a command prints, with its figure."""

    figure: Figure | None

    def __new__(cls, text: str, figure: Figure | None) -> Report:
        made = super().__new__(cls, text)
        made.figure = figure
        return made

    def __repr__(self) -> str:
        return str(self)

    def _repr_svg_(self) -> str | None:
        return None if self.figure is None else self.figure.svg


def command(file: File, name: str, *args: str, plot: bool = False) -> str:
    """What a command prints about a file; `CommandError` where it fails."""
    return _ran(file, name, list(args), plot)[0]


def report(file: File, name: str, *args: str) -> Report:
    """What a command prints about a file, with its figure."""
    text, svg = _ran(file, name, list(args), True)
    return Report(text, None if svg is None else Figure(svg))


def _ran(file: File, name: str, args: list[str], plot: bool) -> tuple[str, str | None]:
    with tempfile.TemporaryDirectory() as folder:
        path = _written(file, Path(folder))
        figure = Path(folder) / "figure.svg"
        drawn = [f"--plot={figure}"] if plot else []
        line = ["nsdc", name, str(path), *args, *drawn]
        code, out, err = _core.main(line, True, False, False, 100)
        text = out.decode(errors="replace")
        if code not in (0, 1) or not text:
            raise CommandError(code, err.decode(errors="replace").replace(f"{folder}/", ""))
        return text, figure.read_text(encoding="utf-8") if figure.exists() else None


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
    """`nsdc order`: the error of an experiment over its step, with the figure."""
    return report(experiment.file, "order", experiment.name, *options)


def modes(experiment: Experiment, *options: str) -> Report:
    """`nsdc modes`: its sliding modes, with the figure."""
    return report(experiment.file, "modes", experiment.name, *options)


def verify(experiment: Experiment, *options: str) -> str:
    """`nsdc verify`: whether all methods and lowerings agree on it."""
    return command(experiment.file, "verify", experiment.name, *options)
