// SPEC.md, "Codec 9: mdtt": windows, of vectors made of this very clip.

import { APART, WEIGHTS } from "../space.js";
import { openWindows } from "../windows.js";

export const id = 9;
export const name = "mdtt";
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
