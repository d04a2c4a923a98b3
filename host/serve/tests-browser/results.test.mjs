// Results that the page shows: of jobs after a reload, of regions, of recordings, of captures.
import assert from "node:assert/strict";
import { cpSync, readdirSync, rmSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { browser, oneServer, open, reloaded, serve, server } from "./server.mjs";

oneServer();

test("flat series, correction, point spread function and quality are shown after a reload", async () => {
  const page = await open(browser, `${server.address}#guides/series`);
  const guide = page.locator("#view-guides");
  await guide.getByLabel("Distances in mm").fill("890, 910, 930");
  await reloaded(server, page, "flat-series", () => page.getByRole("button", { name: "Capture the series" }).click());
  await guide.locator("dt", { hasText: "error before correction" }).waitFor();
  await guide.locator(".status", { hasText: "3 targets: 890.0, 910.0, 930.0 mm" }).waitFor();
  await guide.getByLabel("Method", { exact: true }).selectOption("cdc");
  await page.getByRole("button", { name: "Learn", exact: true }).click();
  await guide.locator("dt", { hasText: "RMS after" }).waitFor();
  await page.reload();
  await guide.locator("dt", { hasText: "RMS after" }).waitFor();
  await guide.locator("dt", { hasText: "error before correction" }).waitFor();
  await page.locator("button[data-guide=psf]").click();
  await page.getByLabel("the flat series: 3 targets at known distances").check();
  await page.getByRole("button", { name: "Find", exact: true }).click();
  const found = guide.locator("dt", { hasText: "point spread function" });
  await found.waitFor();
  await page.reload();
  await found.waitFor();
  await page.locator("button[data-guide=series]").click();
  await page.getByRole("button", { name: "Forget it" }).click();
  await guide.locator(".status", { hasText: "No target yet." }).waitFor();
  assert.equal(await guide.locator("dt", { hasText: "RMS after" }).count(), 0, "forgotten results are not shown");
  await page.locator("#tab-quality").click();
  await page.getByLabel("Pairs", { exact: true }).fill("2");
  await reloaded(server, page, "quality", () => page.getByRole("button", { name: "Measure" }).click());
  await page.locator(".tile", { hasText: "temporal noise" }).waitFor();
  assert.equal(await page.locator("#view-quality tbody tr").count(), 1);
  assert.deepEqual(page.complaints, []);
});

test("the error of a step is that of means of blocks, and none where a region is too small for it", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Capture pair" }).click();
  await page.locator("button[data-layer=surface]:enabled").waitFor();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  const region = async (from, to) => {
    const answer = page.waitForResponse((one) => one.url().endsWith("/region"));
    await page.mouse.move(box.x + from[0] * box.width, box.y + from[1] * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + to[0] * box.width, box.y + to[1] * box.height, { steps: 4 });
    await page.mouse.up();
    return (await (await answer).json()).figures.standard_error_mm;
  };
  const shown = page.locator("dt", { hasText: "± of the means" }).locator("+ dd span");
  const told = async (text) => {
    await shown.filter({ hasText: text }).waitFor();
    return shown.getAttribute("title");
  };
  await page.getByRole("button", { name: "Region", exact: true }).click();
  const first = await region([0.3, 0.35], [0.48, 0.65]);
  const second = await region([0.52, 0.35], [0.7, 0.65]);
  assert.ok(first > 0 && second > 0, `${first}, ${second}`);
  assert.match(await told(`${Math.hypot(first, second).toFixed(3)} mm`), /24 × 24 px/);
  assert.equal((await region([0.5, 0.5], [0.52, 0.52])) ?? null, null);
  assert.match(await told("–"), /needs four blocks/);
  assert.deepEqual(page.complaints, []);
});

