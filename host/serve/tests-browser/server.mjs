// `farnear serve` on the emulated rig, and a browser that looks at it.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const FARNEAR = process.env.FARNEAR ?? join(import.meta.dirname, "../../../target/debug/farnear");
const BROWSERS = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome", chromium.executablePath()];

/** Serves until `close`; the emulated rig where nothing else is named. */
export async function serve(what = ["--rig", "sim"]) {
  const session = mkdtempSync(join(tmpdir(), "farnear-page-"));
  const child = spawn(FARNEAR, ["serve", ...what, "--session", session, "--port", "0"], { stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((done, failed) => {
    child.stdout.once("data", (data) => done(String(data).trim()));
    child.once("exit", (code) => failed(new Error(`farnear serve ended with ${code}`)));
  });
  const close = () => new Promise((done) => {
    child.removeAllListeners("exit");
    child.once("exit", (code) => { rmSync(session, { recursive: true, force: true }); done(code); });
    child.kill("SIGINT");
  });
  return { address, session, close, ask: async (path) => (await fetch(new URL(path, address))).json() };
}

/** A browser; without a graphics card, so that it runs anywhere. */
export function browser() {
  const executablePath = BROWSERS.find((path) => path && existsSync(path));
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
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
