// Rows of the list of one file, asked of the engine by pages and kept while they are near.

const PAGE = 500;
const MOST_PAGES = 200;

/** Rows by index; those that are not here yet are asked for, and `onPage` says when they came. */
export class Rows {
  #pages = new Map();
  #asked = new Set();

  constructor(engine, file, onPage) {
    this.engine = engine;
    this.file = file;
    this.onPage = onPage;
  }

  /** A row, or undefined while it is on its way. */
  get(index) {
    const page = Math.floor(index / PAGE);
    const rows = this.#pages.get(page);
    if (rows) return rows[index - page * PAGE];
    this.#ask(page);
    return undefined;
  }

  async #ask(page) {
    if (this.#asked.has(page)) return;
    this.#asked.add(page);
    try {
      const from = page * PAGE;
      const rows = await this.between(from, from + PAGE);
      this.#pages.set(page, rows);
      if (this.#pages.size > MOST_PAGES) this.#pages.delete(this.#pages.keys().next().value);
      this.onPage();
    } catch {
      // The row stays without its facts. Opening the clip says what is wrong.
    } finally {
      // A page that failed is not asked for again and again while it is drawn.
      setTimeout(() => this.#asked.delete(page), this.#pages.has(page) ? 0 : 5000);
    }
  }

  /** Rows from an index up to another, as the engine gives them. */
  between(from, to) {
    return this.engine.rows(this.file.id, from, Math.min(to, this.file.nClips));
  }
}
