// The playground: triangles with corners to drag, their soft image, and the gradient of every pixel.

import { channels, cleared, colours, scheduled } from "./canvas.js";
import { softness as softnessChart } from "./charts.js";
import { coverage, pixels } from "./images.js";
import * as link from "./link.js";
import { fill } from "./softness.js";

const SIZE = 200; // pixels of the image
const GRID = 50; // of the gradients
const ARROWS = 16; // a side
const REACH = 0.6; // of the chart, in NDC
const START = [[-0.55, -0.5], [0.6, -0.35], [-0.05, 0.6], [0.75, 0.5], [-0.3, 0.35], [0.35, -0.7]];
const PIXEL = [0.45, 0.15];
const CONORMS = { probabilistic: null, einstein: null, hamacher: 0.5, frank: 2, yager: 2, aczel_alsina: 2, dombi: 1, schweizer_sklar: -1 };

export class Playground {
  constructor(section, { engine, names, say }) {
    Object.assign(this, { section, engine, say });
    const find = (selector) => section.querySelector(selector);
    this.inputs = Object.fromEntries([...section.querySelectorAll("[data-play]")].map((input) => [input.dataset.play, input]));
    fill(this.inputs.name, { preset: [], families: names.families, learned: names.learned.filter((name) => !name.endsWith("-surrogate")) });
    this.inputs.conorm.append(...Object.keys(CONORMS).map((name) => new Option(name.replaceAll("_", "-"), name)));
    this.canvases = Object.fromEntries([...section.querySelectorAll("[data-is]")].map((canvas) => [canvas.dataset.is, canvas]));
    this.status = find(".status");
    this.corners = START.map((corner) => [...corner]);
    this.pixel = [...PIXEL];
    this.handles = [...section.querySelectorAll(".stage")].map((stage) => this.#handlesOn(stage));
    find("form").addEventListener("submit", (event) => event.preventDefault());
    find("form").addEventListener("input", (event) => {
      if (event.target === this.inputs.conorm) this.inputs.p.value = CONORMS[this.inputs.conorm.value] ?? "";
      this.#shown();
      this.ask();
    });
    this.inputs.reset.addEventListener("click", () => {
      this.settings = {};
      this.ask();
    });
    this.inputs.link.addEventListener("click", async () => {
      this.#write();
      this.status.textContent = await link.copy();
    });
    this.draw = scheduled(() => this.#draw());
    new ResizeObserver(() => this.draw()).observe(find(".results"));
  }

  /** Settings as the address has them. */
  set settings(told) {
    const { inputs } = this;
    inputs.name.value = told.softness ?? "logistic";
    if (inputs.name.selectedIndex < 0) inputs.name.value = "logistic";
    inputs.width.value = Math.log10(link.number(told.width, 0.08, [10 ** -2.5, 0.5]));
    inputs.squared.checked = told.squared === "true";
    inputs.count.value = told.count === "2" ? "2" : "1";
    inputs.conorm.value = told.conorm in CONORMS ? told.conorm : "probabilistic";
    inputs.p.value = link.number(told.p, CONORMS[inputs.conorm.value], [-100, 100]) ?? "";
    const places = (told.at ?? "").split(",").map(Number);
    const isWhole = places.length === 14 && places.every((x) => Math.abs(x) <= 1);
    const all = isWhole ? places : [...START, PIXEL].flat();
    this.corners = START.map((_, k) => [all[2 * k], all[2 * k + 1]]);
    this.pixel = [all[12], all[13]];
    this.#shown();
  }

  #write() {
    const { inputs } = this;
    const at = [...this.corners, this.pixel].flat().map((x) => x.toFixed(3)).join(",");
    link.write({ tab: "play", softness: inputs.name.value, width: this.#width, squared: inputs.squared.checked, count: inputs.count.value, conorm: inputs.conorm.value, p: inputs.p.value, at }, { softness: "logistic", squared: false, count: 1, conorm: "probabilistic" });
  }

  get #width() {
    return Number((10 ** Number(this.inputs.width.value)).toPrecision(3));
  }

  get #count() {
    return Number(this.inputs.count.value);
  }

  /** Opens the tab. */
  async enter() {
    this.#shown();
    await this.ask();
  }

  #shown() {
    const hasParameter = CONORMS[this.inputs.conorm.value] !== null;
    this.section.querySelector("[data-for=p]").hidden = !hasParameter;
    this.inputs.width.nextElementSibling.textContent = `${(this.#width * SIZE / 2).toFixed(1)} px`;
    for (const handles of this.handles) handles.forEach((handle, k) => (handle.hidden = k < 6 && k >= 3 * this.#count));
    this.#place();
  }

  /** Buttons that stand on the corners and on the pixel; they are dragged, or moved by arrow keys. */
  #handlesOn(stage) {
    return Array.from({ length: 7 }, (_, k) => {
      const name = k < 6 ? `Corner ${(k % 3) + 1}${k < 3 ? "" : " of the second triangle"}` : "Pixel";
      const handle = Object.assign(document.createElement("button"), { type: "button", className: `handle${k === 6 ? " pixel" : k > 2 ? " second" : ""}` });
      handle.setAttribute("aria-label", `${name}; drag it, or use the arrow keys`);
      const to = (x, y) => {
        const place = [x, y].map((value) => Math.max(-1, Math.min(1, value)));
        if (k < 6) this.corners[k] = place;
        else this.pixel = place;
        this.#place();
        this.ask();
      };
      handle.addEventListener("pointerdown", (event) => handle.setPointerCapture(event.pointerId));
      handle.addEventListener("pointermove", (event) => {
        if (!handle.hasPointerCapture(event.pointerId)) return;
        const box = stage.getBoundingClientRect();
        to((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
      });
      handle.addEventListener("keydown", (event) => {
        const by = { ArrowLeft: [-0.02, 0], ArrowRight: [0.02, 0], ArrowUp: [0, 0.02], ArrowDown: [0, -0.02] }[event.key];
        if (!by) return;
        event.preventDefault();
        const [x, y] = k < 6 ? this.corners[k] : this.pixel;
        to(x + by[0], y + by[1]);
      });
      stage.append(handle);
      return handle;
    });
  }

  #place() {
    const places = [...this.corners, this.pixel];
    for (const handles of this.handles) {
      handles.forEach((handle, k) => {
        handle.style.left = `${50 * (1 + places[k][0])}%`;
        handle.style.top = `${50 * (1 - places[k][1])}%`;
      });
    }
  }

  /** Asks for the picture; while it is drawn, later changes wait, and only the last of them counts. */
  async ask() {
    if (this.asks) {
      this.later = true;
      return;
    }
    this.asks = true;
    do {
      this.later = false;
      try {
        await this.#ask();
        this.say("");
      } catch (error) {
        this.say(error.message);
        if (error.fault) this.engine.renew();
      }
    } while (this.later);
    this.asks = false;
    this.draw();
  }

  async #ask() {
    const { inputs } = this;
    const count = this.#count;
    const choice = { name: inputs.name.value, squared: inputs.squared.checked, first: this.#width, last: this.#width };
    const name = inputs.conorm.value;
    const t_conorm = CONORMS[name] === null ? name : `${name}:${inputs.p.value}`;
    const triangles = [0, 3].slice(0, count).map((k) => this.corners.slice(k, k + 3));
    const scene = { triangles, softness: choice, width: this.#width, t_conorm, size: SIZE, grid: GRID };
    await this.engine.ready;
    const { image, gradient } = await this.engine.ask("draw", { scene });
    const curve = await this.engine.ask("curve", { choice, task: "pose", progress: 0, size: SIZE, reach: REACH, count: 241 });
    this.drawn = { image, gradient, count, curve };
    this.draw();
  }

  #draw() {
    if (this.section.hidden || !this.drawn) return;
    const { image, count, curve } = this.drawn;
    const palette = colours();
    const { context, width } = coverage(this.canvases.image, SIZE, (k) => image[k]);
    this.#outlines(context, width, palette);
    this.#pull(context, width, palette);
    this.#field(palette);
    softnessChart(this.canvases.curve, { curves: [{ colour: "a", values: curve.curves[0], dash: [] }], reach: (REACH * SIZE) / 2 });
    const at = this.#numberAt(SIZE);
    const strength = Math.hypot(...this.#moved(this.#numberAt(GRID), count));
    this.status.textContent = `The pixel is covered by ${(100 * image[at]).toFixed(1)} %; moving the triangle by 1 px changes that by up to ${((100 * strength * 2) / SIZE).toFixed(2)} %.`;
  }

  /** Number of the chosen pixel in an image of `size`. */
  #numberAt(size) {
    const [column, row] = [1 + this.pixel[0], 1 - this.pixel[1]].map((x) => Math.min(size - 1, Math.floor((x * size) / 2)));
    return row * size + column;
  }

  /** Derivative of a pixel's coverage by moving all triangles, [x, y]. */
  #moved(k, count, only = null) {
    const { gradient } = this.drawn;
    const sum = [0, 0];
    for (let corner = 0; corner < 3 * count; corner++) {
      if (only !== null && Math.floor(corner / 3) !== only) continue;
      for (const axis of [0, 1]) sum[axis] += gradient[(k * 3 * count + corner) * 2 + axis];
    }
    return sum;
  }

  #outlines(context, width, palette) {
    const at = ([x, y]) => [((1 + x) * width) / 2, ((1 - y) * width) / 2];
    context.lineWidth = 1.5;
    for (let triangle = 0; triangle < this.drawn.count; triangle++) {
      context.strokeStyle = triangle ? palette.b : palette.a;
      context.beginPath();
      for (const corner of this.corners.slice(3 * triangle, 3 * triangle + 3)) context.lineTo(...at(corner));
      context.closePath();
      context.stroke();
    }
  }

