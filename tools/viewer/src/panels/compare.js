// A second clip beside the one shown: which, how it is drawn, and how far it is away.

import { compareClip, fileOf, nameOf } from "./actions.js";
import { chooseFiles } from "../inputs.js";
import { button, choice, facts, fill, later, make, put, toggle } from "../ui/dom.js";
import { count, distance, figure, frameNumber, size, summary } from "../ui/text.js";
import { post, served } from "./server.js";

const MOST_OPTIONS = 400;
const MOST_POINTS = 12;
const CODED = "coded"; // in place of a file's id: what the quality panel coded

export function mountCompare(panel, page) {
  const { store } = page;
  const which = make("section", {}, make("h2", {}, "Compared with"));
  const how = make("section");
  const numbers = make("section");
  const more = make("section");
  put(panel, which, how, numbers, more);
  const chooser = mountChooser(which, page);
  store.watch(["files", "shown", "compared"], () => chooser());
  mountHow(how, store);
  store.watch(["errors", "compared", "errorsShare"], () => fillNumbers(numbers, store));
  mountDiff(more, store);
}

/** Selects of a file and a clip; a list that is too long is for the list of clips. */
function mountChooser(section, page) {
  const { store, engine } = page;
  const files = make("select", { id: "compare-file" });
  const clips = make("select", { id: "compare-clip" });
  const note = make("p", { class: "quiet" });
  const stop = button({ label: "Stop comparing", shown: "Stop", onClick: () => compareClip(page, null) });
  const swap = button({ label: "Swap the two clips", shown: "Swap", onClick: () => swapped(store) });
  const open = button({ label: "Open a file", shown: "Open a file…", onClick: () => chooseFiles(page) });
  const clipField = make("label", { class: "field" }, make("span", {}, "Clip"), clips);
  put(
    section,
    make("label", { class: "field" }, make("span", {}, "File"), files),
    clipField,
    note,
    make("div", { class: "buttons" }, swap, stop, open),
  );
  let asked = 0;
  const fillClips = async () => {
    const mine = ++asked;
    const file = store.get("files").find(({ id }) => String(id) === files.value);
    clipField.hidden = !file || file.nClips > MOST_OPTIONS;
    note.textContent =
      file && file.nClips > MOST_OPTIONS ? "Choose it in the list of clips: its button, or Shift C." : "";
    if (files.value === CODED) note.textContent = "Encoded from the shown clip.";
    if (clipField.hidden) return;
    const rows = await engine.rows(file.id, 0, file.nClips).catch(() => []);
    if (mine !== asked) return;
    const { shown, compared } = { shown: store.get("shown"), compared: store.get("compared") };
    const others = rows.filter(({ index }) => file.id !== shown?.fileId || index !== shown.index);
    fill(
      clips,
      make("option", { value: "" }, "none"),
      others.map(({ index, name }) => make("option", { value: index }, name || "(no name)")),
    );
    clips.value = compared?.fileId === file.id ? String(compared.index) : "";
  };
  const choose = () => {
    if (clips.value === "") compareClip(page, null);
    else compareClip(page, Number(files.value), Number(clips.value));
  };
  clips.addEventListener("change", choose);
  files.addEventListener("change", async () => {
    if (files.value === CODED) return;
    await fillClips();
    const file = store.get("files").find(({ id }) => String(id) === files.value);
    if (file?.nClips !== 1 || clips.options.length < 2) return;
    clips.selectedIndex = 1;
    choose();
  });
  return () => {
    const all = store.get("files");
    const compared = store.get("compared");
    const { value } = files;
    const isCoded = compared !== null && !fileOf(store, compared);
    fill(
      files,
      isCoded && make("option", { value: CODED }, nameOf(store, compared)),
      all.map(({ id, name }) => make("option", { value: id }, name)),
    );
    const other = all.find(({ id }) => id !== store.get("shown")?.fileId);
    const wanted = isCoded ? CODED : compared ? compared.fileId : value || other?.id;
    if (isCoded || all.some(({ id }) => String(id) === String(wanted))) files.value = String(wanted);
    swap.disabled = stop.disabled = !compared;
    fillClips();
  };
}

