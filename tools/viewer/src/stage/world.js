// What is around a figure: sky, floor with a grid, light and shadow.

import {
  CanvasTexture,
  Color,
  DirectionalLight,
  HemisphereLight,
  Mesh,
  PlaneGeometry,
  Scene,
  ShaderMaterial,
  ShadowMaterial,
  SRGBColorSpace,
} from "three";

const REACH = 9; // units of the picture over which the grid fades
const SHADOW = 1.6; // half of the side of the square that has a shadow

const GRID_VERTEX = `
varying vec2 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const GRID_FRAGMENT = `
varying vec2 place;
uniform vec2 middle;
uniform float minor;
uniform float major;
uniform float reach;
uniform vec3 color;
uniform vec3 ground;
float lines(float every, float width) {
  vec2 at = place / every;
  vec2 edge = fwidth(at);
  vec2 away = abs(fract(at - 0.5) - 0.5) / max(edge, 1e-6);
  vec2 line = clamp(width + 0.5 - away, 0.0, 1.0) * clamp(0.35 / max(edge, 1e-6), 0.0, 1.0);
  return max(line.x, line.y);
}
void main() {
  float far = length(place - middle) / reach;
  float fade = 1.0 - smoothstep(0.05, 1.0, far);
  float near = 1.0 - smoothstep(0.0, 0.45, far);
  float line = max(lines(minor, 0.25) * 0.22 * near, lines(major, 0.5) * 0.5);
  float base = 0.55 * (1.0 - smoothstep(0.0, 0.8, far));
  float alpha = max(line, base) * fade;
  if (alpha < 0.004) discard;
  gl_FragColor = vec4(mix(ground, color, line / max(line + base * 0.2, 1e-4)), alpha);
  #include <colorspace_fragment>
}`;

export class World {
  constructor() {
    this.scene = new Scene();
    this.ambient = new HemisphereLight("#ffffff", "#8a8f96", 1);
    this.sun = new DirectionalLight("#ffffff", 1);
    this.#makeShadow();
    this.grid = new Mesh(new PlaneGeometry(2 * REACH, 2 * REACH), gridMaterial());
    this.shadow = new Mesh(
      new PlaneGeometry(2 * SHADOW, 2 * SHADOW),
      new ShadowMaterial({ opacity: 0.25 }),
    );
    for (const plane of [this.grid, this.shadow]) plane.rotation.x = -Math.PI / 2;
    this.grid.renderOrder = -2;
    this.shadow.renderOrder = -1;
    this.shadow.receiveShadow = true;
    this.shadow.material.depthWrite = false;
    this.scene.add(this.ambient, this.sun, this.sun.target, this.grid, this.shadow);
    this.floor = 0;
  }

  #makeShadow() {
    const { shadow } = this.sun;
    this.sun.castShadow = true;
    shadow.mapSize.set(1024, 1024);
    Object.assign(shadow.camera, {
      left: -SHADOW,
      right: SHADOW,
      top: SHADOW,
      bottom: -SHADOW,
      near: 0.5,
      far: 12,
    });
    shadow.radius = 5;
    shadow.bias = -0.0015;
  }

  /** Colors of a theme. */
  paint(theme) {
    this.scene.background?.dispose?.();
    this.scene.background = skyTexture(theme);
    this.ambient.intensity = theme.ambient;
    this.sun.intensity = theme.sun;
    this.shadow.material.opacity = theme.shadow;
    this.grid.material.uniforms.color.value.set(theme.grid);
    this.grid.material.uniforms.ground.value.set(theme.ground);
  }

  /** Lines of the floor, and where it is, in units of the picture. */
  lay({ floor, minor, major }) {
    this.floor = floor;
    this.grid.material.uniforms.minor.value = minor;
    this.grid.material.uniforms.major.value = major;
    this.grid.position.y = floor - 0.0015;
    this.shadow.position.y = floor;
  }

  /** Light, shadow and grid go with the figure, whose middle is at x, z. */
  goWith(x, z) {
    const { sun, grid, shadow, floor } = this;
    sun.position.set(x + 1.1, floor + 6, z + 1.3);
    sun.target.position.set(x, floor, z);
    grid.position.x = shadow.position.x = x;
    grid.position.z = shadow.position.z = z;
    grid.material.uniforms.middle.value.set(x, z);
  }
}

function gridMaterial() {
  return new ShaderMaterial({
    vertexShader: GRID_VERTEX,
    fragmentShader: GRID_FRAGMENT,
    transparent: true,
    depthWrite: false,
    uniforms: {
      middle: {
        value: {
          x: 0,
          y: 0,
          isVector2: true,
          set(x, y) {
            this.x = x;
            this.y = y;
          },
        },
      },
      minor: { value: 0.1 },
      major: { value: 1 },
      reach: { value: REACH },
      color: { value: new Color() },
      ground: { value: new Color() },
    },
  });
}

function skyTexture({ skyTop, skyLow }) {
  const canvas = document.createElement("canvas");
  canvas.width = 4;
  canvas.height = 256;
  const context = canvas.getContext("2d");
  const gradient = context.createLinearGradient(0, 0, 0, 256);
  gradient.addColorStop(0, skyTop);
  gradient.addColorStop(0.7, skyLow);
  gradient.addColorStop(1, skyLow);
  context.fillStyle = gradient;
  context.fillRect(0, 0, 4, 256);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}
