// SPEC.md, "Template of tables" and "The text of tables": TRC, MOT and STO files.

import { ByteReader } from "./bytes.js";
import { ByteWriter } from "./byte-writer.js";
import { Refused } from "./errors.js";
import { FIXED, TRIMMED, parseGrid } from "./grids.js";
import {
  Tokens,
  countText,
  numberOf,
  readDetail,
  readGaps,
  readPatterns,
  writeRows,
} from "./source-text.js";
import { latin1, textOfOrdinal } from "./text.js";

const MAX_HEADER_BYTES = 2 ** 26;

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
  for (const { signal } of signals) {
    if (signal.samplesPerFrame !== 1) {
      throw new Refused(`a table: ${signal.samplesPerFrame} rows a frame of ${signal.name}`);
    }
  }
  const template = readTableTemplate(source.template.data);
  const detail = readDetail(source.detail);
  const [motion] = signals;
  const out = new ByteWriter(maxBytes, "a restored table");
  if (template.marks) writeHeader(out, template.header, names, countText(detail, motion.nRows));
  else out.write(template.header);
  const cells = new Cells(signals, template, numbers);
  const nColumns = cells.nChannels + (template.clock ? 1 : 0);
  const tokenOf = (row, column) => cells.of(row, column);
  const numberOfFrame = numberOf(numbers);
  writeRows(out, { source, template, detail, motion, nColumns, numberOfFrame, tokenOf });
  return out.content();
}

/** The cells of all columns, row after row: those of the signals, then the clock's. */
class Cells {
  constructor(signals, template, numbers) {
    this.places = signals.flatMap((decoded) => {
      const tokens = new Tokens(decoded);
      return decoded.signal.channels.map((_, channel) => ({ tokens, channel, decoded }));
    });
    this.nChannels = this.places.length;
    this.missing = latin1(template.missing);
    this.clock = template.clock;
    this.numberOfFrame = numberOf(numbers);
    if (this.clock) this.checkTimes(signals[0].nRows, numbers);
  }

  of(row, column) {
    if (column === this.nChannels) {
      const ordinal = timeOf(this.clock, this.numberOfFrame(row));
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
  checkTimes(nRows, numbers) {
    const number = numberOf(numbers);
    for (let row = 0; row < nRows; row++) timeOf(this.clock, number(row));
  }
}

/** The ordinal of the time of a frame. */
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

function readTableTemplate(bytes) {
  const reader = new ByteReader(bytes, "a template of a table");
  const header = reader.sized();
  const marks = reader.varint();
  if (marks > 1) reader.refuse(`marks is ${marks}`);
  const missing = reader.sized();
  const clocks = reader.counted(() => readClock(reader));
  if (clocks.length > 1) reader.refuse(`${clocks.length} clocks`);
  const gaps = readGaps(reader);
  const patterns = readPatterns(reader, 1);
  reader.end();
  return { header, marks: marks === 1, missing, clock: clocks[0] ?? null, gaps, patterns };
}

function readClock(reader) {
  const grid = parseGrid(reader);
  if (grid.kind !== FIXED && grid.kind !== TRIMMED) reader.refuse(`a clock on the grid ${grid}`);
  const numerator = BigInt(reader.varint());
  const denominator = BigInt(reader.varint());
  if (denominator === 0n) reader.refuse("a clock divides by 0");
  return { grid, numerator, denominator, offset: BigInt(reader.zigzag()) };
}
