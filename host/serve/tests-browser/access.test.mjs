// The page by keyboard, by touch, with a screen reader, enlarged, and in the colours of the system.
import assert from "node:assert/strict";
import { cpSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { browser, oneServer, open, server } from "./server.mjs";

oneServer(async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Capture pair" }).click();
  await page.locator("button[data-layer=surface]:enabled").waitFor();
  assert.equal(await page.title(), "Depth – farnear", "the title names the view");
  await page.context().close();
});

/** PNG of 2x2 px whose red is 1, 200, 11, 201 and whose alpha is 0, 7, 10, 255. */
const COLOURS = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAYAAABytg0kAAAAGklEQVR4nGNkZGJmOC4kzc7ExcXFxcjI+AMADvsCKKBGbBMAAAAASUVORK5CYII=";

/** The page with the depth of the first pair. */
async function depth(options) {
  const page = await open(browser, `${server.address}#depth/pair-001`, options);
  await page.locator("#view-depth canvas[data-layer=depth]").waitFor();
  await page.locator("button[data-layer=near]:enabled").waitFor();
  return page;
}

const drawn = (page) => page.locator("#view-depth .viewer canvas");
const told = (page, name) => page.locator("#view-depth dt", { hasText: name }).locator("+ dd");

/** The paths to which the page posts from now on, and with what. */
function posts(page) {
  const found = [];
  page.on("request", (request) => { if (request.method() === "POST") found.push({ path: new URL(request.url()).pathname, body: request.postDataJSON() }); });
  return found;
}

test("a depth is probed and a region measured by the keyboard", async () => {
  const page = await depth();
  await page.locator("#view-depth [data-tool=region]").focus();
  await page.keyboard.press("Enter");
  await drawn(page).focus();
  await page.keyboard.press("Shift+ArrowLeft");
  await page.locator("#said", { hasText: /^\d+\.\d\d mm, pixel 320, 240$/ }).waitFor({ state: "attached" });
  await page.keyboard.press("Enter");
  for (let at = 0; at < 6; at++) for (const key of ["Shift+ArrowRight", "Shift+ArrowDown"]) await page.keyboard.press(key);
  await page.keyboard.press("Enter");
  await told(page, "pixels").waitFor();
  const [width, height] = (await told(page, "pixels").textContent()).split(" × ").map(Number);
  assert.ok(width > 6 && width === height, `${width} x ${height}`);
  assert.deepEqual(page.complaints, []);
});

test("a click, two fingers or a touch that the system takes away measure nothing", async () => {
  const page = await depth({ hasTouch: true, viewport: { width: 820, height: 1180 } });
  const sent = posts(page);
  await page.locator("#view-depth [data-tool=region]").tap();
  const box = await drawn(page).boundingBox();
  const at = (part, id) => ({ x: box.x + part * box.width, y: box.y + part * box.height, id });
  const system = await page.context().newCDPSession(page);
  const touch = (type, ...touchPoints) => system.send("Input.dispatchTouchEvent", { type, touchPoints });
  await page.mouse.click(at(0.5).x, at(0.5).y);
  await touch("touchStart", at(0.4, 0));
  await touch("touchStart", at(0.4, 0), at(0.6, 1));
  for (const part of [0.35, 0.3, 0.25]) await touch("touchMove", at(part, 0), at(1 - part, 1));
  await touch("touchEnd", at(0.75, 1));
  await touch("touchEnd");
  await touch("touchStart", at(0.4, 0));
  await touch("touchMove", at(0.5, 0));
  await touch("touchCancel");
  await page.waitForTimeout(300);
  assert.deepEqual(sent.filter(({ path }) => path.startsWith("/api/captures/")), []);
  // A finger that is lifted leaves the figures of its pixel.
  await touch("touchStart", at(0.5, 0));
  await touch("touchEnd");
  assert.match(await page.locator(".probe output").textContent(), /mm$/);
});

test("a region ends at the edge of the picture where the pointer leaves it", async () => {
  const page = await depth();
  const sent = posts(page);
  await page.locator("#view-depth [data-tool=region]").click();
  const box = await drawn(page).boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width + 40, box.y + box.height / 2 + 30);
  await page.mouse.up();
  await told(page, "pixels").waitFor();
  const { x, width } = sent.at(-1).body;
  assert.equal(x + width, 640);
});

test("a region whose answer is late does not become the last one", async () => {
  const page = await depth();
  let late = 0;
  await page.route("**/region", async (route) => {
    if (!late++) await new Promise((done) => setTimeout(done, 1000));
    await route.continue();
  });
  const sent = posts(page);
  await page.locator("#view-depth [data-tool=region]").click();
  const box = await drawn(page).boundingBox();
  for (const [from, to] of [[0.3, 0.4], [0.7, 0.75]]) {
    await page.mouse.move(box.x + box.width * from, box.y + box.height * 0.4);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * to, box.y + box.height * 0.5, { steps: 3 });
    await page.mouse.up();
  }
  await told(page, "step to the region before").waitFor();
  const { width, height } = sent.at(-1).body;
  assert.equal(await told(page, "pixels").textContent(), `${width} × ${height}`);
});

