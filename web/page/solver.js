// A tab that solves a task: its controls, its pictures and charts.

import { OrbitView } from "./orbit.js";
import { scheduled } from "./canvas.js";
import { overTime, softness as softnessChart } from "./charts.js";
import { coverage, differences, outlined, triangles } from "./images.js";
import * as link from "./link.js";
import { Ended } from "./engine.js";
import { SoftnessPicker, USUAL, titled } from "./softness.js";

const SLOWLY = 100; // milliseconds a step
const LARGEST_FILE = 150e6; // bytes
const REACH = 0.15; // of the chart of a softness, in NDC
const RUNS = ["a", "b"];
const FOX = {}; // the mesh that the worker has by itself
const still = matchMedia("(prefers-reduced-motion: reduce)");
const REDUCED = 500; // milliseconds between pictures with reduced motion

export class Solver {
  /** `section` is its part of the page, `task` pose or shape, `usual` its settings. `say` shows an error, or nothing. */
  constructor(section, { task, usual, engine, names, say }) {
    Object.assign(this, { section, task, usual, engine, say, hasGpu: names.gpu });
    this.state = "new"; // new, preparing, ready, running, ended
    this.files = { mesh: null, picture: null };
    this.runs = [];
    const find = (selector) => section.querySelector(selector);
    this.inputs = Object.fromEntries([...section.querySelectorAll("[data-set]")].map((input) => [input.dataset.set, input]));
    this.status = find(".status");
    this.said = find("[data-is=said]");
    this.bar = find("progress");
    this.buttons = Object.fromEntries([...section.querySelectorAll("[data-do]")].map((button) => [button.dataset.do, button]));
    this.canvases = (of, is) => (of ? find(`[data-row=${of}] [data-is=${is}]`) : find(`[data-is=${is}]`));
    this.orbit = task === "pose" ? new OrbitView(this.canvases(null, "orbit")) : null;
    this.slider = find("[data-is=progress]");
    const changed = () => this.#changed();
    this.pickers = RUNS.map((run, k) => new SoftnessPicker(find(`[data-softness=${run}]`), k ? "Second softness" : "Softness", names, changed));
    this.draw = scheduled(() => this.#draw());
    this.drawLater = () => {
      if (!still.matches) return this.draw();
      this.waits ??= setTimeout(() => { this.waits = null; this.draw(); }, REDUCED);
    };
    find("form").addEventListener("submit", (event) => event.preventDefault());
    for (const [name, input] of Object.entries(this.inputs)) input.addEventListener("change", () => this.#set(name));
    for (const input of section.querySelectorAll("[data-open]")) {
      input.addEventListener("change", () => {
        if (input.files[0]) this.open(input.files[0], input.dataset.open);
        input.value = "";
      });
    }
    for (const [name, button] of Object.entries(this.buttons)) button.addEventListener("click", () => this.#do(name));
    this.slider.addEventListener("input", () => this.#curve());
    new ResizeObserver(() => this.draw()).observe(find(".results"));
    this.inputs.gpu.disabled = !names.gpu;
    find("[data-is=noGpu]").hidden = names.gpu;
  }

  /** Settings as the address has them; what it leaves out is as usual. */
  set settings(told) {
    const { usual, inputs } = this;
    const number = (name, range) => link.number(told[name], usual[name], range);
    this.#number("seed", Math.round(number("seed", [0, 2 ** 32 - 1])));
    this.#number("steps", Math.round(number("steps", [1, 2000])));
    if (inputs.triangles) this.#number("triangles", Math.round(number("triangles", [1, 1000])));
    inputs.size.value = told.size ?? usual.size;
    if (inputs.size.selectedIndex < 0) inputs.size.value = usual.size;
    const rate = link.number(told.rate, NaN, [1e-4, 100]);
    inputs.rate.value = Number.isNaN(rate) ? "" : rate;
    inputs.invert.checked = told.invert === "true";
    inputs.gpu.checked = told.gpu === "true" && this.hasGpu;
    inputs.compare.checked = told.with !== undefined;
    this.pickers.forEach((picker, k) => {
      const [name, end] = k ? ["with", "2"] : ["softness", ""];
      const width = (which) => link.number(told[which + end], USUAL[which], [1e-4, 1]);
      picker.value = { name: told[name] ?? (k ? "logistic" : USUAL.name), squared: told[`squared${end}`] === "true", first: width("first"), last: width("last") };
    });
    this.#compares();
    this.#shown();
  }

  #number(name, value) {
    this.inputs[name].value = value;
  }

  /** All settings of the run, as the address has them. */
  get settings() {
    const { inputs, files } = this;
    const [a, b] = this.pickers.map((picker) => picker.value);
    const family = (value, end) => (/^(preset$|learned:)/.test(value.name) ? {} : { [`first${end}`]: value.first, [`last${end}`]: value.last, [`squared${end}`]: value.squared });
    const own = { tab: this.task, seed: inputs.seed.value, steps: inputs.steps.value, size: inputs.size.value, rate: inputs.rate.value, softness: a.name, ...family(a, "") };
    if (inputs.triangles) own.triangles = inputs.triangles.value;
    if (inputs.invert.checked) own.invert = true;
    if (inputs.gpu.checked) own.gpu = true;
    if (inputs.mesh?.value === "file") own.mesh = files.mesh.name;
    if (inputs.target.value === "file") own.target = files.picture.name;
    return inputs.compare.checked ? { ...own, with: b.name, ...family(b, "2") } : own;
  }

  get #usualSettings() {
    return { ...this.usual, softness: USUAL.name, first: USUAL.first, last: USUAL.last, first2: USUAL.first, last2: USUAL.last, squared: false, squared2: false, rate: "" };
  }

  /** What the worker calls this. */
  get #kind() {
    return this.task === "pose" && this.inputs.target.value === "file" ? "mask" : this.task;
  }

  /** What the worker is asked, one for each softness. */
  get #asked() {
    const { inputs } = this;
    const whole = (input, [least, largest]) => Math.min(largest, Math.max(least, Math.round(Number(input.value) || 0)));
    const rate = Number(inputs.rate.value);
    const common = {
      seed: whole(inputs.seed, [0, 2 ** 32 - 1]),
      size: Number(inputs.size.value),
      steps: whole(inputs.steps, [1, 2000]),
      learning_rate: rate > 0 ? Math.min(rate, 100) : null,
    };
    if (inputs.triangles) common.triangles = whole(inputs.triangles, [1, 1000]);
    const pickers = inputs.compare.checked ? this.pickers : this.pickers.slice(0, 1);
    return pickers.map((picker) => ({ ...common, softness: picker.value }));
  }

