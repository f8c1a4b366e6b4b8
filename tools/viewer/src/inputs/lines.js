// Text files in the page: words, numbers, and where something is wrong.

const decoder = new TextDecoder("utf-8", { fatal: true });
const LATIN = new TextDecoder("latin1");

/** A file that cannot be read; `message` says the line. */
export class SourceError extends Error {
  constructor(message) {
    super(message);
    this.name = "SourceError";
  }
}

/** Text as UTF-8, or as Latin-1 where it is not. */
export function textOf(bytes) {
  try {
    return decoder.decode(bytes);
  } catch {
    return LATIN.decode(bytes);
  }
}

/** Something of a file, short, to be shown in a message. */
export const shown = (word) => JSON.stringify(String(word).slice(0, 40));

const NUMBER = /^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$/;

/** The number that a word is; NaN where it is none. */
export function numberOf(word) {
  const number = Number(word);
  return word !== "" && Number.isFinite(number) && NUMBER.test(word) ? number : NaN;
}

const NAN = /^[+-]?(?:nan(?:\([^()\s]*\))?|1\.#(?:ind|qnan|snan)\d*)$/i; // as printf of several systems says it
const INFINITE = /^[+-]?(?:inf(?:inity)?|1\.#inf\d*)$/i;

/** The value that a word is, which may be none: NaN or infinite; null where it is no value. */
export function valueOf(word) {
  if (NUMBER.test(word)) return Number(word);
  if (NAN.test(word)) return NaN;
  if (INFINITE.test(word)) return word.startsWith("-") ? -Infinity : Infinity;
  return null;
}

const DEGREES = 1;

/** A clip whose values are all at hand, as the engine reads one: see engine/clip.js. */
export function clipOf({ name, skeleton, values, rate, format, path, mask = null, more = {} }) {
  const nChannels = skeleton.channels.length;
  const nFrames = nChannels === 0 ? 0 : values.length / nChannels;
  return {
    name,
    nFrames,
    rate,
    skeleton,
    firstFrame: 1,
    source: { path, format },
    metadata: [],
    quality: [],
    lost: [],
    events: [],
    signals: [
      {
        name: "motion",
        codec: null,
        channels: skeleton.channels,
        ownChannels: false,
        samplesPerFrame: 1,
        nResolutions: 1,
        bytes: null,
        segments: [],
      },
    ],
    async read(_, from, to) {
      const part = (array) => array && array.subarray(from * nChannels, to * nChannels);
      return { values: part(values), mask: part(mask) };
    },
    sourceBytes: async () => null,
    ...more,
  };
}

/** A skeleton as the decoder has them: columns counted, channels in one list. */
export function skeletonOf({
  name = "",
  intrinsic,
  unitCm = null,
  angleUnit = DEGREES,
  upAxis = 0,
  joints,
}) {
  let firstColumn = 0;
  const counted = joints.map((joint, index) => {
    const channels = joint.channels.map((channel) => ({
      name: "",
      unit: "",
      ...channel,
      joint: index,
    }));
    const out = {
      positionsAdd: true,
      axis: [0, 0, 0],
      axisOrder: 0,
      tails: [],
      ...joint,
      channels,
      firstColumn,
    };
    firstColumn += channels.length;
    return out;
  });
  const channels = counted.flatMap((joint) => joint.channels);
  return { name, intrinsic, unitCm, angleUnit, upAxis, joints: counted, channels };
}