  /** Arrows at the corners: where each would go to cover the chosen pixel more. */
  #pull(context, width, palette) {
    const { gradient, count } = this.drawn;
    const k = this.#numberAt(GRID);
    const pulls = Array.from({ length: 3 * count }, (_, corner) => [0, 1].map((axis) => gradient[(k * 3 * count + corner) * 2 + axis]));
    const most = Math.max(...pulls.map((pull) => Math.hypot(...pull)));
    if (!(most > 1e-6)) return;
    pulls.forEach(([x, y], corner) => {
      const from = [((1 + this.corners[corner][0]) * width) / 2, ((1 - this.corners[corner][1]) * width) / 2];
      arrow(context, from, [(0.22 * width * x) / most, (-0.22 * width * y) / most], palette.miss, 2.5);
    });
  }

  /** How strong the gradient of each pixel is, and which way it pulls each triangle. */
  #field(palette) {
    const { count } = this.drawn;
    const lengths = Array.from({ length: GRID * GRID }, (_, k) => Math.hypot(...this.#moved(k, count)));
    const most = Math.max(...lengths, 1e-9);
    const [from, to] = [channels(palette.panel), channels(palette.quiet)];
    const { context, width } = pixels(this.canvases.field, GRID, (k) => {
      const level = 0.75 * Math.sqrt(lengths[k] / most);
      return from.map((x, j) => x + level * (to[j] - x));
    });
    this.#outlines(context, width, palette);
    for (let row = 0; row < ARROWS; row++) {
      for (let column = 0; column < ARROWS; column++) {
        const [x, y] = [column, row].map((k) => Math.floor(((k + 0.5) * GRID) / ARROWS));
        for (let triangle = 0; triangle < count; triangle++) {
          const pull = this.#moved(y * GRID + x, count, triangle);
          const length = Math.hypot(...pull);
          if (length < 1e-3 * most) continue;
          const times = ((0.9 * width) / ARROWS) * Math.sqrt(length / most) / length;
          const middle = [((x + 0.5) * width) / GRID, ((y + 0.5) * width) / GRID];
          arrow(context, middle, [times * pull[0], -times * pull[1]], triangle ? palette.b : palette.a, 1.3);
        }
      }
    }
  }
}

function arrow(context, [x, y], [dx, dy], colour, width) {
  const length = Math.hypot(dx, dy);
  if (length < 1) return;
  const head = Math.min(8, 0.4 * length);
  const [ux, uy] = [dx / length, dy / length];
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x + dx, y + dy);
  for (const side of [-0.6, 0.6]) {
    context.moveTo(x + dx, y + dy);
    context.lineTo(x + dx - head * (ux - side * uy), y + dy - head * (uy + side * ux));
  }
  context.stroke();
}
