// What the extension makes of what the server and the program say.

import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";

import figures from "../src/figures.js";
import results from "../src/results.js";
import { connect, program, root, uri } from "./server.mjs";

const here = join(root, "editors/vscode");
const described = JSON.parse(readFileSync(join(here, "package.json"), "utf8"));
const folder = mkdtempSync(join(tmpdir(), "nsdc-"));
const server = await connect();
after(async () => {
  await server.leave();
  rmSync(folder, { recursive: true });
});

const WRONG = `model relay {
  state x = 1;
  x' = -sign(x);
}
simulate settles of relay {
  horizon 10;
  expect x at end ~ 0 within 1e-9;
  expect x  at end
    ~ 1 within 1e-9;  // it is not
}
`;

/** It leaves sliding for a surface that it grazes, of which the run warns in two lines. */
const GRAZES = `model belt {
  param mu = 0.6; param speed = 0.3;
  state x = 0; state v = 1;
  x' = v; v' = -x - mu*sign(v - speed);
}
simulate pulls of belt { horizon 20; }
`;

function written(name, text) {
  const path = join(folder, name);
  writeFileSync(path, text);
  return path;
}

test("the commands of the server are those of the extension", () => {
  const words = results.WORDS.map((word) => `nsdc.${word}`);
  assert.deepEqual(server.capabilities.executeCommandProvider.commands.toSorted(), words.toSorted());
});

test("experiments are found in files that are not open", async () => {
  const textDocument = { uri: uri("examples/oscillator.nsd") };
  const symbols = await server.connection.sendRequest("textDocument/documentSymbol", { textDocument });
  const found = results.experiments(symbols);
  assert(found.length >= 5 && found.length < symbols.length);
  assert.equal(found[0].name, "crossing");
  assert(found[0].range.start.line < found[0].range.end.line);
  assert.deepEqual(results.experiments(null), []);
});

test("every form can be opened", async () => {
  for (const form of Object.keys(results.FORMS)) {
    const answer = await server.command("emit", uri("examples/tutorial_ocp.nsd"), undefined, form);
    const failed = await server.command("emit", uri("examples/tutorial_ocp.nsd"), "absent", form);
    assert.notEqual(failed.status, 0);
    assert(answer.status === 0 && answer.text.length > 20, `${form}: ${answer.text}`);
  }
  assert.deepEqual(results.document("emit", "file:///m/b%20c.nsd", "a", "tex", "x"), { path: "b c.a.tex.txt", language: "latex", text: "x" });
  assert.equal(results.document("emit", "file:///b.nsd", "a", undefined, "x").path, "b.a.system.txt");
  assert.equal(results.document("run", "untitled:Untitled-1", "a", undefined, "x").path, "Untitled-1.a.run.txt");
});

test("what fails is found at its line", async () => {
  const path = written("relay.nsd", WRONG);
  const answer = await server.command("test", pathToFileURL(path).toString(), "settles");
  assert.equal(answer.status, 2);
  const found = results.failures(answer.text);
  assert.equal(found.length, 1);
  const at = results.place(WRONG, found[0].what);
  assert.equal(WRONG.slice(0, at).split("\n").length, 8);
  assert.equal(found[0].expected, "1 within 1e-9");
  assert.match(found[0].got, /off by 1/);
  const passed = await server.command("test", uri("examples/sump.nsd"));
  assert.equal(passed.status, 0);
  assert.deepEqual(results.failures(passed.text), []);
  const broken = written("broken.nsd", WRONG.replace("-sign(x)", "-sign(y)"));
  const refused = await server.command("test", pathToFileURL(broken).toString(), "settles");
  const [first] = results.failures(refused.text);
  assert.match(first.what, /does not compile: E0101/);
  assert.equal(results.place(WRONG, first.what), 0);
});

test("a golden that differs is told line by line", async () => {
  const text = WRONG.replace(/ expect x  at[^]*?;.*\n/, " expect numbers golden;\n");
  const path = written("golden.nsd", text);
  execFileSync(program, ["test", "--accept", path], { stdio: "pipe" });
  const golden = join(folder, "golden.golden/settles.numbers");
  const kept = readFileSync(golden, "utf8");
  writeFileSync(golden, kept.replace("status is solved", "status is stopped"));
  const answer = await server.command("test", pathToFileURL(path).toString(), "settles");
  const [failure] = results.failures(answer.text);
  assert.equal(text.slice(results.place(text, failure.what)).split(";")[0], "expect numbers golden");
  assert.equal(failure.got, failure.expected.replace("status is stopped", "status is solved"));
  assert(failure.got.includes("status is solved"));
});

