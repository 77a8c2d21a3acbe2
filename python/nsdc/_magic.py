"""`%%nsd`: a cell of a notebook that is a file of models and experiments."""

from __future__ import annotations

import keyword
import sys
from typing import Any

from ._errors import ModelError, diagnostics
from ._file import loads

USAGE = "`%%nsd NAME [EXPERIMENT]` takes the name that the file gets, and an experiment that is run"


class CellError(ModelError):
    """What is wrong in a cell, which is shown as a terminal shows it, without lines of Python."""

    def _render_traceback_(self) -> list[str]:
        return self.rendered.splitlines()


def load_ipython_extension(shell: Any) -> None:
    """What `%load_ext nsdc` does: cells that begin with `%%nsd NAME` are files of models and experiments.

    The file is `NAME` from then on. With `%%nsd NAME EXPERIMENT`, the experiment is run and its result is shown.
    What is wrong in the cell ends it, and is shown with its line; warnings are shown, too.

    >>> from IPython.core.interactiveshell import InteractiveShell
    >>> shell = InteractiveShell()
    >>> shell.run_line_magic("load_ext", "nsdc")
    >>> rest = "model rest { state x = 1; x' = 0; } simulate still of rest { horizon 1; }"
    >>> shell.run_cell_magic("nsd", "resting still", rest).status
    'solved'
    >>> list(shell.user_ns["resting"])
    ['still']
    """

    def nsd(line: str, cell: str) -> Any:
        from IPython.core.error import UsageError

        name, *rest = line.split() or [""]
        if not name.isidentifier() or keyword.iskeyword(name) or len(rest) > 1:
            raise UsageError(USAGE)
        file = loads(cell, f"{name}.nsd")
        found, rendered = file._project.check()
        said = diagnostics(found)
        if any(one.severity == "error" for one in said):
            raise CellError(said, rendered)
        shell.user_ns[name] = file
        _tell(rendered)
        if not rest:
            return file
        try:
            experiment = file[rest[0]]
        except KeyError as error:
            raise UsageError(error.args[0]) from None
        try:
            result = experiment.run()
        except ModelError as error:
            raise CellError(error.diagnostics, error.rendered) from None
        known = {(one.code, one.message) for one in said}
        if any((one.code, one.message) not in known for one in result.warnings):
            _tell(result._messages[1])
        return result

    nsd.__doc__ = USAGE
    shell.register_magic_function(nsd, "cell", "nsd")
    _colour(shell)


def _colour(shell: Any) -> None:
    """Gives such cells the colours of the language, where they are typed in a terminal."""
    lexer: Any = getattr(getattr(shell, "pt_app", None), "lexer", None)
    if hasattr(lexer, "magic_lexers"):
        from prompt_toolkit.lexers import PygmentsLexer

        from .highlight import CellLexer

        lexer.magic_lexers["nsd"] = PygmentsLexer(CellLexer)


def _tell(rendered: str) -> None:
    if rendered:
        print(rendered, file=sys.stderr)
