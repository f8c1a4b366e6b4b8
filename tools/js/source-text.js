// SPEC.md, "Source reconstruction": the text of AMC and BVH files.

import { ByteReader } from "./bytes.js";
import { ByteWriter } from "./byte-writer.js";
import { Refused } from "./errors.js";
import { Grid, POINT_ZERO, TEXT64, hasText, valueOf } from "./grids.js";
import { halvesOf, highHalf, lowHalf } from "./int64.js";
import { ordinalOf } from "./ordinals.js";
import { latin1, textOfOrdinal } from "./text.js";

const MAX_PATTERNS = 1024;
const MAX_GAPS = 2 ** 20;
const MAX_RUNS = 2 ** 18;
const MAX_WIDTH = 255;
const MAX_FRAME_BYTES = 2 ** 20;
const FREE_TEXT_BYTES = 2 ** 26;
const VALUE_BYTES = 512;
const SOURCE_RATIO = 4;

const FRAME_NUMBER_TEXT = /^[+-]?[0-9]{1,32}$/;

/**
 * Restores a text file.
 *
 * @param {object} source of CLIP: template.data, detail, size
 * @param {object} motion the first signal, decoded: see sources.js
 * @param {{frame: number, number: bigint}[]} numbers runs of frame numbers that grow by 1
 * @param {number} maxBytes the limit of the caller
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreText(source, motion, numbers, maxBytes) {
  const template = readTextTemplate(source.template.data);
  const detail = readDetail(source.detail);
  const out = new ByteWriter(maxBytes, "a restored text");
  const n = motion.nRows;
  out.write(template.header[0]);
  if (template.header.length === 2) {
    out.write(countText(detail, n));
    out.write(template.header[1]);
  }
  const tokens = new Tokens(motion);
  const nColumns = motion.signal.channels.length;
  const numberOfRow = motion.signal.samplesPerFrame === 1 ? numberOf(numbers) : null;
  const tokenOf = (row, channel) => tokens.of(row, channel);
  const parts = motion.parts.map((part) => ({ ...part, notes: readNotes(part) }));
  out.limit = Math.min(out.limit, out.size + rowsLimit(source.size, [{ nRows: n, nColumns }]));
  writeRows(out, { template, detail, parts, nRows: n, nColumns, numberOfRow, tokenOf });
  return out.content();
}

/** The number of rows as a header prints it. */
export function countText(detail, n) {
  if (detail.count.length > 0 && detail.rows === n) return detail.count;
  return Uint8Array.from(String(n), (character) => character.charCodeAt(0));
}

/**
 * Writes all rows of a text and what follows them.
 *
 * @param {ByteWriter} out whose limit is that of the rows
 * @param {object} text
 * @param {{gaps: Uint8Array[], patterns: object[]}} text.template
 * @param {object} text.detail as readDetail has read it
 * @param {{firstRow: number, nRows: number, skippedRows: number, notes: object}[]} text.parts of
 *   segments: skippedRows of the segment come before; notes as readRowNotes has read them
 * @param {number} text.nRows of all parts
 * @param {number} text.nColumns beside that of frame numbers
 * @param {((row: number) => bigint) | null} text.numberOfRow asked in order; null: there are none
 * @param {(row: number, column: number) => string} text.tokenOf asked row by row
 * @throws {Refused}
 */
export function writeRows(out, text) {
  const { template, detail, parts, nRows, nColumns, numberOfRow, tokenOf } = text;
  const gaps = [...template.gaps, ...detail.gaps];
  const patterns = [...template.patterns, ...detail.patterns];
  checkPatterns(template, detail, patterns, gaps, nColumns);
  for (const { firstRow, nRows: nHere, skippedRows, notes } of parts) {
    for (let i = 0; i < nHere; i++) {
      const row = firstRow + i;
      const pattern = patterns[notes.patternOf(skippedRows + i)];
      if (!pattern) throw new Refused(`a source: row ${row} has a pattern that there is not`);
      for (const run of pattern.runs) {
        if (run.column === 0 && !numberOfRow) {
          throw new Refused("a source: frame numbers of several rows a frame");
        }
        for (let c = run.column; c < run.column + run.nColumns; c++) {
          out.write(gaps[run.gap]);
          const token =
            c === 0
              ? (notes.texts.get(skippedRows + i) ?? String(numberOfRow(row)))
              : tokenOf(row, c - 1);
          writePadded(out, token, run.width);
        }
      }
      if (row < nRows - 1 || !detail.ends) out.write(gaps[pattern.tail]);
    }
  }
  if (detail.ends) out.write(detail.ending);
}

/**
 * Bytes that the rows of a text may take: a limit, not a fault.
 *
 * @param {number} size of the source file, 0: unknown
 * @param {{nRows: number, nColumns: number}[]} tables whose rows these are, together
 */