test("depth that another browser computes replaces the map that is shown", async () => {
  const first = await open(browser, `${server.address}#depth/pair-001`);
  await first.locator("canvas[data-layer=depth]").waitFor();
  const watching = await open(browser, `${server.address}#depth/pair-001`);
  await watching.locator("canvas[data-layer=depth]").waitFor();
  await watching.waitForLoadState("networkidle");
  const map = watching.waitForRequest((request) => request.url().endsWith("/pair-001/files/depth.npy"));
  await first.getByRole("button", { name: "Compute depth", exact: true }).click();
  await map;
  await watching.locator("canvas[data-layer=depth]").waitFor();
  assert.deepEqual(watching.complaints, []);
});

test("a recording that a capture ends is reported with its pairs, one that is stopped is not", async () => {
  const page = await open(browser, server.address);
  const record = page.getByRole("button", { name: "Record", exact: true });
  const said = page.getByText("Recording ended: ");
  await page.getByText("Average, series, still, stack").click();
  await page.getByRole("button", { name: "Live depth" }).click();
  for (const stopped of [true, false]) {
    await page.locator("#view-live .status", { hasText: "ms from image to map" }).waitFor();
    await record.click();
    const stop = page.getByRole("button", { name: "Stop recording" });
    await stop.waitFor();
    await page.waitForTimeout(2000);
    if (stopped) await stop.click();
    else await page.getByRole("button", { name: "Still" }).click();
    await record.waitFor();
    if (stopped) {
      await page.waitForTimeout(500);
      assert.equal(await said.count(), 0);
    }
  }
  await said.waitFor();
  assert.match(await said.textContent(), /^Recording ended: live-002\.pairs, [1-9]\d* pairs\.$/);
  await record.click();
  await said.waitFor({ state: "detached" });
  await page.keyboard.press("Escape");
  assert.deepEqual(page.complaints, []);
});

test("images without the board's light are subtracted only where a light is set", async () => {
  const page = await open(browser, server.address);
  await page.getByText("Average, series, still, stack").click();
  const subtract = page.getByLabel("subtract images without the board's light");
  const light = page.getByLabel("Light 1", { exact: true });
  await page.locator("label[title*='set Light 1 or Light 2']").waitFor();
  assert.ok(await subtract.isDisabled());
  await light.fill("50");
  await light.press("Tab");
  await page.waitForFunction(() => !document.querySelector("#view-live .side details input[type=checkbox]").disabled);
  await subtract.check();
  await light.fill("0");
  await light.press("Tab");
  await page.locator("label[title*='set Light 1 or Light 2']").waitFor();
  assert.ok(!(await subtract.isChecked()));
  assert.deepEqual(page.complaints, []);
});

test("a still and a stack are called so among the captures", async () => {
  const page = await open(browser, server.address);
  await page.getByText("Average, series, still, stack").click();
  await page.getByLabel("Images", { exact: true }).fill("3");
  for (const [name, kind] of [["Still", "still"], ["Stack", "stack"]]) {
    await page.locator("#tab-live").click();
    const button = page.getByRole("button", { name, exact: true });
    await button.and(page.locator(":enabled")).click();
    const job = async () => (await server.ask("/api/state")).job;
    for (let now = await job(); now.kind !== kind || now.phase === "running"; now = await job()) await page.waitForTimeout(100);
    await page.locator("#tab-captures").click();
    await page.locator(".capture-card", { hasText: `${kind}-001` }).locator("p", { hasText: new RegExp(`^${kind} · `) }).waitFor();
  }
  assert.equal(await page.locator(".capture-card", { hasText: "sequence" }).count(), 0);
  assert.deepEqual(page.complaints, []);
});

/** A copy of the first pair under another name, without the entries that `dropped` names. */
function copy(name, dropped) {
  const folder = join(server.session, name);
  cpSync(join(server.session, "pair-001"), folder, { recursive: true });
  for (const entry of readdirSync(folder).filter((entry) => dropped.test(entry))) rmSync(join(folder, entry), { recursive: true });
}

