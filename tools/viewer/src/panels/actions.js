// What several panels do to the store.

import { showClip as showAsked, tellError } from "../asked.js";

export { compareClip, fileOf, nameOf, tell, tellError } from "../asked.js";

/** Shows a clip; tells what is wrong. */
export const showClip = (page, fileId, index) =>
  showAsked(page, fileId, index).catch((error) => tellError(page.store, error));

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
