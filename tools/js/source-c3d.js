// SPEC.md, "Template and detail of C3D" and "The bytes of C3D".

import { ByteReader } from "./bytes.js";
import { ByteWriter } from "./byte-writer.js";
import { clamp } from "./entropy.js";
import { LimitExceeded, Refused } from "./errors.js";
import { BINARY32, Grid, INTEGER, SCALED, VAX_F } from "./grids.js";
import { halvesOf, highHalf, lowHalf } from "./int64.js";
import { NAN_32, ordinalOf } from "./ordinals.js";
import { ANALOG, OUTPUTS, ROTATIONS } from "./registry.js";

const INTEL = 84;
const DEC = 85;
const SGI = 86;

const BLOCK = 512;
const MAX_WORD = 65535;
const MAX_ZEROS = 2 ** 20;
const TWO_16 = 65536;
const TWO_32 = 2 ** 32;

/** Bytes of a field of head, by its kind. */
const FIELD_SIZES = [2, 4, 2, 2, 4, 4, 2];
const ROTATIONS_BLOCK = 6;

const ELEMENTS_OF_A_ROTATION = 17;

/** Id of the source format whose template says which points are outputs. */
const WITH_OUTPUTS = 5;

/**
 * Restores a C3D file.
 *
 * @param {object} source of CLIP: format, template.data, detail
 * @param {object[]} signals of the clip, decoded: see sources.js
 * @param {number} n frames of the clip
 * @param {bigint} firstNumber number of its first frame; has no meaning without frames
 * @param {number} maxBytes the limit of the caller
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreC3d(source, signals, n, firstNumber, maxBytes) {
  const { template, detail, head } = c3dLayout(source);
  const file = new File(template, signals, n, maxBytes);
  const first = n > 0 ? firstNumber : BigInt(detail.first);
  const sameLength = n === detail.nFrames;

  const data = file.section();
  const rotations = file.rotations();
  const out = new ByteWriter(maxBytes, "a restored C3D file");
  out.write(head);
  out.write(data);
  if (sameLength) {
    for (const part of [template.gap, rotations, template.tail, detail.tail]) out.write(part);
    out.zeros(detail.zeros);
  } else {
    // A range of the frames: nothing behind the data is verbatim.
    if (head.length > 0 && BLOCK * head[0] > head.length) {
      throw new Refused("a C3D file: its parameters follow the data");
    }
    const writePadded = (bytes) => {
      out.write(bytes);
      out.zeros(padding(bytes.length));
    };
    out.zeros(padding(head.length + data.length));
    writePadded(rotations);
    writePadded(withoutZeros(template.tail, detail));
  }
  if (!sameLength || first !== BigInt(detail.first)) {
    const blocks = Math.ceil((head.length + data.length) / BLOCK);
    const view = new DataView(out.bytes.buffer, out.bytes.byteOffset, head.length);
    for (const { at, kind } of template.fields) {
      if (kind === ROTATIONS_BLOCK && sameLength) continue;
      file.putField(view, at, kind, Number(first), blocks);
    }
  }
  return out.content();
}

/**
 * What a source says of its file beside the data.
 *
 * @param {object} source of CLIP: format, template.data, detail
 * @returns {{template: object, detail: object, head: Uint8Array}} `head` with its fields
 * @throws {Refused}
 */
export function c3dLayout(source) {
  const template = readTemplate(source.template.data, source.format);
  const detail = readC3dDetail(source.detail, template);
  return { template, detail, head: filledHead(template, detail) };
}

/** Zero bytes from a size to the next multiple of a block. */
function padding(size) {
  return (BLOCK - (size % BLOCK)) % BLOCK;
}

/** The tail, without the zeros at its end. */
function withoutZeros(templateTail, detail) {
  const tail = new Uint8Array(templateTail.length + detail.tail.length);
  tail.set(templateTail);
  tail.set(detail.tail, templateTail.length);
  let size = tail.length;
  while (size > 0 && tail[size - 1] === 0) size--;
  return tail.subarray(0, size);
}

function filledHead(template, detail) {
  const head = template.head.slice();
  let from = 0;
  for (const { at, kind } of template.fields) {
    const size = FIELD_SIZES[kind];
    head.set(detail.values.subarray(from, from + size), at);
    from += size;
  }
  return head;
}

// Structures

function readTemplate(bytes, format) {
  const reader = new ByteReader(bytes, "a C3D template");
  const runs = format === WITH_OUTPUTS ? reader.counted(() => reader.varint()) : null;
  const template = readC3dTemplate(reader);
  reader.end();
  return { ...template, ...placesOf(runs ?? [template.points], template.points, reader) };
}

/** Where the words of each point are: in the outputs or not, the how manyth there, its residual. */
function placesOf(runs, points, reader) {
  if (runs.indexOf(0, 1) > 0) reader.refuse("a run of no points");
  const total = runs.reduce((sum, size) => sum + size, 0);
  if (total !== points) reader.refuse(`runs of ${total} points, but there are ${points}`);
  const places = [];
  const counts = [0, 0]; // points that are points, outputs
  runs.forEach((size, run) => {
    for (let k = 0; k < size; k++) places.push({ isOutput: run % 2 === 1, k: counts[run % 2]++ });
  });
  for (const place of places) place.residual = place.k + (place.isOutput ? counts[0] : 0);
  return { places, nOutputs: counts[1] };
}

