// Sources of bytes that are at hand: an array, a file that was dropped on a page.

import { AccessError } from "./errors.js";

/**
 * Where a file is read from. Whoever reads keeps within 0 <= start <= stop <= size.
 *
 * @typedef {object} Source
 * @property {number} size bytes of the file
 * @property {boolean} [remote] a read costs a request
 * @property {string} [name] for messages
 * @property {(start: number, stop: number) => Promise<Uint8Array>} read the bytes from `start` up
 *   to `stop`, which nobody changes; rejects with {@link AccessError}
 */

/**
 * The bytes of a file, which `fetch` and Blobs give as an ArrayBuffer.
 *
 * @param {Uint8Array | ArrayBuffer} bytes
 * @returns {Uint8Array}
 * @throws {TypeError} for anything else
 */
export function bytesFrom(bytes) {
  if (bytes instanceof Uint8Array) return bytes;
  if (bytes instanceof ArrayBuffer) return new Uint8Array(bytes);
  throw new TypeError("a file is given as a Uint8Array or an ArrayBuffer");
}

/**
 * @param {Uint8Array | ArrayBuffer} bytes of a whole file
 * @returns {Source}
 */
export function fromBytes(bytes) {
  const data = bytesFrom(bytes);
  return {
    size: data.length,
    read: async (start, stop) => data.subarray(start, stop),
  };
}

/**
 * @param {Blob} blob a File is one
 * @returns {Source}
 */
export function fromBlob(blob) {
  const name = blob.name ?? "blob";
  return {
    name,
    size: blob.size,
    async read(start, stop) {
      try {
        return new Uint8Array(await blob.slice(start, stop).arrayBuffer());
      } catch (error) {
        throw new AccessError(`${name}: ${error.message}`); // it was changed or removed meanwhile
      }
    },
  };
}