/** The depth of the first pair. */
async function depthOfPair() {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.waitForLoadState("networkidle");
  return page;
}

/** Opens a capture from the list of the depth view, which is read again. */
async function choose(page, name) {
  await page.locator("#tab-depth").click();
  await page.getByLabel("Capture", { exact: true }).selectOption(name);
}

test("a comparison with another method ends when another capture is opened", async () => {
  const page = await depthOfPair();
  await page.getByLabel("Method", { exact: true }).first().selectOption("favaro");
  await page.getByLabel("keep as another map, to compare").check();
  await page.getByRole("button", { name: "Compute depth", exact: true }).click();
  const compared = page.getByLabel("Compare with");
  await page.waitForFunction(() => document.querySelector("[aria-label='Compare with']").value.startsWith("variant:favaro"));
  copy("pair-plain", /favaro/);
  const last = page.waitForResponse((one) => one.url().endsWith("/pair-plain/files/near.png"));
  await choose(page, "pair-plain");
  await last;
  await page.waitForTimeout(500);
  assert.equal(await compared.inputValue(), "");
  assert.deepEqual(page.complaints, []);
});

test("the surface is not shown for a capture without depth", async () => {
  copy("pair-images", /^(depth|confidence|uncertainty|reason)\./);
  const page = await depthOfPair();
  await page.locator("button[data-layer=surface]:enabled").click();
  await page.locator(".surface canvas").waitFor();
  await choose(page, "pair-images");
  await page.locator("canvas[data-layer=far]").waitFor();
  assert.equal(await page.locator(".surface canvas").count(), 0);
  assert.deepEqual(page.complaints, []);
});

test("figures of a region are removed with the map", async () => {
  const page = await depthOfPair();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  const hint = page.getByText("Draw a second region");
  const region = async () => {
    await page.mouse.move(box.x + 0.4 * box.width, box.y + 0.4 * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.6 * box.height, { steps: 4 });
    await page.mouse.up();
    await hint.waitFor();
  };
  await page.getByRole("button", { name: "Region", exact: true }).click();
  await region();
  await page.getByRole("button", { name: "Compute depth", exact: true }).click();
  await hint.waitFor({ state: "hidden" });
  await page.waitForTimeout(500);
  await region();
  assert.equal(await page.locator("dt", { hasText: "step to the region before" }).count(), 0);
  assert.deepEqual(page.complaints, []);
});

test("sections without a field in Optics stay in the file", async () => {
  const page = await open(browser, `${server.address}#optics`);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await page.locator(".to-scale").waitFor();
  const put = (optics) => page.evaluate(async (optics) => (await import("/link.js")).act("/api/optics", { optics }, "PUT"), optics);
  const { optics: before } = await server.ask("/api/optics");
  const distortion = { camera_matrix: [[6700, 0, 320], [0, 6700, 240], [0, 0, 1]], coefficients: [0.01, 0, 0, 0] };
  await put({ ...before, lens: { ...before.lens, telecentric: false }, distortion, psf: { model: "ring", inner: 0.5 } });
  await page.waitForFunction(() => document.querySelector("#view-optics select").value === "");
  await page.getByLabel("Far focus", { exact: true }).fill("900");
  await page.locator(".to-scale text", { hasText: "900.0 mm" }).waitFor();
  await page.getByRole("button", { name: "Use these optics" }).click();
  await page.getByText("In use for captures from now on.").waitFor();
  const { optics } = await server.ask("/api/optics");
  await put(before);
  assert.equal(optics.focus.far_mm, 900);
  assert.equal(optics.lens.telecentric, false);
  assert.deepEqual(optics.psf, { model: "ring", inner: 0.5 });
  assert.deepEqual(optics.distortion, distortion);
  assert.deepEqual(page.complaints, []);
});

