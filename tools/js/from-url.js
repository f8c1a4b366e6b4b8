// A file on a web server, a range of bytes at a time.

import { AccessError } from "./errors.js";

const TAIL = 128 * 1024; // bytes at the end that come first: most indexes fit
const ATTEMPTS = 4;
const FIRST_WAIT = 150; // ms, doubled after each attempt
const MOST_WHOLE = 2 ** 28; // bytes of a file that its server gives only whole
const CONTENT_RANGE = /^bytes (\d{1,16})-(\d{1,16})\/(\d{1,16})$/;
const EMPTY_RANGE = /^bytes \*\/0$/;
const PASSING = new Set([408, 425, 429, 500, 502, 503, 504]); // worth another attempt
const REPLACED = "the file was replaced while it was read";

/**
 * A source at an http or https address. All reads are of one and the same file, by its size and by
 * its ETag or, without, its Last-Modified. A server that gives no ranges is asked for all of the
 * file once, if that has no more bytes than `limit`.
 *
 * @param {string | URL} address
 * @param {object} [options]
 * @param {Record<string, string>} [options.headers] that every request has
 * @param {AbortSignal} [options.signal]
 * @param {number} [options.limit] bytes of a file that is read as a whole
 * @param {typeof globalThis.fetch} [options.fetch]
 * @returns {Promise<import("./from-bytes.js").Source & {stats: {requests: number, bytes: number}}>}
 *   `stats` count what was asked for so far, and came
 * @throws {AccessError} in everything that goes wrong
 */
export async function fromUrl(address, options = {}) {
  const file = new RemoteFile(String(address), options);
  await file.open();
  return file;
}

class RemoteFile {
  constructor(name, { headers = {}, signal, limit = MOST_WHOLE, fetch = globalThis.fetch }) {
    this.name = name;
    this.remote = true;
    this.size = 0;
    this.stats = { requests: 0, bytes: 0 };
    this.options = { headers, signal };
    this.fetch = fetch;
    this.limit = limit;
    this.identity = null; // of the file, as the first answer tells it
    this.start = 0; // of what is at hand: the end of the file, or all of it
    this.held = new Uint8Array(0);
  }

  /** Asks for the end of the file, which tells its size. */
  async open() {
    const tail = await this.firstAnswer();
    if (tail === null) return;
    this.held = tail;
    this.start = this.size - tail.length;
  }

  async read(start, stop) {
    if (start >= this.start || start === stop) {
      return this.held.subarray(start - this.start, stop - this.start);
    }
    return this.attempt(async () => {
      const response = await this.request(`bytes=${start}-${stop - 1}`);
      if (response.status === 416) this.refuse(REPLACED);
      if (response.status !== 206) this.unexpected(response);
      this.compare(response);
      const said = CONTENT_RANGE.exec(response.headers.get("Content-Range") ?? "");
      if (said && Number(said[3]) !== this.size) this.refuse(REPLACED);
      if (said && (Number(said[1]) !== start || Number(said[2]) !== stop - 1)) {
        this.refuse(`the server sent ${said[0]} for bytes ${start} to ${stop - 1}`);
      }
      return this.body(response, stop - start);
    });
  }

  /** The end of the file; null where the file is empty. */
  async firstAnswer() {
    return this.attempt(async () => {
      let response = await this.request(`bytes=-${TAIL}`, true);
      if (response === null || [400, 416, 501].includes(response.status)) {
        if (EMPTY_RANGE.test(response?.headers.get("Content-Range") ?? "")) return null;
        response = await this.lastRange();
        if (response === null) return null;
      }
      this.identity = identityOf(response);
      if (response.status === 200) return this.whole(response);
      if (response.status !== 206) this.unexpected(response);
      const said = CONTENT_RANGE.exec(response.headers.get("Content-Range") ?? "");
      const size = said ? Number(said[3]) : await this.sizeByHead();
      const most = Math.min(size, TAIL);
      if (said && (Number(said[1]) !== size - most || Number(said[2]) !== size - 1)) {
        this.refuse(`the server sent ${said[0]} for the last ${most} bytes`);
      }
      const tail = await this.body(response, most);
      this.size = size;
      return tail;
    });
  }

