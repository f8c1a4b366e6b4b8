// The tables of conformance/annex: embedded in the page, or beside it on the server.

const NAMES = [
  "bases_cmu31.bin",
  "bases_cmu31_virtual.bin",
  "bases_cmu38.bin",
  "best_start.json",
  "fast_counts.json",
  "frame_start.json",
  "lossless_start.json",
  "online_start.json",
  "pca_start.json",
  "post_filter.json",
  "posewave_start.json",
  "qbc_start.json",
  "wavelet_start.json",
  "wavelets.json",
  "window_start.json",
  "words.bin",
];

/**
 * @param {Record<string, string>} tables name to base64 of raw deflate
 * @returns {Promise<Map<string, Uint8Array>>}
 */
export async function embeddedAnnex(tables) {
  const inflated = Object.entries(tables).map(async ([name, text]) => [name, await inflate(fromBase64(text))]);
  return new Map(await Promise.all(inflated));
}

/** @returns {Promise<Map<string, Uint8Array>>} without those that are not there */
export async function servedAnnex(base) {
  const fetched = NAMES.map(async (name) => {
    try {
      const response = await fetch(new URL(`annex/${name}`, base));
      return response.ok ? [[name, new Uint8Array(await response.arrayBuffer())]] : [];
    } catch {
      return [];
    }
  });
  return new Map((await Promise.all(fetched)).flat());
}

export function fromBase64(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
