// `src/` is what comes of `grammar.js` and of the words of the language, as far as that can be told without the program
// that generates it.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { test } from "node:test";

const require = createRequire(import.meta.url);
const kept = JSON.parse(readFileSync(new URL("../src/grammar.json", import.meta.url), "utf8"));

/** A rule as it is kept. */
function rule(value) {
  if (typeof value === "string") return { type: "STRING", value };
  if (value instanceof RegExp) return { type: "PATTERN", value: value.source, ...(value.flags && { flags: value.flags }) };
  return value;
}

const one = (type) => (content) => ({ type, content: rule(content) });
const several = (type) => (...members) => ({ type, members: members.map(rule) });
const ranked = (type) => (value, content) =>
  content === undefined ? { type, value: 0, content: rule(value) } : { type, value, content: rule(content) };

/** The words that `grammar.js` is written with. */
const language = {
  seq: several("SEQ"),
  choice: several("CHOICE"),
  optional: (content) => language.choice(content, { type: "BLANK" }),
  repeat: one("REPEAT"),
  repeat1: one("REPEAT1"),
  token: Object.assign(one("TOKEN"), { immediate: one("IMMEDIATE_TOKEN") }),
  prec: Object.assign(ranked("PREC"), {
    left: ranked("PREC_LEFT"),
    right: ranked("PREC_RIGHT"),
    dynamic: ranked("PREC_DYNAMIC"),
  }),
  field: (name, content) => ({ type: "FIELD", name, content: rule(content) }),
  alias: (content, value) => ({
    type: "ALIAS",
    content: rule(content),
    named: typeof value !== "string",
    value: value.name ?? value,
  }),
  grammar: (described) => described,
};

test("grammar.json is that of grammar.js", () => {
  Object.assign(globalThis, language);
  const described = require("../grammar.js");
  const symbols = new Proxy({}, { get: (_, name) => ({ type: "SYMBOL", name }) });
  const rules = Object.entries(described.rules).map(([name, of]) => [name, rule(of(symbols))]);
  assert.deepEqual(Object.fromEntries(rules), kept.rules);
  const names = (all) => all.map((symbol) => symbol.name);
  assert.deepEqual(described.extras(symbols).map(rule), kept.extras);
  assert.deepEqual(described.conflicts(symbols).map(names), kept.conflicts);
  assert.deepEqual(names(described.supertypes(symbols)), kept.supertypes);
  assert.equal(described.word(symbols).name, kept.word);
});
