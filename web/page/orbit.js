// The mesh, the camera of the target and the cameras of runs, from outside. Dragging and arrow keys rotate the view.

import { channels, cleared, colours, scheduled } from "./canvas.js";

const START = { turn: 2.5, tilt: 0.42 };
const KEY = 0.12; // radians

export class OrbitView {
  constructor(canvas) {
    this.canvas = canvas;
    this.angles = { ...START };
    this.mesh = null;
    this.truth = null;
    this.cameras = [];
    this.draw = scheduled(() => this.#draw());
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) this.#turn(-event.movementX / 100, event.movementY / 100);
    });
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [KEY, 0], ArrowRight: [-KEY, 0], ArrowUp: [0, KEY], ArrowDown: [0, -KEY] }[event.key];
      if (!by) return;
      event.preventDefault();
      this.#turn(...by);
    });
  }

  #turn(turn, tilt) {
    this.angles.turn += turn;
    this.angles.tilt = Math.max(-1.5, Math.min(1.5, this.angles.tilt + tilt));
    this.draw();
  }

  /** What stands still: flat vertices and faces, and the camera of the target if it is known. */
  show({ positions, faces, truth }) {
    this.mesh = faces && { positions, faces, order: null };
    this.truth = truth;
    this.cameras = [];
    this.draw();
  }

  /** Cameras now, with the way behind them: [{ colour, camera, trail }]. */
  move(cameras) {
    this.cameras = cameras;
    this.draw();
  }

  #draw() {
    const palette = colours();
    const { context, width, height } = cleared(this.canvas);
    const eyes = [this.truth, ...this.cameras.map(({ camera }) => camera)].filter(Boolean).map(({ eye }) => Math.hypot(...eye));
    const extent = 1.12 * Math.max(1.6, ...eyes);
    const times = Math.min(width, height) / 2 / extent;
    const { turn, tilt } = this.angles;
    const [st, ct, su, cu] = [Math.sin(turn), Math.cos(turn), Math.sin(tilt), Math.cos(tilt)];
    const seen = (x, y, z) => {
      const [right, ahead] = [ct * x + st * z, -st * x + ct * z];
      return [width / 2 + times * right, height / 2 - times * (cu * y - su * ahead), cu * ahead + su * y];
    };
    this.#sphere(context, palette, seen, this.truth ? Math.hypot(...this.truth.eye) : Math.max(...eyes, 1.6));
    if (this.mesh) this.#faces(context, palette, seen);
    if (this.truth) camera(context, seen, this.truth, palette.ink, extent);
    for (const { colour, camera: now, trail } of this.cameras) {
      context.strokeStyle = palette[colour];
      context.globalAlpha = 0.55;
      context.lineWidth = 1.5;
      context.beginPath();
      trail.forEach((eye, k) => (eye && trail[k - 1] ? context.lineTo(...seen(...eye)) : context.moveTo(...seen(...(eye ?? [0, 0, 0])))));
      context.stroke();
      context.globalAlpha = 1;
      if (now) camera(context, seen, now, palette[colour], extent);
    }
  }

  /** Circles of a sphere, on which the camera of the target stands. */
  #sphere(context, palette, seen, radius) {
    context.strokeStyle = palette.line;
    context.lineWidth = 1;
    const circle = (place) => {
      context.beginPath();
      for (let k = 0; k <= 72; k++) context.lineTo(...seen(...place((k / 72) * 2 * Math.PI)).slice(0, 2));
      context.stroke();
    };
    for (const up of [-0.6, 0, 0.6]) {
      const ring = radius * Math.cos(up * 1.2);
      circle((a) => [ring * Math.cos(a), radius * Math.sin(up * 1.2), ring * Math.sin(a)]);
    }
    for (const turn of [0, Math.PI / 3, (2 * Math.PI) / 3]) {
      circle((a) => [radius * Math.cos(a) * Math.cos(turn), radius * Math.sin(a), radius * Math.cos(a) * Math.sin(turn)]);
    }
  }

  /** Faces from the back to the front, the lighter the more they are seen from the side. */
  #faces(context, palette, seen) {
    const { positions, faces } = this.mesh;
    const points = [];
    for (let k = 0; k < positions.length; k += 3) points.push(seen(positions[k], positions[k + 1], positions[k + 2]));
    const drawn = [];
    for (let k = 0; k < faces.length; k += 3) {
      const corners = [points[faces[k]], points[faces[k + 1]], points[faces[k + 2]]];
      const [a, b, c] = corners;
      const normal = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
      const sides = Math.hypot(b[0] - a[0], b[1] - a[1]) * Math.hypot(c[0] - a[0], c[1] - a[1]) || 1;
      drawn.push([a[2] + b[2] + c[2], corners, Math.abs(normal) / sides]);
    }
    drawn.sort((a, b) => b[0] - a[0]);
    const [far, near] = [palette.panel, palette.quiet].map(channels);
    context.lineWidth = 0.7;
    context.lineJoin = "round";
    for (const [, [a, b, c], facing] of drawn) {
      const level = 0.3 + 0.6 * facing;
      const shade = far.map((x, k) => Math.round(x + level * (near[k] - x)));
      context.fillStyle = context.strokeStyle = `rgb(${shade})`;
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.lineTo(c[0], c[1]);
      context.closePath();
      context.fill();
      // Without it the background shows between adjacent faces.
      context.stroke();
    }
  }
}

/** A pyramid that opens to where the camera looks. */
function camera(context, seen, { eye, ahead, up }, colour, extent) {
  const length = 0.16 * extent;
  const right = [1, 2, 0].map((i, k) => ahead[i] * up[(k + 2) % 3] - ahead[(k + 2) % 3] * up[i]);
  const corner = (x, y) => eye.map((e, k) => e + length * (ahead[k] + 0.45 * (x * right[k] + y * up[k])));
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => seen(...corner(x, y)));
  const tip = seen(...eye);
  context.strokeStyle = colour;
  context.fillStyle = colour;
  context.lineWidth = 1.8;
  context.lineJoin = "round";
  context.beginPath();
  corners.forEach((point, k) => (k ? context.lineTo(point[0], point[1]) : context.moveTo(point[0], point[1])));
  context.closePath();
  context.globalAlpha = 0.2;
  context.fill();
  context.globalAlpha = 1;
  for (const point of corners) {
    context.moveTo(tip[0], tip[1]);
    context.lineTo(point[0], point[1]);
  }
  context.stroke();
  context.beginPath();
  context.arc(tip[0], tip[1], 3, 0, 7);
  context.fill();
}
