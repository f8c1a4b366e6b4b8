// Reads the annex from the disk, for programs that run in Node.

import { existsSync, readFileSync } from "node:fs";

const packed = new URL("annex/", import.meta.url); // of the package; else that of the repository
const folder = existsSync(packed) ? packed : new URL("../../conformance/annex/", import.meta.url);

/**
 * @param {string} name an annex file
 * @returns {Uint8Array}
 */
export function readAnnex(name) {
  return readFileSync(new URL(name, folder));
}