function readC3dTemplate(reader) {
  const processor = reader.u8();
  const word = reader.u8();
  const [points, channels, subframes] = [reader.varint(), reader.varint(), reader.varint()];
  const unsigned = reader.u8();
  const [rotations, ratio] = [reader.varint(), reader.varint()];
  const head = reader.sized();
  const fields = readFields(reader, head.length);
  const gap = reader.sized();
  const tail = reader.sized();
  if (![INTEL, DEC, SGI].includes(processor)) reader.refuse(`processor ${processor}`);
  if (word !== 2 && word !== 4) reader.refuse(`words of ${word} bytes`);
  if (unsigned > 1 || (unsigned === 1 && word === 4)) reader.refuse(`unsigned is ${unsigned}`);
  const most = Math.max(points, channels, subframes, rotations, ratio);
  if (most > MAX_WORD) reader.refuse(`a number of ${most}`);
  if (subframes === 0 || ratio === 0) reader.refuse("no samples in a frame");
  if (rotations > 0 && word === 2) reader.refuse("rotations as integers");
  if (rotations === 0 && gap.length > 0) reader.refuse("a gap before no rotations");
  return {
    processor,
    word,
    points,
    channels,
    subframes,
    unsigned: unsigned === 1,
    rotations,
    ratio,
    head,
    fields,
    gap,
    tail,
  };
}

function readFields(reader, headSize) {
  let end = 0;
  return reader.counted(() => {
    const at = reader.varint();
    const kind = reader.u8();
    if (kind >= FIELD_SIZES.length) reader.refuse(`a field of kind ${kind}`);
    if (at < end) reader.refuse(`a field at ${at}, the one before ends at ${end}`);
    end = at + FIELD_SIZES[kind];
    if (end > headSize) reader.refuse(`a field up to ${end} of ${headSize} bytes`);
    return { at, kind };
  });
}

function readC3dDetail(bytes, template) {
  const reader = new ByteReader(bytes, "the detail of a C3D source");
  const nFrames = reader.varint();
  const first = reader.varint();
  const values = reader.sized();
  const tail = reader.sized();
  const zeros = reader.varint();
  reader.end();
  const size = template.fields.reduce((sum, { kind }) => sum + FIELD_SIZES[kind], 0);
  if (values.length !== size) reader.refuse(`fields of ${values.length} bytes, not ${size}`);
  if (zeros > MAX_ZEROS) throw new LimitExceeded(`a C3D file with ${zeros} zeros at its end`);
  return { nFrames, first, values, tail, zeros };
}

// Data

/** The signals of a clip as a template wants them. */
class File {
  constructor(template, signals, n, maxBytes) {
    this.template = template;
    this.n = n;
    this.maxBytes = maxBytes;
    const { points, nOutputs, channels, subframes, rotations, ratio } = template;
    const [motion, ...others] = signals;
    const withRole = (role) => others.find(({ signal }) => signal.role === role);
    this.floats = new Grid(template.processor === DEC ? VAX_F : BINARY32, 0, 0, 1);
    this.motion = this.fitting(motion, "motion", 3 * (points - nOutputs), 1);
    this.outputs = null;
    if (nOutputs > 0) {
      this.outputs = this.fitting(withRole(OUTPUTS), "outputs", 3 * nOutputs, 1);
    }
    const residuals = points > 0 ? others.find(({ signal }) => signal.of === 0) : undefined;
    this.residuals = residuals ? this.fitting(residuals, "residuals", points, 1) : null;
    this.analog = null;
    if (channels > 0) {
      this.analog = this.fitting(withRole(ANALOG), "analog", channels, subframes);
    }
    this.turns = null;
    if (rotations > 0) {
      const elements = ELEMENTS_OF_A_ROTATION * rotations;
      this.turns = this.fitting(withRole(ROTATIONS), "rotations", elements, ratio);
    }
  }

  fitting(decoded, name, nChannels, samplesPerFrame) {
    if (!decoded) throw new Refused(`a C3D file needs the signal ${name}`);
    const { signal } = decoded;
    if (signal.channels.length !== nChannels || signal.samplesPerFrame !== samplesPerFrame) {
      throw new Refused(
        `a C3D file with ${nChannels} channels and ${samplesPerFrame} samples of ${name}, ` +
          `but there are ${signal.channels.length} and ${signal.samplesPerFrame}`,
      );
    }
    const kinds = this.template.word === 2 ? [SCALED, INTEGER] : [this.floats.kind];
    for (const { grids } of [decoded, ...decoded.parts]) {
      const other = grids.find(({ kind }) => !kinds.includes(kind));
      if (other) throw new Refused(`a C3D file with ${name} on the grid ${other}`);
    }
    return new Words(decoded);
  }

