"""What is wrong with a model, or with a run."""

from __future__ import annotations

import html
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._result import Result


@dataclass(frozen=True)
class Span:
    """A place in a file; lines and columns are counted from 1, bytes of the text from 0.

    >>> import nsdc
    >>> (error,) = nsdc.check("model fall { state v = 0; v' = -g; }")
    >>> str(error.span), (error.span.start, error.span.end)
    ('text.nsd:1:33', (32, 33))
    """

    file: str
    start: int
    end: int
    line: int
    column: int
    end_line: int
    end_column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Edit:
    """A piece of text in the place of another; of no length where text is inserted.

    >>> import nsdc
    >>> (error,) = nsdc.check("model decay { param rate = 1; state x = 1; x' = -rte*x; }")
    >>> [(edit.span.column, edit.replacement) for edit in error.fixes[0].edits]
    [(50, 'rate')]
    """

    span: Span
    replacement: str


@dataclass(frozen=True)
class Fix:
    """Edits that mend what a diagnostic is about.

    >>> import nsdc
    >>> (error,) = nsdc.check("model decay { param rate = 1; state x = 1; x' = -rte*x; }")
    >>> len(error.fixes), error.fixes[0].is_safe
    (1, False)
    """

    title: str
    #: Whether they may be made without being looked at.
    is_safe: bool
    edits: tuple[Edit, ...]


@dataclass(frozen=True)
class Diagnostic:
    """An error or a warning, with its place.

    >>> import nsdc
    >>> (error,) = nsdc.check("model fall { state v = 0; v' = -g; }")
    >>> error.code, error.severity, error.message
    ('E0101', 'error', 'unknown name `g`')
    """

    #: The code that `nsdc.explain` has a page for, such as `E0101`.
    code: str | None
    #: `error` or `warning`.
    severity: str
    #: What is wrong.
    message: str
    #: Where; none where it is about no place.
    span: Span | None
    #: What to do about it.
    help: str | None
    #: Edits that do so, where these are known.
    fixes: tuple[Fix, ...]

    def __str__(self) -> str:
        place = "" if self.span is None else f"{self.span}: "
        code = "" if self.code is None else f" {self.code}"
        return f"{place}{self.severity}{code}: {self.message}"


def _span(place: dict[str, Any]) -> Span:
    return Span(**{name: place[name] for name in Span.__dataclass_fields__})


def _fix(fix: dict[str, Any]) -> Fix:
    edits = tuple(Edit(_span(edit), edit["replacement"]) for edit in fix["edits"])
    return Fix(fix["title"], fix["applicability"] == "safe", edits)


def diagnostics(text: str) -> list[Diagnostic]:
    """Those of a list in the fields of `nsdc check --json`."""
    found = []
    for message in json.loads(text):
        labels = message["labels"]
        primary = next((label for label in labels if label["is_primary"]), None)
        found.append(
            Diagnostic(
                code=message["code"],
                severity=message["severity"],
                message=message["message"],
                span=None if primary is None else _span(primary),
                help=message["help"],
                fixes=() if message["fix"] is None else (_fix(message["fix"]),),
            )
        )
    return found


class ModelError(Exception):
    """A model or an experiment cannot be run as it stands.

    As text it is what a terminal shows, with the line of the model; in a notebook, too.

    >>> import nsdc
    >>> try:
    ...     nsdc.loads("model fall { state v = 0; v' = -g; } simulate s of fall { horizon 1; }")["s"].run()
    ... except nsdc.ModelError as error:
    ...     print(error.code, error.span.line, error.diagnostics[0].message)
    E0101 1 unknown name `g`
    """

    def __init__(self, diagnostics: list[Diagnostic], rendered: str) -> None:
        super().__init__(diagnostics, rendered)
        #: All that there is to say.
        self.diagnostics = diagnostics
        #: As a terminal shows it.
        self.rendered = rendered

    @classmethod
    def _of(cls, text: str, rendered: str) -> ModelError:
        return cls(diagnostics(text), rendered)

    def _first(self) -> Diagnostic | None:
        errors = [one for one in self.diagnostics if one.severity == "error"]
        return next(iter(errors or self.diagnostics), None)

    @property
    def code(self) -> str | None:
        """The code of the first error."""
        first = self._first()
        return None if first is None else first.code

    @property
    def span(self) -> Span | None:
        """The place of the first error."""
        first = self._first()
        return None if first is None else first.span

    @property
    def help(self) -> str | None:
        """What to do about the first error."""
        first = self._first()
        return None if first is None else first.help

    @property
    def fixes(self) -> tuple[Fix, ...]:
        """Edits that mend the first error."""
        first = self._first()
        return () if first is None else first.fixes

    def __str__(self) -> str:
        return "\n" + self.rendered.rstrip("\n")

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.rendered)}</pre>"


class InternalError(RuntimeError):
    """A mistake of nsdc itself, as text; models, experiments and results stay as they are.

    >>> import nsdc
    >>> issubclass(nsdc.InternalError, RuntimeError)
    True
    """


class DerivativeError(RuntimeError):
    """A run has no derivative, or none that is known, where one is needed; `result` is what it came to.

    >>> import nsdc
    >>> rests = nsdc.loads("model m { state x = 0; x' = -sign(x); } simulate s of m { horizon 1; }")["s"]
    >>> _, pull = rests.vjp(["x"])
    >>> try:
    ...     pull({"x": 1})
    ... except nsdc.DerivativeError as error:
    ...     print(error.result.status, error.result.warnings[0].code)
    solved W0735
    """

    def __init__(self, result: Result, why: str | None = None) -> None:
        super().__init__(result, why)
        self.result = result
        self._why = why

    def __str__(self) -> str:
        if self._why is not None:
            return self._why
        lost = [str(one) for one in self.result.warnings if one.code == "W0735"]
        return "\n".join(lost) or "an output has no derivative at an instant that is asked for"


class RunError(RuntimeError):
    """A run did not end as `solved`; `result` is what it came to.

    >>> import nsdc
    >>> grows = nsdc.loads("model m { state x = 1; x' = x^2; } simulate s of m { horizon 2; }")["s"]
    >>> try:
    ...     grows.run().raise_for_status()
    ... except nsdc.RunError as error:
    ...     print(error.result.status, error.result.time[-1] < 1.001)
    numerical_failure True
    """

    def __init__(self, result: Result) -> None:
        super().__init__(result)
        self.result = result

    def __str__(self) -> str:
        return f"{self.result.status}\n{self.result.report}"