  /** The end of the file from a server that does not count from the end, or whose page may not. */
  async lastRange() {
    const size = await this.sizeByHead();
    if (size === 0) return null;
    return this.request(`bytes=${Math.max(0, size - TAIL)}-${size - 1}`);
  }

  async sizeByHead() {
    const response = await this.request(null, false, "HEAD");
    if (!response.ok) this.unexpected(response);
    const length = response.headers.get("Content-Length");
    if (length === null) this.refuse("the server does not state the size of the file");
    return Number(length);
  }

  /** All of the file, of a server that does not give less. */
  async whole(response) {
    const size = Number(response.headers.get("Content-Length") ?? 0);
    const parts = [];
    let found = 0;
    const tooLong = `the server gives no ranges, and whole files of ${this.limit} bytes at most`;
    if (size > this.limit) {
      await response.body.cancel();
      this.refuse(`${tooLong} are read, this has ${size}`);
    }
    const reader = response.body.getReader();
    for (;;) {
      const { done, value } = await reader.read().catch((error) => {
        throw this.passing(error);
      });
      if (done) break;
      found += value.length;
      parts.push(value);
      if (found <= this.limit) continue;
      await reader.cancel();
      this.refuse(`${tooLong} are read, this has more`);
    }
    const out = new Uint8Array(found);
    let at = 0;
    for (const part of parts) {
      out.set(part, at);
      at += part.length;
    }
    this.stats.bytes += found;
    this.size = found;
    return out;
  }

  async request(range, mayFail = false, method = "GET") {
    this.stats.requests++;
    const headers = { ...this.options.headers, ...(range === null ? {} : { Range: range }) };
    const { fetch } = this;
    try {
      return await fetch(this.name, { ...this.options, method, headers });
    } catch (error) {
      // A range from the end needs leave of a server elsewhere that a plain one does not.
      if (mayFail && error.name !== "AbortError") return null;
      throw this.passing(error);
    }
  }

  /** The bytes of an answer, which have to be as many as were asked for. */
  async body(response, size) {
    let bytes;
    try {
      bytes = new Uint8Array(await response.arrayBuffer());
    } catch (error) {
      throw this.passing(error);
    }
    this.stats.bytes += bytes.length;
    if (bytes.length > size) this.refuse(`${bytes.length} bytes arrived instead of ${size}`);
    const message = `${bytes.length} of ${size} bytes came`;
    if (bytes.length < size) throw this.passing({ message });
    return bytes;
  }

  compare(response) {
    const identity = identityOf(response);
    if (this.identity !== null && identity !== null && identity !== this.identity) {
      this.refuse(REPLACED);
    }
  }

  /** Does something until it succeeds, or fails in a way that will not pass. */
  async attempt(work) {
    for (let attempt = 1; ; attempt++) {
      try {
        return await work();
      } catch (error) {
        if (!error.passing || attempt === ATTEMPTS) throw error;
      }
      await new Promise((resolve) => setTimeout(resolve, FIRST_WAIT * 2 ** (attempt - 1)));
    }
  }

  passing(error) {
    const out = new AccessError(`${this.name}: ${error.message}`);
    out.passing = error.name !== "AbortError";
    return out;
  }

  unexpected({ status, statusText }) {
    const error = this.passing({ message: `the server answers ${status} ${statusText}`.trim() });
    error.passing = PASSING.has(status);
    throw error;
  }

  refuse(message) {
    throw new AccessError(`${this.name}: ${message}`);
  }
}

/** By what a server tells one file from another; null where it does not say. */
function identityOf({ headers }) {
  return headers.get("ETag") ?? headers.get("Last-Modified");
}
