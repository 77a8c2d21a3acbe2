// What the server answers, as an editor shows it. Nothing here knows an editor.

"use strict";

/** What the server does with an experiment. */
const WORDS = ["run", "plot", "test", "verify", "emit"];

/** The forms that `nsdc emit` prints, with what each is. */
const FORMS = {
  system: "the piecewise smooth system, switches explicit",
  dcs: "the dynamic complementarity system",
  fesd: "the discretized system with switch detection",
  mpcc: "the mathematical program with complementarity constraints",
  nl: "an AMPL .nl file",
  tex: "the dynamic complementarity system as LaTeX",
  dot: "which switches act on which states, as a Graphviz graph",
  model: "the model, names resolved and shapes known",
  ast: "the abstract syntax",
};

/** The languages of forms that editors know. */
const LANGUAGES = { tex: "latex", dot: "dot" };

/**
 * The document that shows an answer beside the text: a name, a language and a text.
 *
 * @param {string} word what was done: `run`, `test`, `verify`, `emit`
 * @param {string} uri of the file
 * @param {string} name of the experiment
 * @param {string | undefined} form of `emit`
 * @param {string} text of the answer
 */
function document(word, uri, name, form, text) {
  const ending = word === "emit" ? (form ?? "system") : word;
  const file = decodeURIComponent(uri).split(/[/:]/).at(-1).replace(/\.nsd$/, "");
  return { path: `${file}.${name}.${ending}.txt`, language: LANGUAGES[ending] ?? "plaintext", text };
}

const escaped = (text) =>
  text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

/**
 * The page with a figure, or with why there is none. Nothing in it is run, and nothing is fetched.
 *
 * @param {{ figure?: string | null, text: string }} answer
 */
function page(answer) {
  const policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";
  const data = (svg) => Buffer.from(svg, "utf8").toString("base64");
  const shown = answer.figure
    ? `<img alt="figure" src="data:image/svg+xml;base64,${data(answer.figure)}">`
    : `<pre>${escaped(answer.text)}</pre>`;
  return `<!DOCTYPE html>
<html>
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="${policy}">
<style>img { background: white; max-width: 100%; }</style>
</head>
<body>${shown}</body>
</html>
`;
}

/** Lines of a golden file that differ, and those around them, stand behind so many blanks. */
const GOLDEN = " ".repeat(14);

/**
 * What was expected and what came, where both are told: numbers, or lines of a golden file.
 *
 * @param {string[]} said
 * @param {string[]} lines
 */
function compared(said, lines) {
  const told = (word) => said.find((line) => line.startsWith(`${word} `))?.slice(word.length + 1);
  const side = (mark) => lines.filter((line) => line[0] === mark || line[0] === " ").map((line) => line.slice(2));
  const [expected, got] = lines.length > 0 ? ["-", "+"].map((mark) => side(mark).join("\n")) : ["expected", "got"].map(told);
  return expected === undefined || got === undefined ? {} : { expected, got };
}

/**
 * What failed, from what `nsdc test` prints of one experiment: each with what was said besides.
 *
 * @param {string} text
 * @returns {{ what: string, said: string[], expected?: string, got?: string }[]}
 */
function failures(text) {
  const found = [];
  let failed = false;
  for (const line of text.split("\n")) {
    if (/^\S/.test(line)) {
      failed = line.startsWith("FAILED ");
    } else if (failed && /^ {10}\S/.test(line)) {
      found.push({ what: line.trim(), said: [], lines: [] });
    } else if (failed && found.length > 0 && line.trim() !== "") {
      const { said, lines } = found.at(-1);
      if (line.startsWith(GOLDEN)) lines.push(line.slice(GOLDEN.length));
      else said.push(line.trim());
    }
  }
  return found.map(({ what, said, lines }) => ({ what, said, ...compared(said, lines) }));
}

const squeezed = (text) => text.replace(/\s+/g, " ").trim();

/**
 * Where in a piece of text a statement stands, whatever blanks it has; its first character where it is not there.
 *
 * @param {string} text
 * @param {string} statement
 * @returns {number}
 */
function place(text, statement) {
  const wanted = squeezed(statement);
  for (const { index } of text.matchAll(/\bexpect\b/g)) {
    const end = text.indexOf(";", index);
    if (squeezed(text.slice(index, end < 0 ? text.length : end)) === wanted) return index;
  }
  return 0;
}

/**
 * The experiments among the symbols of a file, in order, with their ranges.
 *
 * @param {{ name: string, detail?: string, range: object, selectionRange: object }[] | null} symbols
 */
function experiments(symbols) {
  return (symbols ?? []).filter((symbol) => symbol.detail === "experiment");
}

module.exports = { FORMS, WORDS, document, page, failures, place, experiments };
