// Memory that cannot be had is a limit like any other.

import { LimitExceeded } from "./errors.js";

const NO_MEMORY = /allocation failed|Invalid typed array length/;

function translated(error) {
  if (!(error instanceof RangeError && NO_MEMORY.test(error.message))) return error;
  return new LimitExceeded(`too large for this machine: ${error.message}`);
}

/**
 * @template T
 * @param {() => T} work
 * @returns {T}
 * @throws {LimitExceeded} where there is no memory for it
 */
export function guarded(work) {
  try {
    return work();
  } catch (error) {
    throw translated(error);
  }
}

/**
 * The same of what is asynchronous.
 *
 * @template T
 * @param {() => Promise<T>} work
 * @returns {Promise<T>}
 */
export async function guardedLater(work) {
  try {
    return await work();
  } catch (error) {
    throw translated(error);
  }
}
