// Which panels are seen. On a narrow page they are drawers, of which one is open at most.

import { button, make, put } from "../ui/dom.js";
import { remember, remembered } from "../ui/settings.js";

const PANELS = [
  ["clips", "Clips", "clips"],
  ["inspector", "Details", "details"],
  ["curves", "Curves", "curves"],
];
const NARROW = "(max-width: 45rem)";
const WIDE = "(min-width: 68rem)";

/** `{ place(), toggle(name), show(name) }`; style reads `data-clips` and the like of the body. */
export function mountLayout(document, { store }) {
  const narrow = matchMedia(NARROW);
  const wide = matchMedia(WIDE);
  const open = new Map();
  const buttons = new Map();
  const apply = () => {
    for (const [name] of PANELS) {
      const isOpen = Boolean(open.get(name));
      document.body.dataset[name] = isOpen ? "open" : "closed";
      buttons.get(name).setAttribute("aria-pressed", String(isOpen));
    }
    store.set({ panels: Object.fromEntries(open) });
  };
  const begin = () => {
    const hasMany = store.get("files").reduce((sum, { nClips }) => sum + nClips, 0) > 1;
    open.set("clips", !narrow.matches && remembered("clips", hasMany));
    open.set("inspector", !narrow.matches && remembered("inspector", wide.matches));
    open.set("curves", !narrow.matches && remembered("curves", true));
    apply();
  };
  const set = (name, isOpen) => {
    if (narrow.matches) for (const [other] of PANELS) open.set(other, false);
    else remember(name, isOpen);
    open.set(name, isOpen);
    apply();
  };
  const toggle = (name) => set(name, !open.get(name));
  const element = make("div", { class: "panel-switch", role: "group", "aria-label": "Panels" });
  for (const [name, text, drawing] of PANELS) {
    const onClick = () => toggle(name);
    buttons.set(name, button({ label: text, shown: text, icon: drawing, onClick }));
    put(element, buttons.get(name));
  }
  // On a narrow page the buttons stand below everything, outside of the bar.
  const bar = document.getElementById("bar");
  const place = () => (narrow.matches ? document.body : bar).append(element);
  narrow.addEventListener("change", () => {
    place();
    begin();
  });
  place();
  let nFiles = -1;
  store.watch(["files"], () => {
    if (store.get("files").length === nFiles) return;
    nFiles = store.get("files").length;
    begin();
  });
  return { place, toggle, show: (name) => set(name, true) };
}
