// SPEC.md, "QUAL": the quality record of a clip.

import { ByteReader } from "./bytes.js";

/**
 * Only the structure is checked: nobody refuses a file for what a record says.
 *
 * @param {Uint8Array} payload of QUAL
 * @returns {{key: string, value: string}[]} metrics and settings
 * @throws {import("./errors.js").Refused}
 */
export function readQuality(payload) {
  const reader = new ByteReader(payload, "QUAL");
  const entries = reader.counted(() => ({ key: reader.text(), value: reader.text() }));
  reader.rest();
  return entries;
}
