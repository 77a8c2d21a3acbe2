// The extension as it is bundled, with the server and an editor that only takes down what it is asked.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { EventEmitter } from "node:events";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, realpathSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";

import { TextDocument } from "vscode-languageserver-textdocument";

import { program, root, uri } from "./server.mjs";

const here = join(root, "editors/vscode");
const require = createRequire(import.meta.url);
const Module = require("node:module");

/** Anything of an editor that is of no interest here: a function, a class, an object. */
function anything(known = {}) {
  return new Proxy(class {}, {
    get: (target, key) => {
      if (key in known) return known[key];
      if (key === "prototype" || typeof key === "symbol") return target[key];
      if (key === "then") return undefined;
      return anything();
    },
    set: (_, key, value) => {
      known[key] = value;
      return true;
    },
    apply: () => anything(),
    construct: () => anything(),
  });
}

class Emitter {
  constructor() {
    this.all = new EventEmitter().setMaxListeners(0);
    this.event = (listener, self) => {
      const bound = listener.bind(self);
      this.all.on("it", bound);
      return { dispose: () => this.all.off("it", bound) };
    };
  }
  fire(value) {
    this.all.emit("it", value);
  }
  dispose() {}
}

class Uri {
  constructor(text) {
    this.text = text;
  }
  static parse(text) {
    return new Uri(text);
  }
  static from({ scheme, path }) {
    return new Uri(`${scheme}:${path}`);
  }
  get scheme() {
    return new URL(this.text).protocol.slice(0, -1);
  }
  static file(path) {
    return new Uri(pathToFileURL(path).toString());
  }
  get path() {
    return new URL(this.text).pathname;
  }
  get fsPath() {
    return fileURLToPath(this.text);
  }
  toString() {
    return this.text;
  }
}

/** Tests of a view, as an editor keeps them. */
class Items {
  constructor() {
    this.all = new Map();
  }
  get size() {
    return this.all.size;
  }
  add(item) {
    this.all.set(item.id, item);
  }
  delete(id) {
    this.all.delete(id);
  }
  replace(items) {
    this.all = new Map(items.map((item) => [item.id, item]));
  }
  forEach(visit) {
    this.all.forEach((item) => visit(item));
  }
}

/** What came of tests. */
const outcomes = [];
const started = [];
const controller = {
  items: new Items(),
  createTestItem: (id, label, uri) => ({ id, label, uri, children: new Items() }),
  createRunProfile(_, __, run) {
    this.run = run;
  },
  createTestRun: () => ({
    started: (item) => started.push(item.label),
    skipped: (item) => outcomes.push([item.label, "skipped"]),
    appendOutput() {},
    passed: (item) => outcomes.push([item.label, "passed"]),
    failed: (item, messages) => outcomes.push([item.label, "failed", messages]),
    errored: (item, message) => outcomes.push([item.label, "errored", message]),
    end: () => outcomes.push("end"),
  }),
};

const folder = mkdtempSync(join(tmpdir(), "nsdc-"));
const inFolder = (name) => pathToFileURL(join(folder, name)).toString();
const relay = inFolder("relay.nsd");
const RELAY =
  "model relay { state x = 1; x' = -sign(x); }\n" +
  "simulate settles of relay {\n  horizon 2;\n  expect x at end ~ 0 within 1e-9;\n}\n" +
  "simulate fails of relay {\n  horizon 2;\n  expect x at end ~ 0 within 1e-9;\n  expect x at 0 ~ 2 within 1e-9;\n}\n";
writeFileSync(fileURLToPath(relay), RELAY);

/** A program that takes down where it is started. */
function noting(name, then) {
  const path = join(folder, "bin", name);
  writeFileSync(path, `#!/bin/sh\npwd >> '${folder}/starts'\n${then}\n`, { mode: 0o755 });
  return path;
}

mkdirSync(join(folder, "bin"));
const noted = noting("nsdc", `exec '${program}' "$@"`);
const ends = noting("ends", "exit 1");
const mute = noting("mute", "exec sleep 1000");

/** Milliseconds that the extension waits for an answer, and those that it waits here. */
const LIMIT = 20_000;
let patience = LIMIT;
const { setTimeout: wait } = globalThis;
globalThis.setTimeout = (call, delay, ...rest) => wait(call, delay === LIMIT ? patience : delay, ...rest);

