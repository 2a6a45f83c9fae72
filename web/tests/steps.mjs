// How long a step of the page's WebAssembly takes, without a browser: `node tests/steps.mjs`, after `./build`. It is the run of the example
// `native`, four times; the first has the translation of the module in it.

import { readFile } from "node:fs/promises";
import init, { PageMesh, PageRun } from "../dist/softrast.js";

await init({ module_or_path: await readFile(new URL("../dist/softrast_web_bg.wasm", import.meta.url)) });
const mesh = PageMesh.fox();
for (let k = 0; k < 4; k++) {
  const run = PageRun.pose(mesh, JSON.stringify({ seed: 0, size: 64, steps: 300, softness: { name: "preset" } }), false);
  const before = process.cpuUsage();
  let frames = 0;
  while ((await run.next()) !== undefined) frames++;
  const { user, system } = process.cpuUsage(before);
  console.log(`${((user + system) / 1e3 / frames).toFixed(2)} ms of CPU time a step`);
  run.free();
}
