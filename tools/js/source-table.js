// SPEC.md, "Template of tables" and "The text of tables": TRC, MOT, STO and CSV files.

import { ByteReader } from "./bytes.js";
import { ByteWriter } from "./byte-writer.js";
import { Refused } from "./errors.js";
import { FIXED, TRIMMED, parseGrid } from "./grids.js";
import {
  Tokens,
  USUAL,
  countText,
  numberOf,
  readGaps,
  readPatterns,
  readRowNotes,
  rowsLimit,
  takeDetail,
  writeRows,
} from "./source-text.js";
import { latin1, textOfOrdinal } from "./text.js";

const MAX_HEADER_BYTES = 2 ** 26;
const MAX_SECTIONS = 64;
const MAX_RUNS = 2 ** 18;

const NAME = 0;
const NEXT_NUMBER = 1;
const SAME_NUMBER = 2;
const COUNT = 3;

const PHRASES = new Map([
  [4, "PathFileType\t4\t(X/Y/Z)\t"],
  [
    5,
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t" +
      "OrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
  ],
  [6, "Frame#\tTime"],
  [7, "version="],
  [8, "nRows="],
  [11, "nColumns="],
  [12, "inDegrees="],
  [14, "endheader"],
  [15, "DataType="],
  [16, "OpenSimVersion="],
  [17, "DataRate="],
  [18, "Units are S.I. units (second, meters, Newtons, ...)"],
  [19, "Angles are in degrees."],
  [20, "datacolumns "],
  [21, "datarows "],
  [22, "range "],
  [23, "Coordinates"],
  [24, "Quaternion"],
  [25, "Format Version,1.2"],
  [26, ",Take Name,"],
  [27, ",Capture Frame Rate,"],
  [28, ",Export Frame Rate,"],
  [29, ",Capture Start Time,"],
  [30, ",Total Frames in Take,"],
  [31, ",Total Exported Frames,"],
]);

/**
 * Restores a table.
 *
 * @param {object} source of CLIP: template.data, detail, size
 * @param {object[]} signals all of them, decoded: see sources.js
 * @param {{frame: number, number: bigint}[]} numbers runs of frame numbers that grow by 1
 * @param {string[]} names of the joints
 * @param {number} maxBytes the limit of the caller
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreTable(source, signals, numbers, names, maxBytes) {
  const templates = readTableTemplate(source.template.data, signals.length);
  const details = readTableDetail(source.detail, templates.length);
  const sections = templates.map((template, at) => {
    const cells = new Cells(template, signals, numbers);
    return { template, detail: details[at], cells };
  });
  const parts = framesOf(signals[0], sections);
  const out = new ByteWriter(maxBytes, "a restored table");
  let left = rowsLimit(
    source.size,
    sections.map(({ cells }) => cells),
  );
  sections.forEach((section, at) => {
    const { template, detail, cells } = section;
    if (template.marks) writeHeader(out, template.header, names, countText(detail, cells.nRows));
    else out.write(template.header);
    const before = out.size;
    out.limit = Math.min(maxBytes, before + left);
    writeRows(out, {
      template,
      detail,
      parts: parts.map((part) => rowsOf(part, at, cells.rowsPerFrame)),
      nRows: cells.nRows,
      nColumns: cells.nColumns,
      numberOfRow: cells.numberOfRow(numberOf(numbers)),
      tokenOf: (row, column) => cells.of(row, column),
    });
    left -= out.size - before;
    out.limit = maxBytes;
  });
  return out.content();
}

/** The parts of the motion in frames, each with the notes of its segment, section by section. */
function framesOf(motion, sections) {
  const { samplesPerFrame } = motion.signal;
  return motion.parts.map((part) => ({
    firstFrame: part.firstRow / samplesPerFrame,
    nFrames: part.nRows / samplesPerFrame,
    skippedFrames: part.skippedRows / samplesPerFrame,
    notes: readTableNotes(part.frameNotes, part.segmentRows / samplesPerFrame, sections),
  }));
}

/** The part of a section that goes with a part of the motion. */
function rowsOf({ firstFrame, nFrames, skippedFrames, notes }, at, rowsPerFrame) {
  return {
    firstRow: firstFrame * rowsPerFrame,
    nRows: nFrames * rowsPerFrame,
    skippedRows: skippedFrames * rowsPerFrame,
    notes: notes[at] ?? USUAL,
  };
}

function readTableNotes(bytes, nFrames, sections) {
  if (bytes.length === 0) return [];
  const reader = new ByteReader(bytes, "frame notes of a table");
  let at = 0;
  const notes = reader.counted(() => {
    if (at === sections.length) reader.refuse(`notes of more sections than ${at}`);
    const rowsPerFrame = reader.varint();
    if (rowsPerFrame !== sections[at++].cells.rowsPerFrame) {
      reader.refuse(`${rowsPerFrame} rows a frame in section ${at - 1}`);
    }
    return readRowNotes(reader, nFrames * rowsPerFrame);
  });
  reader.end();
  return notes;
}

