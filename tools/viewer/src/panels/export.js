// Files made of what is seen: pictures, films, GLB, the source, numbers.

import { recordVideo, stagePicture } from "../stage/capture.js";
import { csvOf } from "../timeline/strips/csv.js";
import { button, make, put } from "../ui/dom.js";
import { fileName } from "../ui/text.js";
import { tell, tellError } from "./actions.js";
import { post, served } from "./server.js";

export function mountExport(panel, page) {
  const { store } = page;
  const buttons = new Map();
  const add = (section, id, text, act) => {
    const one = button({ label: text, shown: text, id: `export-${id}`, class: "wide" });
    one.addEventListener("click", () => run(one, act, page));
    buttons.set(id, one);
    put(section, one);
  };
  const part = (title, note) => make("section", { class: "exports" }, make("h2", {}, title), note && make("p", { class: "quiet" }, note));
  const picture = part("Picture", "The view as it is now.");
  add(picture, "png", "PNG", async () => save(await stagePicture(page), "png"));
  const film = part("Film", "The whole clip, once, at the chosen speed.");
  add(film, "video", "WebM or MP4", (_, say) => filmed(page, say));
  const motion = part("Motion");
  add(motion, "glb", "GLB: animated skeleton", async ({ shown }) => {
    const bytes = await post("glb", served(store, shown));
    return save(new Blob([bytes], { type: "model/gltf-binary" }), "glb");
  });
  add(motion, "source", "Source file", async ({ shown }) => {
    const bytes = await page.engine.source(shown);
    if (!bytes) throw new Error("The clip has no source file.");
    const path = typeof shown.source === "string" ? shown.source : shown.source?.path;
    const name = (path ?? "").split(/[\\/]/).pop();
    return { blob: new Blob([bytes]), name: fileName(name || `${shown.name}.bin`) };
  });
  const numbers = part("Numbers", "The curves below the timeline, one row a frame.");
  add(numbers, "csv", "CSV of the curves", async ({ shown }) => {
    const text = await csvOf(page.engine, shown, store.get("curves") ?? [], store.get("errors"));
    return save(new Blob([text], { type: "text/csv" }), "csv");
  });
  put(panel, picture, film, motion, numbers);
  store.watch(["shown", "server", "files"], () => {
    const shown = store.get("shown");
    for (const one of buttons.values()) one.disabled = !shown;
    const { canGlb = false } = store.get("server") ?? {};
    buttons.get("glb").hidden = !(canGlb && served(store, shown));
    buttons.get("source").disabled = !shown?.source;
  });
}

const save = (blob, suffix) => ({ blob, suffix });

async function filmed(page, say) {
  const made = await recordVideo(page, { onProgress: (share) => say(`${Math.round(100 * share)} %`) });
  const blob = made instanceof Blob ? made : made.blob;
  return save(blob, /mp4/.test(blob.type) ? "mp4" : "webm");
}

/** Makes a file while its button waits, and gives it to the browser. */
async function run(element, act, { store }) {
  const label = element.querySelector("span");
  const { textContent } = label;
  element.disabled = true;
  element.setAttribute("aria-busy", "true");
  try {
    const shown = store.get("shown");
    const made = await act({ shown }, (text) => (label.textContent = `${textContent}: ${text}`));
    const name = made.name ?? `${fileName(shown.name)}.${made.suffix}`;
    download(made.blob, name);
    tell(store, `Saved ${name}.`);
  } catch (error) {
    tellError(store, error);
  } finally {
    label.textContent = textContent;
    element.disabled = false;
    element.removeAttribute("aria-busy");
  }
}

function download(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = make("a", { href: url });
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
