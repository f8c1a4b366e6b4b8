// The three-dimensional picture: watches the store, and draws what it says.

import { nameOf } from "../asked.js";
import { button } from "../ui/dom.js";
import { Actor } from "./actor.js";
import { Labels, project } from "./labels.js";
import { gridOf } from "./framing.js";
import { FIGURE, upOf } from "./axes.js";
import { themeOf, roundUp } from "./colors.js";
import { Contacts, Trails, trailed } from "./marks.js";
import { Painter } from "./painter.js";
import { PointErrors } from "./painting.js";
import { listenToPointer } from "./pointer.js";
import { View } from "./view.js";

const GHOST = 0.4; // opacity of a figure that is laid over another
const FAR = 1.2; // a clip goes farther than so many figures: the camera follows
const ASIDE = 1.15; // units of the picture between figures side by side, at least
const BETWEEN = 0.35; // radians: they stand side by side as seen from the front and a little beside
const PREFETCH = 3; // blocks, while playing
const SOFT = 0.14; // part of its way that the camera follows in a picture
const BELOW = 10; // pixels from the floor to the name of a figure
const LINE = 22; // pixels from one name to the next

let stage = null;

/** The stage of this page. @throws {Error} where nothing can be drawn */
export function mounted() {
  if (!stage?.view)
    throw new Error("there is no picture: this browser does not draw in three dimensions");
  return stage;
}

/** @param {HTMLElement} element of the page */
export function mountStage(element, page) {
  stage = new Stage(element, page);
  return stage;
}

class Stage {
  constructor(element, page) {
    this.element = element;
    this.page = page;
    this.view = null;
    this.shown = null; // actors
    this.compared = null;
    this.pointErrors = null;
    this.usualSpeed = 1;
    const canvas = this.#makeCanvas();
    try {
      this.view = new View(canvas, () => this.#beforeDrawing());
    } catch {
      canvas.remove();
      this.#fault(
        "This browser cannot draw in three dimensions (no WebGL). Curves and numbers still work.",
      );
      return;
    }
    this.labels = new Labels(element);
    this.guess = button({
      label: "Guess lines between markers that keep their distance",
      shown: "Guess lines",
      class: "stage-guess",
      onClick: () => page.store.set({ neighbors: true }),
    });
    this.guess.hidden = true;
    element.append(this.guess);
    this.painter = new Painter(this);
    this.trails = new Trails();
    this.contacts = new Contacts();
    this.contactsOfOther = new Contacts();
    const marks = [this.trails, this.contacts, this.contactsOfOther].map(({ mesh }) => mesh);
    this.view.world.scene.add(...marks);
    this.view.afterDrawing = () => this.#afterDrawing();
    this.#watchTheme();
    this.#watchStore();
    listenToPointer(canvas, this);
  }

