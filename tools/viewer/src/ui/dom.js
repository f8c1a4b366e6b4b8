// Elements made by code. Text of a file becomes a text node here, and nothing else.

import { printable } from "./text.js";

const SVG = "http://www.w3.org/2000/svg";

/**
 * An element with attributes, listeners (`onClick`) and children.
 *
 * Of a child that is text, what is not seen is made visible; null and false are left out.
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2).toLowerCase(), value);
    else if (name === "text") element.textContent = printable(String(value));
    else element.setAttribute(name, value === true ? "" : safe(value));
  }
  put(element, ...children);
  return element;
}

/** Appends children to an element. */
export function put(element, ...children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(safe(child)));
  }
  return element;
}

/** Makes an element hold these children, and no others. */
export function fill(element, ...children) {
  element.replaceChildren();
  return put(element, ...children);
}

const safe = (value) => printable(String(value));

// Paths of 16 by 16, drawn with a line.
const ICONS = {
  open: "M2 4h4l1.5 2H14v7H2zM2 8h12",
  clips: "M2 4h12M2 8h12M2 12h8",
  details: "M2 3h12v10H2zM9.5 3v10",
  curves: "M2 12c3 0 3-8 6-8s3 5 6 5",
  help: "M6 6a2 2 0 1 1 2.6 2c-.5.2-.6.6-.6 1.2M8 11.8v.4",
  theme: "M8 2a6 6 0 1 0 6 6 4.5 4.5 0 0 1-6-6z",
  view: "M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8zM8 6.200a1.8 1.8 0 1 0 0 3.6 1.8 1.8 0 0 0 0-3.600z",
  compare: "M5.5 3v10M10.5 3v10M2 5l3.5-2L9 5M7 11l3.5 2L14 11",
  close: "M4 4l8 8M12 4l-8 8",
  caret: "M6 4l4 4-4 4",
  search: "M7 2.500a4.5 4.5 0 1 0 0 9 4.5 4.5 0 0 0 0-9zM10.3 10.3L14 14",
  check: "M3 8.500l3.5 3.500L13 4.5",
};

/** A small drawing that says nothing to a screen reader. */
export function icon(name) {
  const svg = document.createElementNS(SVG, "svg");
  const path = document.createElementNS(SVG, "path");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  svg.setAttribute("class", "icon");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

/** A button; `label` is what is read, `shown` what is seen. */
export function button({ label, shown, icon: drawing, onClick, ...attributes }) {
  const children = [drawing && icon(drawing), shown && make("span", {}, shown)];
  return make(
    "button",
    { type: "button", "aria-label": label, title: shown ? null : label, onClick, ...attributes },
    ...children,
  );
}

/** One of a few values, as a row of radio buttons. `choices` are pairs of value and text. */
export function choice({ name, legend, choices, value, onChange, isHidden = false }) {
  const group = make("fieldset", { class: "choice" });
  put(group, make("legend", { class: isHidden ? "unseen" : null }, legend));
  const inputs = choices.map(([key, text]) => {
    const input = make("input", { type: "radio", name, value: key });
    input.checked = key === value;
    input.addEventListener("change", () => onChange(key));
    put(group, make("label", {}, input, make("span", {}, text)));
    return input;
  });
  return {
    element: group,
    set: (key) => inputs.forEach((input) => (input.checked = input.value === key)),
  };
}

/** A box that is ticked or not. */
export function toggle({ text, value, onChange, ...attributes }) {
  const input = make("input", { type: "checkbox", ...attributes });
  input.checked = value;
  input.addEventListener("change", () => onChange(input.checked));
  return {
    element: make("label", { class: "toggle" }, input, make("span", {}, text)),
    input,
    set: (checked) => (input.checked = checked),
  };
}

/** A definition list; a row is [term, description or node], without a row where it is null. */
export function facts(rows) {
  const list = make("dl", { class: "facts" });
  for (const row of rows) {
    if (!row || row[1] === null || row[1] === undefined || row[1] === "") continue;
    put(list, make("dt", {}, row[0]), make("dd", {}, row[1]));
  }
  return list;
}

/** A caller that runs `act` once, `ms` after it was last called. */
export function later(act, ms) {
  let timer = 0;
  return (...args) => {
    clearTimeout(timer);
    timer = setTimeout(() => act(...args), ms);
  };
}

/** A caller that runs `act` once in the next picture, however often it is called. */
export function inNextPicture(act) {
  let asked = 0;
  return () => {
    if (asked) return;
    asked = requestAnimationFrame(() => {
      asked = 0;
      act();
    });
  };
}

/** Whether a key that is pressed there is meant for what is typed in. */
export const isTyping = (target) =>
  target instanceof HTMLElement &&
  (target.isContentEditable || /^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName));
