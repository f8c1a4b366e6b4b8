// What the keys do.

import { KEYS } from "../timeline/keys.js";
import { button, make, put } from "../ui/dom.js";

const GROUPS = [
  ["Playing and looking", KEYS],
  [
    "Lists",
    [
      ["↑ ↓, Page, Home, End", "move"],
      ["← →", "close, open a folder"],
      ["Letters", "go to a name"],
      ["Enter", "show a clip, select a point"],
      ["Shift C", "compare with a clip"],
    ],
  ],
  [
    "Curves",
    [
      ["← →", "a frame back, forward"],
      ["+ −", "zoom; with the mouse the wheel, on a touch screen two fingers"],
      ["Shift ← →", "move along"],
      ["0", "all of the clip"],
      ["Enter", "in errors: go to the greatest"],
    ],
  ],
  [
    "Panels",
    [
      ["/", "search clips"],
      ["B, I, V", "show or hide clips, details, curves"],
      ["?", "these keys"],
    ],
  ],
];

/** A dialog; gives the function that opens it. */
export function mountHelp(document) {
  const close = button({ label: "Close", icon: "close", onClick: () => dialog.close() });
  const dialog = make(
    "dialog",
    { class: "help", "aria-labelledby": "help-title" },
    make("header", {}, make("h2", { id: "help-title" }, "Keys"), close),
    make(
      "div",
      { class: "columns" },
      GROUPS.map(([title, rows]) =>
        make(
          "section",
          {},
          make("h3", {}, title),
          make(
            "dl",
            {},
            rows.map(([key, text]) => [make("dt", {}, make("kbd", {}, key)), make("dd", {}, text)]),
          ),
        ),
      ),
    ),
    make("p", { class: "quiet" }, "Nothing that you open here leaves this machine."),
  );
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  put(document.body, dialog);
  return () => dialog.showModal();
}
