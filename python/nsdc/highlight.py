"""Colours of the language for Pygments, and so for Sphinx and for notebooks that become pages.

They are those of editors: `nsd.tmLanguage.json` is a grammar of TextMate, and here is what reads it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from typing import Any, NamedTuple

from pygments.lexer import Lexer
from pygments.token import (
    Comment,
    Keyword,
    Name,
    Number,
    Operator,
    Punctuation,
    String,
    Text,
    _TokenType,
)

#: What scopes are, the first that a scope begins with.
KINDS = {
    "comment.line.documentation": String.Doc,
    "comment": Comment.Single,
    "string": String,
    "constant.numeric": Number,
    "constant.language": Keyword.Constant,
    "support.type.unit": Name.Decorator,
    "support.function": Name.Builtin,
    "support.constant": Name.Constant,
    "keyword.operator": Operator,
    "keyword.control.import": Keyword.Namespace,
    "keyword": Keyword,
    "storage": Keyword.Declaration,
    "entity.name.type": Name.Class,
    "entity.name.function": Name.Function,
    "variable.other.member": Name.Attribute,
    "variable": Name,
    "punctuation": Punctuation,
}


def _kind(scope: str | None, outside: _TokenType) -> _TokenType:
    found = (kind for prefix, kind in KINDS.items() if scope and scope.startswith(prefix))
    return next(found, outside)


Captures = dict[int, "Rule"]


class Rule:
    """A rule of the grammar: what it matches, or begins and ends with, what may stand inside, and how that is called."""

    def __init__(self, grammar: Grammar, rule: dict[str, Any]) -> None:
        self._grammar = grammar
        self._patterns = rule.get("patterns", [])
        self._inside: list[Rule] | None = None
        self.kind = _kind(rule.get("name"), Text)
        begin = rule.get("match") or rule.get("begin")
        self.begin = re.compile(begin) if begin else None
        self.end = re.compile(rule["end"]) if "end" in rule else None
        self.is_last = bool(rule.get("applyEndPatternLast"))
        self.begun = self._captures(rule.get("captures") or rule.get("beginCaptures") or {})
        self.ended = self._captures(rule.get("endCaptures") or {})

    def _captures(self, captures: dict[str, Any]) -> Captures:
        return {int(number): Rule(self._grammar, rule) for number, rule in captures.items()}

    @property
    def inside(self) -> list[Rule]:
        """The rules that may begin inside, in order."""
        if self._inside is None:
            found = []
            for pattern in self._patterns:
                rule = self._grammar.rule(pattern)
                found += [rule] if rule.begin else rule.inside
            self._inside = found
        return self._inside


class Grammar:
    """A grammar of TextMate, as far as that of the language needs it."""

    def __init__(self, text: str) -> None:
        described = json.loads(text)
        self._described = described["repository"]
        self._known: dict[str, Rule] = {}
        self.root = Rule(self, {"patterns": described["patterns"]})

    def rule(self, pattern: dict[str, Any]) -> Rule:
        """A rule by its name, or as it stands."""
        if "include" not in pattern:
            return Rule(self, pattern)
        name = pattern["include"].removeprefix("#")
        if name not in self._known:
            self._known[name] = Rule(self, self._described[name])
        return self._known[name]


class Found(NamedTuple):
    """A place where a rule begins, or where the innermost one ends."""

    match: re.Match[str]
    rule: Rule
    is_end: bool


class Line:
    """A piece of text up to an end, with the next match of each pattern, which stays the next one until it is passed."""

    def __init__(self, text: str, end: int) -> None:
        self.text = text
        self.end = end
        self._found: dict[re.Pattern[str], re.Match[str] | None] = {}

    def search(self, pattern: re.Pattern[str], at: int) -> re.Match[str] | None:
        """The first match that begins here or later; places are asked for from left to right."""
        found = self._found.get(pattern)
        if pattern not in self._found or (found and found.start() < at):
            found = self._found[pattern] = self._seek(pattern, at)
        return found

    def _seek(self, pattern: re.Pattern[str], at: int) -> re.Match[str] | None:
        return pattern.search(self.text, at, self.end)


def _next(line: Line, at: int, stack: list[Rule]) -> Found | None:
    """What comes first; of several at one place, the one that stands first."""
    top = stack[-1]
    candidates = [(rule.begin, rule, False) for rule in top.inside]
    if top.end:
        candidates.insert(len(candidates) if top.is_last else 0, (top.end, top, True))
    best: Found | None = None
    for pattern, rule, is_end in candidates:
        match = line.search(pattern, at) if pattern else None
        if match and (best is None or match.start() < best.match.start()):
            best = Found(match, rule, is_end)
            if match.start() == at:
                break
    return best


Piece = tuple[int, int, _TokenType]


def _captured(match: re.Match[str], captures: Captures, kind: _TokenType) -> Iterator[Piece]:
    """The groups of a match, and what is between them."""
    at = match.start()
    for number, rule in captures.items():
        start, end = match.span(number)
        if start < at:
            continue
        yield at, start, kind
        if rule.inside:
            yield from _pieces(Line(match.string, end), start, [rule])
        else:
            yield start, end, rule.kind
        at = end
    yield at, match.end(), kind


def _pieces(line: Line, at: int, stack: list[Rule]) -> Iterator[Piece]:
    """The pieces of a line from a place on; the stack is then that of the next line."""
    while found := _next(line, at, stack):
        match, rule, is_end = found
        yield at, match.start(), Text
        yield from _captured(match, rule.ended if is_end else rule.begun, rule.kind)
        if is_end:
            stack.pop()
        elif rule.end:
            stack.append(rule)
        at = match.end()
        if at == line.end:
            break
    yield at, line.end, Text


@lru_cache(maxsize=1)
def _grammar() -> Grammar:
    return Grammar((files("nsdc") / "nsd.tmLanguage.json").read_text(encoding="utf-8"))


class NsdLexer(Lexer):  # type: ignore[misc]
    """The lexer, which Pygments knows as `nsd` where the package is installed.

    >>> from nsdc.highlight import NsdLexer
    >>> [(str(kind), text) for kind, text in NsdLexer().get_tokens("x' = 2 m;") if text.strip()][:4]
    [('Token.Name', 'x'), ('Token.Operator', "'"), ('Token.Operator', '='), ('Token.Literal.Number', '2')]
    """

    name = "NSD"
    aliases = ["nsd"]
    filenames = ["*.nsd"]
    mimetypes = ["text/x-nsd"]

    def get_tokens_unprocessed(self, text: str) -> Iterator[tuple[int, _TokenType, str]]:
        """Pieces of the text with where they begin and what they are; together they are the text."""
        stack, before = [_grammar().root], 0
        for line in re.findall(r"[^\n]*\n|[^\n]+", text):
            for start, end, kind in _pieces(Line(line, len(line)), 0, stack):
                if start < end:
                    yield before + start, kind, line[start:end]
            before += len(line)


class CellLexer(NsdLexer):
    """A cell of a notebook: the language behind the line of the magic.

    >>> from nsdc.highlight import CellLexer
    >>> [(str(kind), text) for kind, text in CellLexer().get_tokens("%%nsd m\\nmodel m {}") if text.strip()][:2]
    [('Token.Keyword', '%%nsd m'), ('Token.Keyword.Declaration', 'model')]
    """

    name = "NSD in a cell"
    aliases = []
    filenames = []
    mimetypes = []

    def get_tokens_unprocessed(self, text: str) -> Iterator[tuple[int, _TokenType, str]]:
        """Pieces of the cell."""
        first = text.find("\n") if text.lstrip().startswith("%%") else 0
        end = len(text) if first < 0 else first
        yield 0, Keyword, text[:end]
        for at, kind, piece in super().get_tokens_unprocessed(text[end:]):
            yield end + at, kind, piece
