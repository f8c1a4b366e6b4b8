// Which files the page has: those of its server, those within it, those that people choose or drop.

import { ask, compareClip, showClip, tell } from "./asked.js";
import { embeddedAnnex, fromBase64 } from "./engine/annex.js";
import { accepted, droppedFiles, gathered } from "./inputs/files.js";
import { lostText } from "./ui/text.js";

const places = new Map(); // of opened files, to open them again
const isMcz = (name) => /\.mcz$/i.test(name);

/** Opens what the page was made for, and takes what is dropped on it. */
export async function openFirst(page) {
  takeDrops(page);
  page.salvage = (id, fault) => salvage(page, id, fault);
  page.engine.onDamage = (clip, error) => salvage(page, clip.fileId, error);
  const text = document.getElementById("embedded")?.textContent;
  try {
    const { files = [], annex = {}, diffs = [] } = text ? JSON.parse(text) : {};
    page.engine.setAnnex(await embeddedAnnex(annex));
    if (files.length > 0) await openEmbedded(page, { files, diffs });
    else if (location.protocol.startsWith("http")) await openServed(page);
  } catch (error) {
    tell(page.store, faultText(error), true);
  }
  if (page.store.get("files").length === 0 && page.store.get("message") === null) {
    tell(page.store, `Open a motion file, or drop one here: ${formatsText(page)}`);
  }
}

/** Lets people choose files, which are opened. */
export function chooseFiles(page) {
  const input = document.createElement("input");
  input.type = "file";
  input.multiple = true;
  input.accept = accepted(suffixesOf(page)).join(",");
  input.addEventListener("change", () => openAll(page, [...input.files]));
  input.click();
}

/** What the server reads, as ".trc": nothing where it does not say. */
function suffixesOf({ store }) {
  const server = store.get("server");
  return server?.canConvert ? (server.suffixes ?? []) : [];
}

/** The formats, to be told. */
const formatsText = (page) => {
  const others = accepted(suffixesOf(page)).filter((suffix) => suffix !== ".amc" && suffix !== ".asf");
  return [others[0], others[1], ".amc with its .asf", ...others.slice(2)].join(", ");
};

/**
 * Opens a file, and adds it to the list.
 *
 * @param {object} where `{ url }`, `{ blob, skeleton }` or `{ bytes }`
 * @param {{name: string, url?: string, salvage?: boolean, isLater?: boolean}} about `url` where it
 *   is served; `isLater`: it is read when its clip is wanted, where it is read as a whole
 * @returns {Promise<object>} the entry of `files`
 * @throws {Error} with the name and message of the decoder's
 */
async function addFile({ store, engine }, where, { name, url = null, ...options }) {
  store.set({ loading: name });
  try {
    const opened = options.salvage
      ? await engine.open(where, { name, ...options })
      : await openedStrictlyOrNot({ store, engine }, where, { name, ...options });
    const file = { ...opened, name, url };
    places.set(file.id, where);
    store.set({ files: [...store.get("files"), file] });
    return file;
  } finally {
    if (store.get("loading") === name) store.set({ loading: null });
  }
}

async function openedStrictlyOrNot(page, where, options) {
  const { name } = options;
  try {
    return await page.engine.open(where, options);
  } catch (error) {
    const isText = where.blob && !isMcz(name);
    if (isText || error.name === "AccessError") throw error;
    let opened;
    try {
      opened = await page.engine.open(where, { name, salvage: true });
    } catch {
      throw error; // what is wrong, not what could not be saved
    }
    tell(page.store, `${name} is damaged: ${error.message}. Its intact parts are shown.`, true);
    return opened;
  }
}

/**
 * Opens a file again whose damage was not seen at first; what is shown of it is shown anew.
 *
 * @returns {Promise<number | null>} its new id; null where nothing of it can be read
 */
async function salvage(page, id, fault) {
  const { store, engine } = page;
  const where = places.get(id);
  const file = store.get("files").find((one) => one.id === id);
  places.delete(id);
  if (where === undefined || file === undefined || file.damage.length > 0) return null;
  try {
    const opened = await engine.open(where, { name: file.name, salvage: true });
    const files = store.get("files").map((one) => (one.id === id ? { ...one, ...opened } : one));
    store.set({ files });
    for (const key of ["shown", "compared"]) {
      const clip = store.get(key);
      if (clip?.fileId !== id) continue;
      const anew = await engine.clip(opened.id, clip.index);
      if (store.get(key) === clip) store.set({ [key]: anew, errors: null });
    }
    const lost = store.get("shown")?.fileId === opened.id ? lostText(store.get("shown")) : "";
    tell(page.store, `${file.name} is damaged: ${lost || fault.message}. Its intact parts are shown.`, true);
    return opened.id;
  } catch {
    tell(page.store, `${file.name}: ${faultText(fault)}`, true);
    return null;
  }
}

