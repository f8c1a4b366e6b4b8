// What several panels do to the store.

/** Tells the user something; `isFault` where it did not go well. */
export const tell = (store, text, isFault = false) => store.set({ message: { text, isFault } });

/** What is told of an error. */
export const tellError = (store, error) => tell(store, error?.message ?? String(error), true);

let nAsked = 0;

/** Shows a clip; the one compared goes, or is followed by the clip of the same name of its file. */
export async function showClip(page, fileId, index) {
  const { store, engine } = page;
  const asked = ++nAsked;
  try {
    const clip = await engine.clip(fileId, index);
    if (asked !== nAsked) return;
    const partner = await partnerOf(page, clip).catch(() => null);
    if (asked !== nAsked) return;
    store.set({ shown: clip, compared: partner, errors: null, selection: [], frame: 0 });
  } catch (error) {
    if (asked === nAsked) tellError(store, error);
  }
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
  if (fileId === null) {
    store.set({ compared: null, errors: null, ...colorsWithoutErrors(store) });
    return;
  }
  const { key } = store.get("shown") ?? {};
  try {
    const clip = await engine.clip(fileId, index);
    if (store.get("shown")?.key !== key) return;
    store.set({ compared: clip, errors: null });
  } catch (error) {
    tellError(store, error);
  }
}

const colorsWithoutErrors = (store) => (store.get("colors") === "error" ? { colors: "sides" } : {});

/** Keeps `errors` true to `shown` and `compared`. */
export function watchErrors({ store, engine }) {
  let asked = 0;
  store.watch(["shown", "compared"], async () => {
    const { shown, compared } = { shown: store.get("shown"), compared: store.get("compared") };
    const mine = ++asked;
    if (!shown || !compared) return void store.set({ errors: null });
    try {
      const errors = await engine.errors(shown, compared, (share) => {
        if (mine === asked) store.set({ errorsShare: share });
      });
      if (mine === asked) store.set({ errors, errorsShare: null });
    } catch (error) {
      if (mine !== asked) return;
      store.set({ errors: null, errorsShare: null });
      tellError(store, error);
    }
  });
}

/** The file that a clip is of. */
export const fileOf = (store, clip) =>
  clip ? store.get("files").find(({ id }) => id === clip.fileId) : undefined;
