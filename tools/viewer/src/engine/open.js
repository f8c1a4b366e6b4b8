// A file of any format that is read here, by its name.

import { openMcz } from "./mcz-file.js";

/**
 * @param {object} where `{ url, headers }`, `{ blob }` or `{ bytes }`; beside them `skeleton`, the
 *   text of an ASF
 * @param {{name: string, salvage: boolean}} options
 */
export function openFile(where, options) {
  return openMcz(where, options);
}
