// What motion leaves behind: trails of chosen points, and where feet stand.

import {
  Color,
  Group,
  InstancedMesh,
  InstancedBufferAttribute,
  MeshBasicMaterial,
  RingGeometry,
} from "three";
import { rateOf } from "../timeline/clock.js";
import { rodShape, setBone, solids } from "./instances.js";

const SECONDS = 1.5; // of a trail, before the frame and after it
const MOST = 1200; // pieces of all trails
const MOST_RINGS = 24;
const APART = 0.13; // of rings: of points that are nearer one has a ring

const MOST_TRAILS = 8;
const ENDS = /hand|wrist|foot|toe|ankle|head/i;

/** The points that leave a trail: the chosen ones, else hands and feet. */
export function trailed({ points }, chosen) {
  const ends = points.flatMap(({ name }, point) => (ENDS.test(name) ? [point] : []));
  return (chosen.length > 0 ? chosen : ends).slice(0, MOST_TRAILS);
}

export class Trails {
  constructor() {
    this.mesh = solids(rodShape(), MOST);
    this.mesh.castShadow = false;
    this.mesh.instanceColor = new InstancedBufferAttribute(new Float32Array(3 * MOST).fill(1), 3);
    this.mesh.count = 0;
  }

  /** @param {number[]} points @param {import("./actor.js").Actor} actor */
  draw(actor, points, frame, theme) {
    this.mesh.count = 0;
    if (points.length === 0) return;
    const { clip, poses, axes } = actor;
    const reach = Math.round(SECONDS * rateOf(clip));
    const from = Math.max(0, Math.floor(frame) - reach);
    const to = Math.min(clip.nFrames - 1, Math.floor(frame) + reach);
    const step = Math.max(1, Math.ceil(((to - from) * points.length) / MOST));
    const out = new Float32Array(clip.points.length * 3);
    const before = new Float32Array(6);
    const near = new Color(theme.chosen);
    const far = new Color(theme.gone);
    const color = new Color();
    for (const point of points) {
      before.fill(NaN);
      for (let at = from; at <= to && this.mesh.count < MOST; at += step) {
        const raw = poses.held(at);
        if (raw === null) {
          before.fill(NaN);
          continue;
        }
        axes.apply(raw, out);
        before.copyWithin(0, 3);
        before.set(out.subarray(3 * point, 3 * point + 3), 3);
        if (Number.isNaN(before[0]) || Number.isNaN(before[3])) continue;
        const away = Math.abs(at - frame) / reach;
        const index = this.mesh.count++;
        setBone(this.mesh.instanceMatrix.array, index, before, 0, 1, at > frame ? 0.003 : 0.0058);
        color
          .copy(near)
          .lerp(far, away)
          .toArray(this.mesh.instanceColor.array, 3 * index);
      }
    }
    this.mesh.instanceMatrix.needsUpdate = true;
    this.mesh.instanceColor.needsUpdate = true;
  }
}

/** Rings on the floor below feet that stand. */
export class Contacts {
  constructor() {
    this.group = new Group();
    const material = new MeshBasicMaterial({ transparent: true, opacity: 0.85, depthWrite: false });
    const shape = new RingGeometry(0.055, 0.075, 32);
    shape.rotateX(-Math.PI / 2);
    this.mesh = new InstancedMesh(shape, material, MOST_RINGS);
    const colors = new Float32Array(3 * MOST_RINGS).fill(1);
    this.mesh.instanceColor = new InstancedBufferAttribute(colors, 3);
    this.mesh.frustumCulled = false;
    this.mesh.count = 0;
  }

  /** @param {{point: number, side: string}[]} feet that stand */
  draw({ places }, feet, { floor, theme }) {
    this.mesh.count = 0;
    const color = new Color();
    const taken = [];
    feet.forEach(({ point, side }) => {
      const k = 3 * point;
      if (this.mesh.count >= MOST_RINGS || Number.isNaN(places[k])) return;
      if (taken.some(([x, z]) => Math.hypot(x - places[k], z - places[k + 2]) < APART)) return;
      taken.push([places[k], places[k + 2]]);
      const index = this.mesh.count++;
      const array = this.mesh.instanceMatrix.array;
      array.fill(0, 16 * index, 16 * index + 16);
      for (const at of [0, 5, 10, 15]) array[16 * index + at] = 1;
      array.set([places[k], floor + 0.004, places[k + 2]], 16 * index + 12);
      color.set(theme[side]).toArray(this.mesh.instanceColor.array, 3 * index);
    });
    this.mesh.instanceMatrix.needsUpdate = true;
    this.mesh.instanceColor.needsUpdate = true;
  }
}
