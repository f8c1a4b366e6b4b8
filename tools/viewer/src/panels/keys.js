// Keys of the page as a whole; parts that have the focus take theirs before.

import { isTyping } from "../ui/dom.js";

const PANELS = new Map([
  ["b", "clips"],
  ["i", "inspector"],
  ["v", "curves"],
]);

export function mountKeys(document, { layout, help }) {
  document.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isTyping(event.target) || document.querySelector("dialog[open]")) return;
    if (event.key === "?") help();
    else if (event.key === "/") {
      layout.show("clips");
      document.querySelector("#clips input[type=search]").focus();
    } else if (PANELS.has(event.key)) layout.toggle(PANELS.get(event.key));
    else return;
    event.preventDefault();
  });
}
