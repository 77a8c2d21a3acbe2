"""The language server with the client of Neovim, where that is installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from models import BUILT

NVIM = shutil.which("nvim")
PROGRAM = BUILT / "nsdc"

TEXT = """\
model decay {
  /// How fast.
  param rate : 1/s = 2;
  state ω = 1;
  ω' = -rat*ω;
}
simulate falls of decay { horizon 1; }
"""

#: Opens the text, mends it as the server says, hovers and renames.
SCRIPT = """
local uv, told = vim.loop, {}
local config = { name = "nsdc", cmd = { PROGRAM, "lsp" }, root_dir = uv.cwd() }
-- Before 0.8 there was no `start`.
local id = vim.lsp.start and vim.lsp.start(config)
if not id then
  id = vim.lsp.start_client(config)
  vim.lsp.buf_attach_client(0, id)
end
local client = vim.lsp.get_client_by_id(id)
local function ask(method, params)
  local answer = assert(client.request_sync(method, params, 20000, 0))
  assert(not answer.err, vim.inspect(answer.err))
  return answer.result
end
local function text() return table.concat(vim.api.nvim_buf_get_lines(0, 0, -1, false), "\\n") end
local function wait(what) assert(vim.wait(20000, what, 20)) end

wait(function() return #vim.diagnostic.get(0) > 0 end)
local found = vim.diagnostic.get(0)[1]
told.diagnostic = { found.code, found.lnum, found.message }
local document = vim.lsp.util.make_text_document_params()
local range = { start = { line = found.lnum, character = found.col }, ["end"] = { line = found.lnum, character = found.col } }
local actions = ask("textDocument/codeAction", { textDocument = document, range = range, context = { diagnostics = {} } })
vim.lsp.util.apply_workspace_edit(actions[1].edit, client.offset_encoding)
wait(function() return #vim.diagnostic.get(0) == 0 end)
told.mended = text()

vim.api.nvim_win_set_cursor(0, { 5, 10 })
told.hover = ask("textDocument/hover", vim.lsp.util.make_position_params(0, client.offset_encoding)).contents.value
vim.api.nvim_win_set_cursor(0, { 5, 2 })
told.equation = ask("textDocument/hover", vim.lsp.util.make_position_params(0, client.offset_encoding)).contents.value
vim.api.nvim_win_set_cursor(0, { 5, 10 })
local params = vim.lsp.util.make_position_params(0, client.offset_encoding)
params.newName = "λ"
vim.lsp.util.apply_workspace_edit(ask("textDocument/rename", params), client.offset_encoding)
told.renamed = text()
local run = { command = "nsdc.run", arguments = { document.uri, "falls" } }
told.run = ask("workspace/executeCommand", run).text
io.stdout:write(vim.json.encode(told))
vim.cmd("qa!")
"""


@pytest.mark.skipif(NVIM is None, reason="there is no Neovim")
def test_neovim_shows_mends_hovers_and_renames(tmp_path: Path) -> None:
    (tmp_path / "decay.nsd").write_text(TEXT)
    script = tmp_path / "script.lua"
    script.write_text(f"local PROGRAM = {json.dumps(str(PROGRAM))}\n{SCRIPT}")
    command = [str(NVIM), "--headless", "-u", "NONE", "-i", "NONE", "decay.nsd", "-S", "script.lua", "+cquit"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    code, line, message = told["diagnostic"]
    assert (code, line, message.splitlines()[0]) == ("E0101", 4, "unknown name `rat`")
    assert told["mended"] == TEXT.replace("-rat*", "-rate*").rstrip("\n")
    assert "How fast." in told["hover"] and "1/s" in told["hover"]
    assert "der(ω) = -rate*ω" in told["equation"]
    assert told["renamed"] == told["mended"].replace("rate", "λ")
    assert "falls of decay: solved" in told["run"]
