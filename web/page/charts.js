// Line charts on a canvas.

import { cleared, colours } from "./canvas.js";

const LEFT = 40;
const BOTTOM = 22;
const TOP = 8;
const RIGHT = 10;

/** The axes of a chart; `x` and `y` are [least, largest], and a logarithmic axis has `log`. Gives what places points. */
function axes(canvas, { x, y, log, xTicks, yTicks }) {
  const palette = colours();
  const { context, width, height } = cleared(canvas);
  const scale = (value) => (log ? Math.log10(Math.max(value, 1e-12)) : value);
  const [low, high] = y.map(scale);
  const px = (value) => LEFT + ((value - x[0]) / (x[1] - x[0] || 1)) * (width - LEFT - RIGHT);
  const py = (value) => height - BOTTOM - ((Math.max(scale(value), low) - low) / (high - low || 1)) * (height - BOTTOM - TOP);
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = palette.quiet;
  context.strokeStyle = palette.line;
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const [value, text] of yTicks) {
    const at = Math.round(py(value)) + 0.5;
    context.beginPath();
    context.moveTo(LEFT, at);
    context.lineTo(width - RIGHT, at);
    context.stroke();
    context.fillText(text, LEFT - 5, at);
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  xTicks.forEach(([value, text], k) => {
    if (k === xTicks.length - 1) context.textAlign = "right";
    context.fillText(text, Math.min(px(value) + (k === xTicks.length - 1 ? 8 : 0), width - 4), height - BOTTOM + 6);
  });
  return { context, px, py, palette };
}

function path(context, points, colour, dash = []) {
  context.strokeStyle = colour;
  context.lineWidth = 1.8;
  context.lineJoin = "round";
  context.setLineDash(dash);
  context.beginPath();
  points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
  context.setLineDash([]);
}

/** Values by step, a line for each of some runs: `lines` is [{ colour, values }]. */
export function overTime(canvas, { lines, steps, log, unit = "" }) {
  const values = lines.flatMap((line) => line.values).filter(Number.isFinite);
  let [low, high] = values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
  let yTicks;
  if (log) {
    low = 10 ** Math.floor(Math.log10(Math.max(low, 1e-5)));
    high = 10 ** Math.ceil(Math.log10(Math.max(high, 10 * low)));
    const powers = Math.round(Math.log10(high / low));
    yTicks = Array.from({ length: powers + 1 }, (_, k) => low * 10 ** k).map((value) => [value, short(value)]);
  } else {
    [low, high] = [0, nice(high)];
    yTicks = [0, 0.5, 1].map((share) => [share * high, short(share * high) + unit]);
  }
  const xTicks = [0, 0.5, 1].map((share) => [share * steps, String(Math.round(share * steps))]);
  const { context, px, py, palette } = axes(canvas, { x: [0, steps], y: [low, high], log, xTicks, yTicks });
  for (const { colour, values: line } of lines) {
    path(context, line.map((value, step) => [px(step), py(value)]), palette[colour]);
  }
}

/** Curves s(d): `curves` is [{ colour, values, dash }], over distances from -reach to reach in pixels. */
export function softness(canvas, { curves, reach }) {
  const yTicks = [[0, "0"], [0.5, "½"], [1, "1"]];
  const xTicks = [-1, -0.5, 0, 0.5, 1].map((share) => [share * reach, `${short(share * reach)}${share === 1 ? " px" : ""}`]);
  const { context, px, py, palette } = axes(canvas, { x: [-reach, reach], y: [0, 1], xTicks, yTicks });
  path(context, [[px(0), py(0)], [px(0), py(1)]], palette.line, [3, 3]);
  for (const { colour, values, dash } of curves) {
    const last = values.length - 1;
    path(context, values.map((value, k) => [px(reach * ((2 * k) / last - 1)), py(value)]), palette[colour], dash);
  }
}

/** The least of 1, 2 and 5 times a power of ten that is not below. */
function nice(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-9)));
  return [1, 2, 5, 10].find((factor) => factor * power >= value) * power;
}

function short(value) {
  if (value === 0) return "0";
  return Math.abs(value) < 0.001 ? value.toExponential(0) : String(Number(value.toPrecision(2)));
}
