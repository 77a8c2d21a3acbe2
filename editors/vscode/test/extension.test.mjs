// The extension as it is packaged, with the server and an editor that only takes down what it is asked.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { EventEmitter } from "node:events";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
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
    this.all = new EventEmitter();
    this.event = (listener, self) => {
      this.all.on("it", listener.bind(self));
      return { dispose: () => this.all.off("it", listener) };
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
  get path() {
    return new URL(this.text).pathname;
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
const controller = {
  items: new Items(),
  createTestItem: (id, label, uri) => ({ id, label, uri, children: new Items() }),
  createRunProfile(_, __, run) {
    this.run = run;
  },
  createTestRun: () => ({
    started() {},
    appendOutput() {},
    passed: (item) => outcomes.push([item.label, "passed"]),
    failed: (item, messages) => outcomes.push([item.label, "failed", messages]),
    errored: (item, message) => outcomes.push([item.label, "errored", message]),
    end: () => outcomes.push("end"),
  }),
};

const folder = mkdtempSync(join(tmpdir(), "nsdc-"));
const relay = pathToFileURL(join(folder, "relay.nsd")).toString();
writeFileSync(
  fileURLToPath(relay),
  "model relay { state x = 1; x' = -sign(x); }\n" +
    "simulate settles of relay {\n  horizon 2;\n  expect x at end ~ 0 within 1e-9;\n}\n" +
    "simulate fails of relay {\n  horizon 2;\n  expect x at end ~ 0 within 1e-9;\n  expect x at 0 ~ 2 within 1e-9;\n}\n",
);

const commands = new Map();
const panels = [];
const documents = [];
const picked = [];
const saved = new Emitter();
let contents;
const oscillator = uri("examples/oscillator.nsd");

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
    executeCommand: (name, ...args) => commands.get(name)(...args),
  },
  window: anything({
    showErrorMessage: async (text) => assert.fail(text),
    activeTextEditor: { document: { uri: Uri.parse(oscillator) } },
    showQuickPick: async (items) => items.find((item) => picked.includes(item.label ?? item)),
    createWebviewPanel(_, title) {
      const panel = { title, webview: { html: "" }, onDidDispose() {}, reveal() {} };
      panels.push(panel);
      return panel;
    },
    showTextDocument: async (document) => documents.push(document),
  }),
  workspace: anything({
    getConfiguration: () => ({ get: (name) => ({ path: program, inlayHints: true })[name] }),
    registerTextDocumentContentProvider: (_, provider) => (contents = provider),
    openTextDocument: async (uri) =>
      uri.scheme === "file"
        ? TextDocument.create(uri.toString(), "nsd", 1, readFileSync(fileURLToPath(uri.toString()), "utf8"))
        : { uri, text: contents.provideTextDocumentContent(uri) },
    findFiles: async () => [relay, uri("examples/sump.nsd")].map(Uri.parse),
    asRelativePath: (uri) => uri.path.split("/").at(-1),
    onDidSaveTextDocument: saved.event,
    textDocuments: [],
    workspaceFolders: undefined,
  }),
  languages: anything({ getLanguages: async () => ["plaintext"], setTextDocumentLanguage: async () => {} }),
});

const load = Module._load;
Module._load = (name, ...rest) => (name === "vscode" ? vscode : load(name, ...rest));
execFileSync("npm", ["run", "--silent", "build"], { cwd: here });
const extension = require(join(here, "out/extension.js"));
await extension.activate({ subscriptions: [] });
after(async () => {
  await extension.deactivate();
  rmSync(folder, { recursive: true });
});

test("what is offered is there", () => {
  const { contributes } = require(join(here, "package.json"));
  assert.deepEqual([...commands.keys()].toSorted(), contributes.commands.map(({ command }) => command).toSorted());
});

test("a lens runs an experiment, and its report opens beside", async () => {
  await commands.get("nsdc.run")(oscillator, "crossing");
  const shown = documents.pop();
  assert.equal(shown.uri.toString(), "nsdc:/crossing.run.txt");
  assert.match(shown.text, /crossing of oscillator: solved/);
});

test("an experiment and a form are chosen where none is given", async () => {
  picked.splice(0, 2, "reversed", "dcs");
  await commands.get("nsdc.emitForm")();
  const shown = documents.pop();
  assert.equal(shown.uri.toString(), "nsdc:/reversed.dcs.txt");
  assert(shown.text.length > 100);
});

test("a figure opens beside, and is drawn again when a file is saved", async () => {
  await commands.get("nsdc.plot")(oscillator, "crossing");
  assert.equal(panels.length, 1);
  assert.match(panels[0].webview.html, /data:image\/svg\+xml/);
  panels[0].webview.html = "";
  saved.fire({ uri: Uri.parse(oscillator) });
  while (panels[0].webview.html === "") await new Promise((resolve) => setTimeout(resolve, 10));
  assert.match(panels[0].webview.html, /data:image\/svg\+xml/);
  assert.equal(panels.length, 1);
  assert.equal(documents.length, 0);
});

test("experiments are tests, and fail at the line of what they expect", async () => {
  await controller.resolveHandler();
  const first = controller.items.all.get(relay);
  assert(controller.items.all.has(uri("examples/sump.nsd")));
  assert.deepEqual([...first.children.all.values()].map((item) => item.label), ["settles", "fails"]);
  await controller.run({ include: [first] }, { isCancellationRequested: false });
  const [passed, [name, outcome, messages], end] = outcomes;
  assert.deepEqual([passed, name, outcome, end], [["settles", "passed"], "fails", "failed", "end"]);
  assert.equal(messages.length, 1);
  assert.match(messages[0].text, /^expect x at 0 ~ 2 within 1e-9\nexpected 2/);
  assert.deepEqual(messages[0].location.position, { line: 8, character: 2 });
  assert.equal(messages[0].expectedOutput, "2 within 1e-9");
});