const starts = () => (existsSync(join(folder, "starts")) ? readFileSync(join(folder, "starts"), "utf8").trim().split("\n") : []);

const settings = { path: noted, inlayHints: true };
const commands = new Map();
const contexts = new Map();
const panels = [];
const documents = [];
const picked = [];
const asked = [];
const messages = [];
const selectors = [];
const [saved, closed, configured, moved, trusted] = Array.from({ length: 5 }, () => new Emitter());
const [made, changed, removed] = Array.from({ length: 3 }, () => new Emitter());
let contents;
let files = [relay, uri("examples/sump.nsd")];
const oscillator = uri("examples/oscillator.nsd");
const inFront = { document: { uri: Uri.parse(oscillator), languageId: "nsd" } };

async function until(isTrue) {
  while (!isTrue()) await new Promise((resolve) => setTimeout(resolve, 10));
}

const vscode = anything({
  version: "1.100.0",
  env: anything({ appName: "a test", language: "en" }),
  EventEmitter: Emitter,
  Uri,
  Range: class {
    constructor(line, character, endLine, endCharacter) {
      this.start = { line, character };
      this.end = { line: endLine, character: endCharacter };
    }
  },
  TestMessage: class {
    constructor(text) {
      this.text = text;
    }
  },
  Location: class {
    constructor(uri, position) {
      this.position = position;
    }
  },
  tests: { createTestController: () => controller },
  commands: {
    registerCommand(name, run) {
      assert(!commands.has(name), `${name} is registered twice`);
      commands.set(name, run);
      return { dispose: () => commands.delete(name) };
    },
    executeCommand: (name, ...args) => (name === "setContext" ? contexts.set(...args) : commands.get(name)(...args)),
  },
  window: anything({
    // It stands there until somebody closes it.
    showErrorMessage(text) {
      messages.push(text);
      return new Promise(() => undefined);
    },
    activeTextEditor: inFront,
    visibleTextEditors: [inFront],
    async showQuickPick(items, { title }) {
      asked.push(title);
      return items.find((item) => picked.includes(item.label ?? item));
    },
    createWebviewPanel(_, title) {
      const pages = [];
      const webview = { set html(page) { pages.push(page); } };
      const panel = { title, pages, webview, onDidDispose() {}, reveal() {} };
      panels.push(panel);
      return panel;
    },
    showTextDocument: async (document) => documents.push(document),
  }),
  workspace: anything({
    isTrusted: true,
    getConfiguration: () => ({ get: (name) => settings[name] }),
    registerTextDocumentContentProvider: (_, provider) => (contents = provider),
    openTextDocument: async (uri) =>
      uri.scheme === "file"
        ? TextDocument.create(uri.toString(), "nsd", 1, readFileSync(fileURLToPath(uri.toString()), "utf8"))
        : { uri, text: contents.provideTextDocumentContent(uri) },
    findFiles: async () => files.map(Uri.parse),
    asRelativePath: (uri) => uri.path.split("/").at(-1),
    onDidSaveTextDocument: saved.event,
    onDidCloseTextDocument: closed.event,
    onDidChangeConfiguration: configured.event,
    onDidChangeWorkspaceFolders: moved.event,
    onDidGrantWorkspaceTrust: trusted.event,
    createFileSystemWatcher: () => ({
      onDidCreate: made.event,
      onDidChange: changed.event,
      onDidDelete: removed.event,
      dispose() {},
    }),
    textDocuments: [],
    workspaceFolders: [{ uri: Uri.file(folder), name: "models", index: 0 }],
  }),
  languages: anything({
    getLanguages: async () => ["plaintext"],
    setTextDocumentLanguage: async () => {},
    registerHoverProvider(selector) {
      selectors.push(selector);
      return { dispose() {} };
    },
  }),
});

const load = Module._load;
Module._load = (name, ...rest) => (name === "vscode" ? vscode : load(name, ...rest));
execFileSync("npm", ["run", "--silent", "build"], { cwd: here });
const described = JSON.parse(readFileSync(join(here, "package.json"), "utf8"));
const extension = require(join(here, "out/extension.js"));
await extension.activate({ subscriptions: [], extensionPath: here });
after(async () => {
  await extension.deactivate();
  rmSync(folder, { recursive: true });
});

