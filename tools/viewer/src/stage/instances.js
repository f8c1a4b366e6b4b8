// Many solids of one shape, whose matrices are written as numbers.

import {
  CapsuleGeometry,
  DynamicDrawUsage,
  InstancedMesh,
  LatheGeometry,
  MeshLambertMaterial,
  SphereGeometry,
  Vector2,
} from "three";

/** A bone of length 1 along y and radius 1: thick near its start, thin at its end. */
export function boneShape() {
  const outline = [
    [0, 0],
    [0.45, 0.005],
    [0.72, 0.04],
    [0.95, 0.12],
    [1, 0.2],
    [0.9, 0.42],
    [0.66, 0.75],
    [0.5, 0.95],
    [0.3, 0.995],
    [0, 1],
  ].map(([x, y]) => new Vector2(x, y));
  return new LatheGeometry(outline, 14);
}

/** A head: an egg of length 1 along y and radius 1. */
export function headShape() {
  const shape = new SphereGeometry(1, 20, 16);
  shape.scale(1, 0.55, 1);
  shape.translate(0, 0.55, 0);
  return shape;
}

export const ballShape = () => new SphereGeometry(1, 20, 14);
export const rodShape = () => new CapsuleGeometry(1, 1, 2, 8);

export function solids(shape, count, { opacity = 1 } = {}) {
  const material = new MeshLambertMaterial({
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity === 1,
  });
  const mesh = new InstancedMesh(shape, material, Math.max(1, count));
  mesh.count = count;
  mesh.frustumCulled = false;
  mesh.castShadow = opacity === 1;
  mesh.instanceMatrix.setUsage(DynamicDrawUsage);
  return mesh;
}

/** A ball at x, y, z; of radius 0 it is not there. */
export function setBall(array, index, x, y, z, radius) {
  const at = 16 * index;
  array.fill(0, at, at + 16);
  array[at] = array[at + 5] = array[at + 10] = radius;
  array[at + 12] = x;
  array[at + 13] = y;
  array[at + 14] = z;
  array[at + 15] = 1;
}

/** A solid from one point to another: its y axis lies along them. Too short: it is not there. */
export function setBone(array, index, places, a, b, radius) {
  const at = 16 * index;
  const x = places[3 * a];
  const y = places[3 * a + 1];
  const z = places[3 * a + 2];
  const dx = places[3 * b] - x;
  const dy = places[3 * b + 1] - y;
  const dz = places[3 * b + 2] - z;
  const length = Math.sqrt(dx * dx + dy * dy + dz * dz);
  if (!(length > 1e-6)) {
    array.fill(0, at, at + 16);
    return;
  }
  // The first axis is at right angles to the bone, and to that of the world it is farthest from.
  let px = dy / length;
  let py = -dx / length;
  let pz = 0;
  if (Math.abs(dz) > 0.9 * length) {
    px = dz / length;
    py = 0;
    pz = -dx / length;
  }
  const size = Math.sqrt(px * px + py * py + pz * pz) / radius;
  px /= size;
  py /= size;
  pz /= size;
  array[at] = px;
  array[at + 1] = py;
  array[at + 2] = pz;
  array[at + 3] = 0;
  array[at + 4] = dx;
  array[at + 5] = dy;
  array[at + 6] = dz;
  array[at + 7] = 0;
  array[at + 8] = (py * dz - pz * dy) / length;
  array[at + 9] = (pz * dx - px * dz) / length;
  array[at + 10] = (px * dy - py * dx) / length;
  array[at + 11] = 0;
  array[at + 12] = x;
  array[at + 13] = y;
  array[at + 14] = z;
  array[at + 15] = 1;
}