test("a large picture becomes no larger when it is zoomed out", async () => {
  const page = await open(browser, server.address);
  const scales = await page.evaluate(async () => {
    const { Viewer } = await import("/viewer.js");
    const viewer = new Viewer("large");
    Object.assign(viewer.element.style, { position: "fixed", inset: "0 auto auto 0", width: "400px", height: "300px" });
    document.body.append(viewer.element);
    viewer.show(new ImageData(8192, 64));
    viewer.paint();
    const fits = viewer.scale;
    viewer.zoom(0.8);
    return [fits, viewer.scale];
  });
  assert.ok(scales[1] <= scales[0], `${scales}`);
});

test("a key that is held down acts once", async () => {
  const page = await open(browser, `${server.address}#log`);
  const sent = posts(page);
  await page.locator("#view").focus();
  for (let at = 0; at < 10; at++) await page.keyboard.down("l");
  await page.keyboard.up("l");
  await page.waitForTimeout(300);
  assert.equal(sent.filter(({ path }) => path === "/api/live").length, 1);
});

test("letters act no more once they are switched off, and Esc still stops", async () => {
  const page = await open(browser, `${server.address}#log`);
  await page.getByRole("button", { name: "Keys" }).click();
  await page.getByLabel("Use these keys; Esc always stops").uncheck();
  await page.getByRole("button", { name: "Close", exact: true }).click();
  await page.reload();
  await page.locator("#link[data-phase=ready]").waitFor();
  const sent = posts(page);
  await page.keyboard.press("l");
  await page.keyboard.press("Escape");
  await page.waitForTimeout(300);
  assert.deepEqual(sent.map(({ path }) => path).filter((path) => /live|stop/.test(path)), ["/api/stop"]);
});

test("a button keeps the focus while its job runs, and does nothing then", async () => {
  const page = await open(browser, `${server.address}#live`);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await page.getByLabel("compute depth").uncheck(); // the view stays
  const capture = page.getByRole("button", { name: "Capture pair" });
  const sent = posts(page);
  await capture.press("Enter");
  await page.locator("[data-capture][aria-disabled=true]").first().waitFor();
  await page.keyboard.press("Enter");
  await page.locator("[data-capture][aria-disabled=false]").first().waitFor();
  assert.ok(await capture.evaluate((button) => button === document.activeElement));
  assert.equal(sent.filter(({ path }) => path === "/api/captures").length, 1);
});

test("a plot and a histogram tell their range, their largest value and how many there are", async () => {
  const page = await depth();
  assert.match(await page.locator("#view-depth .histogram").getAttribute("aria-label"), /^distribution of the values: \d{5,6} pixels from [\d.]+ mm to [\d.]+ mm, most near [\d.]+ mm$/);
  await page.locator("#view-depth [data-tool=line]").click();
  const box = await drawn(page).boundingBox();
  await page.mouse.move(box.x + 0.3 * box.width, box.y + 0.5 * box.height);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.7 * box.width, box.y + 0.5 * box.height);
  await page.mouse.up();
  const plot = page.locator("#view-depth .plot[aria-label*=values]");
  await plot.waitFor();
  assert.match(await plot.getAttribute("aria-label"), /: depth, \d{3} values from [\d.]+ to [\d.]+, the largest at \d+/);
});

