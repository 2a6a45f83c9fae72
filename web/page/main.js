// The page: tabs, dropped files, errors.

import { Engine } from "./engine.js";
import * as link from "./link.js";
import { Playground } from "./play.js";
import { Solver } from "./solver.js";

const MESHES = /\.(obj|ply|stl|off|glb|gltf)$/i;
const TABS = ["play", "pose", "shape"];

const error = document.querySelector("#error");
const say = (line) => (error.textContent = line);
const section = (name) => document.getElementById(name);
const tabs = {};
let current = null;

const engine = new Engine({
  frames: (data) => tabs[current]?.take?.(data),
  progress: (share) => tabs[current]?.progress?.(share),
  failed: (line, fault) => (tabs[current]?.fail ? tabs[current].fail(line, fault) : say(line)),
});

/** Opens the tab that the address names, with its settings. */
async function route() {
  const told = link.read();
  const name = TABS.includes(told.tab) ? told.tab : TABS[0];
  if (name !== current) {
    const isOpened = current === null;
    await tabs[current]?.leave?.();
    current = name;
    for (const each of TABS) section(each).hidden = each !== name;
    for (const a of document.querySelectorAll("[data-tab]")) a.toggleAttribute("aria-current", a.dataset.tab === name);
    // A link to a tab opens the page there, the bare address at the top.
    if (isOpened && told.tab) document.querySelector(".tabs").scrollIntoView();
    say("");
  }
  const first = !tabs[name].entered;
  tabs[name].entered = true;
  // A link without settings does not change its tab.
  const anew = Object.keys(told).length > 1;
  if (first || anew) tabs[name].settings = told;
  await tabs[name].enter({ runs: (first || anew) && !matchMedia("(prefers-reduced-motion: reduce)").matches, anew });
  if (anew && (told.mesh || told.target)) say(`This link refers to files that it does not hold: open ${[told.mesh, told.target].filter(Boolean).join(" and ")} again.`);
}

function drops() {
  const over = (on) => document.body.classList.toggle("dropping", on);
  const hasFiles = (event) => event.dataTransfer?.types.includes("Files");
  addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    over(true);
  });
  addEventListener("dragleave", (event) => event.relatedTarget === null && over(false));
  addEventListener("drop", async (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    over(false);
    const files = [...event.dataTransfer.files];
    const meshes = files.filter((file) => MESHES.test(file.name));
    const pictures = files.filter((file) => file.type.startsWith("image/"));
    const tab = current === "play" ? null : current === "shape" && meshes.length ? null : current;
    if (!tab) return say("This tab takes no such file: meshes and masks go to Find a camera, pictures to Cover a picture.");
    if (!meshes.length && !pictures.length) return say(`${files[0]?.name ?? "this"} is neither a mesh (OBJ, PLY, STL, OFF, GLB, glTF) nor a picture`);
    for (const file of meshes.slice(0, 1)) await tabs[tab].open(file, "mesh");
    for (const file of pictures.slice(0, 1)) await tabs[tab].open(file, "picture");
  });
}

async function begin() {
  let names;
  try {
    names = await engine.ready;
  } catch (problem) {
    say(`This page needs WebAssembly with vectors, which browsers have had since 2023: ${problem.message}`);
    return;
  }
  const solver = (task, usual) => new Solver(section(task), { task, usual, engine, names, say });
  tabs.pose = solver("pose", { tab: "", seed: 4, steps: 300, size: 64 });
  tabs.shape = solver("shape", { tab: "", seed: 0, steps: 200, size: 96, triangles: 200 });
  tabs.play = new Playground(section("play"), { engine, names, say });
  addEventListener("hashchange", route);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => tabs[current]?.draw());
  drops();
  await route();
  document.body.dataset.ready = "";
}

if ("serviceWorker" in navigator && location.protocol !== "file:") {
  // Without it the page needs a network the next time, but still works.
  navigator.serviceWorker.register("sw.js").catch(() => {});
}
begin();
