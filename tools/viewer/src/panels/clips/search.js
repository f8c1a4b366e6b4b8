// Clips by words of their names, found page by page.

const STEP = 5000;
const MOST_FOUND = 5000;

/** Whether a name has all the words; letters alone count, not their case. */
export function matcher(text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return (name) => {
    const lower = name.toLowerCase();
    return words.every((word) => lower.includes(word));
  };
}

/**
 * Searches files one after the other; `onFound(found, nSeen)` is called after each page.
 * What is found has the other name of a clip as `alias`, where that has the words and its own not.
 *
 * @returns {() => void} ends it
 */
export function search(sections, text, onFound) {
  const isWanted = matcher(text);
  const found = [];
  let isOver = false;
  (async () => {
    let nSeen = 0;
    for (const section of sections) {
      for (let from = 0; from < section.file.nClips; from += STEP) {
        const rows = await section.rows.between(from, from + STEP).catch(() => []);
        if (isOver) return;
        for (const row of rows) {
          const name = section.file.nClips === 1 ? `${section.file.name} ${row.name}` : row.name;
          const alias = isWanted(name) ? null : (row.aliases ?? []).find(isWanted);
          if (alias !== undefined && found.length < MOST_FOUND) found.push({ section, row, alias });
        }
        nSeen += rows.length;
        onFound(found, nSeen);
        if (found.length >= MOST_FOUND) return;
      }
    }
    onFound(found, nSeen);
  })();
  return () => {
    isOver = true;
  };
}
