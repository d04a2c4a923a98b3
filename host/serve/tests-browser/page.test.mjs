// The page in a real browser, on the emulated rig: `npm ci && npm test`, or `cargo xtask test`.
// SCREENSHOTS=folder keeps pictures of every view; those of the documents are made by pictures.mjs.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { test } from "node:test";
import { Validator } from "@seriousme/openapi-schema-validator";
import { browser, knows, oneServer, open, reloaded, serve, server, simulator } from "./server.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const VIEWS = ["live", "depth", "optics", "captures", "quality", "guides", "log"];
const GUIDES = ["power", "psf", "lens", "series", "shadow", "activity"];
/** Colours do not depend on the size. */
const SIZES = [[1440, 900, "light", "dark"], [820, 1180, "light"], [390, 844, "light"]];

if (process.env.SCREENSHOTS) mkdirSync(process.env.SCREENSHOTS, { recursive: true });
oneServer();

const state = () => server.ask("/api/state");

/** The state, once it fits. */
async function until(fits, what, seconds = 60) {
  for (let round = 0; round < 20 * seconds; round++) {
    const now = await state();
    if (fits(now)) return now;
    await new Promise((done) => setTimeout(done, 50));
  }
  assert.fail(`${what}: ${JSON.stringify(await state())}`);
}

const moving = ({ rig }) => rig.info.coarse.moving || rig.info.lens.moving;
const still = (now) => !moving(now) && now.job?.phase !== "running";

test("the page's JavaScript agrees with its types", () => {
  const compiler = createRequire(import.meta.url).resolve("typescript/bin/tsc");
  const { status, stdout } = spawnSync(process.execPath, [compiler, "--project", import.meta.dirname], { encoding: "utf8" });
  assert.equal(status, 0, stdout);
});

test("the OpenAPI document is valid", async () => {
  const found = await new Validator().validate(await server.ask("/openapi.json"));
  assert.ok(found.valid, JSON.stringify(found.errors));
});

test("the first power-up goes through the checklist, with a verdict for each step", async () => {
  const page = await open(browser, `${server.address}#guides/power`);
  await page.getByRole("button", { name: "Start the checklist" }).click();
  const { job } = await until((now) => now.job?.kind === "check" && now.job.phase !== "running", "the list is gone through", 400);
  assert.equal(job.phase, "done", job.error);
  assert.equal(job.result.failed, 0, JSON.stringify(job.result.steps));
  await page.locator("#view-guides .status", { hasText: `${job.result.passed} passed, 0 failed` }).waitFor();
  assert.equal(await page.locator(".verdict[data-verdict=passed]").count(), job.result.passed);
  assert.ok(job.result.passed > 8, JSON.stringify(job.result.steps));
  if (process.env.SCREENSHOTS) await page.screenshot({ path: join(process.env.SCREENSHOTS, "power-up.png") });
  assert.deepEqual(page.complaints, []);
});

test("from the open page to a turning surface in two clicks", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Capture pair" }).click();
  const surface = page.getByRole("button", { name: "3-D" });
  await surface.waitFor();
  let meshes = 0;
  page.on("request", (request) => { meshes += request.url().endsWith("/mesh.ply"); });
  await surface.dblclick();
  const canvas = page.locator(".surface canvas");
  await canvas.waitFor();
  assert.ok(Number(await page.locator(".surface").getAttribute("data-triangles")) > 10_000);
  // Without a graphics card a frame may take seconds.
  const picture = async () => createHash("sha256").update(await canvas.screenshot()).digest("hex");
  const first = await picture();
  let turned = false;
  for (let at = 0; at < 30 && !turned; at++) {
    await page.waitForTimeout(1000);
    turned = (await picture()) !== first;
  }
  assert.ok(turned, "it turns");
  assert.equal(meshes, 1, "a second click does not begin it anew");
  assert.deepEqual(page.complaints, []);
  const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
  const age = await page.locator("#view-depth .viewer canvas").getAttribute("data-age-ms");
  console.log(`first paint after ${Math.round(paint)} ms; depth on the screen ${age} ms after the near image`);
  await page.context().close();
});

test("a browser that is too old for the page, or runs no scripts, is told so", async () => {
  const context = await browser.newContext({ javaScriptEnabled: false });
  const page = await context.newPage();
  await page.goto(server.address);
  await page.getByText("it needs JavaScript, and a browser not older than").waitFor();
  await context.close();
  const served = await open(browser, server.address);
  assert.equal(await served.locator("#waiting").count(), 0, "where it starts, nothing of that is left");
});

