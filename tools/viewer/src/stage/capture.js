// The picture as a file, and as a film.

import { rateOf } from "../timeline/clock.js";
import { mounted } from "./stage.js";

const TYPES = [
  "video/mp4;codecs=avc1.42E01E",
  "video/mp4",
  "video/webm;codecs=vp9",
  "video/webm;codecs=vp8",
  "video/webm",
];
const PICTURES = 60; // a second, at most
const BITS = 12_000_000; // a second

/**
 * The picture as it is seen now.
 *
 * @returns {Promise<Blob>} a PNG
 */
export function stagePicture() {
  const { view } = mounted();
  view.draw(); // what was drawn before need not be there any more
  return new Promise((resolve, reject) => {
    view.canvas.toBlob(
      (blob) => (blob ? resolve(blob) : reject(new Error("no picture"))),
      "image/png",
    );
  });
}

/** The type of film that this browser makes; null: none. */
function videoType() {
  if (typeof MediaRecorder === "undefined") return null;
  return TYPES.find((type) => MediaRecorder.isTypeSupported(type)) ?? null;
}

/**
 * Plays frames from <= f < to in real time, and films them.
 *
 * @param {object} page
 * @param {{from?: number, to?: number, type?: string, onProgress?: (done: number) => void,
 *   signal?: AbortSignal}} options
 * @returns {Promise<Blob>} WebM or MP4, by its type
 */
export async function recordVideo({ store }, options = {}) {
  const shown = store.get("shown");
  const {
    from = 0,
    to = shown?.nFrames ?? 0,
    type = videoType(),
    onProgress = () => {},
    signal,
  } = options;
  if (shown === null || to <= from) throw new Error("there is nothing to record");
  if (type === null) throw new Error("this browser does not record films");
  const { view } = mounted();
  const recorder = new MediaRecorder(view.canvas.captureStream(PICTURES), {
    mimeType: type,
    videoBitsPerSecond: BITS,
  });
  const parts = [];
  recorder.addEventListener("dataavailable", ({ data }) => data.size > 0 && parts.push(data));
  const ended = new Promise((resolve, reject) => {
    recorder.addEventListener("stop", resolve);
    recorder.addEventListener("error", ({ error }) =>
      reject(error ?? new Error("the film was not recorded")),
    );
  });
  const before = { frame: store.get("frame"), loop: store.get("loop"), playing: false };
  store.set({ playing: false });
  store.set({ frame: from });
  recorder.start(250);
  await played(store, { from, to, shown, onProgress, signal });
  recorder.stop();
  await ended;
  store.set(before);
  if (signal?.aborted) throw new DOMException("stopped", "AbortError");
  return new Blob(parts, { type: type.split(";")[0] });
}

/** Goes through the frames at their time. */
function played(store, { from, to, shown, onProgress, signal }) {
  const begun = performance.now();
  const rate = rateOf(shown) * store.get("speed");
  return new Promise((resolve) => {
    const step = (now) => {
      const frame = Math.min(to - 1, from + (Math.max(0, now - begun) / 1000) * rate);
      store.set({ frame });
      onProgress((frame - from) / Math.max(1, to - 1 - from));
      const isOver = frame >= to - 1 || signal?.aborted || store.get("shown") !== shown;
      if (isOver)
        setTimeout(resolve, 120); // the last picture is to be in it
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  });
}