/** The cells of a section, row after row: its signals, the clock, the rows within their frame. */
class Cells {
  constructor(template, signals, numbers) {
    const mine = template.signals.map((number) => signals[number]);
    this.rowsPerFrame = mine[0].signal.samplesPerFrame;
    this.nRows = mine[0].nRows;
    for (const { signal } of mine) {
      if (signal.samplesPerFrame !== this.rowsPerFrame) {
        throw new Refused(`a table: ${signal.samplesPerFrame} rows a frame of ${signal.name}`);
      }
    }
    this.places = mine.flatMap((decoded) => {
      const tokens = new Tokens(decoded);
      return decoded.signal.channels.map((_, channel) => ({ tokens, channel, decoded }));
    });
    this.nChannels = this.places.length;
    this.nColumns = this.nChannels + (template.clock ? 2 : 1);
    this.missing = latin1(template.missing);
    this.clock = template.clock;
    this.numberOf = this.numberOfRow(numberOf(numbers));
    if (this.clock) this.checkTimes(this.numberOfRow(numberOf(numbers)));
  }

  /** The number of the frame of a row; rows are asked for in order. */
  numberOfRow(numberOfFrame) {
    return (row) => numberOfFrame(Math.floor(row / this.rowsPerFrame));
  }

  /** What the clock counts. */
  count(row, number) {
    return number * BigInt(this.rowsPerFrame) + BigInt(row % this.rowsPerFrame);
  }

  of(row, column) {
    if (column === this.nColumns - 1) return String(row % this.rowsPerFrame);
    if (column === this.nChannels) {
      const ordinal = timeOf(this.clock, this.count(row, this.numberOf(row)));
      return textOfOrdinal(
        this.clock.grid,
        Number(ordinal & 0xffffffffn),
        Number(ordinal >> 32n),
      );
    }
    const { tokens, channel, decoded } = this.places[column];
    const { mask, nChannels } = decoded;
    if (mask && !mask[row * nChannels + channel]) return this.missing;
    return tokens.of(row, channel);
  }

  /** Every time is an ordinal, also of rows that do not print theirs. */
  checkTimes(numberOfRow) {
    for (let row = 0; row < this.nRows; row++) {
      timeOf(this.clock, this.count(row, numberOfRow(row)));
    }
  }
}

/** The ordinal of the time of a frame; throws Refused where that is none. */
function timeOf({ grid, numerator, denominator, offset }, number) {
  const product = number * numerator + offset;
  const rest = ((product % denominator) + denominator) % denominator;
  const ordinal = (product - rest) / denominator;
  if (ordinal < grid.least || ordinal > grid.greatest) {
    throw new Refused(`a clock: the time ${ordinal} of frame ${number} is beyond its grid, ${grid}`);
  }
  return ordinal;
}

/** Writes a header with its marks filled. */
function writeHeader(out, header, names, count) {
  const limit = out.limit;
  out.limit = Math.min(limit, out.size + MAX_HEADER_BYTES);
  const utf8 = new TextEncoder();
  let joint = 0;
  let number = 0;
  let from = 0;
  header.forEach((byte, at) => {
    if (byte > COUNT && !PHRASES.has(byte)) return;
    out.write(header.subarray(from, at));
    from = at + 1;
    if (byte === NAME) {
      if (joint === names.length) throw new Refused(`a table: a name of joint ${joint} of as many`);
      out.write(utf8.encode(names[joint++]));
    } else if (byte === COUNT) {
      out.write(count);
    } else if (byte === NEXT_NUMBER || byte === SAME_NUMBER) {
      number += byte === NEXT_NUMBER ? 1 : 0;
      out.ascii(String(number));
    } else {
      out.ascii(PHRASES.get(byte));
    }
  });
  out.write(header.subarray(from));
  out.limit = limit;
}

/** The sections of a template. */
function readTableTemplate(bytes, nSignals) {
  const reader = new ByteReader(bytes, "a template of a table");
  const mayHave = { runs: MAX_RUNS };
  const used = new Set();
  const sections = reader.counted(() => {
    const numbers = reader.counted(() => reader.varint());
    if (numbers.length === 0) reader.refuse("a section without signals");
    for (const number of numbers) {
      if (number >= nSignals) reader.refuse(`signal ${number} of ${nSignals}`);
      if (used.has(number)) reader.refuse(`signal ${number} twice`);
      used.add(number);
    }
    return { signals: numbers, ...readSection(reader, mayHave) };
  });
  reader.end();
  if (sections.length === 0) reader.refuse("no section");
  if (sections.length > MAX_SECTIONS) reader.refuse(`${sections.length} sections`);
  return sections;
}

function readSection(reader, mayHave) {
  const header = reader.sized();
  const marks = reader.varint();
  if (marks > 1) reader.refuse(`marks is ${marks}`);
  const missing = reader.sized();
  const clocks = reader.counted(() => readClock(reader));
  if (clocks.length > 1) reader.refuse(`${clocks.length} clocks`);
  const gaps = readGaps(reader);
  const patterns = readPatterns(reader, 1, mayHave);
  return { header, marks: marks === 1, missing, clock: clocks[0] ?? null, gaps, patterns };
}

function readTableDetail(bytes, nSections) {
  const reader = new ByteReader(bytes, "the detail of a table");
  const mayHave = { runs: MAX_RUNS };
  const details = reader.counted(() => takeDetail(reader, mayHave));
  reader.end();
  if (details.length !== nSections) reader.refuse(`${details.length} of ${nSections} sections`);
  return details;
}

function readClock(reader) {
  const grid = parseGrid(reader);
  if (grid.kind !== FIXED && grid.kind !== TRIMMED) reader.refuse(`a clock on the grid ${grid}`);
  const numerator = BigInt(reader.varint());
  const denominator = BigInt(reader.varint());
  if (denominator === 0n) reader.refuse("a clock divides by 0");
  return { grid, numerator, denominator, offset: BigInt(reader.zigzag()) };
}
