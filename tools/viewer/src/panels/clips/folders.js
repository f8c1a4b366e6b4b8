// Clips whose names have slashes, as folders in the order in which they first come.

/** A tree of folders of rows. Names are keys of maps: none of them can be a property of anything. */
export class Folders {
  #top = folder("", "");

  get nClips() {
    return this.#top.nClips;
  }

  add(row) {
    const parts = row.name.split("/").filter((part) => part !== "");
    const name = parts.pop() ?? "";
    let at = this.#top;
    at.nClips++;
    // A name of ten thousand slashes is a name, no tree.
    if (parts.length > 32) parts.splice(32, Infinity, parts.slice(32).join("/"));
    for (const part of parts) {
      let next = at.folders.get(part);
      if (!next) {
        next = folder(part, at.path ? `${at.path}/${part}` : part);
        at.folders.set(part, next);
        at.entries.push(next);
      }
      next.nClips++;
      at = next;
    }
    at.entries.push({ row, name });
  }

  /** Rows as they are seen: those of folders of which `isOpen(path)` is true. */
  flat(isOpen, level) {
    const items = [];
    const walk = (at, depth) => {
      at.entries.forEach((entry, place) => {
        const common = { level: depth, place: place + 1, setSize: at.entries.length };
        if (entry.row) items.push({ ...common, row: entry.row, label: entry.name });
        else {
          const open = isOpen(entry.path);
          items.push({ ...common, folder: entry, label: entry.name, isOpen: open });
          if (open) walk(entry, depth + 1);
        }
      });
    };
    walk(this.#top, level);
    return items;
  }
}

const folder = (name, path) => ({ name, path, folders: new Map(), entries: [], nClips: 0 });