test("a field without a number is reported by name, and distances may have decimal commas", async () => {
  const page = await open(browser, `${server.address}#quality`);
  await page.getByLabel("True distance", { exact: true }).pressSequentially("1e");
  await page.getByRole("button", { name: "Measure" }).click();
  await page.locator(".notice.error", { hasText: "True distance: expected a number" }).waitFor();
  await page.locator("#tab-guides").click();
  await page.locator("button[data-guide=series]").click();
  const own = page.locator("#view-guides").getByLabel("Distances in mm");
  const start = page.getByRole("button", { name: "Capture the series" });
  await own.fill("890,5, 905");
  await start.click();
  await page.locator(".notice.error", { hasText: "Distance 5: expected a number of mm above the focal length" }).waitFor();
  await page.route("**/api/calibrate/series", (route) => route.fulfill({ json: { job: 0 } }));
  const request = page.waitForRequest((one) => one.url().endsWith("/api/calibrate/series"));
  await own.fill("890,5; 905; 920");
  await start.click();
  assert.deepEqual((await request).postDataJSON(), { distances: [890.5, 905, 920] });
  assert.deepEqual(page.complaints, []);
});

test("a page is loaded again when its server was restarted, because its job numbers mean other jobs", async () => {
  const first = await serve();
  let second = null;
  const page = await open(browser, first.address);
  try {
    await page.evaluate(() => { globalThis.before = true; });
    await first.close();
    second = await serve(undefined, 0, Number(new URL(first.address).port));
    await page.waitForFunction(() => !globalThis.before && document.querySelector("#link[data-phase=ready]"));
  } finally {
    await page.context().close();
    await second?.close();
  }
});

test("a picture of a new pair that comes after its files does not undo the choice of a layer", async () => {
  const page = await open(browser, server.address);
  const late = [];
  await page.routeWebSocket(/./, (socket) => {
    socket.connectToServer().onMessage((message) => {
      if (typeof message !== "string" && message.includes('"type":"fresh"')) late.push(() => socket.send(message));
      else socket.send(message);
    });
  });
  await page.reload();
  await page.waitForFunction(() => !document.querySelector("[data-capture]").disabled);
  await page.getByRole("button", { name: "Capture pair" }).click();
  await page.locator("button[data-layer=reason]:enabled").click();
  const reasons = page.locator(".reasons span", { hasText: "%" }).first();
  await reasons.waitFor();
  assert.equal(late.length, 1);
  late[0]();
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 500))));
  assert.ok(await reasons.isVisible());
  await page.context().close();
});

test("layers stay in use while the files of the shown capture are loaded again", async () => {
  const page = await open(browser, server.address);
  await page.getByRole("button", { name: "Capture pair" }).click();
  const reason = page.locator("button[data-layer=reason]");
  await page.locator("button[data-layer=reason]:enabled").waitFor();
  await page.locator("#view-depth").getByRole("button", { name: "Compute depth" }).waitFor();
  let release;
  const held = new Promise((asked) => page.route("**/files/reason.png", (route) => { release = () => route.continue(); asked(); }));
  await page.locator("#view-depth").getByRole("button", { name: "Compute depth" }).click();
  await held;
  // The layers that are loaded first are drawn by now.
  await page.evaluate(() => new Promise((done) => setTimeout(done, 300)));
  assert.ok(await reason.isEnabled());
  await reason.click();
  await release();
  await page.locator(".reasons span", { hasText: "%" }).first().waitFor();
  await page.unroute("**/files/reason.png");
  // Reasons of the map before do not stay next to a new map.
  await page.route("**/files/reason.png", (route) => route.abort());
  await page.locator("button[data-layer=depth]").click();
  await page.locator("#view-depth").getByRole("button", { name: "Compute depth" }).click();
  await page.locator("button[data-layer=reason]:disabled").waitFor();
  await page.context().close();
});

