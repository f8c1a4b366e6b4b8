// A canvas as sharp as the screen, and the colors that style gives.

/** Sets a canvas to its size on the screen; gives its context, scaled to CSS pixels, and its size. */
export function sized(canvas) {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height, ratio };
}

const NAMES = ["ink", "quiet", "line", "accent", "fault", "left", "right", "surface", "back"];

/** The colors of the tokens of style.css as they are now, by name; `lines` are those of curves. */
export function palette(element) {
  const probe = document.createElement("span");
  probe.hidden = true;
  element.append(probe);
  const read = (name) => {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  };
  const colors = Object.fromEntries(NAMES.map((name) => [name, read(name)]));
  colors.lines = [1, 2, 3, 4, 5, 6].map((k) => read(`curve-${k}`));
  probe.remove();
  return colors;
}