  section() {
    const { points, channels, subframes, word } = this.template;
    const perFrame = 4 * points + channels * subframes;
    const { put, view, bytes } = this.words(this.n * perFrame * word);
    let at = 0;
    for (let frame = 0; frame < this.n; frame++) {
      for (let p = 0; p < points; p++) {
        this.putPoint(view, at, frame, p, put);
        at += 4 * word;
      }
      for (let s = 0; s < subframes; s++) {
        for (let c = 0; c < channels; c++) {
          const o = this.analog.ordinal(frame * subframes + s, c);
          if (this.template.unsigned) view.setUint16(at, clamp(o, 0, MAX_WORD), this.little);
          else put(view, at, o);
          at += word;
        }
      }
    }
    return bytes;
  }

  rotations() {
    if (!this.turns) return new Uint8Array(0);
    const rows = this.n * this.template.ratio;
    const columns = ELEMENTS_OF_A_ROTATION * this.template.rotations;
    const { put, view, bytes } = this.words(rows * columns * 4);
    let at = 0;
    for (let row = 0; row < rows; row++) {
      for (let c = 0; c < columns; c++, at += 4) put(view, at, this.turns.ordinal(row, c));
    }
    return bytes;
  }

  /** Room for some bytes, and how an ordinal is put there as a word. */
  words(size) {
    if (size > this.maxBytes) {
      throw new LimitExceeded(`a C3D file of ${size} bytes, the limit is ${this.maxBytes}`);
    }
    const bytes = new Uint8Array(size);
    const put =
      this.template.word === 4
        ? (view, at, o) => this.putFloat(view, at, o)
        : (view, at, o) => view.setInt16(at, clamp(o, -32768, 32767), this.little);
    return { bytes, put, view: new DataView(bytes.buffer) };
  }

  get little() {
    return this.template.processor !== SGI;
  }

  putPoint(view, at, frame, p, put) {
    const { word, places } = this.template;
    const place = places[p];
    const signal = place.isOutput ? this.outputs : this.motion;
    const { mask, nChannels } = signal;
    const i = frame * nChannels + 3 * place.k;
    const valid = !mask || (mask[i] && mask[i + 1] && mask[i + 2]);
    const residual = this.residual(frame, place.residual, valid);
    const gap = !valid && this.becomesNaN(signal.values.subarray(i, i + 3), residual);
    for (let axis = 0; axis < 3; axis++) {
      put(view, at + axis * word, gap ? NAN_32 : signal.ordinal(frame, 3 * place.k + axis));
    }
    put(view, at + 3 * word, residual.ordinal);
  }

  /** The fourth word of a point: its ordinal, and whether that is a number below 0. */
  residual(frame, column, valid) {
    if (this.residuals) {
      const ordinal = this.residuals.ordinal(frame, column);
      return { ordinal, value: this.residuals.value(frame, column) };
    }
    const value = valid ? 0 : -1;
    return { ordinal: this.template.word === 2 ? value : this.ofFloat(value), value };
  }

  /** A lossy codec fills gaps; where no word of a point says that it is one, they become NaN. */
  becomesNaN(coordinates, residual) {
    if (this.floats.kind !== BINARY32 || this.template.word !== 4) return false;
    return residual.value >= 0 && !coordinates.some(Number.isNaN);
  }

  /** Ordinal of a number among the floats of the file. */
  ofFloat(value) {
    return Number(ordinalOf(this.floats, value));
  }

  /** Puts the bits of the float grid's number o; ordinals of minus are the NOT of a magnitude. */
  putFloat(view, at, o) {
    const bits = o < 0 ? (-1 - o + 2 ** 31) : o;
    const word = this.floats.kind === VAX_F ? (bits % TWO_16) * TWO_16 + (bits >>> 16) : bits;
    view.setUint32(at, word, this.little);
  }

  putField(view, at, kind, first, blocks) {
    const { n } = this;
    const last = first + n - 1;
    const words = [n, 0, first, last, first, last, 1 + blocks];
    if (kind === 1) {
      this.putFloat(view, at, this.ofFloat(n));
    } else if (FIELD_SIZES[kind] === 2) {
      view.setUint16(at, clamp(words[kind], 0, MAX_WORD), this.little);
    } else {
      const value = clamp(words[kind], 0, TWO_32 - 1);
      view.setUint16(at, value % TWO_16, this.little);
      view.setUint16(at + 2, Math.floor(value / TWO_16), this.little);
    }
  }
}

/** The ordinals of a signal: those that were stored, or those of "Value to ordinal". */
class Words {
  constructor({ signal, parts, values, ordinals, mask }) {
    this.nChannels = signal.channels.length;
    this.values = values;
    this.mask = mask;
    this.halves = ordinals ? halvesOf(ordinals) : null;
    this.parts = parts;
    this.part = 0;
  }

  /** Rows are asked for in order. */
  ordinal(row, channel) {
    const i = row * this.nChannels + channel;
    if (this.halves) return highHalf(this.halves, i) * TWO_32 + lowHalf(this.halves, i);
    while (row >= this.parts[this.part].firstRow + this.parts[this.part].nRows) this.part++;
    return Number(ordinalOf(this.parts[this.part].grids[channel], this.values[i]));
  }

  value(row, channel) {
    return Number(this.values[row * this.nChannels + channel]);
  }
}
