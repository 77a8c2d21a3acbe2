// `nsdc lsp`, and the client that talks with it.

"use strict";

const { isAbsolute, join } = require("node:path");
const vscode = require("vscode");
const { CloseAction, ExecuteCommandRequest, LanguageClient } = require("vscode-languageclient/node");

/** Schemes of documents that the server can read, or that have no file yet. */
const SCHEMES = ["file", "untitled"];

const settings = () => vscode.workspace.getConfiguration("nsdc");

/** The program of the settings; a path that is not absolute begins in the folder, if that is trusted. */
function program() {
  const path = settings().get("path");
  if (isAbsolute(path) || !/[\\/]/.test(path)) return path;
  const [folder] = vscode.workspace.workspaceFolders ?? [];
  if (folder === undefined || !vscode.workspace.isTrusted) {
    throw new Error("a path that is not absolute begins in a folder that is open and trusted");
  }
  return join(folder.uri.fsPath, path);
}

/** Milliseconds in which the program has to answer once it is started. */
const LIMIT = 20_000;

/** A client that leaves commands, and what is said of a start that failed, to who has made it. */
class Client extends LanguageClient {
  registerFeature(feature) {
    if (feature.registrationType?.method !== ExecuteCommandRequest.method) super.registerFeature(feature);
  }

  createDefaultErrorHandler(count) {
    const usual = super.createDefaultErrorHandler(count);
    return {
      error: (...given) => usual.error(...given),
      closed: () => (this.isRunning() ? usual.closed() : { action: CloseAction.DoNotRestart, handled: true }),
    };
  }

  fillInitializeParams(params) {
    super.fillInitializeParams(params);
    params.capabilities.window.showDocument.support = false;
  }

  error(message, data, notify) {
    super.error(message, data, this.isRunning() && notify);
  }
}

/** The server: it is started, stopped and started again, one after the other. */
class Server {
  /**
   * @param {object} of
   * @param {string} of.folder that the program is started in: no folder of models, since some systems look for programs there
   * @param {object} of.log what the client writes to
   * @param {(text: string) => void} of.failed says why the program cannot be started
   * @param {(event: { uri: string, type: number }) => void} of.changed is told of files, once the server knows
   */
  constructor({ folder, log, failed, changed }) {
    Object.assign(this, { folder, log, failed, changed });
    this.last = Promise.resolve();
    this.again = undefined;
    this.client = undefined;
  }

  /** Starts it, for the first time or again; once for all that ask before it begins. */
  restart() {
    this.again ??= this.next(async () => {
      this.again = undefined;
      await this.end();
      await this.begin();
    });
    return this.again;
  }

  stop() {
    return this.next(() => this.end());
  }

  next(step) {
    this.last = this.last.then(step);
    return this.last;
  }

  async begin() {
    try {
      const server = { command: program(), args: ["lsp"], options: { cwd: this.folder } };
      this.client = new Client("nsdc", "nsdc", server, {
        documentSelector: SCHEMES.map((scheme) => ({ language: "nsd", scheme })),
        initializationOptions: { inlayHints: settings().get("inlayHints") },
        initializationFailedHandler: () => false,
        outputChannel: this.log,
        middleware: {
          workspace: {
            didChangeWatchedFile: async (event, next) => {
              await next(event);
              this.changed(event);
            },
          },
        },
      });
      await this.started();
    } catch (error) {
      await this.end();
      this.failed(`nsdc: \`${settings().get("path")} lsp\` cannot be started: ${error.message ?? error}`);
    }
  }

  /** Waits for the answer of the program, but not for ever. */
  async started() {
    let timer;
    const late = new Promise((_, reject) => {
      timer = setTimeout(() => reject(new Error("it does not answer")), LIMIT);
    });
    await Promise.race([this.client.start(), late]).finally(() => clearTimeout(timer));
  }

  async end() {
    const { client } = this;
    this.client = undefined;
    // What could not be started cannot be stopped.
    await client?.stop().catch(() => undefined);
  }

  async request(type, params, token) {
    await this.last;
    if (!this.client?.isRunning()) throw new Error("the language server does not run; is `nsdc.path` right?");
    return this.client.sendRequest(type, params, token);
  }
}

module.exports = { SCHEMES, Server };