function swapped(store) {
  const { shown, compared, frame } = {
    shown: store.get("shown"),
    compared: store.get("compared"),
    frame: store.get("frame"),
  };
  const kept = Math.min(Math.floor(frame), Math.max(0, compared.nFrames - 1));
  store.set({ shown: compared, compared: shown, errors: null, selection: [], frame: kept });
}

function mountHow(section, store) {
  const layout = choice({
    name: "layout",
    legend: "Drawn",
    choices: [
      ["overlay", "Overlaid"],
      ["side", "Side by side"],
    ],
    value: store.get("layout"),
    onChange: (value) => store.set({ layout: value }),
  });
  const colored = toggle({
    text: "Color points by error",
    value: false,
    onChange: (on) => store.set({ colors: on ? "error" : "sides" }),
  });
  put(section, layout.element, colored.element);
  store.watch(["compared", "layout", "colors"], () => {
    section.hidden = !store.get("compared");
    layout.set(store.get("layout"));
    colored.set(store.get("colors") === "error");
  });
}

function fillNumbers(section, store) {
  const compared = store.get("compared");
  const errors = store.get("errors");
  section.hidden = !compared;
  if (!compared) return;
  const shown = store.get("shown");
  fill(section, make("h2", {}, "Distance of points"));
  put(section, facts([["Clip", nameOf(store, compared)], ["", summary(compared)], ["Size", sizes(shown, compared)]]));
  if (!errors) {
    const share = store.get("errorsShare");
    put(section, make("progress", { max: 1, value: share ?? 0, "aria-label": "Points are being compared" }));
    return;
  }
  const unitCm = errors.unit === "cm" ? 1 : null;
  const { mean, max, frame, point } = errors.total;
  const number = (of) => count(frameNumber(shown, of ?? 0));
  const jump = (toFrame, toPoint) => store.set({ playing: false, frame: toFrame, selection: [toPoint] });
  const place = button({
    label: `Go to frame ${number(frame)}, ${shown.points[point]?.name ?? ""}`,
    shown: `frame ${number(frame)}, ${shown.points[point]?.name ?? ""}`,
    class: "link",
    onClick: () => jump(frame, point),
  });
  put(
    section,
    facts([
      ["Mean", make("b", {}, distance(mean, unitCm))],
      ["Greatest", make("b", {}, distance(max, unitCm))],
      ["Where", max > 0 ? place : "nowhere"],
      ["Points", `${count(errors.byPoint.length)} of the same names`],
    ]),
    max > 0 && worstTable(errors, { unitCm, jump, number }),
  );
}

function sizes(shown, compared) {
  if (!shown?.bytes || !compared.bytes) return null;
  const share = figure((100 * compared.bytes) / shown.bytes, 3);
  return `${size(compared.bytes)} against ${size(shown.bytes)}: ${share} %`;
}

function worstTable(errors, { unitCm, jump, number }) {
  const worst = errors.byPoint.filter(({ max }) => max > 0).sort((a, b) => b.max - a.max);
  const place = ({ point, name, frame }) =>
    button({
      label: `Go to ${name} in frame ${number(frame)}`,
      shown: name || "(no name)",
      class: "link",
      onClick: () => jump(frame, point),
    });
  const rows = worst.slice(0, MOST_POINTS).map(({ point, name, mean, max, frame }) =>
    make(
      "tr",
      {},
      make("th", { scope: "row" }, place({ point, name, frame })),
      make("td", {}, distance(mean, unitCm)),
      make("td", {}, distance(max, unitCm)),
    ),
  );
  const head = ["Point", "Mean", "Greatest"].map((text) => make("th", { scope: "col" }, text));
  return make(
    "table",
    {},
    make("caption", {}, "Farthest points"),
    make("thead", {}, make("tr", {}, head)),
    make("tbody", {}, rows),
  );
}

