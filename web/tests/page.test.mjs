// The page in a real browser: `node --test tests/page.test.mjs`, after `./build`. Chromium is CHROMIUM or /usr/bin/chromium.

import assert from "node:assert/strict";
import { access, readFile } from "node:fs/promises";
import { after, before, test } from "node:test";
import { SOFTWARE_GPU, ended, launch, opened, serve, status } from "./browser.mjs";
import { disc, large, meshes, png } from "./files.mjs";

const data = (file) => new URL(`../../data/${file}`, import.meta.url);
let host, browser;

before(async () => {
  host = await serve();
  browser = await launch();
});

after(async () => {
  await browser?.close();
  host?.close();
});

/** A test on a page of its own, which must say nothing on the console and ask nothing of another host. */
function onPage(name, hash, body, options) {
  test(name, async () => {
    const { context, page, wrong } = await opened(browser, host.url + hash, options);
    try {
      await page.waitForSelector("body[data-ready]", { timeout: 60_000 });
      await body(page);
      assert.deepEqual(wrong, []);
    } finally {
      await context.close();
    }
  });
}

const error = (page) => page.locator("#error").textContent();
const click = (page, what, tab = "pose") => page.click(`#${tab} [data-do=${what}]`);

/** What is saved of a run. */
async function saved(page, tab = "pose") {
  const [download] = await Promise.all([page.waitForEvent("download"), click(page, "save", tab)]);
  return JSON.parse(await readFile(await download.path(), "utf8"));
}

/** Drops files on the page. */
async function drop(page, files) {
  const sent = files.map(({ name, type = "", bytes }) => ({ name, type, text: bytes.toString("base64") }));
  await page.evaluate(async (files) => {
    const transfer = new DataTransfer();
    for (const { name, type, text } of files) {
      transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name, { type }));
    }
    document.body.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
  }, sent);
}

onPage("the camera of the fox is found, by the steps of a native run", "#tab=pose&seed=0", async (page) => {
  await ended(page);
  const { runs: [run] } = await saved(page);
  assert.equal(run.losses.length, 301);
  assert.ok(run.angle_deg < 5, `the camera ends ${run.angle_deg} degrees off`);
  assert.equal(run.hard_loss, Math.min(...run.hard_losses), "the step that fits best is returned");
  // Sines and exponentials are rounded differently in a browser, and after some 35 steps runs have gone apart by it.
  const native = JSON.parse(await readFile(new URL("native.json", import.meta.url)));
  assert.equal(native.losses.length, 31);
  const largest = Math.max(...native.losses.map((loss, k) => Math.abs(loss - run.losses[k])));
  assert.ok(largest < 1e-4, `losses of the first 30 steps differ by ${largest}`);
  assert.equal(await error(page), "");
});

onPage("a run pauses, steps, goes on and restarts as it was", "#tab=pose&steps=40&softness=gauss", async (page) => {
  await ended(page);
  const whole = await saved(page);
  await page.click("#pose summary");
  await page.check("#pose [data-set=slow]");
  await click(page, "restart");
  await page.waitForFunction(() => /Step [3-9] /.test(document.querySelector("#pose .status").textContent));
  await click(page, "run");
  await page.waitForFunction(() => document.querySelector("#pose [data-do=run]").textContent === "Continue");
  const paused = await status(page).textContent();
  await page.waitForTimeout(400);
  assert.equal(await status(page).textContent(), paused, "nothing moves while it pauses");
  await click(page, "step");
  const step = Number(/Step (\d+)/.exec(paused)[1]);
  await page.waitForFunction((step) => document.querySelector("#pose .status").textContent.includes(`Step ${step + 1} of`), step);
  await page.uncheck("#pose [data-set=slow]");
  await click(page, "run");
  await ended(page);
  assert.deepEqual((await saved(page)).runs[0].losses, whole.runs[0].losses);
});

