// SPEC.md, "Grammar": the state of a walk through a file, whichever way its chunks come.

import { wellKnownModel } from "./bases.js";
import { hex } from "./bytes.js";
import { readClipEnd } from "./cend.js";
import { HEADER_SIZE, SIGNATURE_SIZE } from "./chunks.js";
import { readClip } from "./clip.js";
import { COPIED, checkCopies } from "./copies.js";
import { addSegment, readSegment } from "./data.js";
import { Refused, Unsupported } from "./errors.js";
import { readHead } from "./head.js";
import { plainId, plainPayload } from "./ids.js";
import { checkIndex } from "./index.js";
import { profile, within } from "./limits.js";
import { checkPlainChunk } from "./plain.js";
import { apply, readRecords } from "./metadata.js";
import { readQuality } from "./qual.js";
import { Attachment, readAlias, readModel, readTemplate } from "./shared.js";
import { readSkeleton } from "./skel.js";
import { frameNumbers } from "./time-base.js";

const BASE_PROFILE = 0;

/**
 * What a file holds. Maps are in file order; ids are in hexadecimal.
 *
 * @typedef {object} MczFile
 * @property {number} size bytes of the file
 * @property {Uint8Array} head payload of HEAD
 * @property {object} limits of its profile
 * @property {object[]} shared where SKEL, MODL and SRCE lie, the first of each id: type, id,
 *   offset, length
 * @property {Map<string, import("./skel.js").Skeleton>} skeletons by id
 * @property {Map<string, {kind: number, data: Uint8Array}>} models by id
 * @property {Map<string, {format: number, data: Uint8Array}>} templates by id, inflated
 * @property {Map<string, string>} metadata of the file as a whole
 * @property {Map<string, Attachment>} attachments by name
 * @property {Map<string, object>} aliases by name
 * @property {Map<string, import("./clip.js").Clip>} clips by name, each with `findModel`,
 *   `segments`, `ancillary`, `quality`, `numbers` and `end`
 */

/** What was found so far, and what may follow. */
export class Walk {
  /**
   * @param {number} size bytes of the file
   * @param {number} limit bytes that an attachment or template may inflate to
   */
  constructor(size, limit) {
    this.inflateLimit = limit;
    this.at = SIGNATURE_SIZE;
    this.file = {
      size,
      head: null,
      shared: [],
      limits: profile(BASE_PROFILE),
      skeletons: new Map(),
      models: new Map(),
      templates: new Map(),
      attachments: new Map(),
      aliases: new Map(),
      clips: new Map(),
      metadata: new Map(),
    };
    this.references = this.file; // where skeletons and clips look up what they name
    this.modelBytes = 0;
    this.clip = null; // the clip that is open
    this.lastClip = null; // the clip that ended last
    this.attachment = null; // the attachment of which a part came last, until it is complete
    this.index = null; // the INDX that came last, until its FOOT
    this.indexes = []; // all so far
    this.endOfFoot = 0; // of the last FOOT
    this.copied = new Map(); // the chunks so far that a COPY may have, by offset
  }

  refuse(message) {
    throw new Refused(`byte ${this.at}: ${message}`);
  }

  /** Takes a chunk in; it is checked as such. */
  take(chunk) {
    if (COPIED.has(chunk.type)) this.copied.set(chunk.offset, chunk);
    if (this.file.head === null) {
      this.readHead(chunk);
      return;
    }
    if (this.index) this.refuse(`${chunk.type} between INDX and FOOT`);
    if (this.attachment && chunk.type !== "ATTA") {
      this.refuse(`${chunk.type} between the parts of attachment ${this.attachment.name}`);
    }
    if (this.file.limits.plain && !chunk.open) checkPlainChunk(chunk);
    this.dispatch(chunk);
  }

  dispatch(chunk) {
    if (chunk.ancillary) this.readAncillary(chunk);
    else if (this.clip) this.readInClip(chunk);
    else this.readInBody(chunk);
  }

  readHead({ type, payload }) {
    if (type !== "HEAD") this.refuse(`the first chunk is ${type}, not HEAD`);
    this.file.limits = readHead(payload);
    this.file.head = payload;
  }

  takeFoot(foot) {
    if (this.clip) this.refuse(`a FOOT in clip ${this.clip.name}`);
    if (this.attachment) this.refuse(`a FOOT in attachment ${this.attachment.name}`);
    const offset = this.index ? this.index.offset : 0;
    const length = this.index ? this.index.end - this.index.offset : 0;
    if (foot.indexOffset !== offset || foot.indexLength !== length) {
      this.refuse("a FOOT that does not say where the INDX before it is");
    }
    this.index = null;
    this.endOfFoot = foot.end;
  }

  /** QUAL, META, REPT, COPY, unknown types: nothing that they say affects what is decoded. */
  readAncillary(chunk) {
    const { type, offset, payload } = chunk;
    if (type === "COPY") checkCopies(chunk, this.copied, this.file.size);
    if (type === "META") this.readMetadata(payload);
    const quality = type === "QUAL" ? readQuality(payload) : null;
    if (this.clip || !this.lastClip) return;
    this.lastClip.ancillary.push({ type, offset, length: payload.length });
    if (quality !== null) this.lastClip.quality ??= quality;
  }