  /** Opens the tab: it shows the start, and goes on from there if it `runs`; begins `anew` if its settings are others. */
  async enter({ runs, anew }) {
    this.#shown();
    if (anew || this.state === "new") await this.#restart(runs);
    this.draw();
    this.#curve();
  }

  /** Leaves the tab; the worker is free for another. */
  async leave() {
    if (this.state === "preparing") this.engine.renew();
    else if (this.state === "running") await this.engine.ask("stop").catch((error) => this.#fail(error));
    if (this.state !== "ended") this.state = "new";
    this.#show();
  }

  /** Takes a file that was dropped or chosen, a mesh or a picture. */
  async open(file, kind) {
    this.say("");
    try {
      if (file.size > LARGEST_FILE) throw new Error(`${file.name} has ${Math.round(file.size / 1e6)} MB, and this page opens at most ${LARGEST_FILE / 1e6}`);
      if (this.state === "preparing") this.engine.renew();
      this.state = "new";
      if (kind === "mesh") await this.#openMesh({ name: file.name, bytes: await file.arrayBuffer() });
      else await this.#openPicture(file);
    } catch (error) {
      this.#fail(error);
      return;
    }
    // A search from a mask is slow and starts only on request.
    await this.#restart(this.#kind !== "mask" && !still.matches);
  }

  async #openMesh(file) {
    const { faces, fileFaces } = await this.engine.give("mesh", file);
    this.files.mesh = file;
    this.#option("mesh", file.name);
    this.note = faces < fileFaces
      ? `${file.name} has ${fileFaces.toLocaleString("en")} faces; ${faces.toLocaleString("en")} are used, with near vertices merged. `
      : `${file.name}: ${faces.toLocaleString("en")} faces. `;
  }

