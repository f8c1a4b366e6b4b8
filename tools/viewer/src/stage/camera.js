// The camera: turned, moved and brought nearer by pointer, touch and keys; standard views.

import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const FIELD = 32; // degrees
const GLIDE = 260; // ms
const MARGIN = 1.12;
const LOW = 0.16; // radians above the floor of views from the side
const TURN = 0.12; // radians a key
const NEARER = 0.9;

/** Angles about the figure: from where it looks to, and up. */
const VIEWS = {
  "three-quarter": [0.6, 0.2],
  front: [0, LOW * 0.3],
  side: [Math.PI / 2, LOW * 0.3],
  top: [0, Math.PI / 2 - 0.001],
};

export class Camera {
  #glide = null;

  /** @param {() => void} onChange the picture is no longer what is seen */
  constructor(canvas, onChange) {
    this.camera = new PerspectiveCamera(FIELD, 1, 0.02, 200);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, {
      enableDamping: true,
      dampingFactor: 0.12,
      zoomToCursor: true,
      minDistance: 0.05,
      maxDistance: 80,
      screenSpacePanning: true,
    });
    this.onChange = onChange;
    this.touched = false; // somebody has turned it
    this.controls.addEventListener("change", onChange);
    this.controls.addEventListener("start", () => {
      this.touched = true;
      this.#glide = null;
    });
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  resize(width, height) {
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }

  /**
   * Looks at a box.
   *
   * @param {{least: number[], most: number[]}} box of the picture
   * @param {{name: string, facing: number, atOnce: boolean}} how `name` of a view, or "fit", which
   *   keeps the direction
   */
  look({ least, most }, { name, facing = 0, atOnce = false }) {
    const middle = new Vector3(...least.map((x, k) => (x + most[k]) / 2));
    const direction =
      name === "fit"
        ? this.#direction()
        : directionOf(VIEWS[name] ?? VIEWS["three-quarter"], facing);
    const distance = this.#distance({ least, most }, direction) * MARGIN;
    const position = middle.clone().addScaledVector(direction, distance);
    this.touched = false;
    const still = atOnce || matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (still) this.#set(position, middle);
    else this.#startGlide(position, middle);
    this.onChange();
  }

  /** How far away all corners of a box are seen. */
  #distance({ least, most }, direction) {
    const up = new Vector3(0, 1, 0);
    const right = new Vector3().crossVectors(up, direction);
    if (right.lengthSq() < 1e-4) right.set(1, 0, 0);
    right.normalize();
    const above = new Vector3().crossVectors(direction, right);
    const half = most.map((x, k) => (x - least[k]) / 2);
    const tall = Math.tan((FIELD * Math.PI) / 360);
    const wide = tall * this.camera.aspect;
    let distance = 0.3;
    for (let corner = 0; corner < 8; corner++) {
      const v = new Vector3(...half.map((x, k) => (corner & (1 << k) ? x : -x)));
      const depth = v.dot(direction);
      const needed = Math.max(Math.abs(v.dot(right)) / wide, Math.abs(v.dot(above)) / tall);
      distance = Math.max(distance, depth + needed);
    }
    return distance;
  }

  #direction() {
    return this.camera.position.clone().sub(this.controls.target).normalize();
  }

  #set(position, target) {
    this.#glide = null;
    this.controls.target.copy(target);
    this.camera.position.copy(position);
    this.controls.update();
  }

  #startGlide(position, target) {
    this.#glide = {
      begun: performance.now(),
      from: { position: this.camera.position.clone(), target: this.controls.target.clone() },
      to: { position, target },
    };
  }

  /** Moves the camera along with what it follows. */
  shift(x, y, z) {
    const way = new Vector3(x, y, z);
    this.camera.position.add(way);
    this.controls.target.add(way);
    if (this.#glide !== null) {
      for (const end of [this.#glide.from, this.#glide.to]) {
        end.position.add(way);
        end.target.add(way);
      }
    }
  }

  /** Before a picture is drawn. @returns {boolean} whether it moves on */
  step(now) {
    if (this.#glide !== null) {
      const { begun, from, to } = this.#glide;
      const part = Math.min(1, (now - begun) / GLIDE);
      const eased = 1 - (1 - part) ** 3;
      this.controls.target.lerpVectors(from.target, to.target, eased);
      this.camera.position.lerpVectors(from.position, to.position, eased);
      if (part === 1) this.#glide = null;
    }
    const moved = this.controls.update();
    return moved || this.#glide !== null;
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    const ways = { a: [-1, 0], d: [1, 0], w: [0, 1], s: [0, -1] };
    if (Object.hasOwn(ways, key)) this.#turnOrMove(ways[key], event.shiftKey);
    else if (key === "+" || key === "=") this.#zoom(NEARER);
    else if (key === "-" || key === "_") this.#zoom(1 / NEARER);
    else return;
    this.touched = true;
    event.preventDefault();
    this.onChange();
  }

  #turnOrMove([x, y], moves) {
    const { camera, controls } = this;
    const arm = camera.position.clone().sub(controls.target);
    if (moves) {
      const step = 0.06 * arm.length();
      const right = new Vector3().setFromMatrixColumn(camera.matrix, 0).multiplyScalar(x * step);
      const above = new Vector3().setFromMatrixColumn(camera.matrix, 1).multiplyScalar(y * step);
      controls.target.add(right).add(above);
      camera.position.add(right).add(above);
      return;
    }
    const angle = Math.asin(Math.max(-1, Math.min(1, arm.y / arm.length())));
    const turned = Math.max(-1.5, Math.min(1.5, angle + y * TURN));
    const about = Math.atan2(arm.x, arm.z) + x * TURN;
    camera.position
      .copy(controls.target)
      .addScaledVector(directionOf([about, turned], 0), arm.length());
  }

  #zoom(factor) {
    const { camera, controls } = this;
    camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
  }
}

function directionOf([about, above], facing) {
  const angle = facing + about;
  const level = Math.cos(above);
  return new Vector3(Math.sin(angle) * level, Math.sin(above), Math.cos(angle) * level);
}
