// Fetches the annex when it is needed, for pages and workers.

import { AccessError } from "./errors.js";
import { Missing } from "./missing.js";

/**
 * A reader for `setAnnex`, whose files are fetched when they are wanted.
 *
 * @param {string | URL} folder where the annex files lie, with a slash at its end
 * @returns {(name: string) => Uint8Array}
 */
export function annexFrom(folder) {
  const files = new Map();
  return (name) => {
    if (files.has(name)) return files.get(name);
    throw new Missing(`the annex ${name}`, async () => {
      files.set(name, await fetched(new URL(name, folder)));
    });
  };
}

async function fetched(address) {
  let response;
  try {
    response = await fetch(address);
    if (response.ok) return new Uint8Array(await response.arrayBuffer());
  } catch (error) {
    throw new AccessError(`${address}: ${error.message}`);
  }
  throw new AccessError(`${address}: the server answers ${response.status}`);
}