test("the depth of the capture is that of the staircase", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("[data-layer=depth][aria-pressed=true]").waitFor();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.getByRole("button", { name: "Region" }).click();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  await page.locator("#view-depth .legend span", { hasText: "mm" }).first().waitFor();
  await page.mouse.move(box.x + box.width * 0.4, box.y + box.height * 0.4);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.44, box.y + box.height * 0.6, { steps: 5 });
  await page.mouse.up();
  const rms = page.locator("dt", { hasText: "plane: RMS" }).locator("+ dd");
  await rms.waitFor();
  const mm = Number.parseFloat(await rms.textContent());
  // A step of the staircase is flat; with the page's method 8 bits of noise leave 0.1 mm, more at the step's edges.
  assert.ok(mm > 0.02 && mm < 1, `${mm} mm`);
  assert.match(await page.locator(".probe output").textContent(), /^\d{3}\.\d\d mm$/);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("Esc stops a move under way, and the positions stay known", async () => {
  const page = await open(browser, server.address);
  await until(still, "at rest");
  const go = async (um) => {
    await page.getByLabel("Lens: go to, in µm").fill(String(um));
    await page.getByRole("button", { name: "Lens: go", exact: true }).click();
  };
  await go(12000);
  await until(moving, "it moves");
  await page.keyboard.press("Escape");
  const { rig, job } = await until((now) => still(now) && now.job?.kind === "move", "it stands");
  assert.equal(job.phase, "stopped");
  assert.ok(rig.info.lens.measured_um < 11500, "before its target");
  assert.equal(rig.info.lens.state, "homed", "along the ramp");
  // Back to where the optics are in reach.
  await go(0);
  await until((now) => still(now) && now.job?.phase === "done", "it is back");
  assert.deepEqual(page.complaints, []);
});

test("a closed tab stops what it began, with the reason, three seconds later at the latest", async () => {
  const page = await open(browser, server.address);
  await page.getByText("Average, series, still, stack").click();
  await page.getByLabel("Pairs of the series").fill("50");
  await page.getByRole("button", { name: "Series", exact: true }).click();
  await until((now) => now.job?.kind === "series" && now.job.phase === "running", "the series begins");
  await page.waitForTimeout(1000);
  await page.context().close();
  const closed = Date.now();
  const { job, rig } = await until((now) => now.job.phase !== "running", "it ends");
  assert.ok(Date.now() - closed > 2000 && Date.now() - closed < 6000, `${Date.now() - closed} ms`);
  assert.equal(job.phase, "stopped");
  assert.match(job.error, /the browser that had control has disconnected/);
  assert.equal(rig.info.lens.state, "homed");
});

