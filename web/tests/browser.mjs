// A static host under a sub-path, and pages of it in headless Chromium, whose every error is one of the test.

import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const dist = fileURLToPath(new URL("../dist", import.meta.url));
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".png": "image/png" };
const PATH = "/some/where/";

/** Serves the page as any static host does. */
export async function serve() {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, "http://localhost");
    const file = pathname.startsWith(PATH) && normalize(pathname.slice(PATH.length) || "index.html");
    try {
      if (!file || file.startsWith("..")) throw new Error("elsewhere");
      const body = await readFile(join(dist, file));
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" }).end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  return { url: `http://127.0.0.1:${server.address().port}${PATH}`, close: () => { server.closeAllConnections(); server.close(); } };
}

export const launch = (...args) => chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox", ...args] });

/** What gives Chromium a WebGPU adapter on any machine: SwiftShader, which computes on the CPU. */
export const SOFTWARE_GPU = ["--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-vulkan=swiftshader", "--use-webgpu-adapter=swiftshader"];

/** A page at an address; `wrong` gathers what it says on the console, and what it asks of any other host. */
export async function opened(browser, url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1200, height: 900 }, ...options });
  const page = await context.newPage();
  const wrong = [];
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) wrong.push(message.text()); });
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("request", (request) => { if (new URL(request.url()).origin !== new URL(url).origin && !/^(blob|data):/.test(request.url())) wrong.push(request.url()); });
  await page.goto(url);
  return { context, page, wrong };
}

/** The line that tells of the run of a tab. */
export const status = (page, tab = "pose") => page.locator(`#${tab} .status`);

/** Waits until the run of a tab has ended. */
export async function ended(page, tab = "pose", timeout = 120_000) {
  await page.waitForFunction((tab) => {
    const said = document.querySelector(`#${tab} .status`).textContent;
    const [, step, steps] = /Step (\d+) of (\d+)/.exec(said) ?? [];
    return step !== undefined && step === steps && document.querySelector(`#${tab} [data-do=run]`).textContent === "Start";
  }, tab, { timeout });
}
