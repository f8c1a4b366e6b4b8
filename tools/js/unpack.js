// Restores the files that an archive was made of: node unpack.js FILE.mcz FOLDER
//
// Each is written under its path below FOLDER, its SHA-256 checked. Nothing that exists is
// overwritten, and no link below FOLDER is followed.

import { lstatSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";

import { readAnnex } from "./annex-node.js";
import { MczError, setAnnex, sources } from "./mcz.js";

/** The folders between `folder` and the file `path` below it are made; none may be a link. */
function makeFolders(folder, path) {
  const parts = dirname(path) === "." ? [] : dirname(path).split("/");
  let at = folder;
  mkdirSync(at, { recursive: true });
  for (const part of parts) {
    at = join(at, part);
    mkdirSync(at, { recursive: true });
    if (!lstatSync(at).isDirectory()) throw new Error(`${at} is no folder`);
  }
}

function main(words) {
  if (words.length !== 2) {
    console.error("node unpack.js FILE.mcz FOLDER");
    return 2;
  }
  const [file, folder] = words;
  setAnnex(readAnnex);
  try {
    for (const { path, bytes } of sources(new Uint8Array(readFileSync(file)))) {
      if (path === "") continue; // a source that has no name
      makeFolders(folder, path);
      writeFileSync(join(folder, path), bytes, { flag: "wx" });
      console.log(`${JSON.stringify(path)} ${bytes.length} bytes`);
    }
  } catch (error) {
    const known = error instanceof MczError || error.code !== undefined;
    console.error(`${file}: ${known ? error.message : error.stack}`);
    return 1;
  }
  return 0;
}

process.exitCode = main(process.argv.slice(2));
