// Tabs: one panel is seen, arrows go from tab to tab.

import { make, put } from "./dom.js";

/**
 * `tabs` are `{ id, text, mount(panel) }`; a panel is mounted when it is first seen.
 *
 * @returns `{ element, panel, show(id), shown() }`
 */
export function tabs(label, list, onShow = () => {}) {
  const row = make("div", { class: "tabs", role: "tablist", "aria-label": label });
  const panels = make("div", { class: "tab-panels" });
  const buttons = new Map();
  const bodies = new Map();
  const mounted = new Set();
  let shown = null;
  const show = (id) => {
    shown = id;
    for (const [key, tab] of buttons) {
      const isShown = key === id;
      tab.setAttribute("aria-selected", String(isShown));
      tab.tabIndex = isShown ? 0 : -1;
      bodies.get(key).hidden = !isShown;
    }
    if (!mounted.has(id)) {
      mounted.add(id);
      list.find((tab) => tab.id === id).mount(bodies.get(id));
    }
    onShow(id);
  };
  for (const { id, text } of list) {
    const tab = make(
      "button",
      { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": `panel-${id}` },
      text,
    );
    tab.addEventListener("click", () => show(id));
    buttons.set(id, tab);
    bodies.set(
      id,
      make("div", { role: "tabpanel", id: `panel-${id}`, "aria-labelledby": `tab-${id}`, tabindex: "0" }),
    );
    put(row, tab);
    put(panels, bodies.get(id));
  }
  row.addEventListener("keydown", (event) => {
    const ids = list.filter(({ id }) => !buttons.get(id).hidden).map(({ id }) => id);
    const at = ids.indexOf(shown);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: ids.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const id = ids[(to + ids.length) % ids.length];
    show(id);
    buttons.get(id).focus();
  });
  return {
    row,
    panels,
    show,
    shown: () => shown,
    setHidden: (id, isHidden) => (buttons.get(id).hidden = isHidden),
  };
}
