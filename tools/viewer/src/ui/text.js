// Numbers and names as people read them.

const MOST = 300; // letters of a name that are shown

// Controls, turns of direction, line ends, blanks but the usual one, unpaired surrogates.
const ODD = /[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]|(?! )\p{Zs}/gu;

/** `text` with letters escaped that are not seen, as the command line does; cut where it is long. */
export function printable(text, most = MOST) {
  const cut = text.length > most ? `${text.slice(0, most)}… (${count(text.length)} letters)` : text;
  return cut.replace(ODD, escaped);
}

function escaped(letter) {
  const code = letter.codePointAt(0);
  const named = { 9: "\\t", 10: "\\n", 13: "\\r" }[code];
  if (named) return named;
  if (code < 0x100) return `\\x${code.toString(16).padStart(2, "0")}`;
  if (code < 0x10000) return `\\u${code.toString(16).padStart(4, "0")}`;
  return `\\U${code.toString(16).padStart(8, "0")}`;
}

const GROUPED = new Intl.NumberFormat("en-US", { maximumFractionDigits: 0 });

/** 1,234,567 */
export const count = (number) => GROUPED.format(number);

/** "1 frame", "240 frames" */
export const counted = (number, word) => `${count(number)} ${number === 1 ? word : `${word}s`}`;

/** Four figures: 0.02315, 12.35, 1,235. */
export function figure(number, figures = 4) {
  if (number === null || number === undefined || Number.isNaN(number)) return "–";
  if (!Number.isFinite(number)) return number > 0 ? "∞" : "-∞";
  if (number === 0) return "0";
  const size = Math.abs(number);
  if (size < 1e-4 || size >= 1e9) return number.toExponential(2);
  const decimals = Math.max(0, figures - 1 - Math.floor(Math.log10(size)));
  return new Intl.NumberFormat("en-US", { maximumFractionDigits: Math.min(decimals, 9) }).format(
    number,
  );
}

/** 812 bytes, 12.9 kB, 1.84 GB */
export function size(bytes) {
  if (bytes === null || bytes === undefined) return "";
  if (bytes < 1000) return counted(bytes, "byte");
  const power = Math.min(4, Math.floor(Math.log10(bytes) / 3));
  return `${figure(bytes / 1000 ** power, 3)} ${["", "kB", "MB", "GB", "TB"][power]}`;
}

/** 0.48 s, 12.5 s, 1:02:03 */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "";
  if (seconds < 60) return `${figure(seconds, seconds < 10 ? 2 : 3)} s`;
  const whole = Math.round(seconds);
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const [hours, minutes, rest] = parts.map((part) => String(part).padStart(2, "0"));
  return hours === "00" ? `${Number(minutes)}:${rest}` : `${Number(hours)}:${minutes}:${rest}`;
}

/** The number of a frame as the file counts them: many begin at 1. */
export function frameNumber({ firstFrame, numbers }, frame) {
  const row = Math.floor(frame);
  const run = numbers?.findLast((one) => one.frame <= row);
  if (run) return run.number + row - run.frame;
  return (Number.isSafeInteger(firstFrame) ? firstFrame : 1) + row;
}

/** "frames 120 to 240 are lost", of all runs of a damaged clip, as the file counts frames. */
export function lostText(clip, most = 20) {
  if (!clip.lost?.length) return "";
  const number = (frame) => count(frameNumber(clip, frame));
  const runs = clip.lost.slice(0, most).map(([from, to]) => {
    return to - from === 1 ? number(from) : `${number(from)} to ${number(to - 1)}`;
  });
  const more = clip.lost.length > most ? [`${count(clip.lost.length - most)} more runs`] : [];
  const isOne = clip.lost.length === 1 && clip.lost[0][1] - clip.lost[0][0] === 1;
  const all = [...runs, ...more];
  const text = [all.slice(0, -1).join(", "), all.at(-1)].filter(Boolean).join(" and ");
  return isOne ? `frame ${text} is lost` : `frames ${text} are lost`;
}

/** Seconds of a clip, or null where nothing says how long a frame is. */
export const secondsOf = ({ nFrames, rate }) => (rate ? nFrames / rate : null);

/** "240 frames · 2 s · 120/s": what is known of a clip, in a line. */
export function summary(row) {
  const seconds = secondsOf(row);
  const codecs = row.codecs ?? (row.codec ? [row.codec] : []);
  return [
    counted(row.nFrames, "frame"),
    seconds === null ? null : duration(seconds),
    row.rate ? `${figure(row.rate)}/s` : null,
    [...new Set(codecs)].join(" + ") || null,
    row.bytes ? size(row.bytes) : null,
  ]
    .filter(Boolean)
    .join(" · ");
}

/** A distance in length units of a clip, in mm where the unit is known. */
export function distance(units, unitCm) {
  if (units === null || units === undefined) return "–";
  return unitCm ? `${figure(units * unitCm * 10)} mm` : `${figure(units)} units`;
}

/** A name as a file on disk may be called. */
export const fileName = (name) =>
  printable(name, 80)
    .replace(/[^\p{L}\p{N}._-]+/gu, "_")
    .replace(/^[._]+/, "") || "clip";
