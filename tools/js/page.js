// The page index.html: lists the clips of a file, and draws the pose of the one that is chosen.

import { Kinematics, hasKinematics } from "./kinematics.js";
import { MczError, decode, list, setAnnex } from "./mcz.js";

const ANNEX = new URL("../../conformance/annex/", import.meta.url);
const ANNEX_FILES = [
  "bases_cmu31.bin",
  "bases_cmu31_virtual.bin",
  "bases_cmu38.bin",
  "fast_counts.json",
  "frame_start.json",
  "lossless_start.json",
  "online_start.json",
  "posewave_start.json",
  "pca_start.json",
  "qbc_start.json",
  "wavelet_start.json",
  "window_start.json",
  "words.bin",
];
const USUAL_RATE = 120; // frames a second, where a clip does not say
const AXES = ["x", "y", "z"];
const FRAMES_OF_EXTENT = 200; // as many poses say where a clip is

const element = (id) => document.getElementById(id);
const fileInput = element("file");
const clipList = element("clips");
const canvas = element("view");
const playButton = element("play");
const frameSlider = element("frame");
const timeOutput = element("time");
const upChoice = element("up");
const droppedInput = element("dropped");

const annexIsThere = fetchAnnex();
const camera = { yaw: 0.6, pitch: 0.25, zoom: 1 };
let bytes = null; // of the file
let chosen = null; // of its clips
let motion = null; // the clip that is shown: chosen, decoded
let playing = null; // where and when playing began: { frame, time }

/** Fetches the annex files; the decoder looks them up when a codec needs one. */
async function fetchAnnex() {
  const files = new Map();
  const fetchOne = async (name) => {
    const response = await fetch(new URL(name, ANNEX));
    if (response.ok) files.set(name, new Uint8Array(await response.arrayBuffer()));
  };
  await Promise.all(ANNEX_FILES.map(fetchOne));
  setAnnex((name) => {
    if (!files.has(name)) throw new Error(`no ${name}`);
    return files.get(name);
  });
}

function say(text, isFault = false) {
  const message = element("message");
  message.textContent = text;
  message.classList.toggle("fault", isFault);
}

/** Does something with a file, and says what is wrong with it. */
function attempt(work) {
  try {
    return work();
  } catch (error) {
    say(`${error instanceof MczError ? error.name : "Error"}: ${error.message}`, true);
    return null;
  }
}

// The file and its clips

/**
 * Shows a file.
 *
 * @param {Uint8Array} content
 * @param {string} name
 */
async function open(content, name) {
  await annexIsThere;
  bytes = content;
  chosen = null;
  close();
  clipList.replaceChildren();
  const clips = attempt(() => list(bytes));
  if (clips === null) return;
  const size = content.length.toLocaleString();
  say(`${name}: ${size} bytes, ${clips.length} ${clips.length === 1 ? "clip" : "clips"}`);
  clipList.append(...clips.map(entryOf));
  if (clips.length > 0) choose(clips[0], clipList.firstElementChild);
}

function entryOf(clip) {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.append(clip.name, ...factsOf(clip).map(smallText));
  button.addEventListener("click", () => choose(clip, item));
  item.append(button);
  return item;
}

function smallText(text) {
  const small = document.createElement("small");
  small.textContent = text;
  return small;
}

function factsOf({ nFrames, frameRate, skeleton, signals, source, metadata, quality }) {
  const { numerator, denominator } = frameRate;
  const rate = numerator / denominator;
  const time = numerator === 0 ? "rate unknown" : `${round(rate)} Hz, ${round(nFrames / rate)} s`;
  const facts = [`${nFrames} frames, ${time}`];
  const { joints, channels } = skeleton;
  const size = `${joints.length} joints, ${channels.length} channels`;
  facts.push(`${skeleton.name || "skeleton"}: ${size}`);
  for (const signal of signals) {
    const { name, codec, nChannels, samplesPerFrame, nResolutions } = signal;
    const rows = samplesPerFrame === 1 ? "" : ` x ${samplesPerFrame}`;
    const details = nResolutions === 1 ? "" : `, ${nResolutions} resolutions`;
    const coded = `${codec}, ${signal.bytes.toLocaleString()} bytes`;
    facts.push(`${name}: ${nChannels} channels${rows}, ${coded}${details}`);
  }
  if (source) facts.push(`source: ${source.path || "without a name"} (${source.format})`);
  for (const [key, value] of metadata) facts.push(`${key}: ${value.slice(0, 80)}`);
  for (const { key, value } of quality ?? []) facts.push(`${key} = ${value}`);
  return facts;
}

