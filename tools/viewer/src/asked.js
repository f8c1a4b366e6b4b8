// What is shown, and what the user is told. What was asked for last counts.

import { lostText } from "./ui/text.js";

/** Tells the user something; `isFault` where it did not go well. */
export const tell = (store, text, isFault = false) => store.set({ message: { text, isFault } });

/** What is told of an error. */
export const tellError = (store, error) => tell(store, error?.message ?? String(error), true);

let nAsked = 0;
let nCompared = 0;

/** A turn of asking for a clip: what has a later one counts. Take it before what takes long. */
export const ask = () => ++nAsked;

/**
 * Shows a clip; the one compared goes, or is followed by the clip of the same name of its file.
 *
 * @param {{turn?: number, isNew?: boolean}} options `turn`: of `ask`; `isNew`: the clip is of what
 *   was just opened, so that nothing is compared, nothing plays, and messages go
 * @returns {Promise<object | null>} the clip; null where something else was asked for since
 * @throws {Error} what is wrong, if nothing else was asked for since
 */
export async function showClip(page, fileId, index, { turn = ask(), isNew = false } = {}) {
  const { store, engine } = page;
  if (turn !== nAsked) return null;
  try {
    const clip = await wholeOrSalvaged(page, fileId, index);
    if (turn !== nAsked) return null;
    const compared = isNew ? null : await partnerOf(page, clip).catch(() => null);
    if (turn !== nAsked) return null;
    const more = isNew ? { playing: false, message: messageThatStays(store) } : {};
    if (clip.lost?.length) more.message = { text: damageText(store, clip), isFault: true };
    store.set({ shown: clip, compared, errors: null, selection: [], frame: 0, ...more });
    return clip;
  } catch (error) {
    if (turn !== nAsked) return null;
    throw error;
  }
}

/** A clip; where its file turns out to be damaged, what is whole of it. */
async function wholeOrSalvaged({ engine, salvage }, fileId, index) {
  try {
    return await engine.clip(fileId, index);
  } catch (error) {
    const id = error.name === "Refused" ? await salvage(fileId, error) : null;
    if (id === null) throw error;
    return engine.clip(id, index);
  }
}

const damageText = (store, clip) => `${nameOf(store, clip)} is damaged: ${lostText(clip)}. Its intact parts are shown.`;

/** What is wrong with the first file that is opened stays. */
function messageThatStays(store) {
  const before = store.get("message");
  return before?.isFault && store.get("shown") === null ? before : null;
}

/** The clip of the compared file that has the name and place of `clip`, or null. */
async function partnerOf({ store, engine }, clip) {
  const compared = store.get("compared");
  if (!compared || compared.fileId === clip.fileId) return null;
  const file = store.get("files").find(({ id }) => id === compared.fileId);
  if (!file || clip.index >= file.nClips) return null;
  const [row] = await engine.rows(file.id, clip.index, clip.index + 1);
  return row?.name === clip.name ? engine.clip(file.id, clip.index) : null;
}

/** Compares a clip with the one that is shown; with none where `fileId` is null. */
export async function compareClip({ store, engine }, fileId, index) {
  const turn = ++nCompared;
  if (fileId === null) {
    store.set({ compared: null, errors: null, ...colorsWithoutErrors(store) });
    return;
  }
  const { key } = store.get("shown") ?? {};
  const isOver = () => turn !== nCompared || store.get("shown")?.key !== key;
  try {
    const clip = await engine.clip(fileId, index);
    if (!isOver()) store.set({ compared: clip, errors: null });
  } catch (error) {
    if (!isOver()) tellError(store, error);
  }
}

const colorsWithoutErrors = (store) => (store.get("colors") === "error" ? { colors: "sides" } : {});

/** The file that a clip is of. */
export const fileOf = (store, clip) =>
  clip ? store.get("files").find(({ id }) => id === clip.fileId) : undefined;

/** The file of a clip, with the clip's name where the file has several; the codec of one just coded. */
export function nameOf(store, clip) {
  const file = fileOf(store, clip);
  if (!file) return clip.label ?? clip.name;
  return file.nClips === 1 ? file.name : `${file.name}: ${clip.name}`;
}
