// What a lab person does with the page, a case for each fault that was found once.
import assert from "node:assert/strict";
import { cpSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { browser, oneServer, open, serve, server } from "./server.mjs";

oneServer();

/** Posts as this page would, with its secret. */
const post = (page, path, body = {}) => page.evaluate(async ([path, body]) => {
  const { secret } = (await import("/link.js")).store.client;
  const answer = await fetch(path, { method: "POST", headers: { "content-type": "application/json", "x-farnear-client": secret }, body: JSON.stringify(body) });
  return { status: answer.status, ...(await answer.json()) };
}, [path, body]);

test("the first view leads: home and focus in one click, with progress in the image", async () => {
  const page = await open(browser, server.address);
  const lead = page.locator(".lead");
  await lead.getByRole("button", { name: "Home and focus" }).click();
  await lead.locator("strong", { hasText: "Home" }).waitFor();
  await page.waitForFunction(() => document.querySelector(".lead").hidden);
  const { rig } = await server.ask("/api/state");
  assert.ok(["homed", "moving"].includes(rig.info.lens.state), rig.info.lens.state);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("a job that fails at once is reported with the next step, and the error goes when the next one ends well", async () => {
  const page = await open(browser, `${server.address}#guides/psf`);
  await post(page, "/api/calibrate/psf", { targets: [], series: false, model: "gaussian" });
  await post(page, "/api/calibrate/correction", { method: "cdc" });
  await page.locator(".notice.error").first().waitFor();
  await page.context().close();
});

test("a reload keeps control and the job while another browser watches", async () => {
  const first = await open(browser, server.address);
  await first.locator("#who", { hasText: "you have control" }).waitFor();
  const second = await open(browser, server.address);
  await second.locator("#who", { hasText: "another browser has control" }).waitFor();
  await first.getByRole("button", { name: "Home", exact: true }).click();
  await first.locator("#job", { hasText: "Home" }).waitFor();
  const { job } = await server.ask("/api/state");
  await first.reload();
  await first.locator("#who", { hasText: "you have control" }).waitFor();
  await second.waitForTimeout(4000);
  const now = (await server.ask("/api/state")).job;
  assert.equal(now.id, job.id);
  assert.notEqual(now.phase, "stopped", now.error);
  assert.match(await second.locator("#who").textContent(), /another browser has control/);
  while ((await server.ask("/api/state")).job.phase === "running") await second.waitForTimeout(200);
  await first.context().close();
  await second.context().close();
});

test("why there is no depth: a layer with a legend, and words under the pointer", async () => {
  const page = await open(browser, server.address);
  await page.waitForFunction(() => !document.querySelector("[data-capture]").disabled);
  await page.getByRole("button", { name: "Capture pair" }).click();
  await page.locator("button[data-layer=reason]:enabled").click();
  await page.locator(".reasons span", { hasText: "%" }).first().waitFor();
  await page.locator("#view-depth .viewer canvas").hover();
  await page.locator("dt", { hasText: "no depth because" }).waitFor();
  assert.equal(await page.getByLabel("Method", { exact: true }).first().inputValue(), "whitened");
  await page.locator("button[data-layer=deviation]:enabled").waitFor();
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("another method is compared on the scale of depth, and its difference has figures", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.getByLabel("Method", { exact: true }).first().selectOption("favaro");
  await page.getByLabel("keep as another map, to compare").check();
  await page.getByRole("button", { name: "Compute depth" }).click();
  await page.getByLabel("Compare with").locator("option", { hasText: "difference: favaro" }).waitFor({ state: "attached" });
  await page.getByLabel("Compare with").selectOption({ label: await page.getByLabel("Compare with").locator("option", { hasText: "difference: favaro" }).textContent() });
  await page.getByText(/pixels: mean .* RMS/).waitFor();
  await page.locator("button[data-layer=surface]:enabled").click();
  await page.locator(".surface[data-triangles] canvas").waitFor();
  assert.match(await page.locator("#view-depth .legend-bar").getAttribute("aria-label"), /mm/);
  await page.context().close();
});

test("half the exposure time halves the brightness of the live image", async () => {
  const page = await open(browser, server.address);
  const mean = async () => parseFloat(await page.locator("#view-live dt", { hasText: /^mean$/ }).locator("+ dd").textContent());
  const within = async (low, high) => {
    for (let value = await mean(); !(value >= low && value <= high); value = await mean()) await page.waitForTimeout(100);
  };
  const exposure = page.locator("#view-live").getByLabel("Exposure", { exact: true });
  await within(5, 95);
  const usual = await mean();
  await exposure.fill("2500");
  await exposure.press("Tab");
  await within(0.45 * usual, 0.55 * usual);
  await exposure.fill("5000");
  await exposure.press("Tab");
  await within(0.95 * usual, 1.05 * usual);
  const found = [];
  for (const begun of ["200", "60000"]) {
    await exposure.fill(begun);
    await exposure.press("Tab");
    await page.waitForFunction((us) => document.querySelector("#view-live input[max='1000000']").value === us, begun);
    await page.getByRole("button", { name: "Auto", exact: true }).click();
    await page.locator(".status", { hasText: "frames/s" }).waitFor();
    let last = begun;
    for (let same = 0; same < 8; await page.waitForTimeout(200)) {
      const value = await exposure.inputValue();
      same = value === last && value !== begun ? same + 1 : 0;
      last = value;
    }
    found.push(Number(last));
  }
  assert.ok(found[0] > 1000 && Math.abs(found[0] / found[1] - 1) < 0.2, `both ways lead to one time: ${found} µs`);
  await page.context().close();
});

test("a region drawn in the live image is what its figures and Find focus use", async () => {
  const page = await open(browser, server.address);
  const canvas = page.locator("#view-live .viewer canvas").first();
  const value = async () => parseFloat(await page.locator("#view-live output.big").textContent());
  const differs = async (from) => { while (!(Math.abs((await value()) / from - 1) > 0.05)) await page.waitForTimeout(100); };
  const button = page.getByRole("button", { name: "Region", exact: true });
  await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
  const whole = await value();
  await button.click();
  const box = await canvas.boundingBox();
  await page.mouse.move(box.x + 0.4 * box.width, box.y + 0.4 * box.height);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.55 * box.width, box.y + 0.6 * box.height, { steps: 4 });
  await page.mouse.up();
  await page.waitForFunction(() => document.querySelector("#view-live [aria-pressed=true][title^='Drag']"));
  await differs(whole);
  const [x, y, width, height] = (await server.ask("/api/state")).live.region;
  assert.ok(x > 150 && x + width < 450 && y > 100 && y + height < 400 && width > 20 && height > 20, `${[x, y, width, height]}`);
  const part = await value();
  const sent = page.waitForRequest((request) => request.url().endsWith("/api/rig/focus"));
  await page.getByRole("button", { name: "Find focus" }).click();
  assert.deepEqual((await sent).postDataJSON().region, [x, y, width, height].join(","));
  await page.waitForFunction(async () => ["done", "failed"].includes((await (await fetch("/api/state")).json()).job.phase));
  await button.click();
  await differs(part);
  assert.equal((await server.ask("/api/state")).live.region, null);
  assert.deepEqual(page.complaints, []);
});

test("a click on a rail moves its stage there", async () => {
  const page = await open(browser, server.address);
  const { fine_min_um: low, fine_max_um: high } = (await server.ask("/api/state")).rig.info;
  const rail = page.locator("svg[data-axis=fine]");
  let box = null; // while the rail is redrawn
  while (!box) box = await rail.boundingBox();
  const { width, height } = box;
  for (const part of [0.3, 0.6]) {
    await rail.click({ position: { x: (width * (14 + part * 272)) / 300, y: height / 2 } });
    const wanted = low + part * (high - low);
    const there = async () => Math.abs((await server.ask("/api/state")).rig.info.fine.asked_um - wanted) < 0.02 * (high - low);
    while (!(await there())) await page.waitForTimeout(100);
  }
  assert.deepEqual(page.complaints, []);
});

test("a stack is looked at image by image", async () => {
  const page = await open(browser, server.address);
  await page.waitForFunction(() => !document.querySelector("[data-capture]").disabled);
  const { job, names } = await post(page, "/api/captures", { kind: "stack", axis: "coarse", from_um: 5830, to_um: 5990, steps: 3 });
  assert.ok(job, "begun");
  while ((await server.ask("/api/state")).job.phase === "running") await page.waitForTimeout(200);
  await page.locator("#tab-captures").click();
  await page.getByRole("button", { name: `Open ${names[0]}` }).click();
  await page.getByLabel("Image of the stack").waitFor();
  await page.locator(".toolbar .dim", { hasText: "1 of 3" }).waitFor();
  await page.getByLabel("Image of the stack").fill("2");
  await page.locator(".toolbar .dim", { hasText: "3 of 3" }).waitFor();
  await page.getByRole("button", { name: "Compute stack" }).click();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.getByRole("button", { name: "All in focus" }).click();
  await page.locator("canvas[data-layer=sharp]").waitFor();
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("captures: newest first, names with blanks and &, rename, delete, filter; Back returns to the view before", async () => {
  const page = await open(browser, server.address);
  cpSync(join(server.session, "pair-001"), join(server.session, "step & 2 mm"), { recursive: true });
  await page.locator("#tab-captures").click();
  await page.locator(".capture-card h3").first().waitFor();
  assert.equal(await page.locator(".capture-card h3").first().textContent(), "step & 2 mm");
  await page.getByRole("button", { name: "Open step & 2 mm" }).click();
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.goBack();
  await page.locator("#view-captures:not([hidden])").waitFor();
  const card = page.locator(".capture-card", { hasText: "step & 2 mm" });
  await card.getByRole("button", { name: "Rename" }).click();
  await page.getByLabel("Answer").fill("plane");
  await page.locator("dialog").getByRole("button", { name: "Rename" }).click();
  const renamed = page.locator(".capture-card", { hasText: "plane" });
  await renamed.waitFor();
  await renamed.getByRole("button", { name: "Delete" }).click();
  await page.locator("dialog").getByRole("button", { name: "Delete" }).click();
  await renamed.waitFor({ state: "detached" });
  assert.ok(!readdirSync(server.session).includes("plane"));
  await page.getByLabel("Show", { exact: true }).selectOption("sequence");
  await page.waitForFunction(() => [...document.querySelectorAll(".capture-card h3")].every((title) => title.textContent.startsWith("stack")));
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("the depth of a whole series is computed from the captures", async () => {
  const page = await open(browser, server.address);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  const begun = await post(page, "/api/captures", { kind: "series", pairs: 2 });
  await page.locator("#tab-captures").click();
  await page.getByLabel("Show", { exact: true }).selectOption("pair");
  await page.locator(".capture-card", { hasText: begun.names[1] }).waitFor();
  await page.getByRole("button", { name: "Compute depth of all" }).click();
  await page.waitForFunction((names) => names.every((name) => document.querySelector(`.capture-card img[src^="/api/captures/${name}/files/view.png?"]`)), begun.names);
  await page.getByRole("button", { name: "Compute depth of all" }).click();
  await page.locator(".notice", { hasText: "No pair without a depth is shown here." }).waitFor();
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("two regions give the step between them, and a profile is saved as CSV", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  const drag = async (from, to) => {
    await page.mouse.move(box.x + from[0] * box.width, box.y + from[1] * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + to[0] * box.width, box.y + to[1] * box.height, { steps: 4 });
    await page.mouse.up();
  };
  await page.getByRole("button", { name: "Region", exact: true }).click();
  await drag([0.35, 0.45], [0.4, 0.55]);
  await page.getByText("Draw a second region").waitFor();
  await drag([0.6, 0.45], [0.65, 0.55]);
  await page.locator("dt", { hasText: "step to the region before" }).waitFor();
  await page.getByRole("button", { name: "Profile" }).click();
  await drag([0.35, 0.5], [0.65, 0.5]);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "CSV" }).click()]);
  assert.equal(download.suggestedFilename(), "profile.csv");
  await page.context().close();
});

test("a scale bar lies in the depth map, and its length is that of the optics", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth][data-scale]").waitFor();
  // A pixel of 7.4 um at 910 mm behind a lens of 50 mm is 0.127 mm: a quarter of 640 px is 20 mm.
  assert.equal(await page.locator("canvas[data-layer=depth]").getAttribute("data-scale"), "20 mm");
  await page.context().close();
});

test("all options of a depth request are offered, with their help, and an answer names the wrong one", async () => {
  const page = await open(browser, `${server.address}#depth/pair-001`);
  await page.locator("canvas[data-layer=depth]").waitFor();
  await page.locator("section.panel", { hasText: "Compute depth" }).getByText("All options").click();
  await page.getByLabel("balance", { exact: true }).waitFor();
  const { components } = await server.ask("/openapi.json");
  const names = Object.keys(components.schemas.CaptureDepthRequest.properties);
  const offered = await page.locator("#view-depth details [name]").evaluateAll((all) => all.map((one) => one.name));
  const elsewhere = ["method", "window", "median_px", "fill", "corrected", "variant", "uncertainty", "write"];
  assert.deepEqual([...offered, ...elsewhere].sort(), [...names].sort());
  await page.getByLabel("balance", { exact: true }).fill("much");
  await page.getByRole("button", { name: "Compute depth" }).click();
  await page.locator(".notice.error", { hasText: "balance: expected" }).waitFor();
  const raw = await post(page, "/api/rig/move", { to_um: 5 });
  assert.equal(raw.status, 422);
  assert.match(raw.error, /axis/);
  assert.doesNotMatch(raw.error, /deserialize|target type/);
  await page.context().close();
});

test("notices cover no button, and the log has times", async () => {
  const page = await open(browser, server.address);
  for (let at = 0; at < 3; at++) {
    await post(page, "/api/calibrate/correction", { method: "cdc" });
    await page.waitForTimeout(300);
  }
  await page.locator(".notice.error").first().waitFor();
  const covered = await page.evaluate(() => [...document.querySelectorAll("button")].filter((button) => {
    const box = button.getBoundingClientRect();
    const top = box.width && document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
    return top && top.closest("#notices") && !button.closest("#notices");
  }).map((button) => button.textContent));
  assert.deepEqual(covered, []);
  await page.locator("#tab-log").click();
  await page.waitForFunction(() => /^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d {2}Learn the correction$/m.test(document.querySelector(".log").textContent));
  await page.context().close();
});

test("live depth says that it waits, has colours with numbers and a probe, and keeps nothing of the image before", async () => {
  const page = await open(browser, server.address);
  await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
  await page.getByRole("button", { name: "Live depth" }).click();
  await page.locator("#view-live .status", { hasText: "waiting for the first map" }).waitFor();
  assert.equal(await page.locator("#view-live output.big").textContent(), "–");
  await page.getByText("Live depth has no focus value").waitFor();
  await page.locator("#view-live .status", { hasText: "maps/s" }).waitFor();
  await page.locator("#view-live .legend span", { hasText: "mm" }).first().waitFor();
  await page.getByLabel("Live depth;").hover();
  await page.getByLabel("Depth under the pointer").filter({ hasText: /mm|no depth/ }).waitFor();
  await page.keyboard.press("Escape");
  await page.context().close();
});

test("a video that cannot be read is refused with a reason, and no old answer stays", async () => {
  const page = await open(browser, `${server.address}#guides/activity`);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  const video = join(server.session, "..", `broken-${process.pid}.y4m`);
  writeFileSync(video, "YUV4MPEG2 W160 H120 F25:1 Cmono\nFRAME\nshort");
  await page.locator("#view-guides").getByLabel("Video file to send").setInputFiles(video);
  await page.locator("p", { hasText: "is there" }).waitFor();
  rmSync(video);
  await page.locator(".person-answer output").evaluate((answer) => { answer.textContent = "walk"; });
  await page.getByRole("button", { name: "Recognise the video" }).click();
  await page.locator(".notice.error", { hasText: "broken" }).waitFor();
  assert.equal(await page.locator(".person-answer output").textContent(), "–");
  await page.context().close();
});

test("a camera that gives no more images is said to be silent, over a dimmed image", async () => {
  const alone = await serve(["--camera", `command:640x480:gray:${process.execPath} ${join(import.meta.dirname, "camera.mjs")} 40`]);
  try {
    const page = await open(browser, alone.address, {}, "absent");
    await page.waitForFunction(() => Number(document.querySelector("#view-live .viewer canvas").dataset.painted) > 3);
    await page.locator(".lead", { hasText: /No image/ }).waitFor();
    await page.locator(".lead").getByRole("button", { name: "Try again" }).waitFor();
    assert.equal(await page.locator("#view-live .viewer").first().evaluate((viewer) => viewer.style.opacity), "0.35");
    await page.context().close();
  } finally {
    assert.equal(await alone.close(), 0);
  }
});

/** How long Stop takes from the page, ms: until no job runs, nothing moves and no live depth is on. */
const stopped = (page) => page.evaluate(async () => {
  const { on, stop } = await import("/link.js");
  return new Promise((done) => {
    const begin = performance.now();
    const off = on("state", ({ job, live, rig: { info } }) => {
      if (job?.phase === "running" || live.mode === "depth" || info.coarse.moving || info.lens.moving) return;
      off();
      done(performance.now() - begin);
    });
    stop();
  });
});

test("Stop works within 0.3 s in every state", async () => {
  const page = await open(browser, server.address);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  const begin = {
    home: () => post(page, "/api/rig/home", {}),
    focus: () => post(page, "/api/rig/focus", {}),
    pair: () => post(page, "/api/captures", { kind: "pair" }),
    series: () => post(page, "/api/captures", { kind: "series", pairs: 20 }),
    stack: () => post(page, "/api/captures", { kind: "stack", axis: "coarse", from_um: 4000, to_um: 5000, steps: 20 }),
    "live depth": () => post(page, "/api/live", { mode: "depth" }),
  };
  const found = {};
  for (const [name, start] of Object.entries(begin)) {
    // Twice the promised 0.3 s, in one of three attempts: other tests use the same processor.
    for (let attempt = 0; attempt < 3 && !(found[name] < 600); attempt++) {
      const answer = await start();
      assert.equal(answer.status, 200, `${name}: ${answer.error}`);
      await page.waitForTimeout(name === "pair" ? 150 : 800);
      found[name] = Math.round(await stopped(page));
    }
  }
  console.log(`Stop, ms: ${JSON.stringify(found)}`);
  for (const [name, ms] of Object.entries(found)) assert.ok(ms < 600, `${name}: ${ms} ms`);
  await page.context().close();
});

/** Watches the page from now on: the longest time without any change on it while a job runs, ms. */
const watch = (page) => page.evaluate(async () => {
  const { on, store } = await import("/link.js");
  const running = () => store.state?.job?.phase === "running" || store.state?.computation?.phase === "running";
  const found = { silence: 0, title: "" };
  let last = performance.now();
  const changed = () => {
    const gap = performance.now() - last;
    if (running() && gap > found.silence) Object.assign(found, { silence: Math.round(gap), title: store.state?.job?.title ?? "" });
    last = performance.now();
  };
  let before = "";
  on("state", (state) => {
    const shown = JSON.stringify([state.job, state.computation, state.rig.info?.lens, state.rig.info?.coarse, state.rig.info?.fine]);
    if (shown !== before) changed();
    before = shown;
  });
  for (const picture of ["image", "depth", "fresh", "person"]) on(picture, changed);
  globalThis.watched = found;
});

test("twelve jobs of a lab session, from the page alone: no dead end, and no silence of more than two seconds", async () => {
  const page = await open(browser, server.address);
  await page.locator("#who", { hasText: "you have control" }).waitFor();
  await watch(page);
  const state = () => server.ask("/api/state");
  const done = [];
  /** Does it, and waits for the end of a job that was not there before. */
  const job = async (what, queue, act) => {
    const before = (await state())[queue]?.id ?? 0;
    await act();
    let now;
    do {
      await page.waitForTimeout(100);
      now = (await state())[queue];
    } while (!now || now.id === before || now.phase === "running");
    assert.equal(now.phase, "done", `${what}: ${now.error}`);
    done.push(what);
    return now;
  };
  const press = (name, place = page) => place.getByRole("button", { name, exact: true }).click();
  await job("home", "job", () => press("Home"));
  await job("near focus", "job", () => press("Near focus"));
  await job("far focus", "job", () => press("Far focus"));
  await page.locator("#tab-live").click();
  await job("pair with depth", "computation", () => press("Capture pair"));
  await page.locator("#tab-live").click();
  await page.getByText("Average, series, still, stack").click();
  await page.getByLabel("Pairs of the series").fill("2");
  await page.getByLabel("Seconds from pair to pair; 0 is at once").fill("4");
  await job("series", "job", () => press("Series"));
  assert.doesNotMatch(await page.locator(".lead").textContent(), /Check the camera/, "the image was held, the camera is well");
  await job("still", "job", () => press("Still"));
  await page.getByLabel("Images", { exact: true }).fill("3");
  await job("stack", "job", () => press("Stack"));
  await page.locator("#tab-depth").click();
  await page.getByLabel("Method", { exact: true }).first().selectOption("ro");
  await page.getByLabel("Capture", { exact: true }).selectOption("pair-001");
  await page.locator("canvas[data-layer=depth]").waitFor();
  await job("depth by another method", "computation", () => press("Compute depth"));
  await page.locator("#tab-guides").click();
  await page.locator("button[data-guide=series]").click();
  await page.locator("#view-guides").getByLabel("Distances in mm").fill("890, 910, 930");
  await job("flat series", "job", () => press("Capture the series"));
  await page.locator("#view-guides").getByLabel("Method", { exact: true }).selectOption("cdc");
  await job("correction", "computation", () => press("Learn"));
  await page.locator("button[data-guide=psf]").click();
  await page.getByLabel("the flat series: 3 targets at known distances").check();
  await job("point spread function", "computation", () => press("Find"));
  await page.locator("#tab-quality").click();
  await page.getByLabel("Pairs", { exact: true }).fill("2");
  await job("quality", "job", () => press("Measure"));
  assert.equal(done.length, 12);
  const { silence, title } = await page.evaluate(() => globalThis.watched);
  console.log(`twelve jobs; longest silence ${silence} ms (${title})`);
  assert.ok(silence < 2000, `${silence} ms during ${title}`);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
});

test("an emulated rig that has ended is restarted, also with another scene, and the live image continues", async () => {
  const own = await serve();
  try {
    const page = await open(browser, own.address);
    await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
    const [child] = readFileSync(`/proc/${own.pid}/task/${own.pid}/children`, "utf8").trim().split(/\s+/).concat(readdirSync(`/proc/${own.pid}/task`).flatMap((task) => readFileSync(`/proc/${own.pid}/task/${task}/children`, "utf8").trim().split(/\s+/))).filter(Boolean).map(Number);
    process.kill(child, "SIGKILL");
    await page.getByText("The emulated rig has ended, or does not answer.").waitFor();
    await page.getByRole("button", { name: "Connect again" }).click();
    await page.locator("#link[data-phase=ready]").waitFor();
    await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
    await page.getByLabel("Scene", { exact: true }).selectOption("plane");
    await page.getByLabel("Distance of the flat target, mm").waitFor();
    await page.locator("#link[data-phase=ready]").waitFor();
    await page.locator("#view-live .status", { hasText: "frames/s" }).waitFor();
    assert.equal((await own.ask("/api/state")).rig.scene, "plane:900");
    const distance = page.getByLabel("Distance of the flat target, mm");
    await distance.fill("20");
    await distance.press("Tab");
    await page.locator(".notice.error", { hasText: "beyond the focal length of 50 mm" }).waitFor();
    assert.equal(await distance.inputValue(), "900");
    const refused = await post(page, "/api/rig/scene", { scene: "attic" });
    assert.equal(refused.status, 400);
    assert.match(refused.error, /"attic": expected staircase, slant, cone, sphere or plane:MM/);
    await page.context().close();
  } finally {
    assert.equal(await own.close(), 0);
  }
});
