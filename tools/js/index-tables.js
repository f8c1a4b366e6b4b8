// SPEC.md, "INDX": the tables of an index, and its bytes as columns, in both ways.

import { textOf } from "./bytes.js";

const utf8 = new TextEncoder();

/** The fields of each table: "varint", "text", "sized", "u8", or so many bytes. */
export const TABLES = {
  shared: { type: 4, id: 16, gap: "varint", length: "varint" },
  attachments: { name: "text", size: "varint", nParts: "varint" },
  parts: { type: 4, gap: "varint", length: "varint" },
  aliases: { name: "text", of: "u8", target: "sized" },
  clips: {
    name: "text",
    skeleton: "varint",
    nFrames: "varint",
    rateNumerator: "varint",
    rateDenominator: "varint",
    nSignals: "varint",
    gap: "varint",
    length: "varint",
    nSegments: "varint",
    cendGap: "varint",
    cendLength: "varint",
    nAncillary: "varint",
  },
  signals: {
    nChannels: "varint",
    samplesPerFrame: "varint",
    skip: "varint",
    spare: "varint",
    codec: "varint",
    preset: "varint",
    codecVersion: "varint",
  },
  segments: {
    gap: "varint",
    size: "varint",
    signal: "varint",
    nFrames: "varint",
    lead: "varint",
    tail: "varint",
    indexFlags: "varint",
  },
  ancillary: { type: 4, gap: "varint", length: "varint" },
};

/** Where each of so many things begins that have these sizes, and where the last one ends. */
export function boundsOf(sizes) {
  const bounds = new Float64Array(sizes.length + 1);
  for (let i = 0; i < sizes.length; i++) bounds[i + 1] = bounds[i] + sizes[i];
  return bounds;
}

/** A table of an index; values are made of its bytes when they are asked for. */
export class Table {
  /**
   * @param {import("./bytes.js").ByteReader} reader
   * @param {string} name in TABLES
   */
  constructor(reader, name) {
    const n = reader.varint();
    if (n > reader.left) reader.refuse(`${n} ${name} in ${reader.left} bytes`);
    this.what = `${name} of INDX`;
    this.n = n; // rows
    for (const [field, kind] of Object.entries(TABLES[name])) {
      this[field] = readColumn(reader, kind, n);
    }
  }

  /** The bytes at an index of a column of bytes. */
  bytes(field, index) {
    const { bytes, bounds } = this[field];
    return bytes.subarray(bounds[index], bounds[index + 1]);
  }

  text(field, index) {
    return textOf(this.bytes(field, index), this.what);
  }

  typeAt(index) {
    return String.fromCharCode(...this.bytes("type", index));
  }
}

function readColumn(reader, kind, n) {
  if (kind === "u8") return reader.take(n);
  if (typeof kind === "number") {
    const bytes = reader.take(n * kind);
    return { bytes, bounds: Float64Array.from({ length: n + 1 }, (_, i) => i * kind) };
  }
  const numbers = new Float64Array(n);
  for (let i = 0; i < n; i++) numbers[i] = reader.varint();
  if (kind === "varint") return numbers;
  const bounds = boundsOf(numbers);
  return { bytes: reader.take(bounds[n]), bounds };
}

/** Writes a table; values of "text" are strings, others numbers or bytes. */
export function writeTable(writer, name, rows) {
  writer.varint(rows.length);
  for (const [field, kind] of Object.entries(TABLES[name])) {
    writer.part(`${name}, ${field}`);
    const values = rows.map((row) => (kind === "text" ? utf8.encode(row[field]) : row[field]));
    if (kind === "text" || kind === "sized") {
      for (const { length } of values) writer.varint(length);
    }
    for (const value of values) {
      if (kind === "varint") writer.varint(value);
      else writer.write(kind === "u8" ? [value] : value);
    }
  }
}
