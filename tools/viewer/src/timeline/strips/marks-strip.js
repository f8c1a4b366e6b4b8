// Marks in time: events with their labels, feet that stand, frames that are lost.

import { later } from "../../ui/dom.js";
import { count, counted, frameNumber, printable } from "../../ui/text.js";
import { Contacts, runsOf } from "./contacts.js";
import { label, paintGround } from "./paint.js";
import { whole } from "./window.js";

const FOOT = 5; // pixels of a foot's bar

export class MarksStrip {
  #feet = [];
  #first = 0;
  #asked = 0;

  constructor(shared) {
    const clip = shared.page.store.get("shown");
    Object.assign(this, { shared, clip });
    this.contacts = new Contacts(shared.page.engine, clip);
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
    const { store } = this.shared.page;
    const mine = ++this.#asked;
    const isOver = () => mine !== this.#asked;
    const { from, to } = whole(this.shared.window(), this.clip.nFrames);
    const up = store.get("up") ?? this.clip.upAxis ?? this.clip.upGuess ?? 1;
    const wanted = store.get("contacts");
    const found = wanted ? await this.contacts.between(from, to, { up, isOver }).catch(() => []) : [];
    if (isOver()) return;
    this.#first = from;
    this.#feet = found.map((foot) => ({ ...foot, runs: runsOf(foot.isStanding, from) }));
    this.row?.draw();
  }

  paint(view) {
    paintGround(view, this.clip);
    this.#paintFeet(view);
    this.#paintEvents(view);
  }

  #paintFeet({ context, height, x, colors }) {
    this.#feet.forEach(({ side, runs }, k) => {
      context.fillStyle = colors[side] ?? colors.quiet;
      const y = height - 3 - (k + 1) * (FOOT + 1);
      for (const [from, to] of runs) context.fillRect(x(from), y, Math.max(1, x(to) - x(from)), FOOT);
    });
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
      this.shared.goTo((this.events.find((e) => Math.floor(e.frame) > frame) ?? this.events[0]).frame);
    } else if (key === "p") {
      this.shared.goTo((this.events.findLast((e) => Math.floor(e.frame) < frame) ?? this.events.at(-1)).frame);
    } else return false;
    return true;
  }

  valueAt(frame) {
    const isLost = (this.clip.lost ?? []).some(([from, to]) => frame >= from && frame < to);
    const event = this.events.find((e) => Math.abs(e.frame - frame) < 1);
    const feet = this.#feet.filter(({ isStanding }) => isStanding[frame - this.#first] === 1);
    const parts = [
      isLost && "lost",
      event && [event.context, event.label].filter(Boolean).join(" "),
      feet.length > 0 && `standing: ${feet.map(({ name }) => name).join(", ")}`,
    ];
    return printable(parts.filter(Boolean).join("; "), 120);
  }

  describe() {
    const { lost = [] } = this.clip;
    const events = this.events
      .slice(0, 20)
      .map((e) => `${[e.context, e.label].filter(Boolean).join(" ")} at ${count(frameNumber(this.clip, e.frame))}`);
    const standing = this.#feet.map(({ name, runs }) => `${name} ${counted(runs.length, "contact")}`);
    const lostText = lost.slice(0, 20).map(([from, to]) => `frames ${count(frameNumber(this.clip, from))} to ${count(frameNumber(this.clip, to - 1))} are lost`);
    const text = [...events, ...standing, ...lostText].join("; ");
    return printable(`${text || "Nothing is marked."} n and p go to events.`, 2000);
  }
}

function colorOf(side, colors) {
  const word = String(side ?? "").toLowerCase();
  return word === "left" ? colors.left : word === "right" ? colors.right : colors.accent;
}
