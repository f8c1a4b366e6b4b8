// SPEC.md, "Codec 8: lsdt-clip": windows, of vectors that need not be those of the clip.

import { APART, WEIGHTS } from "../space.js";
import { openWindows } from "../windows.js";

export const id = 8;
export const name = "lsdt-clip";
export const version = 0;

/**
 * @param {Uint8Array} header
 * @param {object} layout of the signal
 * @returns {import("../windows.js").WindowsDecoder}
 * @throws {import("../errors.js").MczError}
 */
export function open(header, layout) {
  return openWindows(name, header, layout, APART | WEIGHTS);
}
