// A source some of whose bytes are known better than it has them.

/**
 * @param {import("./from-bytes.js").Source} source
 * @param {{start: number, bytes: Uint8Array}[]} parts that do not overlap, within the source
 * @returns {import("./from-bytes.js").Source}
 */
export function overlaid(source, parts) {
  return {
    name: source.name,
    size: source.size,
    remote: source.remote,
    async read(start, stop) {
      const bytes = await source.read(start, stop);
      const met = parts.filter((part) => part.start < stop && start < endOf(part));
      if (met.length === 0) return bytes;
      const out = bytes.slice();
      for (const part of met) {
        const from = Math.max(start, part.start);
        const to = Math.min(stop, endOf(part));
        out.set(part.bytes.subarray(from - part.start, to - part.start), from - start);
      }
      return out;
    },
  };
}

function endOf({ start, bytes }) {
  return start + bytes.length;
}