test("a figure is a page that runs nothing", async () => {
  const path = written("drawn.nsd", WRONG);
  const answer = await server.command("plot", pathToFileURL(path).toString(), "settles");
  const html = results.page(answer);
  assert.match(html, /default-src 'none'/);
  assert.doesNotMatch(html, /<script/);
  const [, data] = /base64,([^"]+)"/.exec(html);
  assert.equal(Buffer.from(data, "base64").toString("utf8"), answer.figure);
  assert.match(answer.figure, /^<svg/);
  assert.match(results.page({ text: "<b> & c" }), /<pre>&lt;b&gt; &amp; c<\/pre>/);
});

test("what is drawn or said cannot become a part of the page", () => {
  const hostile = `</pre></body><script>alert(1)</script><img src=x onerror="alert(1)"> "' &lt;`;
  const tags = (html) => [...html.matchAll(/<\/?\w+/g)].map(([tag]) => tag);
  const around = ["<html", "<head", "<meta", "<meta", "<style", "</style", "</head", "<body"];
  const said = results.page({ text: hostile });
  assert.deepEqual(tags(said), [...around, "<pre", "</pre", "</body", "</html"]);
  const figure = `<svg><script>alert(1)</script></svg>"><script>alert(1)</script>`;
  const drawn = results.page({ figure, text: hostile });
  assert.deepEqual(tags(drawn), [...around, "<img", "</body", "</html"]);
  const [, data] = /<img alt="figure" src="data:image\/svg\+xml;base64,([A-Za-z0-9+\/=]*)">/.exec(drawn);
  assert.equal(Buffer.from(data, "base64").toString("utf8"), figure);
});

test("figures are drawn again, once at a time, until they are closed", async () => {
  const pages = [];
  const drawn = [];
  let close;
  const open = (title, closed) => {
    close = closed;
    return { show: (html) => pages.push(html), reveal: () => pages.push(title) };
  };
  const draw = (uri, name) =>
    new Promise((resolve, reject) => drawn.push({ uri, name, resolve, reject }));
  const all = new figures.Figures(open, draw);
  all.show("file:///a.nsd", "falls", { text: "first" });
  all.show("file:///a.nsd", "falls", { text: "second" });
  assert.equal(pages[1], "falls");
  const saved = [all.again(), all.again(), all.again()];
  assert.equal(drawn.length, 1);
  drawn[0].resolve({ text: "third" });
  await new Promise(setImmediate);
  assert.equal(drawn.length, 2);
  drawn[1].reject(new Error("no such experiment"));
  await Promise.all(saved);
  assert.equal(drawn.length, 2);
  assert.match(pages.at(-1), /no such experiment/);
  const last = all.again();
  close();
  drawn[2].resolve({ text: "fourth" });
  await last;
  assert.match(pages.at(-1), /no such experiment/);
  await all.again();
  assert.equal(drawn.length, 3);
});

/** What a matcher makes of lines, as an editor does. */
function matched({ pattern }, lines) {
  const fits = (at) => pattern.every(({ regexp }, i) => new RegExp(regexp).test(lines[at + i] ?? ""));
  const at = lines.findIndex((_, at) => fits(at));
  if (at < 0) return undefined;
  const found = {};
  pattern.forEach(({ regexp, ...groups }, i) => {
    const match = new RegExp(regexp).exec(lines[at + i]);
    for (const [name, group] of Object.entries(groups)) found[name] = match[group];
  });
  return found;
}

test("problems in a terminal have code, message and place", () => {
  const [short, wrapped] = described.contributes.problemMatchers;
  const wrong = written("wrong.nsd", "model m {\n  state x = 1;\n  x' = -y;\n}\n");
  const checked = spawnSync(program, ["check", wrong], { encoding: "utf8" });
  const lines = (checked.stdout + checked.stderr).split("\n");
  const place = { file: wrong, line: "3", column: "9" };
  assert.deepEqual(matched(short, lines), { code: "E0101", severity: "E", message: "unknown name `y`", ...place });
  assert.equal(matched(wrapped, lines), undefined);
  const grazes = written("grazes.nsd", GRAZES);
  const run = spawnSync(program, ["run", grazes], { encoding: "utf8" });
  const found = matched(wrapped, (run.stdout + run.stderr).split("\n"));
  assert.deepEqual([found.code, found.severity, found.file, found.line], ["W0701", "W", grazes, "6"]);
});

/** A snippet with the texts that stand in it. */
function expanded(body) {
  let text = body.join("\n");
  const texts = { 0: "" };
  const choose = /\$\{(\d+):((?:[^${}]|\$\d+)*)\}/g;
  for (const [, number, given] of text.matchAll(choose)) texts[number] = given;
  text = text.replace(choose, "$2");
  return text.replace(/\$(\d+)/g, (_, number) => texts[number]).replace(/\$(\d+)/g, (_, number) => texts[number]);
}

const AROUND = {
  simulate: ["model block { state x = 1; x' = -x; }\n", ""],
  optimize: ["model cart { state x = 0; control u in [-2, 2]; x' = u; }\n", ""],
  region: ["model m { state x = 1;\n", "\n}"],
  jump: ["model m { state q = 1; state v = 0; q' = v; v' = -9.81;\n", "\n}"],
  mechanics: ["model m { state q[2] = [0, 1]; state v[2] = [1, 0]; q' = v;\n", "\n}"],
  perp: ["model m { state x = 1; algebraic i; let u = i - x; x' = -i;\n", "\n}"],
  plot: ["model m { state x = 1; x' = -x; } simulate s of m { horizon 1;\n", "\n}"],
  model: ["", ""],
};

for (const [title, { prefix, body }] of Object.entries(JSON.parse(readFileSync(join(here, "snippets/nsd.json"), "utf8")))) {
  test(`snippet: ${title}`, () => {
    const [before, behind] = AROUND[prefix];
    const path = written(`${prefix}.nsd`, `${before}${expanded(body)}${behind}\n`);
    execFileSync(program, ["check", path], { encoding: "utf8", stdio: "pipe" });
    if (prefix === "model") execFileSync(program, ["test", path], { encoding: "utf8", stdio: "pipe" });
  });
}

test("models of the walkthrough are right", () => {
  const read = (name) => readFileSync(join(here, `walkthrough/${name}.md`), "utf8").split("```nsd\n")[1].split("```")[0];
  const [model] = read("model").split("simulate");
  const path = written("belt.nsd", model + read("expect"));
  execFileSync(program, ["test", path], { encoding: "utf8", stdio: "pipe" });
});
