// SPEC.md, "Codecs": the codecs by id and version.

import * as best from "./codecs/best.js";
import * as fast from "./codecs/fast.js";
import * as lsdtClip from "./codecs/lsdt-clip.js";
import * as lsdtFrame from "./codecs/lsdt-frame.js";
import * as online from "./codecs/online.js";
import * as pca from "./codecs/pca.js";
import * as posewave from "./codecs/posewave.js";
import * as qbc from "./codecs/qbc.js";
import * as raw from "./codecs/raw.js";
import * as wavelet from "./codecs/wavelet.js";
import { Unsupported } from "./errors.js";

const CODECS = new Map(
  [raw, fast, best, posewave, wavelet, qbc, pca, lsdtFrame, lsdtClip, online].map(
    (codec) => [codec.id, codec],
  ),
);

/** Names of presets by codec, which people know instead of the codec's. */
const PRESETS = new Map([
  [wavelet.id, ["wavelet", "mrdwt", "dwt", "awt"]],
  [lsdtClip.id, ["lsdt-clip", "lsdt-clip", "mdtt", "pca-rdo"]],
]);

/** Names of the codecs, in the order of their ids. */
export const CODEC_NAMES = [...CODECS.values()].map((codec) => codec.name);

/** The name of a signal's codec or preset, or the id where this decoder lacks the codec. */
export function codecLabel({ codec, preset }) {
  return PRESETS.get(codec)?.[preset] ?? CODECS.get(codec)?.name ?? `codec ${codec}`;
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