  /** Those of the file, and of the clips so far. */
  readMetadata(payload) {
    if (this.clip) this.refuse(`META in clip ${this.clip.name}`);
    if (!this.lastClip) this.refuse("META before the first clip");
    for (const record of readRecords(payload, this.file.size)) {
      const clip = this.file.clips.get(record.name);
      if (record.name === "") apply(this.file.metadata, record);
      else if (clip) apply(clip.metadata, record);
    }
  }

  readInClip(chunk) {
    if (chunk.type === "DATA") this.readData(chunk);
    else if (chunk.type === "CEND") this.readClipEnd(chunk);
    else this.refuse(`${chunk.type} in clip ${this.clip.name}`);
  }

  readInBody(chunk) {
    switch (chunk.type) {
      case "SKEL":
        this.addShared(chunk, this.file.skeletons, (plain, id) =>
          readSkeleton(plain, id, this.references),
        );
        break;
      case "MODL":
        this.countModel(chunk.payload);
        this.addShared(chunk, this.file.models, (plain) => this.readModel(plain));
        break;
      case "SRCE":
        this.addShared(chunk, this.file.templates, (plain) =>
          readTemplate(plain, this.file.limits, this.inflateLimit),
        );
        break;
      case "ATTA":
        this.readAttachment(chunk);
        break;
      case "ALIA":
        this.readAlias(chunk);
        break;
      case "CLIP":
        this.readClip(chunk);
        break;
      case "INDX":
        this.readIndex(chunk);
        break;
      default:
        this.refuse(`${chunk.type} where it cannot be`);
    }
  }

  /** SKEL, MODL and SRCE: the first of each id counts. */
  addShared(chunk, map, read) {
    const { type, offset, payload } = chunk;
    const plain = plainPayload(type, payload, this.file.limits, this.inflateLimit);
    const id = plainId(type, plain);
    const key = hex(id);
    if (map.has(key)) return;
    map.set(key, read(plain, id));
    this.file.shared.push({ type, id, offset, length: payload.length });
  }

  /** Each MODL counts, also one that is repeated. */
  countModel(payload) {
    this.modelBytes += payload.length;
    within(this.modelBytes, this.file.limits.modelBytes, "bytes of all models");
  }

  readModel(payload) {
    return { ...readModel(payload), order: this.file.models.size };
  }

  readAttachment({ offset, payload }) {
    if (this.attachment) {
      this.attachment.add(payload);
    } else {
      this.attachment = new Attachment(payload, this.inflateLimit);
      this.attachment.chunks = [];
    }
    const { name, chunks, complete } = this.attachment;
    chunks.push({ offset, length: payload.length });
    if (!complete) return;
    if (this.file.attachments.has(name)) this.refuse(`a second attachment ${name}`);
    this.file.attachments.set(name, this.attachment);
    this.attachment = null;
  }

  readAlias({ payload }) {
    const alias = readAlias(payload, this.file);
    if (this.file.aliases.has(alias.name)) this.refuse(`a second alias ${alias.name}`);
    this.file.aliases.set(alias.name, alias);
  }

  readClip({ payload, offset }) {
    this.clip = readClip(payload, offset, this.references);
    this.clip.findModel = this.modelFinder();
    this.clip.segments = [];
    this.clip.ancillary = [];
    this.clip.quality = null;
  }

  /** Finds models that come before what names them, and those that everybody knows. */
  modelFinder() {
    const { models } = this.file;
    const nBefore = models.size;
    return (id) => {
      const found = models.get(id);
      const model = found && found.order < nBefore ? found : wellKnownModel(id);
      if (!model) throw new Unsupported(`model ${id}, which the file does not have`);
      return model;
    };
  }

  readData({ payload, offset }) {
    const segment = readSegment(payload, this.clip, this.file.limits);
    segment.offset = offset + HEADER_SIZE;
    segment.size = payload.length;
    addSegment(this.clip.signals[segment.signal], segment);
    this.clip.segments.push(segment);
  }

  readClipEnd({ payload, offset }) {
    const { clip } = this;
    clip.end = { ...readClipEnd(payload, clip), offset, length: payload.length };
    clip.nFrames = clip.end.nFrames;
    clip.numbers = frameNumbers(clip);
    this.file.clips.set(clip.name, clip);
    this.lastClip = clip;
    this.clip = null;
  }

  readIndex(chunk) {
    const { head, shared, attachments, aliases, clips } = this.file;
    const found = {
      head,
      shared,
      attachments: [...attachments.values()],
      aliases: [...aliases.values()],
      clips: [...clips.values()],
    };
    this.indexes.push(checkIndex(chunk, found, this.indexes, this.file.size));
    this.index = chunk;
  }
}