  #makeCanvas() {
    const canvas = document.createElement("canvas");
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    this.element.append(canvas);
    canvas.setAttribute("aria-label", "Motion in three dimensions");
    return canvas;
  }

  #fault(text) {
    const old = this.element.querySelector(".stage-fault");
    old?.remove();
    if (text === "") return;
    const fault = document.createElement("p");
    fault.className = "stage-fault";
    fault.textContent = text;
    this.element.append(fault);
  }

  #watchTheme() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const { store } = this.page;
    const change = () => {
      const chosen = store.get("theme"); // "light", "dark", or none
      this.theme = themeOf(chosen ? chosen === "dark" : dark.matches);
      this.view.world.paint(this.theme);
      this.painter.useTheme(this.theme);
      this.painter.paint();
      this.view.ask();
    };
    dark.addEventListener("change", change);
    store.watch(["theme"], change);
  }

  #watchStore() {
    const { store } = this.page;
    store.watch(["shown"], () => this.#show(store.get("shown")));
    store.watch(["compared"], () => this.#compare(store.get("compared")));
    store.watch(["up"], () => this.shown && this.#settle({ reframes: true }));
    store.watch(["layout"], () => {
      this.#relook();
      if (this.compared?.body) this.#look("fit");
    });
    store.watch(["colors", "errors", "selection"], () => this.painter.paint());
    store.watch(["neighbors"], () => {
      this.#guessLines([this.shown, this.compared]);
      this.#offerLines();
    });
    store.watch(["loading"], () => this.labels.setLoading(store.get("loading")));
    store.watch(["view"], () => this.#look(store.get("view").name));
    const drawn = [
      "frame",
      "colors",
      "errors",
      "selection",
      "trails",
      "contacts",
      "names",
      "follow",
      "playing",
    ];
    store.watch(drawn, () => this.view.ask());
  }

  // For tests

  async picture() {
    const { stagePicture } = await import("./capture.js");
    return stagePicture();
  }

  async film(options) {
    const { recordVideo } = await import("./capture.js");
    return recordVideo(this.page, options);
  }

  // Clips come and go

  async #show(clip) {
    this.shown?.close();
    this.shown = null;
    this.#dropCompared();
    this.labels.setPoint(null);
    if (clip === null) {
      this.#describe();
      this.view.ask();
      return;
    }
    const actor = new Actor(this.page.engine, clip, () => this.view.ask());
    this.labels.setLoading(clip.name);
    const isPrepared = await this.#prepared(actor);
    if (this.page.store.get("shown") !== clip) return void actor.close();
    this.labels.setLoading(this.page.store.get("loading"));
    if (!isPrepared) return void actor.close();
    this.shown = actor;
    this.#describe();
    this.#offerLines();
    if (actor.hasFigure) {
      this.#goToFirstSeen(actor);
      this.#settle({ reframes: true, atOnce: true });
      if (actor.samples.length < actor.clip.nFrames) this.#refine(actor);
      this.#guessLines([actor]);
    }
    const compared = this.page.store.get("compared");
    if (compared !== null) this.#compare(compared);
    this.view.draw();
    this.firstPicture ??= performance.now(); // ms since the page was asked for
  }

  /** Goes to the first frame with points where the very first has none. */
  async #goToFirstSeen(actor) {
    const { store } = this.page;
    const isOver = () => this.shown !== actor || store.get("frame") !== 0;
    if (!actor.poses.held(0)?.every(Number.isNaN)) return;
    const frame = await actor.firstSeen(isOver).catch(() => 0);
    if (!isOver() && frame > 0) store.set({ frame, view: { name: store.get("view").name } });
  }

  /** Offers lines where the names of markers say nothing of them. */
  #offerLines() {
    this.guess.hidden = !this.shown?.hasNoLines || this.page.store.get("neighbors");
  }

  async #prepared(actor) {
    try {
      await actor.prepare();
      return true;
    } catch (error) {
      this.page.store.set({ message: { text: `${error.name}: ${error.message}`, isFault: true } });
      return false;
    }
  }

  async #compare(clip) {
    this.#dropCompared();
    const { shown } = this;
    if (clip === null || shown === null || !shown.hasFigure) {
      this.painter.paint();
      this.view.ask();
      return;
    }
    const actor = new Actor(this.page.engine, clip, () => this.view.ask());
    const isGood = await this.#prepared(actor);
    if (
      !isGood ||
      !actor.hasFigure ||
      this.page.store.get("compared") !== clip ||
      this.shown !== shown
    ) {
      actor.close();
      return;
    }
    this.compared = actor;
    this.#relook();
    this.#guessLines([actor]);
  }

  /** Lines of markers without known names, where they are wanted; they come when they are found. */
  async #guessLines(actors) {
    const isWanted = () => this.page.store.get("neighbors");
    for (const actor of actors) {
      if (!actor?.hasNoLines || !actor.hasFigure) continue;
      const text = await actor.guessLines(isWanted()).catch(({ message }) => message);
      if (actor !== this.shown && actor !== this.compared) continue;
      if (!isWanted()) actor.neighbors = null;
      else if (text) this.page.store.set({ message: { text: `No lines: ${text}`, isFault: false } });
      this.#relook();
    }
  }

  /** The points of the compared clip that are chosen: those that the chosen ones are compared with. */
  chosenOther() {
    return this.pointErrors?.others(this.page.store.get("selection")) ?? [];
  }

  #dropCompared() {
    this.compared?.close();
    this.compared = null;
    this.pointErrors = null;
  }

  /** A long clip is looked at further, once it is seen. */
  async #refine(actor) {
    if (actor.samples.length > 20 && actor.clip.nFrames <= 3000) return;
    await actor.lookFurther();
    if (this.shown !== actor) return;
    const before = actor.floor;
    actor.place(this.up, actor.axes.scale);
    if (Math.abs(actor.floor - before) > 0.01) this.#layFloor();
    this.#followIfFar();
    this.view.ask();
  }

  /** Axes, size and floor of the clip that is shown, and its figure. */
  #settle({ reframes = false, atOnce = false } = {}) {
    const { shown } = this;
    this.up = upOf(shown.clip, this.page.store.get("up"));
    shown.place(this.up);
    this.#layFloor();
    this.usualSpeed = roundUp(shown.usualSpeed());
    this.#relook();
    this.#followIfFar();
    if (reframes) this.#look(this.page.store.get("view").name, atOnce);
  }

  #layFloor() {
    const { clip, size, axes, floor } = this.shown;
    const grid = gridOf(size, clip.unitCm);
    this.view.world.lay({ floor, minor: grid.minor * axes.scale, major: grid.major * axes.scale });
    this.gridText = `Grid ${grid.text}`;
    this.labels.setNote(this.gridText);
  }

  #followIfFar() {
    const { least, most } = this.shown.extent();
    const far = Math.max(most[0] - least[0], most[2] - least[2]);
    if (far > FAR * FIGURE) this.page.store.set({ follow: true });
  }

  /** Figures anew: how they look depends on how they are compared. */
  #relook() {
    const { shown, compared, view } = this;
    if (shown === null || !shown.hasFigure) return;
    const isOver = compared !== null && this.page.store.get("layout") === "overlay";
    view.world.scene.add(shown.build({ opacity: 1 }).group);
    this.pointErrors = null;
    if (compared !== null) {
      const ratio =
        shown.clip.unitCm && compared.clip.unitCm ? compared.clip.unitCm / shown.clip.unitCm : 1;
      compared.place(upOf(compared.clip, this.page.store.get("up")), shown.axes.scale * ratio);
      view.world.scene.add(compared.build({ opacity: isOver ? GHOST : 1 }).group);
      this.pointErrors = new PointErrors(shown, compared);
    }
    this.painter.paint();
    view.ask();
  }

  #describe() {
    const { clip } = this.shown ?? {};
    const noFigure = clip && !this.shown.hasFigure;
    this.#fault(noFigure ? whyNoFigure(clip) : "");
    this.view.world.grid.visible = !noFigure; // there is nothing to stand on it
    if (noFigure || !clip) this.labels.setNote("");
    this.view.canvas.setAttribute(
      "aria-label",
      clip
        ? `${clip.name}: ${clip.points.length} points, ${clip.nFrames} frames`
        : "Motion in three dimensions",
    );
  }

  // Pictures

  #beforeDrawing() {
    const { shown, compared } = this;
    const { store } = this.page;
    if (!shown?.body) return;
    const frame = store.get("frame");
    const ahead = store.get("playing") ? PREFETCH : 1;
    const places = shown.at(frame, ahead);
    if (places !== null) {
      if (shown.clip.isMarkers) shown.findLast(frame);
      this.#follow(places);
    }
    if (compared?.body) compared.at(frame * this.pointErrors.step, ahead);
    this.painter.paintNumbers(frame);
    if (places === null) {
      this.#tellFault(shown);
      return;
    }
    const chosen = store.get("selection");
    const aside = this.#aside();
    const other = aside.map((x) => -x);
    shown.body.move(places, { chosen, gone: this.painter.colors.gone, offset: aside });
    const ofOther = { chosen: this.chosenOther(), gone: this.painter.colors.gone, offset: other };
    compared?.body?.move(compared.places, ofOther);
    this.trails.draw(shown, store.get("trails") ? trailed(shown.clip, chosen) : [], frame, this.theme);
    this.#drawContacts(this.contacts, shown, frame);
    this.#drawContacts(this.contactsOfOther, compared, frame * (this.pointErrors?.step ?? 1));
    for (const { mesh } of [this.trails, this.contacts]) mesh.position.set(...aside);
    this.contactsOfOther.mesh.position.set(...other);
  }

  /** Rings on the one floor where the feet of an actor stand; none of no actor. */
  #drawContacts(rings, actor, frame) {
    const { store } = this.page;
    const isWanted = store.get("contacts") && actor?.body;
    const feet = isWanted ? actor.standing.at(frame, store.get("up")) : [];
    rings.draw(actor ?? this.shown, feet, { floor: this.shown.floor, theme: this.theme });
  }

  /** How far the figure that is shown stands aside; the other one stands as far on the other side. */
  #aside() {
    if (!this.compared?.body || this.page.store.get("layout") !== "side") return [0, 0, 0];
    const angle = this.shown.facing + BETWEEN;
    return [(-ASIDE / 2) * Math.cos(angle), 0, (ASIDE / 2) * Math.sin(angle)];
  }

  #tellFault({ poses }) {
    const { fault } = poses;
    if (fault === null || fault === this.told) return;
    this.told = fault;
    this.page.store.set({ message: { text: `${fault.name}: ${fault.message}`, isFault: true } });
  }

  /** Light and floor go with the figure, and the camera where it is to follow. */
  #follow(places) {
    const { least, most } = this.shown.bounds(places);
    const isEmpty = least[0] > most[0];
    this.labels.setNote(isEmpty ? "No point is visible in this frame" : this.gridText);
    if (isEmpty) return;
    const middle = least.map((x, k) => (x + most[k]) / 2);
    this.view.world.goWith(middle[0], middle[2]);
    if (this.page.store.get("follow") && this.middle) {
      const soft = this.page.store.get("playing") ? SOFT : 1;
      const way = middle.map((x, k) => (x - this.middle[k]) * (k === 1 ? soft * 0.3 : soft));
      this.view.eye.shift(...way);
      this.middle = this.middle.map((x, k) => x + way[k]);
      if (Math.hypot(...way) > 1e-4 && soft < 1) this.view.ask();
    } else {
      this.middle = middle;
    }
  }

  #look(name, atOnce = false) {
    const { shown, view } = this;
    if (!shown?.body) return;
    const frame = this.page.store.get("frame");
    const now = shown.at(frame, 1);
    const seen = now && shown.bounds(now);
    const figure = seen?.least.every(Number.isFinite) ? seen : shown.extent(); // markers may be gone
    const isFit = name === "fit";
    const box = isFit || this.page.store.get("follow") ? figure : shown.extent();
    const aside = this.#aside().map(Math.abs);
    const least = box.least.map((x, k) => x - aside[k]);
    const most = box.most.map((x, k) => x + aside[k]);
    least[1] = Math.min(least[1], shown.floor);
    if (!least.every(Number.isFinite)) return;
    this.middle = figure.least.map((x, k) => (x + figure.most[k]) / 2);
    view.eye.look({ least, most }, { name, facing: shown.facing, atOnce });
  }

  #afterDrawing() {
    const { shown } = this;
    this.labels.setFiles(shown?.body && this.compared?.body ? this.#fileLabels() : []);
    if (!shown?.body) return;
    const isOn = this.page.store.get("names");
    const { clientWidth: width, clientHeight: height } = this.element;
    if (isOn || this.labels.names.width > 1) {
      const projected = isOn ? this.projected() : null;
      const { skyLow } = this.theme;
      const color = this.theme === themeOf(true) ? "#dfe5ea" : "#2a3138";
      this.labels.drawNames(shown.clip.points, projected, {
        isOn,
        width,
        height,
        color,
        halo: skyLow,
      });
    }
  }

  /** The names of both files, each below its figure; the second below the first where they overlap. */
  #fileLabels() {
    const { store } = this.page;
    const { clientWidth: width, clientHeight: height } = this.element;
    const isOver = store.get("layout") === "overlay";
    const aside = this.#aside();
    const numbers = ["error", "speed"].includes(store.get("colors"));
    return [this.shown, this.compared].map((actor, k) => {
      const { least, most } = actor.bounds(actor.body.places);
      const x = (least[0] + most[0]) / 2;
      const z = (least[2] + most[2]) / 2;
      const offset = k === 0 ? aside : aside.map((side) => -side);
      const foot = [x, this.shown.floor, z];
      const size = { width, height, offset };
      const [left, top] = project(foot, this.view.eye.camera, size, new Float32Array(3));
      return {
        text: nameOf(store, actor.clip),
        color: k === 1 && isOver && !numbers ? this.theme.ghost : this.theme.center,
        x: left,
        y: Math.min(top + BELOW, height - 2 * LINE) + (k === 1 && isOver ? LINE : 0),
      };
    });
  }

  /** Where the points are on the canvas, in pixels; the third number is their depth. */
  projected() {
    const { clientWidth: width, clientHeight: height } = this.element;
    const places = this.shown.body.places;
    const out = new Float32Array(places.length);
    return project(places, this.view.eye.camera, { width, height, offset: this.#aside() }, out);
  }
}

function whyNoFigure({ nFrames, name }) {
  if (nFrames === 0) return `${name} has no frames.`;
  return `${name} has no figure, because its channels give no positions. Its curves are below.`;
}
