// The extension: it starts `nsdc lsp`, and shows what the server answers.

"use strict";

const vscode = require("vscode");
const { DocumentSymbolRequest, ExecuteCommandRequest, LSPErrorCodes } = require("vscode-languageclient/node");
const { Figures } = require("./figures");
const { FORMS, WORDS, document, experiments } = require("./results");
const { SCHEMES, Server } = require("./server");
const { FILES, Tests } = require("./tests");

/** Of documents that show answers. */
const SCHEME = "nsdc";

let server;

/** Documents that are answers: they change when the same is asked again. */
class Answers {
  constructor() {
    this.texts = new Map();
    this.changed = new vscode.EventEmitter();
    this.onDidChange = this.changed.event;
  }

  provideTextDocumentContent(uri) {
    return this.texts.get(uri.toString()) ?? "";
  }

  forget(uri) {
    this.texts.delete(uri.toString());
  }

  async show({ path, language, text }) {
    const uri = vscode.Uri.from({ scheme: SCHEME, path: `/${path}` });
    this.texts.set(uri.toString(), text);
    this.changed.fire(uri);
    const shown = await vscode.workspace.openTextDocument(uri);
    const known = await vscode.languages.getLanguages();
    if (known.includes(language)) await vscode.languages.setTextDocumentLanguage(shown, language);
    await vscode.window.showTextDocument(shown, {
      viewColumn: vscode.ViewColumn.Beside,
      preserveFocus: true,
      preview: true,
    });
  }
}

const ask = (word, uri, name, { form, token } = {}) => {
  const given = [uri, name, form].filter((one) => one !== undefined);
  return server.request(ExecuteCommandRequest.type, { command: `nsdc.${word}`, arguments: given }, token);
};

/** The experiments of a file. */
const experimentsOf = async (uri) =>
  experiments(await server.request(DocumentSymbolRequest.type, { textDocument: { uri } }));

function panel(title, closed) {
  const column = { viewColumn: vscode.ViewColumn.Beside, preserveFocus: true };
  const shown = vscode.window.createWebviewPanel("nsdc.figure", title, column, { enableScripts: false });
  shown.onDidDispose(closed);
  return {
    show(html) {
      shown.webview.html = html;
    },
    reveal() {
      shown.reveal(undefined, true);
    },
  };
}

/** The file that is meant where none is named: in front, else seen anywhere, else chosen. */
async function meant() {
  const { activeTextEditor, visibleTextEditors } = vscode.window;
  const isModel = ({ languageId, uri }) => languageId === "nsd" && SCHEMES.includes(uri.scheme);
  const seen = [activeTextEditor, ...visibleTextEditors].find((editor) => editor && isModel(editor.document));
  if (seen) return seen.document.uri;
  const files = await vscode.workspace.findFiles(FILES);
  if (files.length === 0) throw new Error("there is no .nsd file here yet");
  const items = files.map((uri) => ({ label: vscode.workspace.asRelativePath(uri), uri }));
  items.sort((one, other) => one.label.localeCompare(other.label));
  return (await vscode.window.showQuickPick(items, { title: "File" }))?.uri;
}

/** A file, one of its experiments and a form: as a lens has them, else chosen; menus give the file and something else. */
async function chosen([file, name, form]) {
  const uri = (file ?? (await meant()))?.toString();
  if (uri === undefined || typeof name === "string") return [uri, name, form];
  const names = (await experimentsOf(uri)).map((experiment) => experiment.name);
  if (names.length === 0) throw new Error("there is no experiment in this file yet");
  return [uri, names.length > 1 ? await vscode.window.showQuickPick(names, { title: "Experiment" }) : names[0]];
}

/** A command, which says once why it could not do what it was asked. */
const command = (word, run) =>
  vscode.commands.registerCommand(`nsdc.${word}`, async (...args) => {
    try {
      return await run(args);
    } catch (error) {
      const isCanceled = [LSPErrorCodes.RequestCancelled, LSPErrorCodes.ServerCancelled].includes(error.code);
      if (!isCanceled) vscode.window.showErrorMessage(`nsdc: ${error.message}`);
      return undefined;
    }
  });

async function cannotStart(text) {
  const open = "Open settings";
  if ((await vscode.window.showErrorMessage(text, open)) === open) {
    await vscode.commands.executeCommand("workbench.action.openSettings", "nsdc.path");
  }
}

async function activate(context) {
  const log = vscode.window.createOutputChannel("nsdc", { log: true });
  const answers = new Answers();
  const figures = new Figures(panel, (uri, name) => ask("plot", uri, name));
  const tests = new Tests(experimentsOf, (uri, name, token) => ask("test", uri, name, { token }));
  const changed = (event) => tests.follow(event);
  server = new Server({ folder: context.extensionPath, log, failed: cannotStart, changed });
  const restart = async () => {
    await server.restart();
    await tests.reopen();
  };
  const answered = (word) => async (args) => {
    const [uri, name, form] = await chosen(args);
    if (name === undefined) return;
    const answer = await ask(word, uri, name, { form });
    if (answer && word === "plot") figures.show(uri, name, answer);
    else if (answer) await answers.show(document(word, uri, name, form, answer.text));
  };
  context.subscriptions.push(
    log,
    tests.controller,
    vscode.workspace.registerTextDocumentContentProvider(SCHEME, answers),
    ...WORDS.map((word) => command(word, answered(word))),
    command("emitForm", async (args) => {
      const [uri, name] = await chosen(args);
      if (name === undefined) return;
      const forms = Object.entries(FORMS).map(([label, description]) => ({ label, description }));
      const form = await vscode.window.showQuickPick(forms, { title: `Form of ${name}`, matchOnDescription: true });
      if (form) await answered("emit")([uri, name, form.label]);
    }),
    command("restart", restart),
    vscode.workspace.onDidSaveTextDocument(({ uri }) => {
      if (uri.scheme === "file" && /\.(nsd|csv)$/.test(uri.path)) figures.again();
    }),
    vscode.workspace.onDidCloseTextDocument(({ uri }) => answers.forget(uri)),
    vscode.workspace.onDidChangeWorkspaceFolders(restart),
    vscode.workspace.onDidGrantWorkspaceTrust(restart),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration("nsdc")) restart();
    }),
  );
  // Where there are models the palette has what can be done with them.
  vscode.commands.executeCommand("setContext", "nsdc.isActive", true);
  // Whoever asks for something waits for it.
  restart();
}

async function deactivate() {
  await server?.stop();
}

module.exports = { activate, deactivate };
