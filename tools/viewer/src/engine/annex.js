// The tables of conformance/annex where they are embedded in the page.

/**
 * @param {Record<string, string>} tables name to base64 of raw deflate
 * @returns {Promise<Map<string, Uint8Array>>}
 */
export async function embeddedAnnex(tables) {
  const inflated = Object.entries(tables).map(async ([name, text]) => [
    name,
    await inflate(fromBase64(text)),
  ]);
  return new Map(await Promise.all(inflated));
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
