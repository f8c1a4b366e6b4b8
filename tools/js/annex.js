// The files of conformance/annex, which are part of SPEC.md: tables that codecs start with and
// models that files may name without having them.

import { Unsupported } from "./errors.js";
import { Missing } from "./missing.js";

let reader = null;
const files = new Map();
const documents = new Map();

/**
 * Says where the annex comes from. A program in Node gives the reader of annex-node.js; a browser
 * fetches the files that it wants first, and gives a function that looks them up; or it gives that
 * of annex-url.js, which fetches them when they are wanted, for all that reads asynchronously.
 *
 * @param {(name: string) => Uint8Array} read the bytes of an annex file, such as "wavelets.json"
 */
export function setAnnex(read) {
  reader = read;
  files.clear();
  documents.clear();
}

/**
 * An annex file, read once.
 *
 * @param {string} name
 * @returns {Uint8Array}
 * @throws {Unsupported} where there is no such file
 */
export function annexBytes(name) {
  if (!files.has(name)) {
    let bytes;
    try {
      bytes = reader(name);
    } catch (error) {
      if (error instanceof Missing) throw error;
      throw new Unsupported(`the annex ${name} is needed and cannot be read`);
    }
    files.set(name, bytes);
  }
  return files.get(name);
}

/**
 * An annex file as the JSON that it is, parsed once. Nobody changes what is returned.
 *
 * @param {string} name
 * @throws {Unsupported} where there is no such file
 */
export function annexJson(name) {
  if (!documents.has(name)) {
    documents.set(name, JSON.parse(new TextDecoder().decode(annexBytes(name))));
  }
  return documents.get(name);
}