export function rowsLimit(size, tables) {
  let nCells = 0;
  for (const { nRows, nColumns } of tables) nCells += nRows * (nColumns + 1);
  const byValues = Math.max(FREE_TEXT_BYTES, VALUE_BYTES * nCells);
  const bySize = size === 0 ? Infinity : Math.max(FREE_TEXT_BYTES, SOURCE_RATIO * size);
  return Math.min(byValues, bySize);
}

function writePadded(out, token, width) {
  if (width === 1 && token[0] !== "-" && token[0] !== "+") out.blanks(1);
  const pad = width === 1 ? 0 : Math.max(0, Math.abs(width) - token.length);
  if (width > 0) out.blanks(pad);
  out.ascii(token);
  if (width < 0) out.blanks(pad);
}

// Tokens

/** How values are printed that their grids do not print. */
const BEYOND_GRID = new Grid(TEXT64, 0, POINT_ZERO, 1);
const WITHOUT_TEXT = new Grid(TEXT64, 0, 0, 1);

/** The tokens of a signal, row after row. */
export class Tokens {
  constructor(motion) {
    this.nChannels = motion.signal.channels.length;
    this.values = motion.values;
    this.halves = motion.ordinals ? halvesOf(motion.ordinals) : null;
    this.parts = motion.parts;
    this.at = -1;
    this.end = 0;
  }

  /** The next part of the rows: its grids and exceptions hold. */
  enter() {
    const part = this.parts[++this.at];
    this.end = part.firstRow + part.nRows;
    this.grids = part.grids;
    this.exceptions = new Map();
    for (const exception of part.exceptions) {
      this.exceptions.set(exception.row * this.nChannels + exception.column, exception);
    }
  }

  of(row, channel) {
    while (row >= this.end) this.enter();
    const i = row * this.nChannels + channel;
    const exception = this.exceptions.size > 0 ? this.exceptions.get(i) : undefined;
    if (exception && Object.is(exception.value, this.values[i])) return latin1(exception.text);
    const grid = this.grids[channel];
    if (this.halves === null) return textOfValue(grid, this.values[i]);
    if (!hasText(grid)) return printed(WITHOUT_TEXT, Number(this.values[i]));
    return textOfOrdinal(grid, lowHalf(this.halves, i), highHalf(this.halves, i));
  }
}

/** The token of a value that need not be on its grid. */
function textOfValue(grid, x) {
  if (!hasText(grid)) return printed(WITHOUT_TEXT, x);
  if (!Number.isFinite(x)) return printed(BEYOND_GRID, x);
  const ordinal = ordinalOf(grid, x);
  const isGreatest = (ordinal < 0n ? grid.least : grid.greatest) === ordinal;
  if (isGreatest && valueOf(grid, ordinal) !== x) return printed(BEYOND_GRID, x);
  return textOfOrdinal(grid, Number(ordinal & 0xffffffffn), Number(ordinal >> 32n));
}

/** A value as TEXT64 prints it, or a word. */
function printed(grid, x) {
  if (Number.isNaN(x)) return "nan";
  if (!Number.isFinite(x)) return x < 0 ? "-inf" : "inf";
  const ordinal = ordinalOf(grid, x);
  return textOfOrdinal(grid, Number(ordinal & 0xffffffffn), Number(ordinal >> 32n));
}

/** The number of a frame, from the runs of them; frames are asked for in order. */
export function numberOf(numbers) {
  let at = 0;
  return (frame) => {
    while (at + 1 < numbers.length && numbers[at + 1].frame <= frame) at++;
    return numbers[at].number + BigInt(frame - numbers[at].frame);
  };
}

// Structures

/** @returns {{header: Uint8Array[], gaps: Uint8Array[], patterns: object[]}} */
function readTextTemplate(bytes) {
  const reader = new ByteReader(bytes, "a text template");
  const header = reader.counted(() => reader.sized());
  if (header.length !== 1 && header.length !== 2) {
    reader.refuse(`a header of ${header.length} parts`);
  }
  const gaps = readGaps(reader);
  const patterns = readPatterns(reader, 1);
  reader.end();
  return { header, gaps, patterns };
}

function readDetail(bytes) {
  const reader = new ByteReader(bytes, "the detail of a source");
  const detail = takeDetail(reader);
  reader.end();
  return detail;
}

/** DETAIL, at a reader; `mayHave` counts the runs down where several share the limit. */
export function takeDetail(reader, mayHave = { runs: MAX_RUNS }) {
  const count = reader.sized();
  const rows = reader.varint();
  const gaps = readGaps(reader);
  const patterns = readPatterns(reader, Infinity, mayHave);
  const ends = reader.varint();
  const ending = reader.sized();
  if (count.length === 0 && rows !== 0) reader.refuse(`no count, but for ${rows} rows`);
  if (ends > 1) reader.refuse(`ends is ${ends}`);
  if (ends === 0 && ending.length > 0) reader.refuse("an ending, but ends is 0");
  return { count, rows, gaps, patterns, ends: ends === 1, ending };
}