test("a number with a comma or with the page's own minus is refused, not changed", async () => {
  const page = await open(browser, server.address);
  const lens = page.getByLabel("Lens: go to, in µm");
  const go = page.getByRole("button", { name: "Lens: go", exact: true });
  await lens.pressSequentially("12,5");
  await page.locator(".notice", { hasText: "expected a number with a decimal point" }).waitFor();
  await go.click();
  await page.locator(".notice.error", { hasText: "Lens: go to, in µm: expected a number" }).waitFor();
  assert.equal((await server.ask("/api/state")).job?.kind === "move", false);
  await lens.press("Backspace");
  await lens.pressSequentially(".5");
  assert.deepEqual([await lens.inputValue(), await lens.getAttribute("aria-invalid")], ["12.5", null]);
  await lens.fill("");
  await page.keyboard.insertText("−12.5");
  assert.deepEqual([await lens.inputValue(), await lens.getAttribute("aria-invalid")], ["", "true"]);
});

test("a light keeps its tenths when the other one is changed", async () => {
  const page = await open(browser, server.address);
  await page.evaluate(async () => (await import("/link.js")).act("/api/live", { light_percent: [0.4, 0] }));
  await page.waitForFunction(() => document.querySelector("input[title^='Light output']").value === "0.4");
  const light = page.getByLabel("Light 2", { exact: true });
  await light.fill("50");
  await light.press("Tab");
  for (let now; now?.[1] !== 50; now = (await server.ask("/api/state")).live.light_percent) if (now) assert.equal(now[0], 0.4);
  assert.deepEqual((await server.ask("/api/state")).live.light_percent, [0.4, 50]);
  await page.evaluate(async () => (await import("/link.js")).act("/api/live", { light_percent: [0, 0] }));
});

test("all options of a stack are offered", async () => {
  const page = await open(browser, `${server.address}#depth/stack-001`);
  const panel = page.locator("section.panel", { hasText: "Depth from focus" });
  await panel.getByText("All options").click();
  await panel.getByLabel("smoothing px").waitFor();
  assert.deepEqual(page.complaints, []);
});

test("a capture with a colon in its name is compared under this name", async () => {
  for (const name of ["pair-colon", "pair-colon:2"]) copy(name, /^$/);
  const page = await depthOfPair();
  await page.locator("#tab-live").click();
  await page.locator("#tab-depth").click();
  const map = page.waitForRequest((request) => request.url().endsWith("/depth.npy"));
  await page.getByLabel("Compare with").selectOption("depth:pair-colon:2");
  assert.match((await map).url(), /\/pair-colon%3A2\/files/);
  for (const name of ["pair-colon", "pair-colon:2"]) rmSync(join(server.session, name), { recursive: true });
});

