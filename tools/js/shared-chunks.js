// Skeletons, models and templates of a file that is read by ranges. Parsers ask for them as for
// entries of a Map; one that is not read yet is Missing.

import { hex } from "./bytes.js";
import { wellKnownModel } from "./bases.js";
import { Refused, Unsupported } from "./errors.js";
import { plainId, plainPayload } from "./ids.js";
import { Missing, supplied } from "./missing.js";
import { checkSourceFormat } from "./registry.js";
import { readModel, readTemplate } from "./shared.js";
import { readSkeleton } from "./skel.js";

const MOST_SKELETONS = 256; // that are kept

export class SharedChunks {
  /**
   * @param {import("./ranges.js").Ranges} ranges
   * @param {import("./directory.js").Directory} directory
   * @param {object} limits of the profile
   * @param {number} inflateLimit bytes that a template may inflate to
   * @param {boolean} salvage what is named may be lost
   */
  constructor(ranges, directory, limits, inflateLimit, salvage) {
    this.ranges = ranges;
    this.directory = directory;
    this.head = directory.head;
    this.limits = limits;
    this.inflateLimit = inflateLimit;
    this.read = new Map(); // by type and id
    this.salvage = salvage;
    const has = (id) => salvage || directory.shared.has(`SKEL ${id}`);
    this.skeletons = { has, get: (id) => this.skeleton(id) };
    this.templates = { get: (id) => this.template(id) };
    this.clips = new Map(); // the names of others are in the directory
  }

  skeleton(id) {
    return this.found("SKEL", id, (payload) => {
      while (this.read.size >= MOST_SKELETONS) this.read.delete(this.read.keys().next().value);
      return () => readSkeleton(payload, bytesOfHex(id), this);
    });
  }

  /** A template of which only the id is known: the rest of it is read when it is needed. */
  template(id) {
    const isThere = this.salvage || this.directory.shared.has(`SRCE ${id}`);
    return isThere ? { id, format: null, data: null } : undefined;
  }

  /**
   * Reads the template of a source.
   *
   * @param {{format: number, template: object}} source of a clip or skeleton; is given the template
   * @param {"clip" | "skeleton"} of
   * @throws {Refused}
   */
  async loadTemplate(source, of) {
    if (source.template.data !== null) return;
    const { id } = source.template;
    const payload = await this.payload("SRCE", id);
    const template = await supplied(() => readTemplate(payload, this.limits, this.inflateLimit));
    checkSourceFormat(source.format, template, of, `SRCE ${id}`);
    source.template = template;
  }

  /**
   * How a clip finds models: those that lie before it, and those that everybody knows.
   *
   * @param {number} offset of CLIP
   * @returns {(id: string) => {kind: number, data: Uint8Array}}
   */
  modelFinder(offset) {
    return (id) => {
      const place = this.directory.shared.get(`MODL ${id}`);
      const isBefore = place !== undefined && (this.salvage || place.offset < offset);
      const model = isBefore
        ? this.found("MODL", id, (payload) => () => readModel(payload))
        : wellKnownModel(id);
      if (!model) throw new Unsupported(`model ${id}, which the file does not have`);
      return model;
    };
  }

  found(type, id, parser) {
    const key = `${type} ${id}`;
    if (this.read.has(key)) return this.read.get(key);
    if (!this.directory.shared.has(key)) return undefined;
    throw new Missing(key, async () => {
      const payload = await this.payload(type, id);
      const parsed = await supplied(parser(payload));
      this.read.set(key, parsed);
    });
  }

  /** The payload of a chunk, of which the id is told by its hash. */
  async payload(type, id) {
    const place = this.directory.shared.get(`${type} ${id}`);
    if (place === undefined) throw new Refused(`${type} ${id} is lost`);
    const payload = await this.ranges.payload(place, this.limits.payloadBytes);
    const plain = await supplied(() =>
      plainPayload(type, payload, this.limits, this.inflateLimit),
    );
    if (hex(plainId(type, plain)) !== id) {
      throw new Refused(`${type} at ${place.offset}: its id is not ${id}`);
    }
    return plain;
  }
}

function bytesOfHex(text) {
  return Uint8Array.from(text.match(/../g), (pair) => parseInt(pair, 16));
}
