// The canvas: drawn when something has changed, and not otherwise.

import { PCFShadowMap, WebGLRenderer } from "three";
import { Camera } from "./camera.js";
import { World } from "./world.js";

const MOST_PIXELS = 2; // of the canvas for one of the page, along a side

export class View {
  #due = false;
  #lost = false;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} beforeDrawing
   * @throws {Error} where there is no WebGL
   */
  constructor(canvas, beforeDrawing) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: true,
      powerPreference: "high-performance",
    });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.world = new World();
    this.eye = new Camera(canvas, () => this.ask());
    this.beforeDrawing = beforeDrawing;
    this.afterDrawing = () => {};
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.#lost = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.#lost = false;
      this.ask();
    });
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(MOST_PIXELS, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.eye.resize(width, height);
    this.draw();
  }

  /** The picture is drawn soon. */
  ask() {
    if (this.#due) return;
    this.#due = true;
    requestAnimationFrame(() => {
      this.#due = false;
      this.draw();
    });
  }

  /** The picture is drawn now. */
  draw() {
    if (this.#lost) return;
    const begun = performance.now();
    this.beforeDrawing();
    const movesOn = this.eye.step(begun);
    this.renderer.render(this.world.scene, this.eye.camera);
    this.afterDrawing();
    this.took = performance.now() - begun; // ms of script
    this.count = (this.count ?? 0) + 1;
    if (movesOn) this.ask();
  }
}
