// The page in a real browser, on the emulated rig: `npm ci && npm test`, or `cargo xtask test`.
// SCREENSHOTS=folder keeps pictures of every view; docs/images has two of them.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { Validator } from "@seriousme/openapi-schema-validator";
import { browser as launch, open, serve } from "./server.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const VIEWS = ["live", "depth", "optics", "captures", "quality", "log"];
const SIZES = [[1440, 900], [820, 1180], [390, 844]];
let server;
let browser;

before(async () => {
  server = await serve();
  browser = await launch();
});
after(async () => {
  await browser?.close();
  assert.equal(await server?.close(), 0, "Ctrl-C ends it well");
});

// A test that failed leaves no browser behind that drives.
afterEach(async () => {
  for (const context of browser.contexts()) await context.close();
});

const state = () => server.ask("/api/state");

/** The state, once it fits. */
async function until(fits, what) {
  for (let round = 0; round < 1200; round++) {
    const now = await state();
    if (fits(now)) return now;
    await new Promise((done) => setTimeout(done, 50));
  }
  assert.fail(`${what}: ${JSON.stringify(await state())}`);
}

const moving = ({ rig }) => rig.info.coarse.moving || rig.info.lens.moving;
const still = (now) => !moving(now) && now.job?.phase !== "running";

test("the OpenAPI document is valid", async () => {
  const found = await new Validator().validate(await server.ask("/openapi.json"));
  assert.ok(found.valid, JSON.stringify(found.errors));
});

test("from the open page to a turning surface in two clicks", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Capture pair" }).click();
  const surface = page.getByRole("button", { name: "3-D" });
  await surface.waitFor();
  await surface.click();
  const canvas = page.locator(".surface canvas");
  await canvas.waitFor();
  assert.ok(Number(await page.locator(".surface").getAttribute("data-triangles")) > 10_000);
  const pictures = [];
  for (let at = 0; at < 2; at++) {
    pictures.push((await canvas.screenshot()).toString("base64"));
    await page.waitForTimeout(1500);
  }
  assert.notEqual(pictures[0], pictures[1], "it turns");
  assert.deepEqual(page.complaints, []);
  const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
  console.log(`first paint after ${Math.round(paint)} ms`);
  await page.context().close();
});

test("the depth of the capture is that of the staircase", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("[data-layer=depth][aria-pressed=true]").waitFor();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.getByRole("button", { name: "Region" }).click();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  await page.waitForFunction(() => document.querySelector(".legend span").textContent.includes("mm"));
  await page.mouse.move(box.x + box.width * 0.4, box.y + box.height * 0.4);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.44, box.y + box.height * 0.6, { steps: 5 });
  await page.mouse.up();
  const rms = page.locator("dt", { hasText: "plane: RMS" }).locator("+ dd");
  await rms.waitFor();
  const mm = Number.parseFloat(await rms.textContent());
  // A step of the staircase is flat; the noise of 8 bits leaves about a millimetre.
  assert.ok(mm > 0.1 && mm < 4, `${mm} mm`);
  assert.match(await page.locator(".probe output").textContent(), /^\d{3}\.\d\d mm$/);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("Esc stops a move under way, and a closed tab stops it too", async () => {
  for (const how of ["esc", "close"]) {
    const page = await open(browser, server.address);
    const { rig } = await until(still, "at rest");
    const target = rig.info.lens.measured_um < 6000 ? 12000 : 100;
    await page.getByLabel("Lens: go to, in µm").fill(String(target));
    await page.getByRole("button", { name: "Lens: go", exact: true }).click();
    await until(moving, "it moves");
    if (how === "esc") await page.keyboard.press("Escape");
    else await page.context().close();
    const { rig: stopped, job } = await until(still, "it stands");
    assert.equal(job.phase, "stopped");
    assert.ok(Math.abs(stopped.info.lens.measured_um - target) > 500, "before its target");
    assert.equal(stopped.info.lens.state, "homed", "along the ramp: the position is known");
    if (how === "esc") await page.context().close();
  }
});

test("a page that is loaded again goes on where it was", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("tab", { name: "Depth" }).click();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.reload();
  await page.locator("canvas[data-layer=depth]").waitFor();
  assert.match(page.url(), /#depth\/pair-001$/);
  await page.locator("#who", { hasText: "you drive" }).waitFor();
  await page.context().close();
});

test("a second browser watches, asks, and is given the controls", async () => {
  const first = await open(browser, server.address);
  await first.locator("#who", { hasText: "you drive" }).waitFor();
  const second = await open(browser, server.address);
  await second.locator("#who", { hasText: "another browser drives" }).waitFor();
  assert.ok(await second.getByRole("button", { name: "Home", exact: true }).isDisabled());
  await second.getByRole("button", { name: "Ask for controls" }).click();
  await first.getByRole("button", { name: "Give" }).click();
  await second.locator("#who", { hasText: "you drive" }).waitFor();
  await first.locator("#who", { hasText: "another browser drives" }).waitFor();
  assert.ok(await first.getByRole("button", { name: "Home", exact: true }).isDisabled());
  await first.context().close();
  await second.context().close();
});

test("optics are calculated as they are typed", async () => {
  const page = await open(browser, `${server.address}#optics`);
  await page.locator(".to-scale").waitFor();
  await page.getByLabel("Far focus", { exact: true }).fill("800");
  await page.getByLabel("m1, far").fill("5.17");
  // m2 = m1 + 2 Fe Rmax = 5.17 + 2 x 50 / 12.8 x 0.020002 mm (Li 2014, eq. 4.4)
  await page.locator("dd", { hasText: "5.3263 mm = 5.0 + 0.3263" }).waitFor();
  await page.getByLabel("Far focus", { exact: true }).fill("20");
  await page.locator("[role=alert]", { hasText: "far_mm" }).waitFor();
  assert.equal(page.complaints.filter((text) => !text.includes("400")).length, 0);
  await page.context().close();
});

test("live depth comes, and stop ends it", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Live depth" }).click();
  await page.locator(".status", { hasText: "ms from image to map" }).waitFor();
  await page.keyboard.press("Escape");
  await until((now) => now.live.mode === "off", "live depth ends");
  await page.getByRole("button", { name: "Live image" }).click();
  await page.locator(".status", { hasText: "frames/s" }).waitFor();
  await page.context().close();
});

for (const [width, height] of SIZES) {
  for (const colorScheme of ["light", "dark"]) {
    test(`every view at ${width}x${height}, ${colorScheme}: readable by all, nothing beside the screen`, async () => {
      const page = await open(browser, server.address, { viewport: { width, height }, colorScheme });
      for (const view of VIEWS) {
        await page.locator(`#tab-${view}`).click();
        await page.waitForTimeout(800);
        if (process.env.SCREENSHOTS) {
          mkdirSync(process.env.SCREENSHOTS, { recursive: true });
          await page.screenshot({ path: join(process.env.SCREENSHOTS, `${view}-${width}-${colorScheme}.png`) });
        }
        await page.evaluate(AXE);
        const { violations } = await page.evaluate(() => globalThis.axe.run());
        const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
        assert.deepEqual(grave.map(({ id, nodes }) => `${view}: ${id} ${nodes[0].target}`), []);
        const beside = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(beside <= 0, `${view} is ${beside} px too wide`);
        assert.ok(await page.locator("#stop").isVisible());
      }
      assert.deepEqual(page.complaints, []);
      await page.context().close();
    });
  }
}
