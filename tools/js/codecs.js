// SPEC.md, "Codecs": the codecs by id and version.

import * as awt from "./codecs/awt.js";
import * as best from "./codecs/best.js";
import * as dwt from "./codecs/dwt.js";
import * as fast from "./codecs/fast.js";
import * as lossless from "./codecs/lossless.js";
import * as lsdtClip from "./codecs/lsdt-clip.js";
import * as lsdtFrame from "./codecs/lsdt-frame.js";
import * as mdtt from "./codecs/mdtt.js";
import * as mrdwt from "./codecs/mrdwt.js";
import * as online from "./codecs/online.js";
import * as pcaRdo from "./codecs/pca-rdo.js";
import * as pca from "./codecs/pca.js";
import * as posewave from "./codecs/posewave.js";
import * as qbc from "./codecs/qbc.js";
import * as raw from "./codecs/raw.js";
import { Unsupported } from "./errors.js";

const CODECS = new Map(
  [
    ...[raw, lossless, mrdwt, qbc, pca, dwt, awt, lsdtFrame, lsdtClip, mdtt, pcaRdo, online],
    ...[best, posewave, fast],
  ].map((codec) => [codec.id, codec]),
);

/** Names of the codecs, in the order of their ids. */
export const CODEC_NAMES = [...CODECS.values()].map((codec) => codec.name);

/** The name of a codec, or its id where this decoder lacks it. */
export function codecLabel(id) {
  return CODECS.get(id)?.name ?? `codec ${id}`;
}

/**
 * The codec that a signal names.
 *
 * @param {{codec: number, codecVersion: number}} signal
 * @returns {{open: (header: Uint8Array, layout: object) => object}}
 * @throws {Unsupported} where this decoder lacks the codec or its version
 */
export function findCodec({ codec: id, codecVersion }) {
  const codec = CODECS.get(id);
  if (!codec) throw new Unsupported(`codec ${id}`);
  if (codecVersion > codec.version) {
    throw new Unsupported(`version ${codecVersion} of codec ${codec.name}`);
  }
  return { ...codec, open: (header, layout) => codec.open(header, layout, codecVersion) };
}
