"""The grammar of tree-sitter, as editors load it."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
from collections.abc import Iterator

import pytest
from models import EXAMPLES, ROOT, agree
from tree_sitter import Language, Node, Parser, Query, QueryCursor

FOLDER = ROOT / "editors/tree-sitter-nsd"

#: What nodes are that stand for one token.
KINDS = {
    "identifier": "name",
    "property": "name",
    "unit_name": "unit",
    "number": "number",
    "string": "string",
    "comment": "comment",
    "doc_comment": "comment",
    "relative_path": "path",
}


@pytest.fixture(scope="module")
def language(tmp_path_factory: pytest.TempPathFactory) -> Language:
    library = tmp_path_factory.mktemp("grammar") / "nsd.so"
    compiler = os.environ.get("CC", "cc")
    source = FOLDER / "src/parser.c"
    subprocess.run([compiler, "-shared", "-fPIC", "-O0", f"-I{source.parent}", source, "-o", library], check=True)
    made = ctypes.CDLL(str(library)).tree_sitter_nsd
    made.restype = ctypes.c_void_p
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype = ctypes.py_object
    capsule.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return Language(capsule(made(), b"tree_sitter.Language", None))


def parsed(language: Language, text: bytes) -> Node:
    return Parser(language).parse(text).root_node


def leaves(node: Node) -> Iterator[Node]:
    """The nodes that stand for one token."""
    if node.type in KINDS or node.child_count == 0:
        yield node
    else:
        for child in node.children:
            yield from leaves(child)


def words(node: Node) -> list[Node]:
    """The keywords."""
    return [leaf for leaf in leaves(node) if not leaf.is_named and leaf.type[0].isalpha()]


def test_every_text_is_parsed_as_the_compiler_reads_it(language: Language, read: dict[str, dict]) -> None:
    for name, one in read.items():
        data = one["text"].encode()
        root = parsed(language, data)
        assert not root.has_error, name
        found = [""] * len(data)
        for leaf in leaves(root):
            word = "word" if leaf.text[:1].isalpha() else "symbol"
            size = leaf.end_byte - leaf.start_byte
            found[leaf.start_byte : leaf.end_byte] = [KINDS.get(leaf.type, word)] * size
        agree(name, data, [(kind, written.encode()) for kind, written in one["tokens"]], found)


def test_trees_of_the_corpus(language: Language) -> None:
    def tree(node: Node) -> str:
        named = [(node.field_name_for_child(k), child) for k, child in enumerate(node.children) if child.is_named]
        inside = [f"{field}: {tree(child)}" if field else tree(child) for field, child in named]
        return f"({' '.join([node.type, *inside])})"

    cases = re.split(r"^=+\n.*\n=+\n", (FOLDER / "test/corpus/language.txt").read_text(), flags=re.MULTILINE)
    assert len(cases) > 5
    for case in filter(str.strip, cases):
        text, expected = case.split("\n---\n")
        root = parsed(language, text.encode())
        assert tree(root) == " ".join(expected.split())


@pytest.fixture(scope="module")
def belt(language: Language) -> Node:
    text = (EXAMPLES / "stick_slip.nsd").read_bytes()
    return parsed(language, text)


def captures(language: Language, name: str, node: Node) -> dict[str, list[Node]]:
    """What a query finds, by the names that it gives."""
    return QueryCursor(Query(language, (FOLDER / f"queries/{name}.scm").read_text())).captures(node)


def test_every_word_is_a_keyword_in_colours(language: Language, read: dict[str, dict]) -> None:
    seen = set()
    for one in read.values():
        root = parsed(language, one["text"].encode())
        found = captures(language, "highlights", root)
        marked = {node.id for name, nodes in found.items() if name.startswith("keyword") for node in nodes}
        missed = [node for node in words(root) if node.id not in marked]
        assert missed == []
        seen |= {node.type for node in words(root)}
    # What the parser knows as words stands in these texts.
    known = [language.node_kind_for_id(k) for k in range(language.node_kind_count) if not language.node_kind_is_named(k)]
    assert {kind for kind in known if kind and kind.isalpha() and kind != "end"} <= seen | {"px"}


def test_values_in_colours_are_those_of_the_compiler(language: Language, read: dict[str, dict]) -> None:
    one = read["values"]
    values = {text for kind, text in one["tokens"] if kind == "name"} - {"a"}
    assert "pi" in values
    found = captures(language, "highlights", parsed(language, one["text"].encode()))
    assert {node.text.decode() for node in found["constant.builtin"]} == values
    query = (FOLDER / "queries/highlights.scm").read_text()
    [listed] = re.findall(r"#any-of\? @constant\.builtin (.*?)\)", query)
    assert set(re.findall(r'"(\w+)"', listed)) == values


def test_names_are_found_where_they_are_declared(language: Language, belt: Node) -> None:
    found = captures(language, "locals", belt)
    declared = {node.text.decode() for node in found["local.definition"]}
    assert {"belt", "x"} <= declared
    used = {node.text.decode() for node in found["local.reference"]}
    assert declared <= used


def test_blocks_fold(language: Language, belt: Node) -> None:
    folds = captures(language, "folds", belt)["fold"]
    assert {"body", "experiment"} <= {node.type for node in folds}
    assert any(node.end_point.row > node.start_point.row for node in folds)