test("a page that is loaded again goes on where it was", async () => {
  // The newest capture may be one of the stopped series, without depth.
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.reload();
  await page.locator("canvas[data-layer=depth]").waitFor();
  assert.match(page.url(), /#depth\/pair-001$/);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await page.context().close();
});

test("a second browser watches, asks, and is given the controls", async () => {
  const first = await open(browser, server.address);
  await first.locator("#who", { hasText: "you have control" }).waitFor();
  const second = await open(browser, server.address);
  await second.locator("#who", { hasText: "another browser has control" }).waitFor();
  assert.ok(await second.getByRole("button", { name: "Home", exact: true }).isDisabled());
  await second.getByRole("button", { name: "Ask for control" }).click();
  const handOver = first.getByRole("button", { name: "Hand over" });
  await handOver.waitFor();
  await first.locator("#stop").click();
  await handOver.click();
  await second.locator("#who", { hasText: "you have control" }).waitFor();
  await first.locator("#who", { hasText: "another browser has control" }).waitFor();
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
  await page.locator(".status", { hasText: "frames/s" }).waitFor({ timeout: 60_000 }).catch(async (error) => {
    assert.fail(`${error}: ${JSON.stringify({ ...await state(), ...await server.ask("/api/log") })}`);
  });
  await page.context().close();
});

test("live depth is recorded and played back", async () => {
  const page = await open(browser, server.address);
  const record = page.getByRole("button", { name: "Record", exact: true });
  assert.ok(await record.isDisabled(), "there is nothing to record");
  await page.getByRole("button", { name: "Live depth" }).click();
  await page.locator(".status", { hasText: "ms from image to map" }).waitFor();
  await record.click();
  await until((now) => now.live.recording, "it records");
  await page.waitForTimeout(4000);
  await page.getByRole("button", { name: "Stop recording" }).click();
  await until((now) => !now.live.recording, "the recording ends");
  await page.keyboard.press("Escape");
  await until((now) => now.live.mode === "off", "live depth ends");
  await page.getByLabel("Recording", { exact: true }).locator("option", { hasText: "live-001" }).waitFor({ state: "attached" });
  await page.getByLabel("as fast as it goes").check();
  const before = Number(await page.getByLabel("Live depth;").getAttribute("data-painted"));
  await page.getByRole("button", { name: "Play" }).click();
  const { computation } = await until((now) => now.computation?.kind === "play" && now.computation.phase !== "running", "it is played");
  assert.equal(computation.phase, "done", computation.error);
  assert.ok(computation.result.pairs >= 1 && computation.result.maps_per_second > 0, JSON.stringify(computation.result));
  console.log(`recording: ${computation.result.pairs} pairs, ${computation.result.maps_per_second} maps/s, ${computation.result.latency_ms} ms a map, ${Number(await page.getByLabel("Live depth;").getAttribute("data-painted")) - before} painted`);
  await page.locator("p", { hasText: "maps/s" }).last().waitFor();
  assert.deepEqual(page.complaints, []);
});

/** What the page painted in a while: pictures a second, and how old they were then (median, ms). */
async function painted(page, canvas, seconds) {
  const [begin, ages] = [Date.now(), []];
  const count = async () => Number((await canvas.getAttribute("data-painted")) ?? 0);
  const first = await count();
  while (Date.now() - begin < 1000 * seconds) {
    ages.push(Number(await canvas.getAttribute("data-age-ms")));
    await page.waitForTimeout(50);
  }
  const rate = (await count() - first) / ((Date.now() - begin) / 1000);
  return { rate, age: ages.sort((a, b) => a - b)[Math.floor(ages.length / 2)] };
}

test("a recording that the disk has no more room for says so, and keeps what it has", async () => {
  // A pair has 1.2 MB.
  const full = await serve(["--rig", "sim"], 8000);
  try {
    const page = await open(browser, full.address);
    await page.getByRole("button", { name: "Live depth" }).click();
    await page.locator(".status", { hasText: "ms from image to map" }).waitFor();
    await page.getByRole("button", { name: "Record", exact: true }).click();
    await page.getByText(/The recording live-001.* has ended: cannot write .*live-001.*; what was recorded before is kept/).waitFor();
    await page.getByLabel("Recording", { exact: true }).locator("option", { hasText: "live-001" }).waitFor({ state: "attached" });
    assert.equal((await full.ask("/api/state")).live.mode, "depth", "live depth goes on");
    assert.deepEqual(page.complaints, []);
    await page.context().close();
  } finally {
    assert.equal(await full.close(), 0);
  }
});

test("a camera without a rig is seen live, and nothing that needs a rig is offered", async () => {
  const alone = await serve(["--camera", `command:640x480:gray:${process.execPath} ${join(import.meta.dirname, "camera.mjs")}`]);
  try {
    const page = await open(browser, alone.address, {}, "absent");
    await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
    const canvas = page.locator("#view-live .viewer canvas").first();
    await page.waitForFunction(() => Number(document.querySelector("#view-live .viewer canvas").dataset.painted) > 5);
    const { rate, age } = await painted(page, canvas, 5);
    console.log(`live image of 640x480 px, 30 a second: ${rate.toFixed(1)} painted a second, ${age} ms old (median)`);
    assert.ok(await page.getByRole("button", { name: "Live depth" }).isDisabled());
    assert.ok(await page.getByRole("button", { name: "Capture pair" }).isDisabled());
    await page.getByText("Gain, region and what else it has").click();
    await page.getByText("A camera of the kind command has nothing to set").waitFor();
    assert.deepEqual(page.complaints, []);
    await page.context().close();
  } finally {
    assert.equal(await alone.close(), 0);
  }
});

test("a GigE Vision camera that the rig triggers: live image and a pair", { skip: !knows("genicam") && "farnear was built without the feature genicam" }, async () => {
  const rig = await simulator(["--gige", "lo", "--paced"]);
  const beside = await serve(["--rig", rig.said.port, "--camera", `genicam:${rig.said.gige}`]);
  try {
    const page = await open(browser, beside.address);
    await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
    await page.waitForFunction(() => Number(document.querySelector("#view-live .viewer canvas").dataset.painted) > 3);
    await page.getByText("Gain, region and what else it has").click();
    await page.locator("#view-live .camera [name=gain]").waitFor();
    await page.getByRole("button", { name: "Capture pair" }).click();
    await page.locator("canvas[data-layer=depth]").waitFor();
    await page.locator("button[data-layer=surface]:enabled").waitFor();
    const { capture } = await beside.ask("/api/captures/pair-001");
    assert.equal(capture.has_depth, true, JSON.stringify(capture));
    assert.match(readFileSync(join(beside.session, "pair-001", "capture.toml"), "utf8"), /genicam/);
    assert.deepEqual(page.complaints, []);
    await page.context().close();
  } finally {
    assert.equal(await beside.close(), 0);
    await rig.close();
  }
});

test("the guide of the flat series captures targets, learns a correction and finds the point spread function", async () => {
  const page = await open(browser, `${server.address}#guides/series`);
  await page.locator("#view-guides").getByLabel("Distances in mm").fill("890, 910, 930");
  await page.getByRole("button", { name: "Capture the series" }).click();
  await page.locator(".status", { hasText: "3 targets: 890.0, 910.0, 930.0 mm" }).waitFor();
  await page.locator("#view-guides").getByLabel("Method", { exact: true }).selectOption("cdc");
  await page.getByRole("button", { name: "Learn", exact: true }).click();
  await page.locator("dt", { hasText: "RMS after" }).waitFor();
  const mm = async (name) => Number.parseFloat(await page.locator("dt", { hasText: name }).locator("+ dd").textContent());
  assert.ok((await mm("RMS after")) <= (await mm("RMS before")), "a correction makes it no worse");
  await page.locator("button[data-guide=psf]").click();
  await page.getByLabel("the flat series: 3 targets at known distances").check();
  await page.getByRole("button", { name: "Find", exact: true }).click();
  const found = page.locator("dt", { hasText: "point spread function" }).locator("+ dd");
  await found.waitFor();
  // The emulated lens is that of the session's optics: a Gaussian with k = 0.4578.
  const k = Number.parseFloat((await found.textContent()).match(/k=([0-9.]+)/)[1]);
  assert.ok(Math.abs(k - 0.4578) < 0.03, `k = ${k}`);
  assert.deepEqual(page.complaints, []);
});

test("two questions with the same words are both asked", async () => {
  const page = await open(browser, server.address);
  await page.addInitScript(() => {
    globalThis.WebSocket = class extends WebSocket {
      constructor(...given) {
        super(...given);
        globalThis.line = this;
      }
    };
  });
  await page.reload();
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await page.evaluate(() => {
    globalThis.receive = globalThis.line.onmessage;
    globalThis.line.onmessage = null;
  });
  // Only the newest state reaches a slow page: the one between two questions may be skipped.
  const question = page.getByText("Put the target at 900 mm");
  const ask = (questions) => page.evaluate(async (questions) => {
    const { store } = await import("/link.js");
    const state = { ...store.state, question: "Put the target at 900 mm", questions };
    globalThis.receive({ data: JSON.stringify({ type: "state", state }) });
  }, questions);
  for (const number of [1, 2]) {
    await ask(number);
    await question.waitFor();
    await page.getByRole("button", { name: "Answer", exact: true }).click();
    await question.waitFor({ state: "detached" });
    await ask(number);
    assert.equal(await question.count(), 0, "it is answered");
  }
});

test("the guide of the lens takes a stack, plots blur, response and errors, and puts its lens in use", async () => {
  const page = await open(browser, `${server.address}#guides/lens`);
  const guide = page.locator("#view-guides");
  await guide.getByLabel("Slices").fill("13");
  await reloaded(server, page, "lens-stack", () => guide.getByRole("button", { name: "Calibrate the lens" }).click());
  const told = (name) => guide.locator("dt", { hasText: name }).locator("+ dd").textContent();
  await guide.locator("dt", { hasText: "verdict" }).waitFor();
  await page.reload();
  await guide.locator("dt", { hasText: "verdict" }).waitFor();
  assert.equal(await told("verdict"), "good");
  // 933 to 886.81 mm.
  assert.ok(Math.abs(Number.parseFloat(await told("working range")) - 46.19) < 0.5, await told("working range"));
  await guide.locator(".plot canvas").nth(2).waitFor();
  const { optics: before } = await server.ask("/api/optics");
  await guide.getByRole("button", { name: "Use it" }).click();
  await page.getByText("In use for captures from now on.").waitFor();
  const { optics } = await server.ask("/api/optics");
  assert.equal(optics.stage.bin, 1);
  // The other tests want the optics of before.
  await page.evaluate(async (optics) => (await import("/link.js")).act("/api/optics", { optics }, "PUT"), before);
  assert.equal((await server.ask("/api/optics")).optics.stage, undefined);
  assert.deepEqual(page.complaints, []);
});

/** Somebody, a bright ellipse, who goes through a picture that stands still; from `Y4M` frames. */
function walk(frames = 40, width = 160, height = 120) {
  const parts = [Buffer.from(`YUV4MPEG2 W${width} H${height} F25:1 Cmono\n`)];
  for (let at = 0; at < frames; at++) {
    const picture = Buffer.alloc(width * height, 60);
    for (let row = 0; row < height; row++) {
      for (let column = 0; column < width; column++) {
        picture[row * width + column] += (row * 7 + column * 13) % 9;
        const [x, y] = [(column - 30 - 2 * Math.max(0, at - 12)) / 11, (row - 62) / 34];
        if (at >= 12 && x * x + y * y < 1) picture[row * width + column] = 200;
      }
    }
    parts.push(Buffer.from("FRAME\n"), picture);
  }
  return Buffer.concat(parts);
}

test("a video that is sent is recognised frame by frame, and its shadow taken off", async () => {
  const page = await open(browser, `${server.address}#guides/activity`);
  const video = join(server.session, "..", `walk-${process.pid}.y4m`);
  writeFileSync(video, walk());
  await page.locator("#view-guides").getByLabel("Video file to send").setInputFiles(video);
  await page.locator("p", { hasText: "is there" }).waitFor();
  rmSync(video);
  await page.getByRole("button", { name: "Recognise the video" }).click();
  const { computation } = await until((now) => now.computation?.kind === "recognise" && now.computation.phase !== "running", "it is recognised");
  assert.equal(computation.phase, "done", computation.error);
  assert.equal(computation.result.frames, 40);
  assert.ok(computation.result.empty_frames < 40, "somebody is seen");
  await page.locator(".person-answer output", { hasText: "of all 40 frames" }).waitFor();
  assert.ok((await page.locator("canvas.person").evaluate((canvas) => canvas.width)) > 0, "the picture is shown");
  await page.locator("button[data-guide=shadow]").click();
  await page.locator("#view-guides").getByLabel("Time", { exact: true }).fill("2026-06-21T12:00");
  await page.locator("dt", { hasText: "shadow's length" }).waitFor();
  await page.getByRole("button", { name: "Take the shadow off" }).click();
  const { computation: cut } = await until((now) => now.computation?.kind === "shadow" && now.computation.phase !== "running", "the shadow is off");
  assert.equal(cut.phase, "done", cut.error);
  await page.locator(".masks img").first().waitFor();
  assert.ok(await page.locator(".masks img").first().evaluate((image) => image.decode().then(() => image.naturalWidth === 160)));
  assert.deepEqual(page.complaints, []);
});

for (const [width, height, ...schemes] of SIZES) {
  for (const colorScheme of schemes) {
    test(`every view at ${width}x${height}, ${colorScheme}: readable by all, nothing beside the screen`, async () => {
      const page = await open(browser, server.address, { viewport: { width, height }, colorScheme });
      for (const view of VIEWS) {
        await page.locator(`#tab-${view}`).click();
        await page.waitForTimeout(800);
        if (process.env.SCREENSHOTS) await page.screenshot({ path: join(process.env.SCREENSHOTS, `${view}-${width}-${colorScheme}.png`) });
        await page.evaluate(AXE);
        const { violations } = await page.evaluate(() => globalThis.axe.run());
        const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
        assert.deepEqual(grave.map(({ id, nodes }) => `${view}: ${id} ${nodes[0].target}`), []);
        const beside = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(beside <= 0, `${view} is ${beside} px too wide`);
        assert.ok(await page.locator("#stop").isVisible());
      }
      for (const guide of GUIDES) {
        await page.locator("#tab-guides").click();
        await page.locator(`button[data-guide=${guide}]`).click();
        await page.waitForTimeout(400);
        if (process.env.SCREENSHOTS) await page.screenshot({ path: join(process.env.SCREENSHOTS, `guide-${guide}-${width}-${colorScheme}.png`) });
        await page.evaluate(AXE);
        const { violations } = await page.evaluate(() => globalThis.axe.run());
        const grave = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
        assert.deepEqual(grave.map(({ id, nodes }) => `${guide}: ${id} ${nodes[0].target}`), []);
        const beside = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(beside <= 0, `${guide} is ${beside} px too wide`);
      }
      assert.deepEqual(page.complaints, []);
      await page.context().close();
    });
  }
}
