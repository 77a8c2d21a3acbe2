// The extension: it starts `nsdc lsp`, and shows what the server answers.

"use strict";

const vscode = require("vscode");
const { LanguageClient, ExecuteCommandRequest, DocumentSymbolRequest } = require("vscode-languageclient/node");
const { Figures } = require("./figures");
const { FORMS, document, experiments, failures, place } = require("./results");

/** Of documents that show answers. */
const SCHEME = "nsdc";

let client;

const settings = () => vscode.workspace.getConfiguration("nsdc");

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

const ask = (word, uri, name, form) =>
  client.sendRequest(ExecuteCommandRequest.type, {
    command: `nsdc.${word}`,
    arguments: [uri, name, form].filter((one) => one !== undefined),
  });

/** The experiments of a file. */
const experimentsOf = async (uri) =>
  experiments(await client.sendRequest(DocumentSymbolRequest.type, { textDocument: { uri } }));

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

/** The file of the text in front and one of its experiments: by a lens, or chosen. */
async function chosen(args) {
  if (args.length > 1) return args;
  const uri = args[0] ?? vscode.window.activeTextEditor?.document.uri.toString();
  if (uri === undefined) return undefined;
  const names = (await experimentsOf(uri)).map((experiment) => experiment.name);
  const name = names.length > 1 ? await vscode.window.showQuickPick(names, { title: "Experiment" }) : names[0];
  return name === undefined ? undefined : [uri, name];
}

function start(context, figures, answers) {
  const program = settings().get("path");
  const server = { command: program, args: ["lsp"] };
  const middleware = {
    async executeCommand(command, args, next) {
      const word = command.slice("nsdc.".length);
      const [uri, name, form] = (await chosen(args)) ?? [];
      if (name === undefined) return undefined;
      const answer = await next(command, form === undefined ? [uri, name] : [uri, name, form]);
      if (answer && word === "plot") figures.show(uri, name, answer);
      else if (answer) await answers.show(document(word, name, form, answer.text));
      return answer;
    },
    // What the server would show is shown above.
    window: { showDocument: async () => ({ success: true }) },
  };
  client = new LanguageClient("nsdc", "nsdc", server, {
    documentSelector: [{ language: "nsd" }],
    initializationOptions: { inlayHints: settings().get("inlayHints") },
    middleware,
  });
  return client.start().catch(async (error) => {
    const text = `nsdc: \`${program} lsp\` cannot be started: ${error.message}`;
    const open = "Open settings";
    if ((await vscode.window.showErrorMessage(text, open)) === open) {
      await vscode.commands.executeCommand("workbench.action.openSettings", "nsdc.path");
    }
  });
}

/** Experiments as tests: a file with its experiments, each at its name. */
class Tests {
  constructor(controller) {
    this.controller = controller;
    controller.resolveHandler = (item) => (item ? this.read(item.uri) : this.readAll());
    controller.refreshHandler = () => this.readAll();
    const run = (request, token) => this.run(request, token);
    controller.createRunProfile("Test", vscode.TestRunProfileKind.Run, run, true);
  }

  async readAll() {
    const files = await vscode.workspace.findFiles("**/*.nsd");
    await Promise.all(files.map((uri) => this.read(uri)));
  }

  async read(uri) {
    const all = this.controller.items;
    const found = await experimentsOf(uri.toString());
    if (found.length === 0) {
      all.delete(uri.toString());
      return;
    }
    const file = this.controller.createTestItem(uri.toString(), vscode.workspace.asRelativePath(uri), uri);
    const items = found.map((experiment) => {
      const item = this.controller.createTestItem(`${uri} ${experiment.name}`, experiment.name, uri);
      item.range = client.protocol2CodeConverter.asRange(experiment.range);
      return item;
    });
    file.children.replace(items);
    all.add(file);
  }

  async run(request, token) {
    const run = this.controller.createTestRun(request);
    const asked = [];
    const collect = (item) => (item.children.size > 0 ? item.children.forEach(collect) : asked.push(item));
    if (request.include) request.include.forEach(collect);
    else this.controller.items.forEach(collect);
    for (const item of asked.filter((item) => !request.exclude?.includes(item))) {
      if (token.isCancellationRequested) {
        run.skipped(item);
      } else {
        await this.once(run, item);
      }
    }
    run.end();
  }

  async once(run, item) {
    run.started(item);
    const begun = Date.now();
    try {
      const answer = await ask("test", item.uri.toString(), item.label);
      run.appendOutput(answer.text.replaceAll("\n", "\r\n"), undefined, item);
      const took = Date.now() - begun;
      if (answer.status === 0) run.passed(item, took);
      else run.failed(item, await this.messages(item, answer.text), took);
    } catch (error) {
      run.errored(item, new vscode.TestMessage(error.message));
    }
  }

  /** What failed, where it is expected. */
  async messages(item, text) {
    const opened = await vscode.workspace.openTextDocument(item.uri);
    const within = opened.getText(item.range);
    return failures(text).map(({ what, said, expected, got }) => {
      const message = new vscode.TestMessage([what, ...said].join("\n"));
      message.expectedOutput = expected;
      message.actualOutput = got;
      const at = opened.offsetAt(item.range.start) + place(within, what);
      message.location = new vscode.Location(item.uri, opened.positionAt(at));
      return message;
    });
  }
}

async function activate(context) {
  const answers = new Answers();
  const figures = new Figures(panel, (uri, name) => ask("plot", uri, name));
  const controller = vscode.tests.createTestController("nsdc", "nsdc");
  const tests = new Tests(controller);
  const isModel = (uri) => uri.path.endsWith(".nsd");
  context.subscriptions.push(
    controller,
    vscode.workspace.registerTextDocumentContentProvider(SCHEME, answers),
    vscode.commands.registerCommand("nsdc.emitForm", async (...args) => {
      const [uri, name] = (await chosen(args)) ?? [];
      if (name === undefined) return;
      const forms = Object.entries(FORMS).map(([label, description]) => ({ label, description }));
      const form = await vscode.window.showQuickPick(forms, { title: `Form of ${name}`, matchOnDescription: true });
      if (form) await vscode.commands.executeCommand("nsdc.emit", uri, name, form.label);
    }),
    vscode.commands.registerCommand("nsdc.restart", async () => {
      await client.stop().catch(() => undefined);
      await start(context, figures, answers);
    }),
    vscode.workspace.onDidSaveTextDocument(({ uri }) => {
      if (!isModel(uri) && !uri.path.endsWith(".csv")) return;
      figures.again();
      if (isModel(uri)) tests.read(uri);
    }),
    vscode.workspace.onDidDeleteFiles(({ files }) =>
      files.forEach((uri) => controller.items.delete(uri.toString())),
    ),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration("nsdc")) vscode.commands.executeCommand("nsdc.restart");
    }),
  );
  await start(context, figures, answers);
}

async function deactivate() {
  await client?.stop();
}

module.exports = { activate, deactivate };
