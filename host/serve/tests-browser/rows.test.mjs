// What a lab person does with the page, a case for each fault that was found once.
import assert from "node:assert/strict";
import { cpSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { browser as launch, open, serve } from "./server.mjs";

let browser, server;
before(async () => {
  browser = await launch();
  server = await serve();
});
afterEach(async () => {
  for (const context of browser.contexts()) await context.close();
  await server.released();
});
after(async () => {
  await browser?.close();
  assert.equal(await server?.close(), 0);
});

/** Posts as this page would, with its secret. */
const post = (page, path, body = {}) => page.evaluate(async ([path, body]) => {
  const secret = sessionStorage.getItem("farnear-client");
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

test("a stack is looked at image by image", async () => {
  const page = await open(browser, server.address);
  await page.waitForFunction(() => !document.querySelector("[data-capture]").disabled);
  const { job, names } = await post(page, "/api/captures", { kind: "stack", axis: "fine", from_um: 20, to_um: 60, steps: 3 });
  assert.ok(job, "begun");
  while ((await server.ask("/api/state")).job.phase === "running") await page.waitForTimeout(200);
  await page.locator("#tab-captures").click();
  await page.getByRole("button", { name: `Open ${names[0]}` }).click();
  await page.getByLabel("Image of the stack").waitFor();
  await page.locator(".toolbar .dim", { hasText: "1 of 3" }).waitFor();
  await page.getByLabel("Image of the stack").fill("2");
  await page.locator(".toolbar .dim", { hasText: "3 of 3" }).waitFor();
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