test("the maps of a capture that is renamed are not shown under another name", async () => {
  copy("pair-zz", /^$/);
  const page = await open(browser, `${server.address}#depth/pair-zz`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.waitForLoadState("networkidle");
  const map = page.waitForRequest((request) => request.url().endsWith("/pair-zzz/files/depth.npy"));
  await page.evaluate(async () => (await import("/link.js")).act("/api/captures/pair-zz/rename", { name: "pair-zzz" }));
  await map;
  await page.locator("canvas[data-layer=depth]").waitFor();
  assert.equal(await page.getByLabel("Capture", { exact: true }).inputValue(), "pair-zzz");
  rmSync(join(server.session, "pair-zzz"), { recursive: true });
});

test("a map that cannot be loaded again is not left as the new one", async () => {
  const page = await depthOfPair();
  await page.route("**/files/depth.npy", (route) => route.abort());
  await page.getByRole("button", { name: "Compute depth", exact: true }).click();
  await page.locator("button[data-layer=depth]:disabled").waitFor();
  assert.equal(await page.locator("canvas[data-layer]").count(), 0);
  await page.unroute("**/files/depth.npy");
  await page.locator("#tab-captures").click();
  await page.getByRole("button", { name: "Open pair-001" }).click();
  await page.locator("canvas[data-layer=depth]").waitFor();
});

test("optics are used as they are typed, however late the answers come", async () => {
  const page = await open(browser, `${server.address}#optics`);
  await page.locator(".to-scale").waitFor();
  const { optics: before } = await server.ask("/api/optics");
  const delays = [1500, 0];
  await page.route("**/api/optics/calculate", async (route) => {
    await new Promise((done) => setTimeout(done, delays.shift() ?? 0));
    await route.continue();
  });
  const far = page.getByLabel("Far focus", { exact: true });
  const asked = page.waitForRequest((request) => request.url().endsWith("/calculate"));
  await far.fill("950");
  await asked;
  await far.fill("920");
  await page.getByRole("button", { name: "Use these optics" }).click();
  await page.getByText("In use for captures from now on.").waitFor();
  assert.equal((await server.ask("/api/optics")).optics.focus.far_mm, 920);
  await page.waitForTimeout(1500);
  assert.equal(await page.locator(".to-scale text", { hasText: "920.0 mm" }).count(), 1);
  await page.evaluate(async (optics) => (await import("/link.js")).act("/api/optics", { optics }, "PUT"), before);
});

test("the list of captures is that of the last search, with the pictures of now", async () => {
  const page = await open(browser, `${server.address}#captures`);
  const names = page.locator(".capture-card h3");
  await names.first().waitFor();
  await page.route("**/api/captures?search=s", async (route) => { await new Promise((done) => setTimeout(done, 1000)); await route.continue(); });
  const search = page.getByLabel("Search captures");
  const asked = page.waitForRequest((request) => request.url().endsWith("search=s"));
  await search.fill("s");
  await asked;
  await search.fill("pair-001");
  await page.waitForTimeout(1500);
  assert.deepEqual(await names.allTextContents(), ["pair-001"]);
  const picture = page.waitForRequest((request) => request.url().includes("/pair-001/files/view.png"));
  await page.evaluate(async () => (await import("/link.js")).act("/api/captures/pair-001/depth", { method: "subbarao" }));
  await picture;
  await page.unrouteAll({ behavior: "wait" });
});

test("a duplicated tab watches", async () => {
  const page = await open(browser, server.address);
  const [twin] = await Promise.all([page.context().waitForEvent("page"), page.evaluate(() => { window.open(location.href); })]);
  await twin.getByText("another browser has control").waitFor();
  assert.match(await page.locator("#who").textContent(), /you have control/);
});

test("an address that is not encoded as one opens its view", async () => {
  const page = await open(browser, `${server.address}#log/%ff`);
  await page.locator("#view-log").waitFor();
  assert.deepEqual(page.complaints, []);
});

test("the login tells why a token is refused", async () => {
  const page = await (await browser.newContext()).newPage();
  await page.route("**/login", (route) => route.fulfill({ status: 429, json: { error: "too many wrong tokens" } }));
  await page.goto(`${server.address}login.html`);
  await page.getByLabel("Token").fill("0123456789abcdef");
  await page.getByRole("button", { name: "Open" }).click();
  await page.getByText("too many wrong tokens").waitFor();
  await page.unroute("**/login");
  await page.route("**/login", (route) => route.abort());
  await page.getByRole("button", { name: "Open" }).click();
  await page.getByText("farnear does not answer").waitFor();
});

test("a server that vanishes is reported, and a stop that it does not answer", async () => {
  const silent = await serve();
  const page = await open(browser, silent.address);
  try {
    process.kill(silent.pid, "SIGSTOP");
    await page.locator("#stop").click();
    await page.getByText("farnear has not answered the stop.").waitFor({ timeout: 5000 });
    await page.locator("#link", { hasText: "no connection" }).waitFor({ timeout: 20_000 });
    process.kill(silent.pid, "SIGCONT");
    await page.locator("#link[data-phase=ready]").waitFor();
  } finally {
    process.kill(silent.pid, "SIGCONT");
    await page.context().close();
    await silent.close();
  }
});
