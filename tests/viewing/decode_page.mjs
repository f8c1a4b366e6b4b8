// Decodes the files of documents as pages hold them, with nothing but their own tables, and says
// how many frames each has.

import { readFileSync } from "node:fs";
import { inflateRawSync } from "node:zlib";
import { decode, list, setAnnex } from "../../tools/js/mcz.js";

for (const path of process.argv.slice(2)) {
  const { files, annex } = JSON.parse(readFileSync(path, "utf8"));
  setAnnex((name) => {
    if (!(name in annex)) throw new Error(`the page has no ${name}`);
    return new Uint8Array(inflateRawSync(Buffer.from(annex[name], "base64")));
  });
  for (const { base64 } of files) {
    const bytes = new Uint8Array(Buffer.from(base64, "base64"));
    for (const { signals } of decode(bytes)) if (signals.length === 0) throw new Error("no signal");
    for (const { nFrames } of list(bytes)) console.log(nFrames);
  }
}
