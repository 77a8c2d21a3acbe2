"""Colours for Pygments, and cells of notebooks."""

from __future__ import annotations

import html
import os
import random
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from IPython.core.error import UsageError
from IPython.core.interactiveshell import InteractiveShell
from IPython.terminal.ptutils import IPythonPTLexer
from models import BALL, BELT, EXAMPLES, ROOT, agree
from prompt_toolkit.document import Document
from pygments.token import Comment, Keyword, Name, Number, Operator, String, Token

import nsdc
from nsdc import highlight
from nsdc.highlight import Line, NsdLexer

#: What the compiler says of what is coloured so, the first that fits.
KINDS = [
    (String.Doc, "comment"),
    (Comment, "comment"),
    (String, "string"),
    (Number, "number"),
    (Keyword.Constant, "name"),
    (Keyword, "word"),
    (Name.Decorator, "unit"),
    (Name, "name"),
    (Operator, "symbol"),
    (Token, "symbol"),
]


def kinds(text: str) -> list[str]:
    """What each character is."""
    found: list[str] = []
    for at, token, piece in NsdLexer().get_tokens_unprocessed(text):
        assert at == len(found)
        found += [next(kind for known, kind in KINDS if token in known)] * len(piece)
    return found


@pytest.mark.parametrize("of", ["examples/", "stdlib/", "as a name"])
def test_colours_are_what_the_compiler_reads(read: dict[str, dict], of: str) -> None:
    texts = {name: one for name, one in read.items() if of in name}
    assert len(texts) > 5
    for name, one in texts.items():
        found = kinds(one["text"])
        assert len(found) == len(one["text"])
        # Of paths Pygments has strings.
        tokens = [("string" if kind == "path" else kind, written) for kind, written in one["tokens"]]
        agree(name, one["text"], tokens, found)


def test_any_text_is_coloured_to_its_end() -> None:
    draw = random.Random(2026)
    text = (EXAMPLES / "stick_slip.nsd").read_text()
    for _ in range(200):
        start = draw.randrange(len(text))
        piece = text[start : start + 300]
        cut = "".join(c for c in piece if draw.random() > 0.2)
        marks = "".join(draw.choices("{}()[];:.,'\"/\n x2", k=60))
        for broken in (cut, marks):
            assert len(kinds(broken)) == len(broken)