/** The figures of `mcz diff`, asked of the server, or carried by a page that was sent. */
function mountDiff(section, store) {
  let abort = null;
  const load = later(async () => {
    abort?.abort();
    const [a, b] = [served(store, store.get("shown")), served(store, store.get("compared"))];
    const carried = carriedDiff(store);
    section.hidden = !store.get("compared") || !(carried || (a && b && store.get("server")?.canEncode));
    if (section.hidden) return;
    if (carried) return void showDiff(section, carried, store.get("shown"));
    abort = new AbortController();
    try {
      const found = await post("diff", { a, b }, { signal: abort.signal });
      showDiff(section, found, store.get("shown"));
    } catch (error) {
      if (error.name !== "AbortError") fill(section, title(), make("p", { class: "quiet" }, error.message));
    }
  }, 300);
  section.hidden = true;
  store.watch(["shown", "compared"], load);
}

/** What a page that was sent has of the clips that are compared: its files against the first. */
function carriedDiff(store) {
  const place = (clip) => store.get("files").findIndex(({ id }) => id === clip?.fileId);
  const { shown, compared } = { shown: store.get("shown"), compared: store.get("compared") };
  if (place(shown) !== 0 || place(compared) < 1) return null;
  const { clips = [], notes = [] } = store.get("diffs")[place(compared) - 1] ?? {};
  const found = clips.find((one) => one.name_a === shown.name && one.name_b === compared.name);
  if (found) return { clips: [found] };
  const why = notes.filter((note) => note.startsWith(`${shown.name}: `));
  return why.length > 0 ? { clips: [{ notes: why }] } : null;
}

const title = () => make("h2", {}, "Figures of mcz diff");
const NAMES = new Map([
  ["mean_position_error_cm", ["Mean position error", "cm"]],
  ["mean_position_error", ["Mean position error", "units"]],
  ["max_position_error_cm", ["Greatest position error", "cm"]],
  ["max_position_error", ["Greatest position error", "units"]],
  ["max_position_error_frame", ["… in frame", ""]],
  ["max_position_error_point", ["… of point", ""]],
  ["mean_velocity_error_cm_s", ["Mean velocity error", "cm/s"]],
  ["max_velocity_error_cm_s", ["Greatest velocity error", "cm/s"]],
  ["mean_acceleration_error_cm_s2", ["Mean acceleration error", "cm/s²"]],
  ["max_acceleration_error_cm_s2", ["Greatest acceleration error", "cm/s²"]],
  ["shell_mean_cm", ["Mean of the shell", "cm"]],
  ["shell_max_cm", ["Greatest of the shell", "cm"]],
  ["slide_mean_mm", ["Feet slide, mean", "mm"]],
  ["slide_max_mm", ["Feet slide, greatest", "mm"]],
  ["contacts", ["Contacts", ""]],
  ["mse", ["MSE of channels", ""]],
  ["sqnr_db", ["SQNR", "dB"]],
  ["mismatched_values", ["Mismatched values", ""]],
  ["mismatched_points", ["Mismatched points", ""]],
]);

function showDiff(section, { clips = [] }, shown) {
  const number = (frame) => count(frameNumber(shown, frame));
  const found = clips[0] ?? {};
  const hasCm = typeof found.mean_position_error_cm === "number";
  const rows = [...NAMES].map(([key, [name, unit]]) => {
    if (hasCm && unit === "units") return null;
    const value = Object.hasOwn(found, key) ? found[key] : null;
    if (value === null || typeof value === "object") return null;
    if (key.endsWith("_frame")) return [name, number(value)];
    return [name, typeof value === "number" ? `${figure(value)} ${unit}`.trim() : value];
  });
  const ratio = (side) => found[`ratios_${side}`]?.cr_source;
  const ratios = [ratio("a"), ratio("b")].every(Number.isFinite)
    ? ["Source : bytes", `${figure(ratio("a"))} and ${figure(ratio("b"))}`]
    : null;
  const notes = (found.notes ?? []).map((note) => make("p", { class: "quiet" }, note));
  fill(section, title(), facts([...rows, ratios]), notes);
}
