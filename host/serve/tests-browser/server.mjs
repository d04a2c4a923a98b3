// `farnear serve` on the emulated rig, and a browser that looks at it.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, afterEach, before } from "node:test";
import { chromium } from "playwright-core";

const FARNEAR = process.env.FARNEAR ?? join(import.meta.dirname, "../../../target/debug/farnear");
const BROWSERS = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome", chromium.executablePath()];

/** Serves until `close`; the emulated rig where nothing else is named. With `blocks` it can write no file that is larger than so many
 * blocks (of 512 bytes, or of 1024: the shell's), as on a disk that is full. */
export async function serve(what = ["--rig", "sim"], blocks = 0, port = 0) {
  const session = mkdtempSync(join(tmpdir(), "farnear-page-"));
  const limited = blocks ? ["sh", "-c", `trap "" XFSZ; ulimit -f ${blocks}; exec "$0" "$@"`] : [];
  const [program, ...first] = [...limited, FARNEAR];
  const child = spawn(program, [...first, "serve", ...what, "--session", session, "--port", String(port)], { stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((done, failed) => {
    child.stdout.once("data", (data) => done(String(data).trim()));
    child.once("exit", (code) => failed(new Error(`farnear serve ended with ${code}`)));
  });
  const close = () => new Promise((done) => {
    child.removeAllListeners("exit");
    child.once("exit", (code) => { rmSync(session, { recursive: true, force: true }); done(code); });
    child.kill("SIGINT");
  });
  const ask = async (path) => (await fetch(new URL(path, address))).json();
  /** Waits until control is not reserved for a page that has closed. */
  const released = async () => {
    while ((await ask("/api/state")).control.holder !== null) await new Promise((done) => setTimeout(done, 100));
  };
  return { address, session, pid: child.pid, close, ask, released };
}

/** Whether the program was built with this kind of camera. */
export function knows(kind) {
  const { stdout } = spawnSync(FARNEAR, ["camera", "list", "--json"], { encoding: "utf8" });
  return JSON.parse(stdout).kinds.some((known) => known.kind === kind && known.built_in);
}

/** The emulated rig as a program of its own, until `close`; where it is, in `said`. */
export async function simulator(options) {
  const child = spawn(join(dirname(FARNEAR), "farnear-sim"), ["run", ...options], { stdio: ["pipe", "pipe", "inherit"] });
  const said = await new Promise((done, failed) => {
    child.stdout.once("data", (data) => done(JSON.parse(data)));
    child.once("exit", (code) => failed(new Error(`farnear-sim ended with ${code}`)));
  });
  child.removeAllListeners("exit");
  return { said, close: () => new Promise((done) => { child.once("exit", done); child.kill(); }) };
}

const FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader"];
const found = () => BROWSERS.find((path) => path && existsSync(path));

/** The browser and the server of `oneServer`. */
export let browser, server;

/** One browser, and one server of the emulated rig, for all tests of a file, which begin after `prepare`. */
export function oneServer(prepare = async () => {}) {
  before(async () => {
    server = await serve();
    browser = await launch();
    await prepare();
  });
  after(async () => {
    await browser?.close();
    assert.equal(await server?.close(), 0, "Ctrl-C ends it well");
  });
  // A test that failed leaves no page open. Control is reserved for the last page: the next one gets it after that.
  afterEach(async () => {
    for (const context of browser.contexts()) await context.close();
    await server.released();
  });
}

/** A browser without a graphics card, so that it runs anywhere, as one is that finds none: it puts pages together by the processor, and
 * SwiftShader is for WebGL alone. (With SwiftShader for everything, pages come a few times a second.) */
export function launch() {
  return chromium.launch({ executablePath: found(), args: FLAGS });
}

/** The same browser without Playwright, asked by its own protocol. `open` loads a page and gives what runs scripts in it. */
export function plain() {
  const profile = mkdtempSync(join(tmpdir(), "farnear-browser-"));
  const options = [...FLAGS, "--headless", "--remote-debugging-pipe", `--user-data-dir=${profile}`, "--window-size=1440,900"];
  const child = spawn(found(), options, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  const [, , , to, from] = child.stdio;
  const waiting = new Map();
  let [last, text] = [0, ""];
  from.on("data", (data) => {
    const messages = (text + data).split("\0");
    text = messages.pop();
    for (const { id, result, error } of messages.map((message) => JSON.parse(message))) {
      waiting.get(id)?.(result ?? { exceptionDetails: error });
      waiting.delete(id);
    }
  });
  const ask = (method, params, sessionId) => new Promise((done) => {
    waiting.set(++last, done);
    to.write(`${JSON.stringify({ id: last, method, params, sessionId })}\0`);
  });
  const open = async (url) => {
    const { targetId } = await ask("Target.createTarget", { url });
    const { sessionId } = await ask("Target.attachToTarget", { targetId, flatten: true });
    return async (expression) => {
      const { result, exceptionDetails } = await ask("Runtime.evaluate", { expression, returnByValue: true, awaitPromise: true }, sessionId);
      if (exceptionDetails) throw new Error(`${expression}: ${JSON.stringify(exceptionDetails)}`);
      return result.value;
    };
  };
  const close = () => new Promise((done) => {
    child.once("exit", () => { rmSync(profile, { recursive: true, force: true, maxRetries: 5 }); done(); });
    child.kill();
  });
  return { open, close };
}

/** A page; what its console says of errors is kept in `page.complaints`. */
export async function open(browser, address, options = {}, phase = "ready") {
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, ...options });
  const page = await context.newPage();
  page.complaints = [];
  page.on("console", (message) => { if (message.type() === "error") page.complaints.push(message.text()); });
  page.on("pageerror", (error) => page.complaints.push(String(error)));
  page.setDefaultTimeout(120_000);
  await page.goto(address);
  await page.locator(`#link[data-phase=${phase}]`).waitFor();
  return page;
}

/** Begins a job by `act`, waits until it runs, and loads the page again under it. */
export async function reloaded(server, page, kind, act) {
  await act();
  const job = async () => (await server.ask("/api/state")).job;
  while ((await job())?.kind !== kind) await page.waitForTimeout(20);
  assert.equal((await job()).phase, "running", "the page is loaded again during the job");
  await page.reload();
}