test("reasons are right where a browser changes the values of a canvas, and the surface does not keep their legend", async () => {
  const context = await browser.newContext();
  await context.addInitScript(() => {
    const { getImageData } = CanvasRenderingContext2D.prototype;
    CanvasRenderingContext2D.prototype.getImageData = function (...given) {
      const image = getImageData.apply(this, given);
      image.data.fill(77);
      return image;
    };
  });
  const page = await context.newPage();
  await page.goto(`${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.locator("button[data-layer=reason]:enabled").click();
  const legend = page.locator(".reasons span");
  await legend.filter({ hasText: "depth measured" }).waitFor();
  const wrong = await page.evaluate(async () => {
    const buffer = await (await fetch("/api/captures/pair-001/files/far.png")).arrayBuffer();
    const picture = await createImageBitmap(new Blob([buffer]));
    const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
    context.drawImage(picture, 0, 0);
    const { data } = context.getImageData(0, 0, picture.width, picture.height);
    const image = await (await import("/png.js")).parse(buffer);
    return image.data.filter((value, at) => value !== data[4 * at]).length;
  });
  assert.equal(wrong, 0);
  await page.locator("button[data-layer=surface]:enabled").click();
  await legend.first().waitFor({ state: "detached" });
  assert.ok(await page.locator("#view-depth .legend-bar").isVisible());
});

test("a question answers itself with nothing that is typed for a field", async () => {
  const page = await open(browser, server.address);
  await page.getByLabel("Lens: go to, in µm").click();
  await page.keyboard.type("12");
  await page.evaluate(async () => {
    const { ask } = await import("/ui.js");
    ask("Put the target at 900 mm", { text: true }).then((answer) => { globalThis.answered = answer; });
  });
  await page.keyboard.type("34");
  await page.keyboard.press("Enter");
  const dialog = page.getByRole("dialog", { name: "Put the target at 900 mm" });
  assert.ok(await dialog.isVisible());
  assert.equal(await page.evaluate(() => globalThis.answered), undefined);
});

test("the focus stays in the list after a capture is renamed or deleted, and in the page after a notice is closed", async () => {
  for (const name of ["one", "two", "x".repeat(200)]) cpSync(join(server.session, "pair-001"), join(server.session, name), { recursive: true });
  const page = await open(browser, `${server.address}#captures`);
  const focused = () => page.evaluate(() => document.activeElement.getAttribute("aria-label") ?? document.activeElement.id);
  const until = (wanted) => page.waitForFunction((wanted) => document.activeElement.getAttribute("aria-label") === wanted, wanted);
  const card = (name) => page.locator(".capture-card", { has: page.getByRole("heading", { name, exact: true }) });
  await card("one").waitFor();
  assert.equal(await page.locator(".captures").evaluate((list) => list.scrollWidth - list.clientWidth), 0, "a long name is broken");
  await card("one").getByRole("button", { name: "Rename" }).press("Enter");
  await page.keyboard.type("three");
  await page.keyboard.press("Enter");
  await until("Open three");
  await card("three").getByRole("button", { name: "Delete" }).press("Enter");
  await page.getByRole("dialog").getByRole("button", { name: "Delete" }).press("Enter");
  await card("three").waitFor({ state: "detached" });
  await page.waitForFunction(() => document.activeElement.closest(".capture-card"));
  await page.evaluate(async () => (await import("/ui.js")).notice("An error", "error"));
  await page.locator("#notices button").press("Enter");
  assert.equal(await focused(), "view");
});

test("a screen reader announces the begin and the end of a job, and no counters", async () => {
  const page = await open(browser, server.address);
  const live = page.getByRole("button", { name: "Live image" });
  await page.locator("#view-live .group button:enabled").first().waitFor();
  if ((await live.getAttribute("aria-pressed")) !== "true") await live.click();
  await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
  await page.evaluate(() => {
    globalThis.heard = [];
    const live = "[role=status], [role=alert], [role=log], [aria-live=polite], output";
    new MutationObserver((changes) => {
      for (const { target, addedNodes } of changes) {
        const place = (target instanceof Element ? target : target.parentElement).closest(live);
        const loud = [place, ...[...addedNodes].flatMap((node) => (node instanceof Element ? [...node.querySelectorAll("output")] : []))];
        for (const one of loud) if (one && one.ariaLive !== "off") globalThis.heard.push(one.textContent);
      }
    }).observe(document.body, { subtree: true, childList: true, characterData: true });
  });
  await page.waitForTimeout(2000);
  assert.deepEqual(await page.evaluate(() => globalThis.heard), []);
  await page.getByRole("button", { name: "Near focus" }).click();
  await page.locator("#said", { hasText: ": done" }).waitFor({ state: "attached" });
  const heard = await page.evaluate(() => globalThis.heard);
  assert.ok(heard.some((text) => text.endsWith(" has begun")) && heard.length < 4, JSON.stringify(heard));
});

test("a field names its unit, and is marked while it has no number", async () => {
  const page = await open(browser, server.address);
  const exposure = page.getByLabel("Exposure", { exact: true });
  assert.equal(await exposure.evaluate((input) => document.getElementById(input.getAttribute("aria-describedby")).textContent), "µs");
  await exposure.fill("");
  await exposure.press("Tab");
  await page.waitForFunction(() => document.querySelector("#notices .error"));
  assert.equal(await exposure.getAttribute("aria-invalid"), "true");
  await exposure.fill("4000");
  assert.equal(await exposure.getAttribute("aria-invalid"), null);
});

test("a short or enlarged window hides nothing behind the rig, and keeps Stop", async () => {
  for (const [width, height] of [[1000, 700], [720, 450], [320, 256]]) {
    const page = await depth({ viewport: { width, height } });
    const [view, rig] = await page.evaluate(() => ["#view", "#rig"].map((name) => document.querySelector(name).getBoundingClientRect()).map(({ top, bottom }) => ({ top, bottom })));
    assert.ok(view.bottom <= rig.top, `${width} x ${height}: ${view.bottom} px of the view, the rig at ${rig.top} px`);
    await page.locator("#rig summary").scrollIntoViewIfNeeded();
    assert.ok(await page.locator("#stop").evaluate((stop) => stop.contains(document.elementFromPoint(stop.getBoundingClientRect().x + 9, stop.getBoundingClientRect().y + 9))));
    if (height < 420) assert.equal(await page.locator("#top").evaluate((top) => getComputedStyle(top).position), "static");
    await page.context().close();
    await server.released();
  }
});

test("with the system's colours the selected view, the pressed layer and the keys of the reasons are seen", async () => {
  const page = await depth({ forcedColors: "active" });
  await page.locator("button[data-layer=reason]").click();
  const paint = (selector) => page.locator(selector).first().evaluate((element) => getComputedStyle(element).backgroundColor);
  assert.notEqual(await paint("#tabs [aria-selected=true]"), await paint("#tabs [aria-selected=false]"));
  assert.notEqual(await paint("#view-depth [data-layer][aria-pressed=true]"), await paint("#view-depth [data-layer][aria-pressed=false]"));
  assert.equal(await paint(".reasons i"), "rgb(47, 58, 64)");
});

test("colours of the reasons differ also for people with a colour-vision deficiency", async () => {
  const page = await open(browser, server.address);
  const colours = await page.evaluate(async () => (await import("/reasons.js")).REASON_COLOURS);
  // Machado, Oliveira & Fernandes 2009, full deficiency; linear sRGB.
  const eyes = {
    protanopia: [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998],
    deuteranopia: [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.01182, 0.04294, 0.968881],
    tritanopia: [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.3039],
  };
  const times = (matrix, v) => [0, 3, 6].map((row) => matrix[row] * v[0] + matrix[row + 1] * v[1] + matrix[row + 2] * v[2]);
  const linear = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  const lab = (rgb) => {
    const xyz = times([0.433899, 0.376226, 0.189908, 0.212673, 0.715152, 0.072175, 0.017756, 0.109472, 0.872877], rgb.map((c) => Math.max(0, Math.min(1, c))));
    const [x, y, z] = xyz.map((c) => (c > 0.008856 ? Math.cbrt(c) : 7.787 * c + 16 / 116));
    return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
  };
  for (const [eye, matrix] of Object.entries(eyes)) {
    const seen = colours.map((text) => lab(times(matrix, linear(text))));
    seen.forEach((one, at) => seen.slice(0, at).forEach((other, before) => {
      const apart = Math.hypot(...one.map((value, channel) => value - other[channel]));
      assert.ok(apart > 20, `${eye}: ${colours[at]} and ${colours[before]} differ by ${apart.toFixed(1)}`);
    }));
  }
});

test("dates have one form in every language, and the sun's time is also shown in UTC", async () => {
  const page = await open(browser, `${server.address}#captures`, { locale: "ar-EG", timezoneId: "Asia/Tokyo" });
  await page.locator(".capture-words p", { hasText: /\d{4}-\d\d-\d\d \d\d:\d\d:\d\d$/ }).first().waitFor();
  await page.locator("#tab-guides").click();
  await page.locator("button[data-guide=shadow]").click();
  const time = page.locator("#view-guides").getByLabel("Time", { exact: true });
  await time.fill("2026-06-21T12:00");
  await page.locator("#view-guides dd", { hasText: "2026-06-21 03:00" }).waitFor();
  await time.fill("");
  await page.locator("#view-guides .bad", { hasText: "Time: expected a date and a time" }).waitFor();
  assert.equal(await page.locator("#view-guides dd", { hasText: "2026-06-21" }).count(), 0, "figures of the time before");
});

test("a colour image has the values of its file, also where it is transparent", async () => {
  const page = await open(browser, server.address);
  const values = await page.evaluate(async (text) => {
    const { parse } = await import("/png.js");
    return [...(await parse(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer)).data];
  }, COLOURS);
  assert.deepEqual(values, [1, 200, 11, 201]);
});

test("the page starts in a browser that keeps nothing for it and has no known language", async () => {
  const context = await browser.newContext();
  await context.addInitScript(() => {
    for (const name of ["localStorage", "sessionStorage"]) Object.defineProperty(globalThis, name, { get() { throw new DOMException("denied", "SecurityError"); } });
    Object.defineProperty(Navigator.prototype, "language", { get: () => "C" });
  });
  const page = await context.newPage();
  await page.goto(server.address);
  await page.locator("#link[data-phase=ready]").waitFor();
  await page.locator("#theme").click();
  assert.equal(await page.locator("#notices .error").count(), 0);
});
