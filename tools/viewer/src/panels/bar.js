// The bar: what is open, how it is looked at, which panels are seen.

import { button, choice, fill, make, put, toggle } from "../ui/dom.js";
import { popover } from "../ui/popover.js";
import { fileOf } from "./actions.js";
import { summary } from "../ui/text.js";
import { THEMES } from "./theme.js";

const VIEWS = [
  ["three-quarter", "Three-quarter"],
  ["front", "Front"],
  ["side", "Side"],
  ["top", "Top"],
];
const COLORS = [
  ["sides", "Left, right"],
  ["speed", "Speed"],
  ["error", "Error"],
];
const DRAWN = [
  ["trails", "Trails of selected points"],
  ["contacts", "Foot contacts"],
  ["names", "Names"],
  ["neighbors", "Guess lines between markers"],
  ["follow", "Follow the figure"],
];

/** `openFiles()` asks for files and opens them; `layout` says which panels are seen; `help()` opens. */
export function mountBar(element, page, { openFiles, layout, theme, help }) {
  const title = make("h1", {}, "MCZ");
  const names = make("p", { class: "files" });
  const open = button({ label: "Open files", shown: "Open…", icon: "open", onClick: openFiles });
  open.id = "open";
  put(
    element,
    title,
    names,
    make(
      "div",
      { class: "tools" },
      open,
      viewMenu(page),
      themeMenu(theme),
      button({ label: "Help: keys", icon: "help", onClick: help, id: "help" }),
    ),
  );
  layout.place();
  page.store.watch(["shown", "files", "loading"], () => fillNames(names, page.store));
}

function fillNames(element, store) {
  const files = store.get("files");
  const shown = store.get("shown");
  const file = fileOf(store, shown);
  if (!shown) {
    const loading = store.get("loading");
    const text = files.map(({ name }) => name).join(", ") || "No file is open";
    fill(element, loading ? `Loading ${loading} …` : text);
    document.title = "MCZ";
    return;
  }
  const isSame = files.length === 1 && file?.nClips === 1;
  const name = file?.name ?? shown.name;
  fill(
    element,
    make("b", { title: name }, name),
    !isSame && shown.name !== name && make("span", { title: shown.name }, shown.name || "(no name)"),
    make("small", { class: "quiet" }, summary(shown)),
  );
  document.title = `${element.querySelector("b").textContent} – MCZ`;
}

function viewMenu({ store }) {
  const { element, body } = popover({ label: "View", shown: "View", icon: "view", id: "view-menu" });
  const views = VIEWS.map(([name, text]) =>
    button({ label: `View: ${text}`, shown: text, onClick: () => store.set({ view: { name } }) }),
  );
  const colors = choice({
    name: "colors",
    legend: "Colors",
    choices: COLORS,
    value: store.get("colors"),
    onChange: (value) => store.set({ colors: value }),
  });
  const boxes = DRAWN.map(([key, text]) => {
    const box = toggle({ text, value: store.get(key), onChange: (on) => store.set({ [key]: on }) });
    store.watch([key], () => box.set(store.get(key)));
    if (key === "neighbors") showWhereGuessed(store, box.element);
    return box.element;
  });
  store.watch(["colors"], () => colors.set(store.get("colors")));
  put(body, make("div", { class: "grid-2" }, views), colors.element, boxes);
  return element;
}

/** Shows a box only where a clip has markers whose names say nothing of lines. */
function showWhereGuessed(store, box) {
  const place = () => {
    const { isMarkers, bones } = store.get("shown") ?? {};
    box.hidden = !isMarkers || bones.length > 0;
  };
  store.watch(["shown"], place);
  place();
}

function themeMenu(theme) {
  const { element, body } = popover({ label: "Light or dark", icon: "theme", id: "theme-menu" });
  const { element: group } = choice({
    name: "theme",
    legend: "Theme",
    choices: THEMES,
    value: theme.wanted(),
    onChange: theme.set,
  });
  put(body, group);
  return element;
}