function round(value) {
  return Number(value.toPrecision(6));
}

// The clip that is chosen

function choose(clip, item) {
  for (const other of clipList.children) other.setAttribute("aria-current", other === item);
  droppedInput.value = 0;
  droppedInput.max = clip.signals[0].nResolutions - 1;
  droppedInput.disabled = clip.signals[0].nResolutions === 1;
  const up = AXES[clip.skeleton.upAxis - 1];
  if (up) upChoice.value = up;
  chosen = clip;
  show(clip);
}

function show(clip) {
  close();
  const started = performance.now();
  const resolution = Number(droppedInput.value);
  const decoded = attempt(() => decode(bytes, { clip: clip.name, resolution }));
  if (decoded === null) {
    draw();
    return;
  }
  const [signal] = decoded[0].signals;
  const drawn = !clip.signals[0].ownChannels && hasKinematics(clip.skeleton);
  const took = Math.round(performance.now() - started);
  say(`${clip.name}: decoded in ${took} ms${drawn ? "" : "; its skeleton has no kinematics"}`);
  motion = {
    nFrames: clip.nFrames,
    rate: clip.frameRate.numerator / clip.frameRate.denominator || USUAL_RATE,
    rowsPerFrame: clip.signals[0].samplesPerFrame,
    signal,
    kinematics: drawn ? new Kinematics(clip.skeleton) : null,
  };
  motion.extent = extentOf(motion);
  const hasFrames = clip.nFrames > 0;
  frameSlider.max = Math.max(0, clip.nFrames - 1);
  frameSlider.value = Math.min(frameSlider.value, frameSlider.max);
  frameSlider.disabled = !hasFrames;
  playButton.disabled = !hasFrames;
  draw();
}

function close() {
  pause();
  motion = null;
  frameSlider.disabled = true;
  playButton.disabled = true;
  timeOutput.value = "";
  draw();
}

/** The pose of a frame: what is invalid is NaN. */
function poseOf({ kinematics, signal, rowsPerFrame }, frame) {
  const { values, mask, nChannels } = signal;
  const start = frame * rowsPerFrame * nChannels;
  const row = Float64Array.from({ length: nChannels }, (_, c) =>
    mask === null || mask[start + c] === 1 ? Number(values[start + c]) : NaN,
  );
  return kinematics.pose(row);
}

/** Middle and size of the positions of a clip, and the lowest of each axis. */
function extentOf(clip) {
  const least = [Infinity, Infinity, Infinity];
  const most = [-Infinity, -Infinity, -Infinity];
  const step = Math.max(1, Math.floor(clip.nFrames / FRAMES_OF_EXTENT));
  for (let frame = 0; clip.kinematics && frame < clip.nFrames; frame += step) {
    for (const point of poseOf(clip, frame).points) {
      if (Number.isNaN(point[0])) continue;
      for (let k = 0; k < 3; k++) {
        least[k] = Math.min(least[k], point[k]);
        most[k] = Math.max(most[k], point[k]);
      }
    }
  }
  if (least[0] > most[0]) return { middle: [0, 0, 0], size: 1, least: [0, 0, 0] };
  const size = Math.hypot(...most.map((x, k) => x - least[k])) || 1;
  return { middle: least.map((x, k) => (x + most[k]) / 2), size, least };
}

// Drawing

/** Positions to points of the canvas: turned about the upward axis, then tilted. */
function projection(width, height) {
  const { middle, size } = motion.extent;
  const up = AXES.indexOf(upChoice.value);
  const [right, ahead] = [(up + 2) % 3, (up + 1) % 3];
  const scale = (0.9 * Math.min(width, height) * camera.zoom) / size;
  const [cy, sy] = [Math.cos(camera.yaw), Math.sin(camera.yaw)];
  const [cp, sp] = [Math.cos(camera.pitch), Math.sin(camera.pitch)];
  return (point) => {
    const [x, y, z] = [right, up, ahead].map((k) => point[k] - middle[k]);
    const depth = x * sy + z * cy;
    const across = x * cy - z * sy;
    return [width / 2 + scale * across, height / 2 - scale * (y * cp - depth * sp)];
  };
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  if (motion === null) return;
  const frame = Number(frameSlider.value);
  timeOutput.value = `${frame} / ${motion.nFrames}, ${(frame / motion.rate).toFixed(2)} s`;
  if (motion.kinematics === null || motion.nFrames === 0) return;
  const project = projection(width, height);
  const { color } = getComputedStyle(canvas);
  drawGround(context, project, color);
  drawPose(context, project, color, poseOf(motion, frame));
}

