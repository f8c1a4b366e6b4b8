// Marks in time: events with their labels, feet that stand, frames that are lost.

import { later } from "../../ui/dom.js";
import { count, counted, frameNumber, lostText, printable } from "../../ui/text.js";
import { label, paintGround } from "./paint.js";
import { whole } from "./window.js";

const FOOT = 5; // pixels of a foot's bar

export class MarksStrip {
  #seen = { from: 0, to: 0, why: "", feet: [] }; // contacts, as the engine gives them
  #asked = 0;

  constructor(shared) {
    const clip = shared.page.store.get("shown");
    Object.assign(this, { shared, clip });
    this.events = [...(clip.events ?? [])].sort((a, b) => a.frame - b.frame);
    this.load = later(() => this.#load(), 60);
    this.load();
  }

  /** Whether there is anything to mark; contacts are asked for by hand. */
  static isWanted(clip, store) {
    return (clip.events ?? []).length > 0 || (clip.lost ?? []).length > 0 || store.get("contacts");
  }

  close() {
    this.#asked++;
  }

  async #load() {
    const { store, engine } = this.shared.page;
    const mine = ++this.#asked;
    if (!store.get("contacts")) return;
    const { from, to } = whole(this.shared.window(), this.clip.nFrames);
    const { why, from: first, to: last } = this.#seen;
    if (!why && from >= first && to <= last) return;
    const wanted = { from, to, up: store.get("up") };
    const none = ({ message }) => ({ from, to, why: message, feet: [] });
    const found = await engine.contacts(this.clip, wanted).catch(none);
    if (mine !== this.#asked) return;
    this.#seen = found;
    this.row?.draw();
  }

  paint(view) {
    paintGround(view, this.clip);
    this.#paintFeet(view);
    this.#paintWhy(view);
    this.#paintEvents(view);
  }

  #paintFeet({ context, height, x, colors }) {
    this.#seen.feet.forEach(({ side, runs }, k) => {
      context.fillStyle = colors[side] ?? colors.quiet;
      const y = height - 3 - (k + 1) * (FOOT + 1);
      for (const [from, to] of runs) context.fillRect(x(from), y, Math.max(1, x(to) - x(from)), FOOT);
    });
  }

  /** Why there are no contacts, where somebody has asked for them. */
  #paintWhy({ context, height, colors }) {
    if (!this.#seen.why) return;
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "bottom";
    label(context, `No contacts: ${this.#seen.why}`, 6, height - 3, colors, colors.quiet);
  }

  #paintEvents({ context, width, height, x, from, to, colors }) {
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "top";
    let free = -Infinity;
    for (const { frame, label: text, context: side } of this.events) {
      if (frame < from - 1 || frame > to) continue;
      const at = Math.round(x(frame)) + 0.5;
      context.strokeStyle = context.fillStyle = colorOf(side, colors);
      context.lineWidth = 1.5;
      context.beginPath();
      context.moveTo(at, 0);
      context.lineTo(at, height);
      context.stroke();
      if (at < free) continue;
      const shown = printable(String(text ?? ""), 24);
      label(context, shown, at + 4, 3, colors, colors.ink);
      free = at + 10 + context.measureText(shown).width;
    }
  }

  click(frame, slack) {
    const near = this.events.filter((event) => Math.abs(event.frame - frame) <= slack);
    if (!near.length) return false;
    near.sort((a, b) => Math.abs(a.frame - frame) - Math.abs(b.frame - frame));
    this.shared.goTo(near[0].frame);
    return true;
  }

  key({ key }) {
    const frame = Math.floor(this.shared.page.store.get("frame"));
    if (!this.events.length) return false;
    if (key === "n" || key === "Enter") {
      const next = this.events.find((e) => Math.floor(e.frame) > frame);
      this.shared.goTo((next ?? this.events[0]).frame);
    } else if (key === "p") {
      const before = this.events.findLast((e) => Math.floor(e.frame) < frame);
      this.shared.goTo((before ?? this.events.at(-1)).frame);
    } else return false;
    return true;
  }

  valueAt(frame) {
    const isLost = (this.clip.lost ?? []).some(([from, to]) => frame >= from && frame < to);
    const event = this.events.find((e) => Math.abs(e.frame - frame) < 1);
    const feet = this.#seen.feet.filter(({ runs }) => runs.some(([a, b]) => frame >= a && frame < b));
    const parts = [
      isLost && "lost",
      event && [event.context, event.label].filter(Boolean).join(" "),
      feet.length > 0 && `standing: ${feet.map(({ name }) => name).join(", ")}`,
    ];
    return printable(parts.filter(Boolean).join("; "), 120);
  }

  describe() {
    const number = (frame) => count(frameNumber(this.clip, frame));
    const events = this.events
      .slice(0, 20)
      .map((e) => `${[e.context, e.label].filter(Boolean).join(" ")} at ${number(e.frame)}`);
    const { feet, why } = this.#seen;
    const standing = feet.map(({ name, runs }) => `${name} ${counted(runs.length, "contact")}`);
    const unknown = why ? [`no contacts of feet: ${why}`] : [];
    const gone = [lostText(this.clip)].filter(Boolean);
    const text = [...events, ...standing, ...unknown, ...gone].join("; ");
    return printable(`${text || "Nothing is marked."} n and p go to events.`, 2000);
  }
}

function colorOf(side, colors) {
  const word = String(side ?? "").toLowerCase();
  return word === "left" ? colors.left : word === "right" ? colors.right : colors.accent;
}
