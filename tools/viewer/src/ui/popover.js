// A button that shows a few controls below itself.

import { button, make, put } from "./dom.js";

/** `{ element, body }`: the button with its box, which Escape and a click elsewhere close. */
export function popover({ label, shown, icon, id }) {
  const body = make("div", { class: "popover", id, role: "group", "aria-label": label });
  body.hidden = true;
  const opener = button({
    label,
    shown,
    icon,
    "aria-expanded": "false",
    "aria-controls": id,
    onClick: () => set(body.hidden),
  });
  const set = (isOpen) => {
    body.hidden = !isOpen;
    opener.setAttribute("aria-expanded", String(isOpen));
  };
  const element = put(make("div", { class: "popover-home" }), opener, body);
  element.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || body.hidden) return;
    event.stopPropagation();
    set(false);
    opener.focus();
  });
  document.addEventListener("pointerdown", (event) => {
    if (!element.contains(event.target)) set(false);
  });
  element.addEventListener("focusout", ({ relatedTarget }) => {
    if (relatedTarget && !element.contains(relatedTarget)) set(false);
  });
  return { element, body, close: () => set(false) };
}
