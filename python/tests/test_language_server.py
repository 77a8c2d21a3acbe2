"""The language server with a client that others have written, pytest-lsp, which refuses what the protocol does not have."""

from __future__ import annotations

import re
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_lsp
from lsprotocol import types
from models import BUILT, ROOT
from pytest_lsp import ClientServerConfig, LanguageClient, client_capabilities

PROGRAM = str(BUILT / "nsdc")
EXAMPLES = sorted((ROOT / "examples").glob("*.nsd"))[::6]
#: Pages whose wrong example is one file that `nsdc check` refuses by the code of the page.
PAGES = ["E0010", "E0101", "E0107", "E0110", "E0203", "E0301", "E0401", "E0501"]


@pytest_lsp.fixture(config=ClientServerConfig(server_command=[PROGRAM, "lsp"]))
async def client(lsp_client: LanguageClient) -> AsyncIterator[None]:
    @lsp_client.feature(types.CLIENT_REGISTER_CAPABILITY)
    def watch(params: types.RegistrationParams) -> None:
        assert [known.method for known in params.registrations] == [types.WORKSPACE_DID_CHANGE_WATCHED_FILES]

    params = types.InitializeParams(capabilities=client_capabilities("visual-studio-code"))
    await lsp_client.initialize_session(params)
    yield
    await lsp_client.shutdown_session()


async def opened(client: LanguageClient, uri: str, text: str) -> list[types.Diagnostic]:
    document = types.TextDocumentItem(uri=uri, language_id="nsd", version=1, text=text)
    client.text_document_did_open(types.DidOpenTextDocumentParams(text_document=document))
    await client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
    return list(client.diagnostics[uri])


def position(text: str, byte: int) -> types.Position:
    """Columns count units of UTF-16."""
    before = text[:byte].rsplit("\n", 1)[-1]
    return types.Position(line=text.count("\n", 0, byte), character=len(before.encode("utf-16-le")) // 2)


@pytest.mark.asyncio
@pytest.mark.parametrize("code", PAGES)
async def test_wrong_examples_have_their_codes(client: LanguageClient, code: str, tmp_path: Path) -> None:
    page = subprocess.run([PROGRAM, "explain", code], capture_output=True, text=True, check=True).stdout
    text = re.findall(r"```nsd wrong\n(.*?)```", page, re.DOTALL)[0]
    path = tmp_path / "page.nsd"
    told = await opened(client, path.as_uri(), text)
    path.write_text(text)
    checked = subprocess.run([PROGRAM, "check", path], capture_output=True, text=True).stderr
    place = re.search(rf"{code}.*?page\.nsd:(\d+):(\d+)\]", checked, re.DOTALL)
    assert place, checked
    its = next(known for known in told if known.code == code)
    assert its.range.start.line + 1 == int(place[1])
    assert its.code_description and its.code_description.href.endswith(f"{code}.md")


@pytest.mark.asyncio
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
async def test_examples_are_answered(client: LanguageClient, path: Path) -> None:
    text = path.read_text()
    assert await opened(client, path.as_uri(), text) == []
    uri = types.TextDocumentIdentifier(uri=path.as_uri())
    name = re.search(r"^  state (\w+)", text, re.MULTILINE)
    experiment = re.search(r"^(?:simulate|optimize|fit|mpc) (\w+) of (\w+)", text, re.MULTILINE)
    assert name and experiment
    at = position(text, name.start(1))
    hover = await client.text_document_hover_async(types.HoverParams(text_document=uri, position=at))
    assert hover and isinstance(hover.contents, types.MarkupContent) and name[1] in hover.contents.value
    found = await client.text_document_definition_async(
        types.DefinitionParams(text_document=uri, position=position(text, experiment.start(2)))
    )
    assert isinstance(found, types.Location)
    assert found.range.start == position(text, text.index(f"model {experiment[2]}") + 6)
    context = types.ReferenceContext(include_declaration=True)
    places = await client.text_document_references_async(
        types.ReferenceParams(text_document=uri, position=at, context=context)
    )
    assert places and at in [place.range.start for place in places]
    edit = await client.text_document_rename_async(
        types.RenameParams(text_document=uri, position=at, new_name="renamed_7")
    )
    assert edit and edit.changes and len(edit.changes[path.as_uri()]) == len(places)
    options = types.FormattingOptions(tab_size=2, insert_spaces=True)
    edits = await client.text_document_formatting_async(
        types.DocumentFormattingParams(text_document=uri, options=options)
    )
    assert not edits
    offered = await client.text_document_completion_async(
        types.CompletionParams(text_document=uri, position=position(text, text.rindex("}")))
    )
    items = offered.items if isinstance(offered, types.CompletionList) else offered
    assert items and "horizon" in [item.label for item in items]
    lenses = await client.text_document_code_lens_async(types.CodeLensParams(text_document=uri))
    titles = [lens.command.title for lens in lenses or [] if lens.command]
    assert titles[:5] == ["run", "plot", "test", "verify", "emit"]


@pytest.mark.asyncio
async def test_columns_are_units_of_utf_16(client: LanguageClient) -> None:
    text = "model m { state 𝛼 = 1; /* 😀 */ 𝛼' = -ω; }\n"
    told = await opened(client, "file:///nowhere/greek.nsd", text)
    its = next(known for known in told if known.code == "E0101")
    assert its.range.start == position(text, text.index("ω"))