export function readGaps(reader) {
  const gaps = reader.counted(() => reader.sized());
  if (gaps.length > MAX_GAPS) reader.refuse(`${gaps.length} gaps`);
  return gaps;
}

export function readPatterns(reader, most = Infinity, mayHave = { runs: MAX_RUNS }) {
  const patterns = reader.counted(() => {
    const runs = reader.counted(readRun);
    mayHave.runs -= runs.length;
    if (mayHave.runs < 0) reader.refuse(`more than ${MAX_RUNS} runs`);
    return { runs, tail: reader.varint() };
  });
  if (patterns.length > most) reader.refuse(`${patterns.length} patterns`);
  return patterns;
}

function readRun(reader) {
  const gap = reader.varint();
  const column = reader.varint();
  const nColumns = reader.varint();
  const width = reader.zigzag();
  if (nColumns === 0) reader.refuse("a run of no columns");
  if (column === 0 && nColumns > 1) reader.refuse("more than one column of frame numbers");
  if (width === -1 || Math.abs(width) > MAX_WIDTH) reader.refuse(`a width of ${width}`);
  return { gap, column, nColumns, width };
}

function checkPatterns(template, detail, patterns, gaps, nChannels) {
  if (template.patterns.length === 0 && detail.patterns.length > 0) {
    throw new Refused("a source: patterns in the detail and none in the template");
  }
  if (patterns.length > MAX_PATTERNS) throw new Refused(`a source: ${patterns.length} patterns`);
  for (const pattern of patterns) {
    checkColumns(pattern.runs, nChannels);
    let size = gapSize(gaps, pattern.tail);
    for (const run of pattern.runs) size += gapSize(gaps, run.gap) * run.nColumns;
    if (size > MAX_FRAME_BYTES) throw new Refused(`a source: gaps of ${size} bytes in a frame`);
  }
}

function gapSize(gaps, gap) {
  if (gap >= gaps.length) throw new Refused(`a source: gap ${gap} of ${gaps.length}`);
  return gaps[gap].length;
}

/** Each column at most once, and none beyond the channels. */
function checkColumns(runs, nChannels) {
  let end = 0;
  for (const run of [...runs].sort((a, b) => a.column - b.column)) {
    if (run.column < end) throw new Refused(`a source: column ${run.column} twice in a pattern`);
    end = run.column + run.nColumns;
    if (end > nChannels + 1) throw new Refused(`a source: column ${end - 1} of ${nChannels}`);
  }
}

// Frame notes

/** What is said of rows that are usual. */
export const USUAL = { patternOf: () => 0, texts: new Map() };

/** The frame notes of a segment; empty: all is as usual. */
function readNotes({ frameNotes, segmentRows }) {
  if (frameNotes.length === 0) return USUAL;
  const reader = new ByteReader(frameNotes, "frame notes");
  const notes = readRowNotes(reader, segmentRows);
  reader.end();
  return notes;
}

/**
 * Reads the notes of rows.
 *
 * @param {ByteReader} reader
 * @param {number} nRows of the whole segment
 * @returns {{patternOf: (row: number) => number, texts: Map<number, string>}} rows are those of
 *   the segment; patternOf is asked in order
 */
export function readRowNotes(reader, nRows) {
  const ends = [];
  let end = 0;
  reader.counted(() => {
    const n = reader.varint();
    const pattern = reader.varint();
    if (n === 0) reader.refuse("a run of no rows");
    end += n;
    if (end > nRows) reader.refuse(`patterns of more than ${nRows} rows`);
    if (pattern >= MAX_PATTERNS) reader.refuse(`pattern ${pattern}`);
    ends.push({ end, pattern });
  });
  const texts = readNumberTexts(reader, nRows);
  let at = 0;
  const patternOf = (row) => {
    while (at < ends.length && ends[at].end <= row) at++;
    return at < ends.length ? ends[at].pattern : 0;
  };
  return { patternOf, texts };
}

function readNumberTexts(reader, nRows) {
  const texts = new Map();
  let row = 0;
  reader.counted(() => {
    const step = reader.varint();
    const text = latin1(reader.sized());
    if (step === 0 && texts.size > 0) reader.refuse("two texts of a frame number");
    row += step;
    if (row >= nRows) reader.refuse(`a frame number of row ${row} of ${nRows}`);
    if (!FRAME_NUMBER_TEXT.test(text)) reader.refuse(`the frame number ${JSON.stringify(text)}`);
    texts.set(row, text);
  });
  return texts;
}
