#!/usr/bin/env node
// Restores the files that an archive was made of: node unpack.js [--force] FILE.mcz FOLDER
//
// Each is written under its path below FOLDER, its SHA-256 checked, and has its name when all of it
// is there. What exists is overwritten with --force alone, and no link below FOLDER is followed.

import {
  closeSync,
  fsyncSync,
  linkSync,
  lstatSync,
  mkdirSync,
  openSync,
  readFileSync,
  renameSync,
  rmSync,
  writeFileSync,
} from "node:fs";
import { basename, dirname, join } from "node:path";

import { readAnnex } from "./annex-node.js";
import { MczError, setAnnex, sources } from "./mcz.js";

const USAGE = "node unpack.js [--force] FILE.mcz FOLDER";
const SHOWN = 48; // letters of a name in that of its temporary file: 192 bytes of 255 at most

/** The folders between `folder` and the file `path` below it are made; none may be a link. */
function makeFolders(folder, path) {
  const parts = dirname(path) === "." ? [] : dirname(path).split("/");
  let at = folder;
  mkdirSync(at, { recursive: true });
  for (const part of parts) {
    at = join(at, part);
    mkdirSync(at, { recursive: true });
    if (!lstatSync(at).isDirectory()) throw inTheWay(`${at} is no folder`);
  }
}

/** What is said of a file that is not written because of another. */
function inTheWay(text) {
  return Object.assign(new Error(text), { code: "EEXIST" });
}

/** Writes `path` by way of a temporary file beside it: whole, or not at all. */
function writeWhole(path, bytes, force) {
  const shown = [...basename(path)].slice(0, SHOWN).join("");
  const part = join(dirname(path), `.${shown}.${process.pid}.part`);
  const handle = openSync(part, "wx");
  try {
    try {
      writeFileSync(handle, bytes);
      fsyncSync(handle);
    } finally {
      closeSync(handle);
    }
    giveName(part, path, force);
  } finally {
    rmSync(part, { force: true });
  }
}

/** Renames `part` to `path`; without `force` never over what has come there meanwhile. */
function giveName(part, path, force) {
  if (force) return renameSync(part, path);
  try {
    linkSync(part, path); // unlike a rename it replaces nothing
  } catch (error) {
    if (error.code === "EEXIST" || exists(path)) {
      throw inTheWay(`${path} exists; use --force to replace it`);
    }
    renameSync(part, path); // a file system without second names
  }
}

function exists(path) {
  return lstatSync(path, { throwIfNoEntry: false }) !== undefined;
}

/** Writes every file that the archive `bytes` was made of; the number of those that were not. */
function unpack(archive, folder, force) {
  const written = new Set();
  let failures = 0;
  for (const { path, bytes } of sources(archive)) {
    if (path === "") continue; // a source that has no name
    const target = join(folder, path);
    try {
      if (written.has(path)) throw inTheWay(`${target} was written from this archive already`);
      if (!force && exists(target)) throw inTheWay(`${target} exists; use --force to replace it`);
      makeFolders(folder, path);
      writeWhole(target, bytes, force);
      written.add(path);
      console.log(`${JSON.stringify(path)} ${bytes.length} bytes`);
    } catch (error) {
      if (error.code === undefined) throw error;
      console.error(error.message);
      failures += 1;
    }
  }
  return failures;
}

function main(words) {
  const force = words.includes("--force");
  const names = words.filter((word) => word !== "--force");
  if (names.length !== 2) {
    console.error(USAGE);
    return 2;
  }
  const [file, folder] = names;
  setAnnex(readAnnex);
  try {
    return unpack(new Uint8Array(readFileSync(file)), folder, force) === 0 ? 0 : 1;
  } catch (error) {
    const known = error instanceof MczError || error.code !== undefined;
    console.error(`${file}: ${known ? error.message : error.stack}`);
    return 1;
  }
}

process.exitCode = main(process.argv.slice(2));
