// The worker: owns the WebAssembly, and answers requests one after the other. It loads nothing from a network except its own files.
//
// A request is { id, ask, ... }, an answer { id, ok } or { id, error }. Frames of a running run are pushed: { frame }.

import init, * as softrast from "./softrast.js";

const LARGEST_PICTURE = 768; // pixels a side of what is kept of a picture
const MOST_PIXELS = 120e6; // of a picture that is opened at all

let mesh = null;
let picture = null;
let runs = [];
let goes = null; // the run that goes on by itself: { pause }
let steps = Promise.resolve(); // of the latest step, which a GPU takes its time for
let gpu = null; // that it has been set up
const playground = { is: null };

const asks = {
  /** Names that can be chosen, and whether there is a GPU. */
  async ready() {
    const [adapter] = await Promise.all([hasAdapter(), init({ module_or_path: new URL("softrast_web_bg.wasm", import.meta.url) })]);
    return { ...JSON.parse(softrast.names()), gpu: adapter };
  },

  /** A mesh, the fox unless there are bytes. */
  mesh({ name, bytes }) {
    const next = bytes ? softrast.PageMesh.parse(new Uint8Array(bytes), name) : softrast.PageMesh.fox();
    mesh?.free();
    mesh = next;
    const faces = mesh.faces();
    return { faces: faces.length / 3, fileFaces: mesh.file_faces() };
  },

  /** A picture in any format that the browser reads, made smaller if it is large. */
  async picture({ blob }) {
    let bitmap;
    try {
      bitmap = await createImageBitmap(blob);
    } catch {
      throw `${blob.name ?? "the file"} is no picture that this browser can read`;
    }
    const { width, height } = bitmap;
    if (width * height > MOST_PIXELS) throw `a picture of ${width} × ${height} pixels is more than this page opens`;
    const times = Math.min(1, LARGEST_PICTURE / Math.max(width, height));
    const [w, h] = [width, height].map((side) => Math.max(1, Math.round(side * times)));
    const context = new OffscreenCanvas(w, h).getContext("2d", { willReadFrequently: true });
    context.imageSmoothingQuality = "high";
    context.drawImage(bitmap, 0, 0, w, h);
    bitmap.close();
    picture = { rgba: new Uint8Array(context.getImageData(0, 0, w, h).data.buffer), width: w };
    return { width, height, reduced: times < 1 ? [w, h] : null };
  },

  /** The curve of a softness. */
  curve({ choice, task, progress, size, reach, count }) {
    return JSON.parse(softrast.curve(JSON.stringify(choice), task, progress, size, reach, count));
  },

  /** The file of a softness. */
  file({ choice, task }) {
    return JSON.parse(softrast.softness_file(JSON.stringify(choice), task));
  },

  /** Runs side by side on the same start, not begun; on the GPU if `onGpu`. */
  async open({ task, settings, invert, onGpu }) {
    await stop();
    for (const run of runs) run.free();
    runs = [];
    if (onGpu) await (gpu ??= softrast.set_up_gpu());
    for (const each of settings) runs.push(opened(task, JSON.stringify(each), invert, onGpu));
    const about = JSON.parse(runs[0].about());
    const faces = task === "shape" ? null : mesh.faces();
    return { ...about, target: runs[0].target(), positions: runs[0].positions(), faces };
  },

  /** What the first step needs; long for a mask. */
  prepare() {
    runs.forEach((run, k) => run.prepare((share) => postMessage({ progress: (k + share) / runs.length })));
    return { steps: JSON.parse(runs[0].about()).steps };
  },

  /** One step of every run. */
  async step() {
    await stop();
    return step();
  },

  /** Steps until the end or until it is stopped, with so many milliseconds between them. */
  async go({ pause }) {
    await stop();
    const mine = { pause };
    goes = mine;
    keep(mine);
    return null;
  },

  async stop() {
    await stop();
    return null;
  },

  /** Triangles and the gradients of pixels. */
  draw({ scene }) {
    playground.is ??= new softrast.PagePlayground();
    const image = playground.is.draw(JSON.stringify(scene));
    return { image, gradient: playground.is.gradient() };
  },
};

/** Whether WebGPU has anything to run on. */
async function hasAdapter() {
  try {
    return Boolean(await navigator.gpu?.requestAdapter());
  } catch {
    return false;
  }
}

function opened(task, settings, invert, onGpu) {
  const needed = task === "pose" ? null : picture;
  if (task !== "pose" && !needed) throw "there is no picture yet";
  switch (task) {
    case "pose": return softrast.PageRun.pose(mesh, settings, onGpu);
    case "mask": return softrast.PageRun.mask(mesh, needed.rgba, needed.width, invert, settings, onGpu);
    default: return softrast.PageRun.shape(needed.rgba, needed.width, invert, settings, onGpu);
  }
}

/** Nothing is asked of the runs any more after that. */
async function stop() {
  goes = null;
  await steps;
}

function step() {
  const taken = stepped();
  steps = taken.catch(() => {});
  return taken;
}

/** Frames of all runs, and whether that was the last. */
async function stepped() {
  const frames = [];
  for (const run of runs) {
    const clock = performance.now();
    const numbers = await run.next();
    const ms = performance.now() - clock;
    frames.push(numbers === undefined ? null : { ...JSON.parse(numbers), soft: run.soft(), hard: run.hard(), ms });
  }
  return { frames, ended: frames.every((frame) => frame === null) };
}

async function keep(mine) {
  try {
    while (goes === mine) {
      const { frames, ended } = await step();
      postMessage({ frames, ended }, frames.flatMap((frame) => (frame ? [frame.soft.buffer, frame.hard.buffer] : [])));
      if (ended && goes === mine) goes = null;
      await (mine.pause ? new Promise((done) => setTimeout(done, mine.pause)) : turn());
    }
  } catch (error) {
    goes = null;
    fail(error);
  }
}

// Lets messages in between steps; a timer would wait for 4 ms.
const { port1, port2 } = new MessageChannel();
let turned = null;
port1.onmessage = () => turned();
const turn = () => new Promise((done) => {
  turned = done;
  port2.postMessage(null);
});

const fail = (error) => postMessage({ error: told(error), fault: isFault(error) });
// A panic during an await leaves its request without an answer.
addEventListener("error", (event) => {
  event.preventDefault();
  fail(event.error ?? event);
});

/** An error of Rust code is text; anything else is a fault of the page. */
const isFault = (error) => typeof error !== "string";

function told(error) {
  if (!isFault(error)) return error;
  let panic = "";
  try {
    panic = softrast.fault();
  } catch {
    // The WebAssembly has not been loaded, so there is no fault.
  }
  return `this page has a fault: ${panic || error?.message || error}`;
}

// One after the other: some requests wait for a picture.
let queue = Promise.resolve();
onmessage = ({ data }) => {
  queue = queue.then(async () => {
    try {
      postMessage({ id: data.id, ok: await asks[data.ask](data) });
    } catch (error) {
      postMessage({ id: data.id, error: told(error), fault: isFault(error) });
    }
  });
};