onPage("a link gives the same run again", "#tab=pose&steps=12&seed=7&softness=gauss&first=0.05&with=learned%3Apose", async (page) => {
  await ended(page);
  const first = await saved(page);
  assert.equal(first.runs.length, 2);
  assert.deepEqual(first.runs.map((run) => run.settings.softness.name), ["gauss", "learned:pose"]);
  assert.equal(first.runs[0].settings.softness.first, 0.05);
  // Both begin at the same place.
  assert.equal(first.runs[0].angles_deg[0], first.runs[1].angles_deg[0]);
  assert.notEqual(first.runs[0].losses[12], first.runs[1].losses[12]);
  await page.goto("about:blank");
  await page.goto(first.link);
  await ended(page);
  const again = await saved(page);
  for (const k of [0, 1]) assert.deepEqual(again.runs[k].losses, first.runs[k].losses);
});

onPage("meshes of all formats can be dropped", "#tab=pose&steps=3", async (page) => {
  await ended(page);
  const fox = await readFile(data("meshes/fox.glb"));
  for (const [ending, bytes] of [...Object.entries(meshes), ["glb", fox]]) {
    await drop(page, [{ name: `mine.${ending}`, bytes }]);
    await page.waitForFunction((ending) => document.querySelector("#pose .status").textContent.startsWith(`mine.${ending}: `), ending);
    await ended(page);
    assert.equal(await error(page), "", ending);
    if (ending !== "glb") assert.match(await status(page).textContent(), /: 4 faces\. Step 3 of 3/);
    assert.equal((await saved(page)).mesh, `mine.${ending}`);
  }
});

onPage("what is wrong with a file is one line, and the page goes on", "#tab=pose&steps=3", async (page) => {
  await ended(page);
  const text = (body) => Buffer.from(body);
  for (const [name, bytes, expected] of [
    ["bad.obj", text("v 0 0 0\nf 1 2 3\n"), "bad.obj:2: index 2 is out of range: the file has 1 vertices"],
    ["bad.glb", text("glTF"), /^bad\.glb: /],
    ["bad.ply", text("ply\n"), /^bad\.ply/],
    ["bad.stl", text("solid\n"), /^bad\.stl/],
    ["notes.txt", text("hello"), /^notes\.txt is neither a mesh/],
    ["bad.png", text("hello"), /^bad\.png is no picture/],
    ["black.png", png(40, 40, () => 0), /^the mask is empty/],
    ["white.png", png(40, 40, () => 255), /^the mask is full/],
  ]) {
    await drop(page, [{ name, bytes, type: name.endsWith(".png") ? "image/png" : "" }]);
    await page.waitForFunction(() => document.querySelector("#error").textContent !== "");
    const line = await error(page);
    if (typeof expected === "string") assert.equal(line, expected);
    else assert.match(line, expected);
    assert.ok(!line.includes("\n") && line.length < 300, line);
    await page.evaluate(() => (document.querySelector("#error").textContent = ""));
  }
  await page.selectOption("#pose [data-set=target]", "seed");
  await page.waitForFunction(() => document.querySelector("#pose .status").textContent.includes("Step 0 of 3"));
  await click(page, "run");
  await ended(page);
  assert.equal(await error(page), "");
});

onPage("a mesh of a million faces and a picture of 20 megapixels are reduced with a word", "#tab=pose&steps=2", async (page) => {
  await ended(page);
  await page.setInputFiles("#pose [data-open=mesh]", { name: "large.ply", mimeType: "", buffer: large() });
  await page.waitForFunction(() => /^large\.ply has 1,000,000 faces; [\d,]+ are used/.test(document.querySelector("#pose .status").textContent), null, { timeout: 60_000 });
  await ended(page);
  await page.setInputFiles("#pose [data-open=picture]", { name: "large.png", mimeType: "image/png", buffer: disc(5000, 4000) });
  await page.waitForFunction(() => document.querySelector("#pose .status").textContent.startsWith("large.png: 5000 × 4000 pixels, reduced to 768 × 614."), null, { timeout: 60_000 });
  assert.equal(await error(page), "");
});

