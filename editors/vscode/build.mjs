// Bundles the extension to `out/`, with the licenses of the packages that come into it.

import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

import { build } from "esbuild";

const here = fileURLToPath(new URL(".", import.meta.url));
const { metafile } = await build({
  absWorkingDir: here,
  entryPoints: ["src/extension.js"],
  bundle: true,
  platform: "node",
  format: "cjs",
  target: "node18",
  external: ["vscode"],
  minify: true,
  logLevel: "warning",
  outfile: "out/extension.js",
  metafile: true,
});

/** The license of a package, as its folder has it. */
function notice(folder) {
  const { name, version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const files = readdirSync(folder).filter((file) => /^(licen[cs]e|copying|notice|third)/i.test(file));
  if (files.length === 0) throw new Error(`${name} has no license in ${folder}`);
  const texts = files.map((file) => readFileSync(join(folder, file), "utf8").trim());
  return [`${name} ${version} (${license})`, ...texts].join("\n\n");
}

const [{ inputs }] = Object.values(metafile.outputs);
const folders = Object.keys(inputs).map((path) => /.*node_modules\/(@[^/]+\/)?[^/]+(?=\/)/.exec(path)?.[0]);
const packages = [...new Set(folders.filter(Boolean))].sort();
const rule = `\n\n${"-".repeat(80)}\n\n`;
mkdirSync(join(here, "out"), { recursive: true });
writeFileSync(
  join(here, "out/THIRD-PARTY-NOTICES.txt"),
  ["The extension contains these packages.", ...packages.map((folder) => notice(join(here, folder)))].join(rule) + "\n",
);
