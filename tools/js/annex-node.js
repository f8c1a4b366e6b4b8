// Reads the annex from the disk, for programs that run in Node.

import { readFileSync } from "node:fs";

const folder = new URL("../../conformance/annex/", import.meta.url);

/**
 * @param {string} name an annex file
 * @returns {Uint8Array}
 */
export function readAnnex(name) {
  return readFileSync(new URL(name, folder));
}