onPage("a camera is found from a mask, and the search can be cancelled", "#tab=pose&steps=40", async (page) => {
  await ended(page);
  await drop(page, [{ name: "03.png", type: "image/png", bytes: await readFile(data("views/fox/images/03.png")) }]);
  await page.waitForFunction(() => document.querySelector("#pose .status").textContent.endsWith("Press Start."));
  await click(page, "run");
  await page.waitForFunction(() => document.querySelector("#pose [data-do=run]").textContent === "Cancel");
  await click(page, "run");
  await page.waitForFunction(() => document.querySelector("#pose [data-do=run]").textContent === "Start");
  await click(page, "run");
  await ended(page);
  const { runs: [run], target } = await saved(page);
  assert.equal(target, "03.png");
  // The lens is only assumed.
  assert.ok(run.hard_loss < 0.15, `IoU ${1 - run.hard_loss}`);
});

onPage("triangles cover a picture", "#tab=shape", async (page) => {
  await ended(page, "shape");
  const { runs: [run] } = await saved(page, "shape");
  assert.ok(run.hard_loss < 0.02 && run.hard_losses[0] > 0.2, `hard error ${run.hard_losses[0]}, then ${run.hard_loss}`);
  await drop(page, [{ name: "disc.png", type: "image/png", bytes: disc(90, 60) }]);
  await page.waitForFunction(() => document.querySelector("#shape .status").textContent.startsWith("disc.png: 90 × 60 pixels"));
  await ended(page, "shape");
  assert.ok((await saved(page, "shape")).runs[0].hard_loss < 0.02);
});

onPage("the playground answers to keys, softness and T-conorm", "#tab=play&count=2", async (page) => {
  const drawn = () => page.evaluate(() => new Promise((done) => setTimeout(() => done(document.querySelector("#play .status").textContent + document.querySelector("#play [data-is=image]").toDataURL()), 400)));
  const start = await drawn();
  assert.match(start, /^The pixel is covered by [\d.]+ %; moving the triangle by 1 px changes that by up to [\d.]+ %/);
  await page.locator("#play .handle").first().focus();
  for (let k = 0; k < 5; k++) await page.keyboard.press("ArrowUp");
  const moved = await drawn();
  assert.notEqual(moved, start);
  await page.selectOption("#play [data-play=conorm]", "yager");
  const other = await drawn();
  assert.notEqual(other, moved);
  await page.selectOption("#play [data-play=count]", "1");
  const one = await drawn();
  await page.selectOption("#play [data-play=conorm]", "einstein");
  const covered = (said) => Number(/by ([\d.]+) %/.exec(said)[1]);
  assert.ok(Math.abs(covered(await drawn()) - covered(one)) < 0.2, "with one face all T-conorms are the same");
  await page.click("#play [data-play=reset]");
  assert.match(await drawn(), /covered/);
  assert.equal(await error(page), "");
});

onPage("nothing moves by itself where motion is to be reduced", "#tab=pose", async (page) => {
  await page.waitForFunction(() => document.querySelector("#pose .status").textContent.includes("Step 0 of 300"));
  await page.waitForTimeout(500);
  assert.match(await status(page).textContent(), /Step 0 of 300/);
}, { reducedMotion: "reduce" });

for (const [device, width, height] of [["laptop", 1280, 800], ["phone", 390, 844]]) {
  onPage(`the first screen of a ${device} has three doors and the start of the playground`, "", async (page) => {
    const bottom = async (selector, edge = "bottom") => page.locator(selector).first().evaluate((element, edge) => element.getBoundingClientRect()[edge], edge);
    assert.deepEqual(await page.locator(".doors h2").allTextContents(), ["I have pictures", "I use torch", "I write Rust"]);
    assert.ok(await bottom(".doors section:last-child") < height, "all doors are visible");
    assert.ok(await bottom("#play .stage", "top") < height - 100, "the playground begins");
    assert.equal(await page.evaluate(() => scrollY), 0);
  }, { viewport: { width, height } });
}

onPage("a link to a tab shows the tab", "#tab=pose&steps=2", async (page) => {
  await ended(page);
  const top = await page.locator("nav.tabs").evaluate((element) => element.getBoundingClientRect().top);
  assert.ok(Math.abs(top) < 2, `the tabs are at ${top}`);
}, { viewport: { width: 390, height: 844 } });

