// Colors of the figures on the stage, and the scale beside them where colors are numbers.

import { figure } from "../ui/text.js";
import { alike, byNumber, bySide, palette } from "./painting.js";

export class Painter {
  #stage;
  #isNumbers = false;

  /** @param {object} stage see stage.js: its `shown`, `compared` and `pointErrors` are painted */
  constructor(stage) {
    this.#stage = stage;
  }

  useTheme(theme) {
    this.theme = theme;
    this.colors = palette(theme);
  }

  /** Colors that stay from frame to frame. */
  paint() {
    const { shown, compared, page, labels } = this.#stage;
    if (!shown?.body) return;
    const { store } = page;
    const mode = store.get("colors");
    this.#isNumbers = (mode === "error" && compared !== null) || mode === "speed";
    if (this.#isNumbers) return;
    shown.body.paint(bySide(shown.clip.points, this.colors), this.theme, store.get("selection"));
    if (compared?.body) {
      const isOver = store.get("layout") === "overlay";
      const colorOf = isOver ? alike(this.colors.ghost) : bySide(compared.clip.points, this.colors);
      compared.body.paint(colorOf, this.theme, this.#stage.chosenOther());
    }
    labels.setScale(null);
  }

  /** Colors that change from frame to frame. */
  paintNumbers(frame) {
    if (!this.#isNumbers) return;
    if (this.#stage.page.store.get("colors") === "speed") this.#paintSpeeds(frame);
    else this.#paintErrors();
  }

  #paintSpeeds(frame) {
    const { shown, compared, page, labels, usualSpeed } = this.#stage;
    const speeds = shown.speeds(frame, new Float32Array(shown.clip.points.length));
    const chosen = page.store.get("selection");
    shown.body.paint(byNumber(speeds, usualSpeed, this.colors.gone), this.theme, chosen);
    compared?.body?.paint(alike(this.colors.ghost), this.theme, this.#stage.chosenOther());
    labels.setScale(["0", `${figure(usualSpeed)} ${shown.clip.unitCm === null ? "units/s" : "m/s"}`]);
  }

  #paintErrors() {
    const { shown, compared, page, labels, pointErrors } = this.#stage;
    if (!compared?.body || pointErrors === null) return;
    pointErrors.measure();
    const most = pointErrors.scaleEnd(page.store.get("errors"));
    const { ofShown, ofCompared, unit } = pointErrors;
    const chosen = page.store.get("selection");
    shown.body.paint(byNumber(ofShown, most, this.colors.center), this.theme, chosen);
    const others = this.#stage.chosenOther();
    compared.body.paint(byNumber(ofCompared, most, this.colors.center), this.theme, others);
    labels.setScale(["0", figure(most / 2, 3), `${figure(most)} ${unit}`]);
  }
}
