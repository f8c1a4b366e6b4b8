// Builds dist/viewer.html: the page with its script, worker and style inside, under a policy that
// lets nothing else run. `node build.mjs`; three.js and esbuild come from `npm ci`.

import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, readdirSync, renameSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { deflateRawSync } from "node:zlib";
import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));

const COMMON = {
  bundle: true,
  minify: true,
  write: false,
  target: ["es2022"],
  legalComments: "none",
  charset: "utf8",
  logLevel: "warning",
};

/** The text of a bundle. */
async function bundled(entry, options) {
  const { outputFiles } = await build({ ...COMMON, ...options, entryPoints: [here(entry)] });
  return outputFiles[0].text;
}

/** `import text from "worker:engine/worker.js"`: a worker's bundle as a string. */
const workers = {
  name: "workers",
  setup(builder) {
    builder.onResolve({ filter: /^worker:/ }, ({ path }) => ({
      path: path.slice("worker:".length),
      namespace: "worker",
    }));
    builder.onLoad({ filter: /.*/, namespace: "worker" }, async ({ path }) => ({
      contents: await bundled(`src/${path}`, { format: "iife" }),
      loader: "text",
    }));
  },
};

const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;

/** What the page may do: run what is in it, show what it makes, ask the server it came from. */
function policy(script, style) {
  return [
    "default-src 'none'",
    `script-src ${hash(script)}`,
    `style-src ${hash(style)}`,
    "worker-src blob:",
    "img-src data: blob:",
    "media-src blob:",
    "connect-src 'self' blob:",
    "base-uri 'none'",
    "form-action 'none'",
  ].join("; ");
}

const TABLES = /(?:_start\.json|\.bin)$/; // of the annex, those that decoders read

/** What the page has when it is opened by itself: no file, and the tables of all codecs. */
function embedded() {
  const folder = here("../../mcz/annex/");
  const names = readdirSync(folder).filter((name) => TABLES.test(name)).sort();
  const packed = (name) => deflateRawSync(readFileSync(folder + name), { level: 9 }).toString("base64");
  const annex = Object.fromEntries(names.map((name) => [name, packed(name)]));
  const document = JSON.stringify({ files: [], annex });
  return `<script type="application/json" id="embedded">${document}</script>`;
}

function licences() {
  const three = readFileSync(here("node_modules/three/LICENSE"), "utf8").trim();
  return `three.js\n\n${three}`;
}

const script = await bundled("src/main.js", { format: "esm", plugins: [workers] });
const style = await bundled("src/page.css", { loader: { ".css": "css" } });
const fill = {
  policy: policy(script, style),
  style: `<style>${style}</style>`,
  embedded: embedded(),
  script: `<script type="module">${script}</script>`,
  licences: `<!--\nThis page holds:\n\n${licences()}\n-->`,
};
const page = readFileSync(here("src/index.html"), "utf8").replace(
  /<!-- build:(\w+) -->|build:(\w+)/g,
  (_, comment, word) => fill[comment ?? word],
);

mkdirSync(here("dist"), { recursive: true });
writeFileSync(here("dist/viewer.html.part"), page);
renameSync(here("dist/viewer.html.part"), here("dist/viewer.html"));
console.log(`dist/viewer.html: ${page.length.toLocaleString("en")} bytes`);
