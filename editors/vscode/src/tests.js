// The view of tests.

"use strict";

const vscode = require("vscode");
const { FileChangeType } = require("vscode-languageclient/node");
const { failures, place } = require("./results");

const FILES = "**/*.nsd";

const asRange = ({ start, end }) => new vscode.Range(start.line, start.character, end.line, end.character);

/** Experiments as tests: a file with its experiments, each at its name. */
class Tests {
  /**
   * @param {(uri: string) => Promise<{ name: string, range: object }[]>} experiments of a file
   * @param {(uri: string, name: string, token: object) => Promise<{ status: number, text: string }>} test one of them, until
   *   the token cancels it
   */
  constructor(experiments, test) {
    this.experiments = experiments;
    this.test = test;
    this.isOpen = false;
    this.controller = vscode.tests.createTestController("nsdc", "nsdc");
    this.controller.resolveHandler = (item) => (item ? this.read(item.uri) : this.open());
    this.controller.refreshHandler = () => this.readAll();
    const run = (request, token) => this.run(request, token);
    this.controller.createRunProfile("Test", vscode.TestRunProfileKind.Run, run, true);
  }

  /** What has become of a file; one that cannot be read has no tests, and why not is said where it is open. */
  async follow({ uri, type }) {
    const file = vscode.Uri.parse(uri);
    if (!this.isOpen || !file.path.endsWith(".nsd")) return;
    if (type === FileChangeType.Deleted) this.forget(file);
    else await this.read(file).catch(() => this.forget(file));
  }

  open() {
    this.isOpen = true;
    return this.reopen();
  }

  /** What is shown, after the server has been started. */
  async reopen() {
    if (this.isOpen) await this.readAll().catch(() => undefined);
  }

  forget(uri) {
    this.controller.items.delete(uri.toString());
  }

  async readAll() {
    const files = await vscode.workspace.findFiles(FILES);
    const there = new Set(files.map((uri) => uri.toString()));
    const gone = [];
    this.controller.items.forEach(({ uri }) => there.has(uri.toString()) || gone.push(uri));
    gone.forEach((uri) => this.forget(uri));
    await Promise.all(files.map((uri) => this.read(uri)));
  }

  async read(uri) {
    const found = await this.experiments(uri.toString());
    if (found.length === 0) {
      this.forget(uri);
      return;
    }
    const file = this.controller.createTestItem(uri.toString(), vscode.workspace.asRelativePath(uri), uri);
    const items = found.map((experiment) => {
      const item = this.controller.createTestItem(`${uri} ${experiment.name}`, experiment.name, uri);
      item.range = asRange(experiment.range);
      return item;
    });
    file.children.replace(items);
    this.controller.items.add(file);
  }

  async run(request, token) {
    const run = this.controller.createTestRun(request);
    const asked = [];
    const collect = (item) => {
      if (request.exclude?.includes(item)) return;
      if (item.children.size > 0) item.children.forEach(collect);
      else asked.push(item);
    };
    if (request.include) request.include.forEach(collect);
    else this.controller.items.forEach(collect);
    for (const item of asked) {
      if (token.isCancellationRequested) {
        run.skipped(item);
      } else {
        await this.once(run, item, token);
      }
    }
    run.end();
  }

  async once(run, item, token) {
    run.started(item);
    const begun = Date.now();
    try {
      const answer = await this.test(item.uri.toString(), item.label, token);
      run.appendOutput(answer.text.replaceAll("\n", "\r\n"), undefined, item);
      const took = Date.now() - begun;
      if (answer.status === 0) run.passed(item, took);
      else run.failed(item, await this.messages(item, answer.text), took);
    } catch (error) {
      if (token.isCancellationRequested) run.skipped(item);
      else run.errored(item, new vscode.TestMessage(error.message));
    }
  }

  /** What failed, where it is expected now: the text may have changed since the view was made. */
  async messages(item, text) {
    const found = await this.experiments(item.uri.toString());
    const experiment = found.find(({ name }) => name === item.label);
    const range = experiment ? asRange(experiment.range) : item.range;
    const opened = await vscode.workspace.openTextDocument(item.uri);
    const within = opened.getText(range);
    return failures(text).map(({ what, said, expected, got }) => {
      const message = new vscode.TestMessage([what, ...said].join("\n"));
      message.expectedOutput = expected;
      message.actualOutput = got;
      const at = opened.offsetAt(range.start) + place(within, what);
      message.location = new vscode.Location(item.uri, opened.positionAt(at));
      return message;
    });
  }
}

module.exports = { FILES, Tests };
