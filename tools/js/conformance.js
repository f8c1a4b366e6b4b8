// The command of conformance/README.md: an MCZ file on standard input, its arrays or its source
// files on standard output. With --serve many requests, each with its own answer. Before these,
// --decoded-limit N sets another limit of what is decoded than SPEC.md has, for tests. For tests,
// too: --ranges reads the file by ranges, --salvage what a damaged one still holds.

import { readFileSync, readSync, writeSync } from "node:fs";

import { readAnnex } from "./annex-node.js";
import { bytesOf } from "./cend.js";
import { CODEC_NAMES } from "./codecs.js";
import { VERSION } from "./head.js";
import { MczError, decode, fromBytes, open, setAnnex, sources } from "./mcz.js";
import { SOURCE_FORMAT_NAMES } from "./registry.js";

const CAPABILITIES = {
  codecs: CODEC_NAMES,
  sources: SOURCE_FORMAT_NAMES,
  format: VERSION,
  options: ["--clip", "--frames", "--joints", "--resolution", "--post-filter", "--serve"],
};
const STDIN = 0;
const STDOUT = 1;
const OK = 0;
const FAILED = 2;

async function main(words) {
  setAnnex(readAnnex);
  const limits = {};
  if (words[0] === "--decoded-limit") limits.decodedLimit = Number(words.splice(0, 2)[1]);
  if (words.includes("--serve")) {
    await serve(limits);
    return OK;
  }
  if (words.includes("--capabilities")) {
    write([line(CAPABILITIES)]);
    return OK;
  }
  const { exit, parts } = await answer(words, new Uint8Array(readFileSync(STDIN)), limits);
  write(parts);
  return exit;
}

/** Answers requests until the input ends. */
async function serve(limits) {
  const input = new Input();
  for (let request = input.line(); request !== null; request = input.line()) {
    const { arguments: words, bytes } = JSON.parse(request);
    const { exit, parts } = await answer(words, input.take(bytes), limits);
    const size = parts.reduce((sum, part) => sum + part.length, 0);
    write([line({ exit, bytes: size }), ...parts]);
  }
}

/** The exit code and the output that a request is answered with; reasons go to standard error. */
async function answer(words, bytes, limits) {
  try {
    return { exit: OK, parts: await respond(words, bytes, limits) };
  } catch (error) {
    const known = error instanceof MczError;
    process.stderr.write(known ? `${error.message}\n` : `${error.stack}\n`);
    return { exit: known ? error.exitCode : FAILED, parts: [] };
  }
}

async function respond(words, bytes, limits) {
  if (words.includes("--source")) return listSources(sources(bytes, limits));
  const options = parse(words);
  if (options.salvage === undefined) return listArrays(decode(bytes, { ...options, ...limits }));
  const { salvage } = options;
  const file = await open(fromBytes(bytes), { salvage, limit: limits.decodedLimit });
  return listArrays(await decodeByRanges(file, options));
}

/** The clips of an open file, as {@link decode} gives them. */
async function decodeByRanges(file, { clip: name, frames, joints, resolution = 0 }) {
  const clips = [];
  for (const { index } of name === undefined ? file.clips : [file.clips[file.clips.indexOf(name)]]) {
    const clip = await file.clip(index);
    const signals = [];
    for (const { index: signal, ownChannels, nResolutions } of clip.signals) {
      if (joints && ownChannels) continue;
      const dropped = signal === 0 ? resolution : Math.min(resolution, nResolutions - 1);
      const request = { signal, frames, joints, resolution: dropped };
      signals.push(await clip.read(request).catch((error) => passed(file, error)));
    }
    clips.push({ name: clip.name, signals: signals.filter((signal) => signal !== null) });
  }
  return clips;
}

/** Of a damaged file, what can be had of other signals counts. */
function passed({ salvage }, error) {
  if (salvage && error instanceof MczError) return null;
  throw error;
}

/** The options of {@link decode} that the command line asks for. */
function parse(words) {
  const options = {};
  const rest = [...words];
  while (rest.length > 0) {
    const word = rest.shift();
    if (word === "--post-filter") options.postFilter = true;
    else if (word === "--ranges") options.salvage = false;
    else if (word === "--salvage") options.salvage = true;
    else if (word === "--clip") options.clip = rest.shift();
    else if (word === "--frames") options.frames = rest.shift().split(":").map(Number);
    else if (word === "--joints") options.joints = rest.shift().split(",").map(Number);
    else if (word === "--resolution") options.resolution = Number(rest.shift());
    else throw new Error(`unknown argument ${word}`);
  }
  return options;
}

function listArrays(clips) {
  const arrays = [];
  const contents = [];
  for (const clip of clips) {
    for (const { name, nRows, nChannels, values, mask } of clip.signals) {
      const names = { clip: clip.name, signal: name };
      const shape = [nRows, nChannels];
      const dtype = values instanceof BigInt64Array ? "<i8" : "<f8";
      const add = (array, type, content) => {
        arrays.push({ ...names, array, dtype: type, shape, bytes: content.length });
        contents.push(content);
      };
      add("values", dtype, bytesOf(values));
      if (mask) add("mask", "u1", mask);
    }
  }
  return [line({ arrays }), ...contents];
}

function listSources(files) {
  const list = files.map(({ path, bytes }) => ({ path, bytes: bytes.length }));
  return [line({ sources: list }), ...files.map((file) => file.bytes)];
}

function line(document) {
  return new TextEncoder().encode(`${JSON.stringify(document)}\n`);
}

/** Standard input, read as far as it is needed. */
class Input {
  constructor() {
    this.chunk = new Uint8Array(65536);
    this.at = 0;
    this.end = 0;
  }

  /** @returns {string | null} up to the next newline; null where the input has ended */
  line() {
    const bytes = [];
    while (this.at < this.end || this.fill()) {
      const byte = this.chunk[this.at++];
      if (byte === 0x0a) return new TextDecoder().decode(Uint8Array.from(bytes));
      bytes.push(byte);
    }
    return null;
  }

  /** @returns {Uint8Array} the next `size` bytes */
  take(size) {
    const out = new Uint8Array(size);
    const here = this.chunk.subarray(this.at, Math.min(this.end, this.at + size));
    out.set(here);
    this.at += here.length;
    let at = here.length;
    while (at < size) {
      const n = readSome(out.subarray(at));
      if (n === 0) throw new Error("the input ends within a request");
      at += n;
    }
    return out;
  }

  fill() {
    this.at = 0;
    this.end = readSome(this.chunk);
    return this.end > 0;
  }
}

/** Bytes that were read into `buffer`; 0 at the end of the input. */
function readSome(buffer) {
  return patiently(() => readSync(STDIN, buffer, 0, buffer.length, null));
}

function write(parts) {
  for (const part of parts) {
    let at = 0;
    while (at < part.length) at += patiently(() => writeSync(STDOUT, part, at));
  }
}

/** Does something with a pipe as soon as the pipe lets it. */
function patiently(work) {
  for (;;) {
    try {
      return work();
    } catch (error) {
      if (error.code === "EOF") return 0;
      if (error.code !== "EAGAIN") throw error;
      Atomics.wait(new Int32Array(new SharedArrayBuffer(4)), 0, 0, 1);
    }
  }
}

process.exitCode = await main(process.argv.slice(2));
