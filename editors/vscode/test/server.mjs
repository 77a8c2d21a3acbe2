// A client of `nsdc lsp`, over pipes.

import { spawn } from "node:child_process";
import { join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

import protocol from "vscode-languageserver-protocol/node";

export const root = fileURLToPath(new URL("../../..", import.meta.url));
/** What `cargo build` makes. */
export const built = resolve(root, process.env.CARGO_TARGET_DIR || "target", "debug");
export const program = join(built, "nsdc");

export const uri = (path) => pathToFileURL(join(root, path)).toString();

export async function connect() {
  const server = spawn(program, ["lsp"], { stdio: ["pipe", "pipe", "inherit"] });
  const connection = protocol.createProtocolConnection(
    new protocol.StreamMessageReader(server.stdout),
    new protocol.StreamMessageWriter(server.stdin),
  );
  connection.listen();
  const folders = [{ uri: pathToFileURL(root).toString(), name: "nsdc" }];
  const params = { processId: null, rootUri: null, capabilities: {}, workspaceFolders: folders };
  const { capabilities } = await connection.sendRequest("initialize", params);
  connection.sendNotification("initialized", {});
  const command = (word, ...args) =>
    connection.sendRequest("workspace/executeCommand", { command: `nsdc.${word}`, arguments: args });
  const leave = async () => {
    await connection.sendRequest("shutdown");
    connection.sendNotification("exit");
    await new Promise((resolve) => server.on("exit", resolve));
    connection.dispose();
  };
  return { connection, capabilities, command, leave };
}