function drawGround(context, project, color) {
  const { middle, size, least } = motion.extent;
  const up = AXES.indexOf(upChoice.value);
  const [a, b] = [(up + 1) % 3, (up + 2) % 3];
  const half = 5;
  context.strokeStyle = color;
  context.globalAlpha = 0.2;
  context.lineWidth = 1;
  context.beginPath();
  for (let i = -half; i <= half; i++) {
    for (const [along, across] of [[a, b], [b, a]]) {
      for (const end of [-half, half]) {
        const point = [...middle];
        point[up] = least[up];
        point[along] += (end * size) / (2 * half);
        point[across] += (i * size) / (2 * half);
        const [x, y] = project(point);
        if (end < 0) context.moveTo(x, y);
        else context.lineTo(x, y);
      }
    }
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawPose(context, project, color, { origins, tails, points }) {
  const isThere = (point) => !Number.isNaN(point[0]);
  const line = (from, to) => {
    if (!isThere(from) || !isThere(to)) return;
    context.moveTo(...project(from));
    context.lineTo(...project(to));
  };
  context.strokeStyle = color;
  context.lineWidth = 2.5;
  context.lineCap = "round";
  context.beginPath();
  motion.kinematics.joints.forEach(({ parent }, j) => {
    if (parent >= 0) line(origins[parent], origins[j]);
    for (const tail of tails[j]) line(origins[j], tail);
  });
  context.stroke();
  context.fillStyle = "#d55";
  for (const point of points.filter(isThere)) {
    context.beginPath();
    context.arc(...project(point), 3.5, 0, 2 * Math.PI);
    context.fill();
  }
}

// Playing and turning

function play() {
  if (Number(frameSlider.value) >= motion.nFrames - 1) frameSlider.value = 0;
  playing = { frame: Number(frameSlider.value), time: performance.now() };
  playButton.textContent = "Pause";
  requestAnimationFrame(step);
}

function pause() {
  playing = null;
  playButton.textContent = "Play";
}

function step(now) {
  if (playing === null) return;
  const seconds = Math.max(0, now - playing.time) / 1000;
  const frame = playing.frame + Math.floor(seconds * motion.rate);
  frameSlider.value = Math.min(frame, motion.nFrames - 1);
  draw();
  if (frame >= motion.nFrames) pause();
  else requestAnimationFrame(step);
}

async function openFile(file) {
  if (file) await open(new Uint8Array(await file.arrayBuffer()), file.name);
}

fileInput.addEventListener("change", () => openFile(fileInput.files[0]));
document.addEventListener("dragover", (event) => event.preventDefault());
document.addEventListener("drop", (event) => {
  event.preventDefault();
  openFile(event.dataTransfer.files[0]);
});
playButton.addEventListener("click", () => (playing === null ? play() : pause()));
frameSlider.addEventListener("input", () => {
  pause();
  draw();
});
upChoice.addEventListener("change", draw);
droppedInput.addEventListener("change", () => chosen && show(chosen));
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!canvas.hasPointerCapture(event.pointerId)) return;
  camera.yaw += event.movementX / 120;
  camera.pitch = Math.max(-1.5, Math.min(camera.pitch + event.movementY / 120, 1.5));
  draw();
});
canvas.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    camera.zoom = Math.max(0.1, Math.min(camera.zoom * 1.001 ** -event.deltaY, 50));
    draw();
  },
  { passive: false },
);
new ResizeObserver(draw).observe(canvas);

// A file that the address names: index.html?file=clip.mcz
const named = new URLSearchParams(location.search).get("file");
if (named !== null) {
  const response = await fetch(named);
  if (response.ok) await open(new Uint8Array(await response.arrayBuffer()), named);
  else say(`${named} cannot be fetched`, true);
}
