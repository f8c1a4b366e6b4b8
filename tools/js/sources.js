// SPEC.md, "Source reconstruction": the source files of clips and skeletons, byte for byte.

import { sameBytes } from "./bytes.js";
import { Refused } from "./errors.js";
import { within } from "./limits.js";
import { sourceKind } from "./registry.js";
import { sha256 } from "./sha256.js";
import { restoreArrays } from "./source-arrays.js";
import { checkAsf } from "./source-asf.js";
import { restoreC3d } from "./source-c3d.js";
import { restoreTable } from "./source-table.js";
import { restoreText } from "./source-text.js";

/**
 * The source file of a clip. Of a clip whose codecs are lossless it is told by size and hash.
 *
 * @param {object} request
 * @param {import("./clip.js").Clip} request.clip one that has a source
 * @param {import("./signals.js").DecodedSignal[]} request.signals all of them, with all the frames
 *   that are shown
 * @param {{frame: number, number: bigint}[]} request.numbers runs of frame numbers
 * @param {Uint8Array} request.sourceSha256 as CEND has it
 * @param {number} request.maxBytes limit of a restored file
 * @returns {Uint8Array}
 * @throws {Refused}
 * @throws {import("./errors.js").Unsupported} where the format is not known
 */
export function restoreClip({ clip, signals, numbers, sourceSha256, maxBytes }) {
  const { source } = clip;
  const kind = sourceKind(source.format);
  const bytes = restored(kind, { clip, signals, numbers, maxBytes });
  if (signals.every(({ ordinals }) => ordinals !== null)) {
    checkFile(bytes, source.size, sourceSha256, `the source of clip ${clip.name}`);
  }
  return bytes;
}

function restored(kind, { clip, signals, numbers, maxBytes }) {
  const { source } = clip;
  if (kind === "c3d") {
    return restoreC3d(source, signals, clip.nFrames, numbers[0].number, maxBytes);
  }
  if (kind === "arrays") return restoreArrays(source, signals, numbers, clip.nFrames, maxBytes);
  if (kind === "table") {
    const names = clip.skeleton.joints.map(({ name }) => name);
    return restoreTable(source, signals, numbers, names, maxBytes);
  }
  return restoreText(source, signals[0], numbers, maxBytes);
}

/**
 * The own source file of a skeleton: its template, which has to describe that skeleton.
 *
 * @param {import("./skel.js").Skeleton} skeleton that has a source
 * @param {number} maxBytes limit of a restored file
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreSkeleton(skeleton, maxBytes) {
  const { source } = skeleton;
  sourceKind(source.format);
  const { data } = source.template;
  within(data.length, maxBytes, "bytes of the source of a skeleton");
  checkFile(data, source.size, source.sha256, "the source of a skeleton");
  checkAsf(data, skeleton);
  return data;
}

function checkFile(bytes, size, hash, what) {
  if (bytes.length !== size) throw new Refused(`${what}: ${bytes.length} bytes, not ${size}`);
  if (!sameBytes(sha256(bytes), hash)) throw new Refused(`${what}: its hash is another`);
}
