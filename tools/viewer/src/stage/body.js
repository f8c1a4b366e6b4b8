// A figure: bones and joints, or markers, as solids.

import { Color, Group, InstancedBufferAttribute } from "three";
import { ballShape, boneShape, headShape, setBall, setBone, solids } from "./instances.js";

const WIDTH = 0.073; // radius of a bone of length 1; shorter ones are thicker for their length
const TAPER = 0.6;
const THIN = 0.006; // least and greatest radius, in units of the picture
const THICK = 0.044;
const HEAD = /head/i;
const HEAD_WIDTH = [0.04, 0.075];
const LINE = 0.0055; // radius of a line between markers
const MARKER = 0.019;
const HEAD_LENGTH = 0.08; // at least
const CHOSEN = [1.55, 0.026]; // how much larger a chosen point is, and its least radius

/** What is drawn of a clip in one frame. */
export class Body {
  #bones;
  #heads;
  #balls;
  #radii; // of bones, then of balls
  #colors = [];

  /**
   * @param {{points: object[], isMarkers: boolean}} clip
   * @param {{bones: number[][], loose: Set<number>}} anatomy see anatomy.js
   * @param {Float32Array} places of some frame, in units of the picture, from which lengths come
   * @param {{opacity?: number}} look
   */
  constructor(clip, { bones, loose }, places, look = {}) {
    this.clip = clip;
    this.group = new Group();
    this.places = new Float32Array(clip.points.length * 3).fill(NaN);
    this.last = new Float32Array(clip.points.length * 3).fill(NaN); // where points were seen last
    this.loose = loose;
    const heads = clip.isMarkers ? [] : headsOf(bones, clip.points, places);
    this.bones = [...bones.filter((bone) => !heads.includes(bone)), ...heads];
    this.nHeads = heads.length;
    this.#bones = solids(boneShape(), this.bones.length - heads.length, look);
    this.#heads = solids(headShape(), heads.length, look);
    this.#balls = solids(ballShape(), clip.points.length, look);
    for (const mesh of this.#meshes()) {
      mesh.instanceColor = new InstancedBufferAttribute(
        new Float32Array(3 * mesh.instanceMatrix.count).fill(1),
        3,
      );
      this.group.add(mesh);
    }
    this.#measure(places);
  }

  #meshes() {
    return [this.#bones, this.#heads, this.#balls];
  }

  /** The solid of a bone: which one of which kind. */
  #solid(i) {
    const nBones = this.bones.length - this.nHeads;
    return i < nBones ? [this.#bones, i] : [this.#heads, i - nBones];
  }

  #measure(places) {
    const { points, isMarkers } = this.clip;
    const ofBones = this.bones.map(([a, b], i) => {
      if (isMarkers) return LINE;
      const length = distance(places, a, b);
      if (i >= this.bones.length - this.nHeads) return within(0.42 * length, ...HEAD_WIDTH);
      return within(WIDTH * length ** TAPER, THIN, Math.min(THICK, 0.3 * length));
    });
    const ofBalls = points.map(() => (isMarkers ? MARKER : 0));
    if (!isMarkers) {
      this.bones.forEach(([a, b], i) => {
        const radius = Math.min(ofBones[i], THICK);
        ofBalls[a] = Math.max(ofBalls[a], 0.66 * radius);
        ofBalls[b] = Math.max(ofBalls[b], (HEAD.test(points[b].name) ? 0.3 : 0.6) * radius);
      });
    }
    const isDrawn = (point) => !this.loose.has(point);
    this.#radii = {
      ofBones,
      ofBalls: ofBalls.map((radius, point) => (isDrawn(point) ? Math.max(radius, THIN) : 0)),
    };
  }

  radius(point) {
    return this.#radii.ofBalls[point];
  }

  /**
   * @param {(point: number) => number[]} colorOf red, green, blue of each point
   * @param {number[]} chosen points
   */
  paint(colorOf, theme, chosen) {
    const color = new Color();
    const write = ([mesh, index], rgb) => mesh.instanceColor.setXYZ(index, rgb[0], rgb[1], rgb[2]);
    const special = color.set(theme.chosen).toArray();
    this.#colors = this.clip.points.map((_, point) =>
      chosen.includes(point) ? special : colorOf(point),
    );
    this.bones.forEach(([a, b], i) => write(this.#solid(i), this.#boneColor(a, b, colorOf)));
    this.#colors.forEach((rgb, point) => write([this.#balls, point], rgb));
    for (const mesh of this.#meshes()) mesh.instanceColor.needsUpdate = true;
  }

  /** A bone belongs to the point it leads to; a line between markers of two sides to neither. */
  #boneColor(a, b, colorOf) {
    const { points, isMarkers } = this.clip;
    if (!isMarkers || points[a].side === points[b].side) return colorOf(b);
    return colorOf(points[a].side === "center" ? a : b);
  }

  /** Moves the figure to where its points are; `offset` moves it aside. */
  move(places, { chosen = [], gone, offset = [0, 0, 0] }) {
    this.places.set(places);
    const balls = this.#balls.instanceMatrix.array;
    const { ofBalls, ofBones } = this.#radii;
    for (let point = 0; point < ofBalls.length; point++) {
      const k = 3 * point;
      const isThere = !Number.isNaN(places[k]);
      if (isThere) for (let axis = 0; axis < 3; axis++) this.last[k + axis] = places[k + axis];
      const from = isThere ? places : this.last;
      const grown = radiusOf(ofBalls[point], isThere, chosen.includes(point));
      const isAnywhere = !Number.isNaN(from[k]);
      setBall(
        balls,
        point,
        from[k] || 0,
        from[k + 1] || 0,
        from[k + 2] || 0,
        isAnywhere ? grown : 0,
      );
      const rgb = isThere ? this.#colors[point] : gone;
      if (rgb) this.#balls.instanceColor.setXYZ(point, rgb[0], rgb[1], rgb[2]);
    }
    this.bones.forEach(([a, b], i) => {
      const [mesh, index] = this.#solid(i);
      setBone(mesh.instanceMatrix.array, index, places, a, b, ofBones[i]);
    });
    this.#balls.instanceColor.needsUpdate = true;
    for (const mesh of this.#meshes()) mesh.instanceMatrix.needsUpdate = true;
    this.group.position.set(...offset);
  }

  dispose() {
    for (const mesh of this.#meshes()) {
      mesh.geometry.dispose();
      mesh.material.dispose();
      mesh.dispose();
    }
    this.group.removeFromParent();
  }
}

function radiusOf(radius, isThere, isChosen) {
  if (isChosen) return Math.max(CHOSEN[0] * radius, CHOSEN[1]);
  return isThere ? radius : 0.7 * radius;
}

const within = (value, least, most) => Math.max(least, Math.min(most, value));

function distance(places, a, b) {
  return Math.hypot(...[0, 1, 2].map((k) => places[3 * a + k] - places[3 * b + k]));
}

/** Bones that lead to a head and no further. */
function headsOf(bones, points, places) {
  const starts = new Set(bones.map(([a]) => a));
  const isLong = (a, b) => distance(places, a, b) > HEAD_LENGTH;
  return bones
    .filter(([a, b]) => HEAD.test(points[b].name) && !starts.has(b) && isLong(a, b))
    .slice(0, 1);
}
