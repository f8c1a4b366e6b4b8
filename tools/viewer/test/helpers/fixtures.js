// Files for the tests, made once by Python in dist/fixtures, and again when their maker is newer.

import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, renameSync, rmSync, statSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { ROOT } from "./server.js";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const MAKER = here("fixtures.py");

/** The Python that has mcz, and what it needs to find this tree. */
export const python = process.env.PYTHON ?? "python3";
export const environment = { ...process.env, PYTHONPATH: ROOT };

/** The path of a file; `isAll` of one that takes long to make. */
export function fixture(name, { isAll = false } = {}) {
  return join(folder(isAll), name);
}

function folder(isAll) {
  const place = here(`../../dist/fixtures${isAll ? "-all" : ""}`);
  if (existsSync(place) && statSync(place).mtimeMs > statSync(MAKER).mtimeMs) return place;
  mkdirSync(here("../../dist"), { recursive: true });
  const made = mkdtempSync(here("../../dist/making-"));
  const done = spawnSync(python, [MAKER, made, ...(isAll ? ["--all"] : [])], {
    env: environment,
    encoding: "utf8",
  });
  if (done.status !== 0) throw new Error(`${python} ${MAKER}: ${done.stderr || done.error}`);
  rmSync(place, { recursive: true, force: true });
  try {
    renameSync(made, place);
  } catch {
    rmSync(made, { recursive: true }); // another test was faster
  }
  return place;
}
