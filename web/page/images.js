// Square images of bytes or floats, drawn as pixels, and outlines of covered pixels.

import { channels, cleared, colours } from "./canvas.js";

/** Draws `size` × `size` pixels, whose colour as [red, green, blue] `of` says by their number. */
export function pixels(canvas, size, of) {
  const image = new ImageData(size, size);
  for (let k = 0; k < size * size; k++) {
    const [red, green, blue] = of(k);
    image.data.set([red, green, blue, 255], 4 * k);
  }
  const small = new OffscreenCanvas(size, size);
  small.getContext("2d").putImageData(image, 0, 0);
  const { context, width, height } = cleared(canvas);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, width, height);
  return { context, width, height };
}

/** A colour between two at a level from 0 to 1. */
const between = (from, to) => (level) => from.map((x, k) => x + level * (to[k] - x));

/** A coverage: nothing is the colour of the panel, all is that of ink. */
export function coverage(canvas, size, level) {
  const { panel, ink } = colours();
  const shade = between(channels(panel), channels(ink));
  return pixels(canvas, size, (k) => shade(level(k)));
}

/** The target, quietly, and the outline of an image over it. */
export function outlined(canvas, size, target, image, colour) {
  const { panel, quiet } = colours();
  const shade = between(channels(panel), channels(quiet));
  const { context, width } = pixels(canvas, size, (k) => shade((target[k] / 255) * 0.55));
  if (!image) return;
  context.lineWidth = 2;
  context.lineJoin = "round";
  context.strokeStyle = colour;
  context.beginPath();
  const times = width / size;
  const covered = (x, y) => x >= 0 && y >= 0 && x < size && y < size && image[y * size + x] > 127;
  for (let y = 0; y <= size; y++) {
    for (let x = 0; x <= size; x++) {
      const here = covered(x, y);
      if (here !== covered(x - 1, y)) line(context, times, [x, y], [x, y + 1]);
      if (here !== covered(x, y - 1)) line(context, times, [x, y], [x + 1, y]);
    }
  }
  context.stroke();
}

function line(context, times, from, to) {
  context.moveTo(from[0] * times, from[1] * times);
  context.lineTo(to[0] * times, to[1] * times);
}

/** Where two hard images are alike, and where only one of them covers. */
export function differences(canvas, size, target, image) {
  const palette = colours();
  const [panel, ink, miss, extra] = [palette.panel, palette.ink, palette.miss, palette.extra].map(channels);
  pixels(canvas, size, (k) => {
    const [wanted, drawn] = [target[k] > 127, image[k] > 127];
    if (wanted && drawn) return ink;
    return wanted ? miss : drawn ? extra : panel;
  });
}

/** The edges of loose triangles, whose corners in NDC are `theta`. */
export function triangles(canvas, theta, colour) {
  const { context, width } = cleared(canvas);
  const place = (k) => [(1 + theta[k]) * 0.5 * width, (1 - theta[k + 1]) * 0.5 * width];
  context.strokeStyle = colour;
  context.fillStyle = colour;
  context.lineWidth = 1;
  context.beginPath();
  for (let k = 0; k < theta.length; k += 6) {
    context.moveTo(...place(k));
    context.lineTo(...place(k + 2));
    context.lineTo(...place(k + 4));
    context.closePath();
  }
  context.globalAlpha = 0.15;
  context.fill();
  context.globalAlpha = 0.9;
  context.stroke();
}