/** A test after which nothing has been said that was not expected. */
const silent = (title, run) =>
  test(title, async () => {
    await run();
    assert.deepEqual(messages.splice(0), []);
  });

silent("what is offered is there", () => {
  const titles = described.contributes.commands.map(({ command }) => command);
  assert.deepEqual([...commands.keys()].toSorted(), titles.toSorted());
  // The palette has them where the extension is at work.
  const { commandPalette } = described.contributes.menus;
  assert.deepEqual(commandPalette.map(({ command }) => command).toSorted(), titles.toSorted());
  assert(commandPalette.every(({ when }) => contexts.get(when)));
});

test("what is named is in the package, and the licenses of what is bundled", () => {
  const listed = execFileSync("npx", ["--no-install", "vsce", "ls", "--no-dependencies"], { cwd: here, encoding: "utf8" });
  const there = new Set(listed.trim().split("\n"));
  const { languages, grammars, snippets, walkthroughs } = described.contributes;
  const named = [
    described.main,
    ...languages.map(({ configuration }) => configuration),
    ...[...grammars, ...snippets].map(({ path }) => path),
    ...walkthroughs.flatMap(({ steps }) => steps.map(({ media }) => media.markdown)),
    "README.md",
    "LICENSE",
    "out/THIRD-PARTY-NOTICES.txt",
  ].map((path) => path.replace(/^\.\//, ""));
  assert.deepEqual(named.filter((path) => !there.has(path)), []);
  const paths = JSON.stringify(described.contributes).match(/"[^" ]+\.(json|md|svg|png)"/g).map((path) => JSON.parse(path));
  assert.deepEqual(paths.map((path) => path.replace(/^\.\//, "")).filter((path) => !named.includes(path)), []);
  assert.deepEqual([...there].filter((path) => /^(src|test|node_modules)\/|\.mjs$/.test(path)), []);
  const notices = readFileSync(join(here, "out/THIRD-PARTY-NOTICES.txt"), "utf8").split(/^-{80}$/m);
  assert(notices.some((text) => /^\s*vscode-languageclient [\d.]+ \(MIT\)[^]*Microsoft Corporation[^]*WITHOUT WARRANTY/.test(text)));
});

silent("a lens runs an experiment, and its report opens beside until it is closed", async () => {
  await commands.get("nsdc.run")(oscillator, "crossing");
  const shown = documents.pop();
  assert.equal(shown.uri.toString(), "nsdc:/oscillator.crossing.run.txt");
  assert.match(shown.text, /crossing of oscillator: solved/);
  assert.equal(contents.provideTextDocumentContent(shown.uri), shown.text);
  closed.fire(shown);
  assert.equal(contents.provideTextDocumentContent(shown.uri), "");
});

silent("files and texts without a file are the server's, and no others", () => {
  const [selector] = selectors;
  assert.deepEqual(selector.map(({ language, scheme }) => [language, scheme]), [["nsd", "file"], ["nsd", "untitled"]]);
});

silent("an experiment and a form are chosen where none is given", async () => {
  picked.splice(0, 2, "reversed", "dcs");
  await commands.get("nsdc.emitForm")();
  const shown = documents.pop();
  assert.equal(shown.uri.toString(), "nsdc:/oscillator.reversed.dcs.txt");
  assert(shown.text.length > 100);
});

silent("menus name the file alone, or with a group of editors", async () => {
  picked.splice(0, 2, "fails");
  for (const args of [[Uri.parse(relay)], [Uri.parse(relay), { groupId: 0 }]]) {
    await commands.get("nsdc.run")(...args);
    assert.equal(documents.pop().uri.toString(), "nsdc:/relay.fails.run.txt");
  }
});

test("without a text in front the file is one that is seen, or chosen", async () => {
  const { window } = vscode;
  window.activeTextEditor = undefined;
  picked.splice(0, 2, "reversed", "relay.nsd", "settles");
  await commands.get("nsdc.run")();
  assert.equal(documents.pop().uri.toString(), "nsdc:/oscillator.reversed.run.txt");
  window.visibleTextEditors = [{ document: { uri: Uri.parse("git:/a.nsd"), languageId: "nsd" } }];
  asked.splice(0);
  await commands.get("nsdc.run")();
  assert.deepEqual(asked, ["File", "Experiment"]);
  assert.equal(documents.pop().uri.toString(), "nsdc:/relay.settles.run.txt");
  picked.splice(0);
  await commands.get("nsdc.run")();
  assert.deepEqual(messages, []);
  files = [];
  await commands.get("nsdc.plot")();
  files = [relay, uri("examples/sump.nsd")];
  assert.deepEqual(messages.splice(0), ["nsdc: there is no .nsd file here yet"]);
  assert.equal(documents.length, 0);
  Object.assign(window, { activeTextEditor: inFront, visibleTextEditors: [inFront] });
});

silent("a figure opens beside, and is drawn again when a file is saved", async () => {
  await commands.get("nsdc.plot")(oscillator, "crossing");
  const [{ pages }] = panels;
  assert.equal(pages.length, 1);
  // This is no file of a disk.
  saved.fire({ uri: Uri.parse("git:/a.nsd") });
  saved.fire({ uri: Uri.parse(oscillator) });
  await until(() => pages.length > 1);
  await commands.get("nsdc.plot")(oscillator, "crossing");
  assert.equal(pages.length, 3);
  pages.forEach((page) => assert.match(page, /data:image\/svg\+xml/));
  assert.equal(panels.length, 1);
  assert.equal(documents.length, 0);
});

/** What stops nothing, as far as anybody listens. */
const never = { isCancellationRequested: false, onCancellationRequested: () => ({ dispose() {} }) };

silent("experiments are tests, and fail at the line of what they expect", async () => {
  await controller.resolveHandler();
  const first = controller.items.all.get(relay);
  assert(controller.items.all.has(uri("examples/sump.nsd")));
  assert.deepEqual([...first.children.all.values()].map((item) => item.label), ["settles", "fails"]);
  await controller.run({ include: [first] }, never);
  const [passed, [name, outcome, messages], end] = outcomes.splice(0);
  assert.deepEqual([passed, name, outcome, end], [["settles", "passed"], "fails", "failed", "end"]);
  assert.equal(messages.length, 1);
  assert.match(messages[0].text, /^expect x at 0 ~ 2 within 1e-9\nexpected 2/);
  assert.deepEqual(messages[0].location.position, { line: 8, character: 2 });
  assert.equal(messages[0].expectedOutput, "2 within 1e-9");
});

silent("tests that are excluded are not run, nor those in a file that is", async () => {
  const first = controller.items.all.get(relay);
  const [, fails] = first.children.all.values();
  await controller.run({ include: [first], exclude: [fails] }, never);
  assert.deepEqual(outcomes.splice(0), [["settles", "passed"], "end"]);
  await controller.run({ exclude: [first, controller.items.all.get(uri("examples/sump.nsd"))] }, never);
  assert.deepEqual(outcomes.splice(0), ["end"]);
});

silent("a test that is stopped ends at once, and is skipped like those behind it", async () => {
  const long = inFolder("long.nsd");
  writeFileSync(
    fileURLToPath(long),
    "model spin { state x = 1; state y = 0; x' = -y; y' = x; }\n" +
      "simulate first of spin { horizon 1e9; expect x at end < 2; }\nsimulate second of spin { horizon 1e9; }\n",
  );
  made.fire(Uri.parse(long));
  await until(() => controller.items.all.has(long));
  const stopped = new Emitter();
  const token = {
    isCancellationRequested: false,
    onCancellationRequested: (listener) =>
      token.isCancellationRequested ? setTimeout(listener, 0) : stopped.event(listener),
  };
  const ended = controller.run({ include: [controller.items.all.get(long)] }, token);
  await until(() => started.includes("first"));
  token.isCancellationRequested = true;
  stopped.fire();
  await ended;
  assert.deepEqual(outcomes.splice(0), [["first", "skipped"], ["second", "skipped"], "end"]);
  rmSync(fileURLToPath(long));
  removed.fire(Uri.parse(long));
  await until(() => !controller.items.all.has(long));
});

silent("what fails is placed where it stands now", async () => {
  const [, fails] = controller.items.all.get(relay).children.all.values();
  // As if lines had come before it.
  fails.range = new vscode.Range(0, 0, 3, 0);
  await controller.run({ include: [fails] }, never);
  const [[, , [message]]] = outcomes.splice(0);
  assert.deepEqual(message.location.position, { line: 8, character: 2 });
});

silent("the view of tests follows the files", async () => {
  const other = inFolder("other.nsd");
  const labels = () => [...(controller.items.all.get(other)?.children.all.values() ?? [])].map((item) => item.label);
  writeFileSync(fileURLToPath(other), RELAY);
  made.fire(Uri.parse(other));
  await until(() => labels().length === 2);
  writeFileSync(fileURLToPath(other), RELAY.replace("simulate fails", "simulate stops"));
  changed.fire(Uri.parse(other));
  await until(() => labels()[1] === "stops");
  rmSync(fileURLToPath(other));
  removed.fire(Uri.parse(other));
  await until(() => labels().length === 0);
  files = [relay];
  await controller.refreshHandler();
  assert.deepEqual([...controller.items.all.keys()], [relay]);
});

const change = { affectsConfiguration: (name) => name === "nsdc" };

silent("changes that come together start the server once, others one after the other", async () => {
  const before = starts().length;
  configured.fire(change);
  configured.fire(change);
  await commands.get("nsdc.run")(oscillator, "crossing");
  assert.equal(starts().length, before + 1);
  configured.fire(change);
  await until(() => starts().length === before + 2);
  // It is starting.
  configured.fire(change);
  moved.fire({ added: [], removed: [] });
  await commands.get("nsdc.run")(oscillator, "crossing");
  assert.equal(starts().length, before + 3);
  moved.fire({ added: [], removed: [] });
  await commands.get("nsdc.run")(oscillator, "crossing");
  assert.equal(starts().length, before + 4);
  assert.match(documents.splice(0).at(-1).text, /solved/);
});

test("the program is not started in the folder, and a path from it on is taken if it is trusted", async () => {
  settings.path = "bin/nsdc";
  const before = starts().length;
  configured.fire(change);
  await commands.get("nsdc.run")(oscillator, "crossing");
  assert.equal(documents.splice(0).length, 1);
  assert.equal(starts().length, before + 1);
  assert.deepEqual(new Set(starts()), new Set([realpathSync(here)]));
  vscode.workspace.isTrusted = false;
  configured.fire(change);
  await until(() => messages.length > 0);
  assert.match(messages.pop(), /`bin\/nsdc lsp` cannot be started: .* trusted$/);
  assert.equal(starts().length, before + 1);
  vscode.workspace.isTrusted = true;
  trusted.fire();
  await commands.get("nsdc.run")(oscillator, "crossing");
  assert.equal(documents.splice(0).length, 1);
  assert.deepEqual(messages, []);
});

for (const [title, path, why, tries] of [
  ["is not there", "/nonexistent", /ENOENT/, 0],
  ["ends at once", ends, /./, 1],
  ["never answers", mute, /does not answer/, 1],
]) {
  test(`a program that ${title} is tried once, and told once`, async () => {
    const before = starts().length;
    settings.path = path;
    patience = path === mute ? 300 : LIMIT;
    configured.fire(change);
    await until(() => messages.length > 0);
    assert.match(messages[0], why);
    for (const { command } of described.contributes.commands.filter(({ command }) => command !== "nsdc.restart")) {
      messages.splice(0);
      await commands.get(command)(Uri.parse(oscillator), { groupId: 0 });
      assert.deepEqual(messages, ["nsdc: the language server does not run; is `nsdc.path` right?"]);
    }
    messages.splice(0);
    await commands.get("nsdc.restart")();
    assert.equal(messages.length, 1);
    assert(messages.pop().startsWith(`nsdc: \`${path} lsp\` cannot be started`));
    saved.fire({ uri: Uri.parse(oscillator) });
    changed.fire(Uri.parse(relay));
    await controller.resolveHandler();
    await extension.deactivate();
    assert.deepEqual(messages, []);
    assert.equal(starts().length, before + 2 * tries);
    settings.path = noted;
    patience = LIMIT;
    configured.fire(change);
    await until(() => controller.items.size > 0);
    await commands.get("nsdc.run")(oscillator, "crossing");
    assert.equal(documents.splice(0).length, 1);
    assert.deepEqual(messages, []);
  });
}