test("links to the documentation lead to pages that exist", async () => {
  const page = await readFile(new URL("../page/index.html", import.meta.url), "utf8");
  const linked = [...page.matchAll(/href="https:\/\/github\.com\/softrast\/softrast\/blob\/main\/([^"#]+)"/g)].map((link) => link[1]);
  assert.ok(linked.length >= 8, `${linked}`);
  for (const file of linked) await access(new URL(`../../${file}`, import.meta.url));
  const built = await readFile(new URL("../dist/index.html", import.meta.url), "utf8");
  for (const [, file] of built.matchAll(/href="(book\/[^"#]+)"/g)) await access(new URL(`../dist/${file}`, import.meta.url));
});

onPage("all tabs fit on a phone", "#tab=pose&steps=2&with=logistic", async (page) => {
  for (const tab of ["pose", "shape", "play"]) {
    await page.click(`nav a[data-tab=${tab}]`);
    await page.waitForSelector(`#${tab}:not([hidden])`);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 360, tab);
  }
}, { viewport: { width: 360, height: 740 }, colorScheme: "dark" });

onPage("it works without a network once it has been loaded", "#tab=pose&steps=2", async (page) => {
  await page.evaluate(() => navigator.serviceWorker.ready);
  await page.waitForFunction(async () => {
    const names = (await caches.keys()).filter((name) => name.startsWith("softrast "));
    return names.length === 1 && (await (await caches.open(names[0])).keys()).length > 15;
  });
  await page.context().setOffline(true);
  await page.reload();
  await ended(page);
  await page.click("nav a[data-tab=shape]");
  await ended(page, "shape");
});

onPage("without an adapter for WebGPU the switch is off, and a line says so", "#tab=pose&steps=2&gpu=true", async (page) => {
  await ended(page);
  for (const tab of ["pose", "shape"]) {
    assert.ok(await page.isDisabled(`#${tab} [data-set=gpu]`), tab);
    assert.ok(!(await page.isChecked(`#${tab} [data-set=gpu]`)), tab);
    assert.equal(await page.locator(`#${tab} [data-is=noGpu]`).getAttribute("hidden"), null);
  }
  assert.equal((await saved(page)).computed_on, "CPU");
});

test("on WebGPU runs are those of the CPU", async () => {
  const software = await launch(...SOFTWARE_GPU);
  try {
    for (const [tab, hash] of [["pose", "#tab=pose&seed=0&steps=8&size=32&softness=gauss"], ["shape", "#tab=shape&steps=4&size=64&triangles=100&softness=gauss"]]) {
      const runs = [];
      for (const gpu of ["", "&gpu=true"]) {
        const { context, page, wrong } = await opened(software, host.url + hash + gpu);
        await page.waitForSelector("body[data-ready]", { timeout: 60_000 });
        await ended(page, tab, 240_000);
        const result = await saved(page, tab);
        assert.equal(result.computed_on, gpu ? "WebGPU" : "CPU");
        assert.equal(await error(page), "");
        assert.deepEqual(wrong, []);
        runs.push(result.runs[0].losses);
        await context.close();
      }
      const [cpu, gpu] = runs;
      assert.equal(gpu.length, cpu.length);
      // Both compute in f32, and round otherwise.
      const largest = Math.max(...cpu.map((loss, k) => Math.abs(loss - gpu[k])));
      assert.ok(largest < 1e-4, `losses of ${tab} differ by ${largest}: ${cpu} and ${gpu}`);
      assert.notEqual(gpu.at(-1), gpu[0], `nothing moves: ${gpu}`);
    }
  } finally {
    await software.close();
  }
});

test("neither the page nor its worker can send anything to another host", async () => {
  const { context, page } = await opened(browser, host.url);
  await page.waitForSelector("body[data-ready]");
  const blocked = () => new Promise((done) => {
    addEventListener("securitypolicyviolation", (event) => done(event.effectiveDirective));
    fetch("https://example.org/", { method: "POST", body: "mine", mode: "no-cors" }).then(() => done("sent"), () => {});
    setTimeout(() => done("neither sent nor blocked"), 5000);
  });
  assert.equal(await page.evaluate(blocked), "connect-src");
  assert.equal(await page.workers()[0].evaluate(blocked), "connect-src");
  await context.close();
});
