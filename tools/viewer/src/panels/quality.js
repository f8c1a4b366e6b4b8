// How small the clip can be: it is coded anew as a slider moves, and each try is a point of a plot.

import { button, facts, fill, later, make, put } from "../ui/dom.js";
import { count, distance, figure, size } from "../ui/text.js";
import { tell, tellError } from "./actions.js";
import { dialsOf } from "./dials.js";
import { RatePlot } from "./rate-plot.js";
import { post, served } from "./server.js";

const WAIT_MS = 250;
const STEPS = 1000; // of the slider

export function mountQuality(panel, page) {
  new Quality(panel, page);
}

class Quality {
  #tries = [];
  #dials = [];
  #abort = null;
  #file = null; // the last coded file, which is closed when there is another
  #waiting = null; // a try whose error is not known yet

  constructor(panel, page) {
    Object.assign(this, { page, store: page.store });
    this.codec = make("select", { id: "quality-codec" });
    this.dial = make("select", { id: "quality-dial" });
    this.slider = make("input", { type: "range", min: 0, max: STEPS, step: 1, id: "quality-slider" });
    this.number = make("input", { type: "number", step: "any", id: "quality-value", "aria-label": "Value" });
    this.unit = make("select", { id: "quality-unit" });
    this.meaning = make("p", { class: "quiet" });
    this.result = make("div", { role: "status", class: "result" });
    this.plot = new RatePlot();
    this.#build(panel);
    this.encode = later(() => this.#encode(), WAIT_MS);
    this.store.watch(["server"], () => this.#fillCodecs());
    this.store.watch(["shown"], () => this.#forget());
    this.store.watch(["errors"], () => this.#measured());
    this.store.watch(["theme"], () => this.plot.draw());
  }

  #build(panel) {
    const field = (text, ...inputs) => make("div", { class: "field" }, make("label", { for: inputs[0].id }, text), inputs);
    this.unitField = field("One unit is", this.unit);
    for (const [value, text] of [["", "unknown"], ["cm", "1 cm"], ["mm", "1 mm"], ["m", "1 m"], ["in", "1 inch"]]) {
      put(this.unit, make("option", { value }, text));
    }
    this.controls = make(
      "section",
      {},
      field("Codec", this.codec),
      field("Dial", this.dial),
      make("div", { class: "field" }, make("label", { for: "quality-slider" }, "Value"), make("div", { class: "dial" }, this.slider, this.number)),
      this.unitField,
      this.meaning,
      make("div", { class: "buttons" }, button({ shown: "Encode", onClick: () => this.#encode() }), button({ label: "Clear the tries", shown: "Clear", onClick: () => this.#clear() })),
    );
    this.note = make("p", { class: "quiet" });
    put(panel, this.note, this.controls, this.plot.element, this.result);
    this.codec.addEventListener("change", () => this.#fillDials());
    this.dial.addEventListener("change", () => this.#setDial());
    this.unit.addEventListener("change", () => this.encode());
    this.slider.addEventListener("input", () => {
      this.number.value = this.#chosen.valueAt(this.slider.value / STEPS);
      this.#sayValue();
      this.encode();
    });
    this.number.addEventListener("input", () => {
      if (!this.number.checkValidity() || this.number.value === "") return;
      this.slider.value = Math.round(STEPS * this.#chosen.shareOf(Number(this.number.value)));
      this.#sayValue();
      this.encode();
    });
  }

  get #chosen() {
    return this.#dials[this.dial.selectedIndex] ?? this.#dials[0];
  }

  #fillCodecs() {
    const codecs = this.store.get("server")?.codecs ?? [];
    this.codecs = (Array.isArray(codecs) ? codecs : (codecs.codecs ?? [])).filter(({ lossless }) => !lossless);
    fill(this.codec, this.codecs.map(({ name }) => make("option", { value: name }, name)));
    this.#fillDials();
  }

  #fillDials() {
    const codec = this.codecs.find(({ name }) => name === this.codec.value);
    this.#dials = codec ? dialsOf(codec, this.store.get("shown")) : [];
    fill(this.dial, this.#dials.map(({ name, text }) => make("option", { value: name }, text)));
    this.#setDial();
  }

  #setDial() {
    const dial = this.#chosen;
    if (!dial) return;
    this.slider.value = Math.round(STEPS * dial.shareOf(dial.start));
    this.number.value = dial.start;
    Object.assign(this.number, { min: dial.least, max: dial.most });
    this.meaning.textContent = dial.meaning;
    this.#sayValue();
  }

  #sayValue() {
    this.slider.setAttribute("aria-valuetext", `${this.#chosen.text} ${this.number.value}`);
  }

  #forget() {
    const clip = this.store.get("shown");
    if (this.shownKey === clip?.key) return;
    this.shownKey = clip?.key;
    const canEncode = served(this.store, clip) !== null;
    this.controls.hidden = !canEncode;
    this.unitField.hidden = Boolean(clip?.unitCm);
    this.note.textContent = canEncode
      ? ""
      : clip
        ? "Only clips of files that mcz view serves can be re-encoded."
        : "No clip is shown.";
    this.#abort?.abort();
    this.#waiting = null;
    this.#clear();
    if (this.codecs) this.#fillDials();
  }

  #clear() {
    this.#tries = [];
    fill(this.result);
    this.#draw();
  }

  async #encode() {
    const clip = this.store.get("shown");
    const source = served(this.store, clip);
    const dial = this.#chosen;
    if (!source || !dial) return;
    this.#abort?.abort();
    const abort = (this.#abort = new AbortController());
    const value = Number(this.number.value);
    const asked = { ...source, codec: this.codec.value, params: { [dial.name]: value } };
    if (!clip.unitCm && this.unit.value) asked.unit = this.unit.value;
    this.result.setAttribute("aria-busy", "true");
    try {
      const made = await post("encode", asked, { signal: abort.signal });
      await this.#take(made, { clip, dial, value, isOver: () => abort.signal.aborted });
    } catch (error) {
      if (abort.signal.aborted) return;
      fill(this.result, make("p", { class: "fault" }, error.message));
    } finally {
      if (abort === this.#abort) this.result.removeAttribute("aria-busy");
    }
  }

  async #take(made, { clip, dial, value, isOver }) {
    const { engine } = this.page;
    const url = new URL(made.url, document.baseURI).href;
    const file = await engine.open({ url }, { name: made.name });
    const coded = await engine.clip(file.id, 0);
    if (isOver() || this.store.get("shown") !== clip) return void engine.close(file.id);
    const before = this.#file;
    this.#file = file;
    const bytes = made.payload ?? made.size;
    const label = `${dial.name} ${figure(value, 3)}`;
    this.#waiting = { codec: this.codec.value, label, bytes, size: made.size, seconds: made.seconds, key: coded.key, clip };
    const compared = { ...coded, servedUrl: made.url, label: `${this.codec.value}, ${label}` };
    this.store.set({ compared, errors: null, colors: "error" });
    if (before) engine.close(before.id).catch((error) => tellError(this.store, error));
  }

  /** Errors came: they are of the try that waits, if that is what is compared. */
  #measured() {
    const errors = this.store.get("errors");
    const waiting = this.#waiting;
    if (!errors || !waiting || this.store.get("compared")?.key !== waiting.key) return;
    this.#waiting = null;
    const factor = errors.unit === "cm" ? 10 : 1;
    const unit = errors.unit === "cm" ? "mm" : "units";
    const one = { ...waiting, mean: errors.total.mean * factor, max: errors.total.max * factor, unit };
    this.#tries = [...this.#tries.filter((old) => old.codec !== one.codec || old.label !== one.label), one];
    this.#show(one, errors);
    this.#draw();
  }

  #show(one, errors) {
    const { clip, bytes, seconds } = one;
    const unitCm = errors.unit === "cm" ? 1 : null;
    const ofSource = clip.source?.size ?? clip.source?.bytes;
    const float32 = clip.nFrames * clip.channels.length * 4;
    fill(
      this.result,
      facts([
        ["Bytes", make("b", {}, `${size(bytes)}`)],
        ["Rate", clip.rate ? `${figure((8 * bytes) / (clip.nFrames / clip.rate) / 1000, 3)} kbit/s` : null],
        ["Of the shown clip", clip.bytes ? `${figure((100 * bytes) / clip.bytes, 3)} %` : null],
        ["Ratio", `${figure(float32 / bytes, 3)} : 1 of float32${typeof ofSource === "number" ? `, ${figure(ofSource / bytes, 3)} : 1 of the source` : ""}`],
        ["Mean error", make("b", {}, distance(errors.total.mean, unitCm))],
        ["Greatest", make("b", {}, distance(errors.total.max, unitCm))],
        ["Took", Number.isFinite(seconds) ? `${figure(seconds, 3)} s` : null],
      ]),
    );
    tell(this.store, `${one.codec}, ${one.label}: ${count(bytes)} bytes, mean ${distance(errors.total.mean, unitCm)}`);
  }

  #draw() {
    this.plot.show(this.#tries);
  }
}