def passed(text: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many characters all searches for patterns go over while a text is coloured."""
    count = 0

    class Counted(Line):
        def _seek(self, pattern: re.Pattern[str], at: int) -> re.Match[str] | None:
            nonlocal count
            found = super()._seek(pattern, at)
            count += (found.end() if found else self.end) - at
            return found

    with monkeypatch.context() as patch:
        patch.setattr(highlight, "Line", Counted)
        assert len(kinds(text)) == len(text)
    return count


@pytest.mark.parametrize("piece", ["x' = -2 m*f(y[1], z); ", 'plot { a; "text" } ', "a ", "( "])
def test_a_long_line_is_searched_as_its_length(piece: str, monkeypatch: pytest.MonkeyPatch) -> None:
    short, long = (passed(f"model m {{ {piece * count}}}", monkeypatch) for count in (100, 200))
    assert short < long < 3 * short


def test_comments_end_with_the_line_alone() -> None:
    assert kinds("// a\u2028b\x0cc\nx") == ["comment"] * 8 + ["symbol", "name"]


def test_pygments_finds_the_lexer(tmp_path: Path) -> None:
    described = tomllib.loads((ROOT / "python/pyproject.toml").read_text())
    known = described["project"]["entry-points"]["pygments.lexers"]
    # As if it were installed.
    folder = tmp_path / "nsdc-0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: nsdc\nVersion: 0\n")
    lines = "".join(f"{name} = {module}\n" for name, module in known.items())
    (folder / "entry_points.txt").write_text(f"[pygments.lexers]\n{lines}")
    folders = [str(tmp_path), str(ROOT / "python"), *filter(None, [os.environ.get("PYTHONPATH")])]
    command = [sys.executable, "-m", "pygments", "-l", "nsd", "-f", "html"]
    page = subprocess.run(
        command,
        input="model m { state x = 1; }",
        env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert '<span class="kd">state</span>' in page.stdout


@pytest.fixture
def shell() -> InteractiveShell:
    shell = InteractiveShell()
    shell.run_line_magic("load_ext", "nsdc")
    return shell


def test_a_cell_in_a_terminal_has_colours(shell: InteractiveShell) -> None:
    # What a terminal has; here is none.
    shell.pt_app = SimpleNamespace(lexer=IPythonPTLexer())
    cell = Document("%%nsd ball\nmodel m { state x = 1; }")

    def styles() -> dict[str, str]:
        return {text: style for style, text in shell.pt_app.lexer.lex_document(cell)(1)}

    assert "keyword" not in styles()["state"]
    shell.run_line_magic("reload_ext", "nsdc")
    assert "keyword" in styles()["state"] and "number" in styles()["1"]


def test_a_cell_is_a_file(shell: InteractiveShell) -> None:
    cell = shell.run_cell(f"%%nsd ball\n{BALL}")
    assert cell.success and cell.result is shell.user_ns["ball"]
    assert list(shell.user_ns["ball"]) == ["falls"]
    cell = shell.run_cell(f"%%nsd ball falls\n{BALL}")
    assert isinstance(cell.result, nsdc.Result) and cell.result.ok
    again = shell.run_cell("ball['falls'].run()['q'][-1]")
    assert again.result == cell.result["q"][-1]


def test_a_file_shows_its_text_in_colours(shell: InteractiveShell) -> None:
    file = shell.run_cell(f"%%nsd ball\n{BALL}").result
    page = file._repr_html_()
    coloured = re.search(r"<details><summary>text</summary>(.*)</details>", page, flags=re.DOTALL)
    assert coloured and html.unescape(re.sub("<[^>]*>", "", coloured[1])).strip() == BALL.strip()
    # `state` is coloured as no name is.
    styles = {text: style for style, text in re.findall(r'<span style="([^"]*)">([^<]*)</span>', coloured[1])}
    assert styles["state"] and styles["state"] == styles["param"] != styles.get("v")


def test_what_is_wrong_in_a_cell_is_shown_at_its_line(
    shell: InteractiveShell, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = BALL.replace("v' = -g;", "v' = -gravity;")
    cell = shell.run_cell(f"%%nsd ball\n{wrong}")
    assert isinstance(cell.error_in_exec, nsdc.ModelError) and cell.error_in_exec.code == "E0101"
    shown = capsys.readouterr().out
    assert "unknown name `gravity`" in shown and "ball.nsd:" in shown and "_magic.py" not in shown
    # It cannot run without a horizon.
    cell = shell.run_cell("%%nsd ball falls\n" + BALL.replace("horizon 1;", ""))
    assert isinstance(cell.error_in_exec, nsdc.ModelError) and cell.error_in_exec.code == "E0505"


def test_warnings_of_a_cell_are_shown(shell: InteractiveShell, capsys: pytest.CaptureFixture[str]) -> None:
    # A name that is a function's, and a run that leaves sliding for a surface that it grazes.
    text = BELT.replace("state x[2]", "let sin = 1; state x[2]")
    assert shell.run_cell(f"%%nsd belt\n{text}").success
    assert re.findall(r"^W\d+", capsys.readouterr().err, flags=re.MULTILINE) == ["W0104"]
    shell.run_cell(f"%%nsd belt pulls\n{text.replace('let sin = 1; ', '')}")
    shown = capsys.readouterr().err
    assert "W0701" in shown and "belt.nsd:" in shown


def test_a_cell_that_is_wrong_leaves_the_name(shell: InteractiveShell) -> None:
    shell.run_cell(f"%%nsd ball\n{BALL}")
    kept = shell.user_ns["ball"]
    assert not shell.run_cell("%%nsd ball\nmodel").success
    assert shell.user_ns["ball"] is kept


def test_an_error_of_a_run_is_no_error_of_how_it_is_called(
    shell: InteractiveShell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(self: nsdc.Experiment) -> None:
        raise KeyError("within")

    monkeypatch.setattr(nsdc.Experiment, "run", fails)
    with pytest.raises(KeyError, match="within"):
        shell.run_cell_magic("nsd", "ball falls", BALL)


def test_how_the_magic_is_called(shell: InteractiveShell) -> None:
    for line in ("", "a-b", "class", "ball falls twice"):
        with pytest.raises(UsageError, match="takes the name"):
            shell.run_cell_magic("nsd", line, BALL)
    with pytest.raises(UsageError, match="did you mean `falls`"):
        shell.run_cell_magic("nsd", "ball fals", BALL)


def test_the_cells_of_the_readme_run(shell: InteractiveShell) -> None:
    blocks = (ROOT / "python/README.md").read_text().split("```python\n")[1:]
    cells = [block.split("```")[0] for block in blocks]
    load, cell = (text for text in cells if text.startswith("%"))
    assert shell.run_cell(load).success
    result = shell.run_cell(cell).result
    assert result.ok and result["x"][0] == 1
    assert shell.run_cell('relay["settles"].run(x=2)["x"][0]').result == 2
