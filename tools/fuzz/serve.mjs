// Answers requests about .mcz files, one after the other, with the decoder in the folder that the
// first argument names. A request is a line {"arguments": [...], "limit": N, "bytes": N} and a file,
// an answer a line {"exit": N, "bytes": N, "message": "..."} and the output of
// conformance/README.md. Exit 2 is an error that is none of the decoder's own.

import { readSync, writeSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = pathToFileURL(`${process.argv[2]}/`);
const load = (name) => import(new URL(name, folder));
const { MczError, decode, setAnnex, sources } = await load("mcz.js");
const { bytesOf } = await load("cend.js");
setAnnex((await load("annex-node.js")).readAnnex);

const STDIN = 0;
const STDOUT = 1;
const LINE_END = 10;

function take(count) {
  const bytes = new Uint8Array(count);
  for (let at = 0; at < count; ) {
    const came = readSync(STDIN, bytes, at, count - at);
    if (came === 0) process.exit(0);
    at += came;
  }
  return bytes;
}

function line() {
  const found = [];
  for (let byte = take(1)[0]; byte !== LINE_END; byte = take(1)[0]) found.push(byte);
  return JSON.parse(new TextDecoder().decode(new Uint8Array(found)));
}

function parse(words) {
  const options = {};
  const rest = [...words];
  while (rest.length > 0) {
    const word = rest.shift();
    if (word === "--source") options.source = true;
    else if (word === "--post-filter") options.postFilter = true;
    else if (word === "--clip") options.clip = rest.shift();
    else if (word === "--frames") options.frames = rest.shift().split(":").map(Number);
    else if (word === "--joints") options.joints = rest.shift().split(",").filter(Boolean).map(Number);
    else options.resolution = Number(rest.shift());
  }
  return options;
}

function arraysOf(clips) {
  const arrays = [];
  const contents = [];
  for (const clip of clips) {
    for (const { name, nRows, nChannels, values, mask } of clip.signals) {
      const place = { clip: clip.name, signal: name };
      const shape = [nRows, nChannels];
      const add = (array, dtype, content) => {
        arrays.push({ ...place, array, dtype, shape, bytes: content.length });
        contents.push(content);
      };
      add("values", values instanceof BigInt64Array ? "<i8" : "<f8", bytesOf(values));
      if (mask) add("mask", "u1", mask);
    }
  }
  return [{ arrays }, contents];
}

function sourcesOf(files) {
  const list = files.map(({ path, bytes }) => ({ path, bytes: bytes.length }));
  return [{ sources: list }, files.map((file) => file.bytes)];
}

function answer({ arguments: words, limit }, file) {
  const options = { ...parse(words), decodedLimit: limit };
  try {
    const [listing, contents] = options.source
      ? sourcesOf(sources(file, options))
      : arraysOf(decode(file, options));
    return { exit: 0, parts: [new TextEncoder().encode(`${JSON.stringify(listing)}\n`), ...contents] };
  } catch (error) {
    const ours = error instanceof MczError;
    const message = ours ? error.message : String(error.stack ?? error);
    return { exit: ours ? error.exitCode : 2, parts: [], message };
  }
}

function write(bytes) {
  for (let at = 0; at < bytes.length; ) at += writeSync(STDOUT, bytes, at);
}

for (;;) {
  const request = line();
  const { exit, parts, message = "" } = answer(request, take(request.bytes));
  const bytes = parts.reduce((sum, part) => sum + part.length, 0);
  write(new TextEncoder().encode(`${JSON.stringify({ exit, bytes, message })}\n`));
  for (const part of parts) write(part);
}
