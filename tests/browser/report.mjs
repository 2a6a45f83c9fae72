// The page of a result in a real browser: `node report.mjs PAGE.html ...`. Chromium draws it with SwiftShader, without a network.

import assert from "node:assert/strict";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const WEBGL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const NO_WEBGL = ["--disable-3d-apis"];
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";

/** Opens the page in a browser with these flags; what it says on the console, and what it asks of the network, is an error. */
async function open(file, args, options = {}) {
  const browser = await chromium.launch({ executablePath, args: ["--no-sandbox", ...args] });
  const page = await browser.newPage({ viewport: { width: 1000, height: 900 }, ...options });
  const wrong = [];
  page.on("console", (message) => { if (message.type() === "error") wrong.push(message.text()); });
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("request", (request) => { if (!/^(file|data|blob):/.test(request.url())) wrong.push(request.url()); });
  await page.goto(pathToFileURL(file).href);
  return { browser, page, wrong };
}

/** After what was asked for has been drawn. */
const drawn = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

/** Pixels of the first viewer as text, to tell whether they have changed. */
async function pixels(page) {
  await drawn(page);
  return page.evaluate(() => document.querySelector(".viewer canvas").toDataURL());
}

/** IoU of what is drawn with the mask of view `index`: how well the viewer's cameras are those of the file. */
async function iou(page, index) {
  await page.selectOption(".viewer select", String(index));
  await drawn(page);
  return page.evaluate(async (index) => {
    const box = document.querySelector(".viewer");
    const view = JSON.parse(box.querySelector("script").textContent).views[index];
    const canvas = box.querySelector("canvas");
    const [width, height] = [canvas.width, canvas.height];
    const scale = Math.min(width / view.width, height / view.height);
    const [x, y] = [(width - scale * view.width) / 2, (height - scale * view.height) / 2];
    const mask = new Image();
    mask.src = `data:image/png;base64,${view.mask}`;
    await mask.decode();
    const target = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    target.drawImage(mask, x, y, scale * view.width, scale * view.height);
    const [a, b] = [target, canvas.getContext("2d")].map((context) => context.getImageData(0, 0, width, height).data);
    let [both, either] = [0, 0];
    for (let row = Math.ceil(y); row < Math.floor(y + scale * view.height); row++) {
      for (let column = Math.ceil(x); column < Math.floor(x + scale * view.width); column++) {
        const at = 4 * (row * width + column);
        const [inMask, inMesh] = [a[at] >= 128, b[at + 3] > 0];
        both += inMask && inMesh;
        either += inMask || inMesh;
      }
    }
    return both / either;
  }, index);
}

