// The keyboard, anywhere on the page but where text is written.

export const SPEEDS = [0.25, 0.5, 1, 2, 4];
const MANY = 10; // frames

const VIEWS = { 1: "front", 2: "side", 3: "top", 4: "three-quarter", f: "fit" };

/** What each key does; the help of the page may list it. */
export const KEYS = [
  ["Space", "play, pause"],
  ["← →", "a frame back, on; with Shift ten"],
  ["Home End", "first frame, last frame"],
  ["[ ]", "slower, faster"],
  ["L", "loop: start again at the end"],
  ["F", "figure in the middle"],
  ["1 2 3 4", "from the front, the side, the top, a quarter"],
  ["C", "camera follows"],
  ["N", "names"],
  ["T", "trails of the chosen points"],
  ["W A S D", "turn the camera, where the picture has the focus; with Shift move it"],
  ["+ −", "nearer, farther, where the picture has the focus"],
];

export function listenToKeys({ store }) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (isTyping(event.target, event.key)) return;
    if (act(store, event)) event.preventDefault();
  });
}

/** Whether a key belongs to what has the focus. */
function isTyping(target, key) {
  if (!(target instanceof Element)) return false;
  if (target.closest("dialog[open]")) return true;
  if (
    target.closest(
      "input:not([type=range]):not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable]",
    )
  ) {
    return true;
  }
  const moves = /^(Arrow|Home|End|Page)/.test(key);
  if (
    moves &&
    target.closest(
      "[role=listbox], [role=tree], [role=tablist], [role=grid], [role=slider], [role=radiogroup], input",
    )
  ) {
    return true;
  }
  return (
    key === " " &&
    target.closest("button, a, summary, label, input, [role=option], [role=button]") !== null
  );
}

function act(store, { key, shiftKey }) {
  const small = key.toLowerCase();
  const step = shiftKey ? MANY : 1;
  switch (small) {
    case " ":
      return change(store, { playing: !store.get("playing") });
    case "arrowleft":
      return go(store, Math.ceil(store.get("frame")) - step);
    case "arrowright":
      return go(store, Math.floor(store.get("frame")) + step);
    case "home":
      return go(store, 0);
    case "end":
      return go(store, Infinity);
    case "[":
      return change(store, { speed: nextSpeed(store.get("speed"), -1) });
    case "]":
      return change(store, { speed: nextSpeed(store.get("speed"), 1) });
    case "l":
      return change(store, { loop: !store.get("loop") });
    case "c":
      return change(store, { follow: !store.get("follow") });
    case "n":
      return change(store, { names: !store.get("names") });
    case "t":
      return change(store, { trails: !store.get("trails") });
    default:
      return Object.hasOwn(VIEWS, small) && change(store, { view: { name: VIEWS[small] } });
  }
}

function change(store, values) {
  store.set(values);
  return true;
}

/** Goes to a frame, within those of the clip; playing ends. */
export function go(store, frame) {
  const shown = store.get("shown");
  if (shown === null || shown.nFrames === 0) return false;
  const within = Math.max(0, Math.min(frame, shown.nFrames - 1));
  store.set({ playing: false });
  store.set({ frame: within });
  return true;
}

function nextSpeed(speed, step) {
  const at = SPEEDS.findIndex((one) => one >= speed);
  return SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at + step))];
}
