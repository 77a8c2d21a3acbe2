// The colours of all models agree with what the compiler reads.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import oniguruma from "vscode-oniguruma";
import textmate from "vscode-textmate";

import { built } from "./server.mjs";

const here = fileURLToPath(new URL(".", import.meta.url));

/** Texts with their tokens: `cargo build -p nsd-tests --example editors` makes what prints them. */
function texts() {
  const printed = execFileSync(join(built, "examples/editors"), ["--tokens"], { maxBuffer: 2 ** 28, encoding: "utf8" });
  return JSON.parse(printed);
}

/** Python, as far as it matters here. */
const PYTHON = { scopeName: "source.python", patterns: [{ name: "string.python", begin: "'", end: "'" }] };

async function registry() {
  const wasm = createRequire(import.meta.url).resolve("vscode-oniguruma/release/onig.wasm");
  await oniguruma.loadWASM(readFileSync(wasm));
  const known = JSON.parse(readFileSync(join(here, "../package.json"), "utf8")).contributes.grammars;
  return new textmate.Registry({
    onigLib: Promise.resolve({
      createOnigScanner: (patterns) => new oniguruma.OnigScanner(patterns),
      createOnigString: (text) => new oniguruma.OnigString(text),
    }),
    loadGrammar: async (scope) => {
      if (scope === PYTHON.scopeName) return PYTHON;
      const file = join(here, "..", known.find(({ scopeName }) => scopeName === scope).path);
      return textmate.parseRawGrammar(readFileSync(file, "utf8"), file);
    },
    getInjections: (scope) => known.filter(({ injectTo }) => injectTo?.includes(scope)).map(({ scopeName }) => scopeName),
  });
}

/** What a scope says that the compiler says, too. */
const KINDS = [
  [/^comment\./, "comment"],
  [/^string\.unquoted/, "path"],
  [/^string\./, "string"],
  [/^constant\.numeric/, "number"],
  [/^support\.type\.unit/, "unit"],
  [/^keyword\.operator/, "symbol"],
  [/^(keyword|storage)\./, "word"],
  [/^(variable|entity|support|constant)\./, "name"],
];

function kindOf(scopes) {
  const scope = scopes.at(-1);
  return KINDS.find(([pattern]) => pattern.test(scope))?.[1] ?? "symbol";
}

/** The kind at every character of a text. */
function coloured(language, text) {
  const kinds = [];
  let state = textmate.INITIAL;
  for (const line of text.split("\n")) {
    const found = language.tokenizeLine(line, state);
    assert(!found.stoppedEarly);
    for (const { startIndex, endIndex, scopes } of found.tokens) {
      assert(!scopes.some((scope) => scope.startsWith("invalid")), `${scopes} in ${line}`);
      for (let at = startIndex; at < Math.min(endIndex, line.length); at++) kinds.push(kindOf(scopes));
    }
    kinds.push("line");
    state = found.ruleStack;
  }
  return kinds;
}

const all = Object.entries(texts());
const grammars = await registry();
const language = await grammars.loadGrammar("source.nsd");

test("there are models, and texts with every word as a name", () => {
  assert(all.filter(([name]) => name.startsWith("examples/")).length > 50);
  assert(all.filter(([name]) => name.endsWith(" as a name")).length > 80);
});

for (const [name, { text, tokens }] of all) {
  test(`colours of ${name}`, () => {
    const kinds = coloured(language, text);
    let at = 0;
    const wrong = [];
    for (const [kind, written] of tokens) {
      at = text.indexOf(written, at);
      const found = new Set(kinds.slice(at, at + written.length));
      if (found.size !== 1 || !found.has(kind)) {
        const begin = text.lastIndexOf("\n", at - 1) + 1;
        const line = text.slice(begin, (text + "\n").indexOf("\n", at));
        wrong.push(`${[...found]} for the ${kind} \`${written}\` at ${at - begin} of: ${line}`);
      }
      at += written.length;
    }
    assert.equal(wrong.join("\n"), "");
  });
}

test("cells of notebooks that begin with %%nsd", async () => {
  const python = await grammars.loadGrammar("source.python");
  const [, { text }] = all.find(([name]) => name === "examples/oscillator.nsd");
  const magic = "%%nsd oscillator crossing";
  const kinds = coloured(python, `${magic}\n${text}`);
  assert.equal(kinds[0], "word");
  assert.deepEqual(kinds.slice(magic.length + 1), coloured(language, text));
  // What else is in a notebook stays Python, in which a prime begins a string.
  assert.equal(coloured(python, "x' = 1").at(-2), "string");
});