/**
 * Opens files that were chosen or dropped, and shows the first.
 *
 * @param {Map<File, string>} [folders] of `droppedFiles`
 */
export async function openAll(page, files, folders) {
  const wanted = gathered(files, { folders, suffixes: suffixesOf(page) });
  if (wanted.length === 0) {
    tell(page.store, `No motion file there; the page opens ${formatsText(page)}`, true);
    return;
  }
  const turn = ask();
  let shown = false;
  for (const { file, skeleton, nSkeletons } of wanted) {
    try {
      if (nSkeletons > 1)
        throw new Error(`${nSkeletons} ASF files may be its skeleton: drop it with one alone`);
      const opened = await openOne(page, file, { skeleton, isLater: shown });
      if (!shown && opened.nClips > 0) {
        await showClip(page, opened.id, 0, { turn, isNew: true });
        shown = true;
      }
    } catch (error) {
      tell(page.store, `${file.name}: ${faultText(error)}`, true);
    }
  }
}

async function openOne(page, file, { skeleton, isLater }) {
  const server = page.store.get("server");
  if (isMcz(file.name)) return addFile(page, { blob: file }, { name: file.name });
  if (server?.canConvert) {
    const { url, name } = await converted(skeleton ? [file, skeleton] : [file]);
    return addFile(page, { url: absolute(url) }, { name, url });
  }
  return addFile(page, { blob: file, skeleton }, { name: file.name, isLater });
}

/** Has the server make an .mcz of a file of another format. */
async function converted(files) {
  const body = new FormData();
  for (const file of files) body.append("file", file, file.name);
  const response = await fetch(absolute("convert"), { method: "POST", body });
  const answer = await response.json().catch(() => ({}));
  if (!response.ok)
    throw new Error(answer.error?.message ?? `the server answers ${response.status}`);
  return answer;
}

async function openEmbedded(page, { files, diffs }) {
  const turn = ask();
  const opened = [];
  for (const { name, base64 } of files) {
    opened.push(await addFile(page, { bytes: fromBase64(base64) }, { name }));
  }
  page.store.set({ diffs });
  await showFirst(page, opened, turn);
  if (diffs.length > 0) await compareSecond(page, opened);
}

async function openServed(page) {
  const api = await serverFacts();
  if (api === null) return;
  page.engine.setAnnex(absolute("annex/"));
  page.store.set({ server: api });
  stayAlive(page);
  const turn = ask();
  const opened = [];
  for (const { name, url } of api.files) {
    try {
      const { salvage } = api;
      opened.push(await addFile(page, { url: absolute(url) }, { name, url, salvage }));
      if (opened.length === 1) await showFirst(page, opened, turn);
    } catch (error) {
      tell(page.store, `${name}: ${faultText(error)}`, true);
    }
  }
  if (api.diff) await compareSecond(page, opened);
}

/** The server ends when nobody listens any more, and says so when it ends before. */
function stayAlive(page) {
  const alive = new EventSource(absolute("alive"));
  alive.addEventListener("end", () => {
    alive.close();
    page.store.set({ server: null });
    tell(page.store, "The server has ended. Open clips stay usable.", true);
  });
}

async function showFirst(page, [first], turn) {
  if (first?.nClips > 0) await showClip(page, first.id, 0, { turn, isNew: true });
}

/** The first clips of two files are compared. */
async function compareSecond(page, [first, second]) {
  if (!(first?.nClips > 0 && second?.nClips > 0)) return;
  if (page.store.get("shown")?.fileId !== first.id) return;
  page.store.set({ tab: "compare" });
  await compareClip(page, second.id, 0);
}

async function serverFacts() {
  const response = await fetch(absolute("api.json")).catch(() => null);
  return response?.ok ? response.json() : null;
}

const absolute = (path) => new URL(path, document.baseURI).href;

/** What is wrong, with the name of the decoder's error where it is one. */
function faultText({ name, message }) {
  const isPlain = name === "Error" || name === "SourceError" || name === "AccessError";
  return isPlain ? message : `${name}: ${message}`;
}

/** Files and folders may be dropped anywhere. */
function takeDrops(page) {
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("is-dropping");
  });
  document.addEventListener("dragleave", (event) => {
    if (event.relatedTarget === null) document.body.classList.remove("is-dropping");
  });
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    document.body.classList.remove("is-dropping");
    const { files, folders, nLeft } = await droppedFiles(event.dataTransfer);
    await openAll(page, files, folders);
    const left = `${nLeft} dropped files are left out: unreadable, or too many`;
    if (nLeft > 0) tell(page.store, left, true);
  });
}
