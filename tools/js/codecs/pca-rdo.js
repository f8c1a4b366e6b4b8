// SPEC.md, "Codec 10: pca-rdo": windows, with a mean and with courses of the clip's own.

import { APART, COURSES, MEAN, WEIGHTS } from "../space.js";
import { openWindows } from "../windows.js";

export const id = 10;
export const name = "pca-rdo";
export const version = 0;

/**
 * @param {Uint8Array} header
 * @param {object} layout of the signal
 * @returns {import("../windows.js").WindowsDecoder}
 * @throws {import("../errors.js").MczError}
 */
export function open(header, layout) {
  return openWindows(name, header, layout, APART | WEIGHTS | MEAN | COURSES);
}
