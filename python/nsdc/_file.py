"""A file of models and experiments."""

from __future__ import annotations

import difflib
import html
import os
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from . import _core
from ._errors import Diagnostic, diagnostics
from ._experiment import Experiment
from ._quantities import named


class File:
    """A file of models and experiments, with what it uses; `file["name"]` is an experiment of it.

    It can be pickled: it has all that has been read with it.

    >>> import nsdc
    >>> file = nsdc.loads("model rest { state x = 1; x' = 0; } simulate r of rest { horizon 1; }")
    >>> list(file), file.models
    (['r'], ['rest'])
    >>> file["s"]
    Traceback (most recent call last):
    KeyError: 'there is no experiment `s`; did you mean `r`?'
    """

    def __init__(self, path: str, files: list[tuple[str, bytes]], is_disk: bool) -> None:
        #: Its path, or its name.
        self.path = path
        self._is_disk = is_disk
        self._project = _core.Project(path, files, is_disk)
        self._experiments: dict[str, Experiment] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.path, tuple(self._project.files()), self._is_disk)

    @property
    def models(self) -> list[str]:
        """The names of its models."""
        return self._project.models()

    @property
    def experiments(self) -> Mapping[str, Experiment]:
        """Its experiments by name, in order."""
        return {name: self._made(name) for name in self._project.experiments()}

    def _made(self, name: str) -> Experiment:
        return self._experiments.setdefault(name, Experiment(self, name))

    def __iter__(self) -> Iterator[str]:
        return iter(self._project.experiments())

    def __len__(self) -> int:
        return len(self._project.experiments())

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and named("name", name) in self._project.experiments()

    def __getitem__(self, name: str) -> Experiment:
        known, name = self._project.experiments(), named("name", name)
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.0 if len(known) == 1 else 0.6)
            there = f"there are {', '.join(known)}" if known else "the file has none"
            help = f"did you mean `{close[0]}`?" if close else there
            raise KeyError(f"there is no experiment `{name}`; {help}")
        return self._made(name)

    def check(self) -> list[Diagnostic]:
        """What is wrong with its models and experiments, without a run."""
        return diagnostics(self._project.check()[0])

    def __repr__(self) -> str:
        return f"<{self.path}: {', '.join(map(repr, self.experiments.values())) or 'no experiment'}>"

    def _repr_html_(self) -> str:
        messages = self._project.check()[1]
        told = f"<pre>{html.escape(messages)}</pre>" if messages else ""
        rows = "".join(f"<li>{html.escape(name)}</li>" for name in self)
        text = dict(self._project.files())[self.path].decode(errors="replace")
        shown = f"<details><summary>text</summary>{_coloured(text)}</details>"
        return f"<b>{html.escape(self.path)}</b><ul>{rows}</ul>{told}{shown}"


def _coloured(text: str) -> str:
    """A text as HTML, in the colours of the language where Pygments is installed; Jupyter needs it itself."""
    try:
        from pygments import highlight
        from pygments.formatters import HtmlFormatter
    except ImportError:
        return f"<pre>{html.escape(text)}</pre>"
    from .highlight import NsdLexer

    # A page may be dark, and has no classes of Pygments.
    return str(highlight(text, NsdLexer(), HtmlFormatter(noclasses=True, cssstyles="color: black")))


@lru_cache(maxsize=16)
def _restored(path: str, files: tuple[tuple[str, bytes], ...], is_disk: bool) -> File:
    """A file that was pickled: once for all copies in a process, as those of the tasks of a worker."""
    return File(path, list(files), is_disk)


def load(path: str | os.PathLike[str]) -> File:
    """A file of the disk, with what it uses. `OSError` where it cannot be read; what is wrong in it comes with `check` and
    with runs.

    >>> import nsdc, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "rest.nsd"
    ...     _ = path.write_text("model rest { state x = 1; x' = 0; } simulate r of rest { horizon 1; }")
    ...     list(nsdc.load(path))
    ['r']
    """
    return File(os.fspath(path), [], True)


def loads(
    text: str, name: str = "text.nsd", files: Mapping[str, str | bytes] | None = None
) -> File:
    """A text, which has this name in diagnostics, with the files that it may use by their paths beside it.

    >>> import nsdc
    >>> parts = {"parts/decay.nsd": "model decay { state x = 1; x' = -x; }"}
    >>> text = "use ./parts/decay.{decay}; simulate d of decay { horizon 1; }"
    >>> nsdc.loads(text, files=parts)["d"].run().status
    'solved'
    """
    if not isinstance(text, str):
        raise TypeError(f"text: expected a text, got {text!r}")
    given = {**(files or {}), name: text}
    return File(name, [(name, _encoded(name, text)) for name, text in given.items()], False)


def _encoded(name: str, content: Any) -> bytes:
    if not isinstance(content, (str, bytes, bytearray)):
        raise TypeError(f"files: expected a text or bytes as `{name}`, got {content!r}")
    return content.encode() if isinstance(content, str) else bytes(content)


def check(text: str, name: str = "text.nsd") -> list[Diagnostic]:
    """What is wrong with a text, without a run.

    >>> import nsdc
    >>> [str(one) for one in nsdc.check("model fall { state v = 0; v' = -g; }")]
    ['text.nsd:1:33: error E0101: unknown name `g`']
    """
    return loads(text, name).check()


def explain(code: str) -> str:
    """The page of a code, with an example and what to do about it. `KeyError` where there is no such code.

    >>> import nsdc
    >>> "unknown name" in nsdc.explain("E0101")
    True
    """
    return _core.explain(code)
