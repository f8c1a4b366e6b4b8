// The transport: play, scrub, speed, loop, where one is; and below it the strips.

import { Clock, USUAL_RATE, rateOf } from "./clock.js";
import { SPEEDS, go, listenToKeys } from "./keys.js";
import { count, frameNumber } from "../ui/text.js";
import { mountStrips } from "./strips/strips.js";
import { timeOf } from "../ui/times.js";

const PATHS = {
  play: "M4 2.5v11l9-5.5z",
  pause: "M4 2.5h3v11H4zM9.5 2.5h3v11h-3z",
  back: "M11 3v10L4.5 8zM3 3h1.6v10H3z",
  on: "M5 3v10l6.5-5zM11.4 3H13v10h-1.6z",
  loop: "M4 5h6.5V3L14 5.8l-3.5 2.8v-2H5.6V9H4zM12 11H5.5v2L2 10.2l3.5-2.8v2h4.9V7H12z",
};

/** @param {HTMLElement} element of the page */
export function mountTimeline(element, page) {
  const { store } = page;
  const row = make("div", "transport");
  const strips = make("div", "strips");
  element.append(row, strips);

  const play = button("play", "Play");
  const back = button("back", "A frame back");
  const on = button("on", "A frame on");
  const scrub = make("input", "scrub");
  const place = make("output", "place");
  const speed = speedChoice();
  const loop = button("loop", "Loop");
  row.append(play, back, on, scrub, place, speed, loop);
  scrub.type = "range";
  scrub.min = "0";
  scrub.step = "1";
  scrub.setAttribute("aria-label", "Frame");

  play.addEventListener("click", () => store.set({ playing: !store.get("playing") }));
  back.addEventListener("click", () => go(store, Math.ceil(store.get("frame")) - 1));
  on.addEventListener("click", () => go(store, Math.floor(store.get("frame")) + 1));
  scrub.addEventListener("input", () => go(store, Number(scrub.value)));
  speed.addEventListener("change", () => store.set({ speed: Number(speed.value) }));
  loop.addEventListener("click", () => store.set({ loop: !store.get("loop") }));

  store.watch(["shown"], () => {
    const shown = store.get("shown");
    const isThere = shown !== null && shown.nFrames > 0;
    for (const one of [play, back, on, scrub, speed, loop]) one.disabled = !isThere;
    scrub.max = String(Math.max(0, (shown?.nFrames ?? 1) - 1));
    place.title =
      isThere && !shown.rate
        ? `The file does not state its rate; ${USUAL_RATE} frames a second are assumed`
        : "";
  });
  store.watch(["frame", "shown"], () => showPlace(store, scrub, place));
  store.watch(["playing"], () => {
    const playing = store.get("playing");
    label(play, playing ? "pause" : "play", playing ? "Pause" : "Play");
  });
  store.watch(["speed"], () => (speed.value = String(store.get("speed"))));
  store.watch(["loop"], () => loop.setAttribute("aria-pressed", String(store.get("loop"))));

  new Clock(store);
  listenToKeys(page);
  mountStrips(strips, page);
}

function showPlace(store, scrub, place) {
  const shown = store.get("shown");
  if (shown === null || shown.nFrames === 0) {
    place.textContent = "";
    return;
  }
  const frame = Math.floor(store.get("frame"));
  const text = placeText(shown, frame);
  scrub.value = String(frame);
  scrub.style.setProperty("--done", `${(100 * frame) / Math.max(1, shown.nFrames - 1)}%`);
  scrub.setAttribute("aria-valuetext", text);
  place.textContent = text;
}

/** "12 / 343 · 0.10 s"; frames are numbered as the file does. */
function placeText(clip, frame) {
  const time = timeOf(clip, frame);
  const seconds = time === null ? `≈ ${timeText(frame / rateOf(clip))}` : timeText(time);
  const number = (n) => count(frameNumber(clip, n));
  return `${number(frame)} / ${number(clip.nFrames - 1)} · ${seconds}`;
}

function timeText(seconds) {
  if (seconds < 0) return `−${timeText(-seconds)}`;
  if (seconds < 60) return `${seconds.toFixed(2)} s`;
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(2).padStart(5, "0")}`;
}

function speedChoice() {
  const choice = make("select", "speed");
  choice.setAttribute("aria-label", "Speed");
  const names = { 0.25: "¼×", 0.5: "½×" };
  for (const value of SPEEDS) {
    const option = document.createElement("option");
    option.value = String(value);
    option.textContent = names[value] ?? `${value}×`;
    choice.append(option);
  }
  return choice;
}

function make(tag, name) {
  const element = document.createElement(tag);
  element.className = name;
  return element;
}

function button(icon, text) {
  const element = make("button", `transport-${icon}`);
  element.type = "button";
  label(element, icon, text);
  return element;
}

function label(element, icon, text) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  const path = document.createElementNS(space, "path");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  path.setAttribute("d", PATHS[icon]);
  svg.append(path);
  element.replaceChildren(svg);
  element.setAttribute("aria-label", text);
  element.title = text;
}