  async #openPicture(blob) {
    const { width, height, reduced } = await this.engine.give("picture", { blob });
    this.files.picture = blob;
    this.#option("target", blob.name);
    this.note = `${blob.name}: ${width} × ${height} pixels${reduced ? `, reduced to ${reduced.join(" × ")}` : ""}. `;
  }

  /** Lets a file be chosen, and chooses it. */
  #option(name, title) {
    const select = this.inputs[name];
    const option = select.querySelector("[value=file]") ?? new Option("", "file");
    option.textContent = title;
    select.append(option);
    select.value = "file";
    this.#shown();
  }

  #set(name) {
    this.#compares();
    this.#shown();
    if (name === "slow") {
      if (this.state === "running") this.engine.ask("go", { pause: this.#pause }).catch((error) => this.#fail(error));
      return;
    }
    if (name === "mesh" || name === "target") this.note = "";
    this.#changed();
  }

  #compares() {
    const compare = this.inputs.compare.checked;
    for (const selector of ["[data-softness=b]", "[data-row=b]"]) this.section.querySelector(selector).hidden = !compare;
  }

  /** Shows the controls that mean something. */
  #shown() {
    const isMask = this.#kind === "mask";
    const show = (selector, shown) => {
      const element = this.section.querySelector(selector);
      if (element) element.hidden = !shown;
    };
    if (this.task === "pose") {
      show("[data-for=seed]", !isMask);
      show("[data-for=picture]", isMask);
      this.buttons.another.hidden = isMask;
      const name = this.section.querySelector("[data-is=errorName]");
      name.textContent = isMask ? "error of the hard image (1 − IoU) by step" : "angle to the target's camera by step";
    }
  }

  /** Other settings: the run begins anew, and goes on if it was going. */
  #changed() {
    clearTimeout(this.soon);
    const runs = this.state === "running" || this.again === true;
    this.again = runs;
    this.soon = setTimeout(() => {
      this.again = false;
      this.#curve();
      this.#restart(runs && this.#kind !== "mask");
    }, 150);
  }

  async #do(name) {
    if (name === "link") {
      link.write(this.settings, this.#usualSettings);
      const own = this.inputs.mesh?.value === "file" || this.inputs.target.value === "file";
      this.said.textContent = this.status.textContent = (await link.copy()) + (own ? " It names your files but does not hold them." : "");
      return;
    }
    if (name === "save") return this.#save();
    if (name === "another") {
      this.inputs.seed.value = (Number(this.inputs.seed.value) + 1) % 2 ** 32;
      return this.#restart(true);
    }
    if (name === "restart") return this.#restart(this.state === "running" || this.state === "ended");
    try {
      if (this.state === "preparing") {
        this.engine.renew();
        this.state = "new";
        return this.#restart(false);
      }
      if (this.state === "running") {
        await this.#stop();
      } else if (name === "step") {
        if (this.state !== "ready") await this.#restart(false);
        if (await this.#prepared()) this.#take(await this.engine.ask("step"));
      } else {
        if (this.state !== "ready") await this.#restart(false);
        await this.#go();
      }
    } catch (error) {
      this.#fail(error);
    }
    this.#show();
  }

  get #pause() {
    return this.inputs.slow.checked ? SLOWLY : 0;
  }

  async #go() {
    if (this.state !== "ready" || !(await this.#prepared())) return;
    this.state = "running";
    this.since = performance.now();
    this.#show();
    await this.engine.ask("go", { pause: this.#pause });
  }

  async #stop() {
    // Frames arrive until then.
    await this.engine.ask("stop");
    if (this.state === "running") this.state = "ready";
    this.draw();
  }

  /** What a mask needs before the first step. */
  async #prepared() {
    if (this.isPrepared) return true;
    this.state = "preparing";
    this.#show();
    const { steps } = await this.engine.ask("prepare");
    if (this.state !== "preparing") return false;
    this.steps = steps;
    this.isPrepared = true;
    this.state = "ready";
    return true;
  }

  /** Begins anew with the settings that there are now. */
  async #restart(runs) {
    const token = (this.token = Symbol("restart"));
    this.say("");
    if (this.state === "preparing") this.engine.renew();
    this.state = "new";
    link.write(this.settings, this.#usualSettings);
    try {
      await this.engine.ready;
      await this.#filesGiven();
      if (token !== this.token) return;
      const settings = this.#asked;
      const kind = this.#kind;
      const { invert: { checked: invert }, gpu: { checked: onGpu } } = this.inputs;
      const opened = await this.engine.ask("open", { task: kind, settings, invert, onGpu });
      if (token !== this.token) return;
      Object.assign(this, { opened, kind, onGpu, asked: settings, steps: opened.steps, isPrepared: kind !== "mask" });
      this.runs = settings.map(() => ({ frames: [], latest: null }));
      this.state = "ready";
      this.orbit?.show(opened);
      if (kind !== "mask") this.#take(await this.engine.ask("step"));
      if (runs && token === this.token) await this.#go();
    } catch (error) {
      this.#fail(error);
    }
    this.#show();
    this.draw();
  }

  /** Another tab, or a worker that was ended, may have left others there. */
  async #filesGiven() {
    const { engine, inputs, files } = this;
    if (this.task === "pose") await engine.give("mesh", inputs.mesh.value === "file" ? files.mesh : FOX);
    if (inputs.target.value === "file") await engine.give("picture", { blob: files.picture });
    else if (this.task === "shape") await engine.give("picture", { blob: (files.letters ??= await (await fetch("letters.png")).blob()) });
  }

  /** Frames of the worker. */
  take(data) {
    if (this.state === "running") this.#take(data);
  }

  #take({ frames, ended }) {
    frames.forEach((frame, k) => {
      if (!frame || !this.runs[k]) return;
      const { soft, hard, ...numbers } = frame;
      const run = this.runs[k];
      run.latest = { ...numbers, soft, hard };
      run.frames.push(numbers);
      // The last of equally good steps is used, as in the other programs.
      if (!run.best || frame.hard_loss <= run.best.hard_loss) run.best = run.latest;
    });
    if (ended) {
      this.state = "ended";
      // A run returns its best-fitting step, which needs no knowledge of the true answer.
      for (const run of this.runs) run.latest = run.best;
      this.draw();
    }
    const shown = this.runs[0]?.latest;
    if (shown) this.slider.value = shown.progress;
    this.#show();
    this.drawLater();
    if (shown && this.state !== "running") this.#curve();
  }

  /** How much of a preparation is done. */
  progress(share) {
    if (this.state !== "preparing") return;
    this.bar.value = share;
    this.status.textContent = `${this.note ?? ""}Looking from all directions: ${Math.round(100 * share)} %`;
  }

  /** Shows an error and stands still. */
  fail(line, fault) {
    this.#fail(Object.assign(new Error(line), { fault }));
  }

  #fail(error) {
    if (error instanceof Ended) return;
    this.say(error.message);
    this.state = "new";
    // After a panic the engine cannot be used again.
    if (error.fault) this.engine.renew();
    this.#show();
  }

  /** Buttons and the line above the pictures; readers of screens hear it whenever a run stands. */
  #show() {
    this.#line();
    if (this.state !== "running" && this.state !== "preparing") this.said.textContent = this.status.textContent;
  }

  #line() {
    const { buttons, state } = this;
    buttons.run.textContent = { running: "Pause", preparing: "Cancel", ended: "Start" }[state] ?? (this.runs[0]?.frames.length > 1 && state === "ready" ? "Continue" : "Start");
    buttons.step.disabled = state === "running" || state === "preparing";
    buttons.save.disabled = !this.runs[0]?.frames.length;
    const latest = this.runs.map((run) => run.latest);
    if (state === "preparing") return;
    if (!latest[0]) {
      this.bar.value = 0;
      this.status.textContent = state === "ready" ? `${this.note ?? ""}Press Start.` : (this.note ?? "");
      return;
    }
    const first = this.runs[0].frames.at(-1);
    this.bar.value = first.step / this.steps;
    const of = latest.map((frame, k) => (frame ? `${this.#nameOf(frame, k)}${this.#errorOf(frame)}` : "")).join("");
    const [start, starts] = first.start;
    const which = starts > 1 ? `, start ${start + 1} of ${starts}` : start > 0 ? `, start ${start + 1}` : "";
    const ms = this.#milliseconds;
    this.status.textContent = `${this.note ?? ""}Step ${first.step} of ${this.steps}${which}${of}.${ms ? ` ${ms.toFixed(1)} ms a step.` : ""}`;
  }

  /** Which run, and at the end which step of it is shown. */
  #nameOf(frame, k) {
    const isBest = this.state === "ended" && frame.step < this.steps;
    if (this.runs.length === 1) return isBest ? `, the best at step ${frame.step}: ` : ": ";
    return `. ${titled(this.asked[k].softness.name)}${isBest ? `, the best at step ${frame.step}` : ""}: `;
  }

  #errorOf(frame) {
    if (frame.angle_deg !== null) return `loss ${frame.loss.toFixed(4)}, camera ${frame.angle_deg.toFixed(1)}° off`;
    return this.kind === "mask" ? `overlap over union ${(1 - frame.hard_loss).toFixed(3)}` : `loss ${frame.loss.toFixed(4)}, hard error ${frame.hard_loss.toFixed(4)}`;
  }

  /** The median of the steps so far, all runs together. */
  get #milliseconds() {
    const median = ({ frames }) => {
      const ms = frames.slice(1).map((frame) => frame.ms).sort((a, b) => a - b);
      return ms[ms.length >> 1] ?? 0;
    };
    return this.runs.reduce((sum, run) => sum + median(run), 0);
  }

  #draw() {
    if (this.section.hidden || !this.opened) return;
    const { target, size } = this.opened;
    this.runs.forEach(({ latest }, k) => {
      const of = RUNS[k];
      const colour = getComputedStyle(document.documentElement).getPropertyValue(`--${of}`).trim();
      outlined(this.canvases(of, "target"), size, target, this.task === "pose" ? latest?.hard : null, colour);
      if (!latest) return;
      coverage(this.canvases(of, "soft"), size, (at) => latest.soft[at] / 255);
      differences(this.canvases(of, "hard"), size, target, latest.hard);
      if (this.task === "shape") triangles(this.canvases(of, "triangles"), latest.theta, colour);
    });
    const lines = (of) => this.runs.map(({ frames }, k) => ({ colour: RUNS[k], values: frames.map(of) }));
    overTime(this.canvases(null, "loss"), { lines: lines((frame) => frame.loss), steps: this.steps, log: true });
    const hasAngle = this.kind === "pose";
    overTime(this.canvases(null, "error"), { lines: lines((frame) => (hasAngle ? frame.angle_deg : frame.hard_loss)), steps: this.steps, log: this.kind === "shape", unit: hasAngle ? "°" : "" });
    // A restart is not connected to the previous trail.
    const trail = ({ frames }) => frames.flatMap(({ camera, start }, k) => (k && frames[k - 1].start[0] !== start[0] ? [null, camera?.eye] : [camera?.eye]));
    this.orbit?.move(this.runs.map((run, k) => ({ colour: RUNS[k], camera: run.latest?.camera, trail: trail(run) })).filter(({ camera }) => camera));
    if (this.state === "running") this.#curve();
  }

  /** The curve at the progress of the run that the slider shows. */
  async #curve() {
    if (this.section.hidden || this.asksCurve) return;
    this.asksCurve = true;
    try {
      await this.engine.ready;
      const { task, slider, inputs } = this;
      const size = Number(inputs.size.value);
      const request = { task: this.#kind === "shape" ? "shape2d" : this.#kind, size, reach: REACH, count: 241 };
      const chosen = inputs.compare.checked ? this.pickers : this.pickers.slice(0, 1);
      const progresses = this.runs.map((run) => (this.state === "running" && run.latest ? run.latest.progress : Number(slider.value)));
      const found = await Promise.all(chosen.map((picker, k) => this.engine.ask("curve", { ...request, choice: picker.value, progress: progresses[k] ?? Number(slider.value) })));
      const pixel = 2 / size;
      const curves = found.flatMap(({ curves }, k) => curves.map((values, j) => ({ colour: RUNS[k], values, dash: j ? [5, 4] : [] })));
      softnessChart(this.canvases(null, "curve"), { curves, reach: REACH / pixel });
      found.forEach(({ width, moves, adaptive, curves }, k) => {
        const how = adaptive ? "Its width follows the error of the run, and a run that stalls restarts." : moves ? "Its width moves over the run." : "Its width is fixed.";
        chosen[k].hint.textContent = how + (curves.length > 1 ? " Dashed: what the gradient is taken of." : "");
        if (k === 0) slider.nextElementSibling.textContent = `${(width / pixel).toFixed(2)} px`;
      });
    } catch (error) {
      this.#fail(error);
    } finally {
      this.asksCurve = false;
    }
  }

  /** Saves what was found, with all that it takes to find it again. */
  async #save() {
    const { asked, runs, kind, onGpu } = this;
    const task = kind === "shape" ? "shape2d" : kind;
    const softnesses = await Promise.all(asked.map(({ softness }) => this.engine.ask("file", { choice: softness, task })));
    const result = {
      program: "softrast in a browser",
      link: location.href,
      computed_on: onGpu ? "WebGPU" : "CPU",
      task,
      mesh: this.task === "pose" ? (this.inputs.mesh.value === "file" ? this.files.mesh.name : "fox") : undefined,
      target: this.inputs.target.value === "file" ? this.files.picture.name : undefined,
      runs: runs.map(({ frames, latest }, k) => ({
        settings: asked[k],
        softness: softnesses[k],
        steps: frames.at(-1).step,
        returned_step: latest.step,
        loss: latest.loss,
        hard_loss: latest.hard_loss,
        angle_deg: latest.angle_deg ?? undefined,
        camera: latest.camera ?? undefined,
        theta: latest.theta,
        milliseconds_a_step: this.#milliseconds,
        losses: frames.map(({ loss }) => loss),
        hard_losses: frames.map(({ hard_loss }) => hard_loss),
        angles_deg: kind === "pose" ? frames.map(({ angle_deg }) => angle_deg) : undefined,
      })),
    };
    const url = URL.createObjectURL(new Blob([`${JSON.stringify(result, null, 1)}\n`], { type: "application/json" }));
    Object.assign(document.createElement("a"), { href: url, download: `softrast-${task}.json` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }
}