async function turns(file) {
  const { browser, page, wrong } = await open(file, WEBGL);
  await page.locator(".viewer-stage").first().scrollIntoViewIfNeeded();
  const opens = await page.evaluate(() => JSON.parse(document.querySelector(".viewer script").textContent).opens ?? -1);
  assert.equal(Number(await page.locator(".viewer select").first().inputValue()), opens, "the view that the page opens through");
  await drawn(page);
  assert.equal(await page.locator(".viewer-stage canvas").nth(1).isVisible(), opens >= 0, "its outline");
  await page.getByRole("button", { name: "Reset" }).click();
  const start = await pixels(page);
  const box = await page.locator(".viewer canvas").first().boundingBox();
  const middle = [box.x + box.width / 2, box.y + box.height / 2];

  await page.mouse.move(...middle);
  await page.mouse.down();
  await page.mouse.move(middle[0] + 80, middle[1] + 30, { steps: 4 });
  await page.mouse.up();
  const turned = await pixels(page);
  assert.ok(turned !== start, "dragging turns the mesh");
  await page.mouse.wheel(0, -300);
  const zoomed = await pixels(page);
  assert.ok(zoomed !== turned, "the wheel zooms");
  await page.locator(".viewer canvas").first().focus();
  await page.keyboard.press("ArrowLeft");
  assert.ok(await pixels(page) !== zoomed, "keys turn");
  await page.getByRole("button", { name: "Reset" }).click();
  assert.ok(await pixels(page) === start, "Reset brings the start back");
  // A viewer ignores the wheel while the page scrolls, as after a click on an element outside the view.
  await page.waitForTimeout(300);
  await page.mouse.move(...middle);
  await page.mouse.wheel(0, 2000);
  const far = await pixels(page);
  await page.getByRole("checkbox", { name: "Cameras" }).uncheck();
  assert.ok(await pixels(page) !== far, "cameras can be hidden");

  await page.getByLabel("Up").selectOption({ label: "−y" });
  const hanging = await pixels(page);
  assert.ok(hanging !== start && hanging !== far, "another axis may be up");
  await page.getByLabel("Up").selectOption({ index: 0 });

  const colours = page.getByRole("checkbox", { name: "Colours" });
  const painted = await page.evaluate(() => Boolean(JSON.parse(document.querySelector(".viewer script").textContent).colours));
  assert.equal(await colours.count() > 0, painted, "a switch where there are colours");
  if (painted) {
    const before = await pixels(page);
    await colours.uncheck();
    assert.ok(await pixels(page) !== before, "colours can be left out");
    await colours.check();
    assert.ok(await pixels(page) === before, "and come back");
  }

  const notes = await page.evaluate(() => JSON.parse(document.querySelector(".viewer script").textContent).views.map((view) => view.note));
  for (const [index, note] of notes.entries()) {
    const said = Number(/IoU ([\d.]+)/.exec(note)[1]);
    const seen = await iou(page, index);
    assert.ok(Math.abs(seen - said) < 0.03, `view ${index} says ${note}, but an IoU of ${seen.toFixed(3)} is to be seen`);
    assert.ok((await page.locator(".viewer .note").first().textContent()).includes(note));
  }
  await page.getByRole("button", { name: "Reset" }).click();
  await drawn(page);
  assert.equal(await page.locator(".viewer-stage canvas").nth(1).isVisible(), false, "no outline stays behind");
  assert.deepEqual(wrong, []);
  if (process.env.SHOTS) await shots(page, process.env.SHOTS);
  await browser.close();
  return notes.length;
}

/** The pictures of the README. */
async function shots(page, folder) {
  const stage = page.locator(".viewer-stage").first();
  await page.getByRole("checkbox", { name: "Cameras" }).uncheck();
  await page.selectOption(".viewer select", "3");
  // The screen may be some frames late.
  await page.waitForTimeout(500);
  await stage.screenshot({ path: `${folder}/view.png` });
  await page.getByRole("button", { name: "Reset" }).click();
  await page.getByRole("checkbox", { name: "Cameras" }).check();
  await stage.hover();
  await page.mouse.wheel(0, 600);
  await page.waitForTimeout(500);
  await stage.screenshot({ path: `${folder}/mesh.png` });
}

/** A picture stands where the mesh cannot be turned. */
async function falls_back(file, args, options) {
  const { browser, page } = await open(file, args, options);
  assert.equal(await page.locator(".viewer canvas").count(), 0);
  assert.ok(await page.locator(".viewer img").first().evaluate((image) => image.naturalWidth > 0));
  assert.ok(await page.locator(".viewer img").first().isVisible());
  await browser.close();
}

/** Nothing is wider than a phone. */
async function fits_a_phone(file) {
  const { browser, page, wrong } = await open(file, WEBGL, { viewport: { width: 375, height: 700 } });
  await drawn(page);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 375, `the page is ${wide} pixels wide`);
  assert.deepEqual(wrong, []);
  await browser.close();
}

const files = process.argv.slice(2);
assert.ok(files.length > 0, "which pages?");
for (const file of files) {
  const views = await turns(file);
  await falls_back(file, NO_WEBGL);
  await falls_back(file, WEBGL, { javaScriptEnabled: false });
  await fits_a_phone(file);
  console.log(`${file}: the mesh turns, ${views} views fit what the page says of them, a picture stands in without WebGL`);
}
