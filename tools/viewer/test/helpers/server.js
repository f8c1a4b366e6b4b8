// The page as `mcz view` serves it, without Python: README.md, "The server".

import { createServer } from "node:http";
import { readFileSync } from "node:fs";
import { basename } from "node:path";
import { fileURLToPath } from "node:url";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
export const ROOT = here("../../../../");
export const vector = (path) => `${ROOT}conformance/vectors/valid/${path}`;

/**
 * Serves dist/viewer.html below a token, with files beside it.
 *
 * @param {object} wanted `files`: paths, or `{ name, bytes }`; `api`: what api.json says besides;
 *   `posts`: answers to POSTs, by path: functions of the body that give JSON or bytes
 * @returns `{ url, requests, close() }`; `requests` are paths that were asked for
 */
export async function serve({ files = [], api = {}, posts = {} } = {}) {
  const page = readFileSync(here("../../dist/viewer.html"));
  const held = files.map((file) =>
    typeof file === "string" ? { name: basename(file), bytes: readFileSync(file) } : file,
  );
  const requests = [];
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, "http://x");
    const path = decodeURIComponent(pathname).replace(/^\/token\//, "");
    requests.push(`${request.method} ${path}`);
    try {
      if (request.method === "POST") await post(posts[path], request, response, held);
      else get(path, request, response);
    } catch (error) {
      json(response, { error: { class: "MczError", message: error.message } }, 422);
    }
  });

  function get(path, request, response) {
    const document = {
      version: "0",
      files: held
        .filter(({ isHidden }) => !isHidden)
        .map(({ name, bytes }, k) => ({ name, size: bytes.length, url: `files/${k}`, kind: "mcz" })),
      codecs: [],
      canEncode: false,
      canConvert: false,
      canGlb: false,
      ...api,
    };
    const [, number] = path.match(/^files\/(\d+)$/) ?? [];
    const [, annex] = path.match(/^annex\/([\w.-]+)$/) ?? [];
    if (path === "") send(response, page, "text/html; charset=utf-8");
    else if (path === "api.json") json(response, document);
    else if (path === "alive") response.writeHead(200, { "Content-Type": "text/event-stream" }).write(": here\n\n");
    else if (held[number]) ranged(held[number].bytes, request, response, number);
    else if (annex) send(response, readFileSync(`${ROOT}conformance/annex/${annex}`), "application/octet-stream");
    else response.writeHead(404).end();
  }

  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const { port } = server.address();
  return {
    url: `http://127.0.0.1:${port}/token/`,
    requests,
    close: () => (server.closeAllConnections(), new Promise((resolve) => server.close(resolve))),
  };
}

function ranged(bytes, request, response, tag) {
  const [, from, to] = request.headers.range?.match(/^bytes=(\d+)-(\d*)$/) ?? [];
  const head = { ETag: `"${tag}-${bytes.length}"`, "Accept-Ranges": "bytes" };
  if (from === undefined) {
    send(response, bytes, "application/octet-stream", 200, head);
    return;
  }
  const end = Math.min(bytes.length, to === "" ? Infinity : Number(to) + 1);
  const range = { ...head, "Content-Range": `bytes ${from}-${end - 1}/${bytes.length}` };
  send(response, bytes.subarray(Number(from), end), "application/octet-stream", 206, range);
}

async function post(answer, request, response, held) {
  const parts = [];
  for await (const part of request) parts.push(part);
  const body = Buffer.concat(parts);
  if (!answer) throw new Error("this server does not do that");
  const asked = /json/.test(request.headers["content-type"]) ? JSON.parse(body) : body;
  const made = await answer(asked, held);
  if (Buffer.isBuffer(made)) send(response, made, "application/octet-stream");
  else json(response, made);
}

function send(response, bytes, type, status = 200, more = {}) {
  response.writeHead(status, { "Content-Type": type, "Content-Length": bytes.length, ...more }).end(bytes);
}

const json = (response, document, status = 200) =>
  send(response, Buffer.from(JSON.stringify(document)), "application/json", status);
