// The pictures of docs/page.md, taken of the page as it is: `npm run pictures`. `page.sha256` beside them says of which files of the page;
// a test of the suite compares, so that no picture is older than what it shows.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { join, relative } from "node:path";
import { launch, open, serve } from "./server.mjs";

const PAGE = join(import.meta.dirname, "../page");
const OUT = process.env.SCREENSHOTS ?? join(import.meta.dirname, "../../../docs/images");
/** 720 px across, wide enough for both columns. */
const LOOK = { viewport: { width: 1200, height: 750 }, deviceScaleFactor: 0.6, colorScheme: "light" };
/** Bytes of a picture that a document may hold. */
const BYTES_MAX = 60_000;

const server = await serve();
const browser = await launch();
try {
  const page = await open(browser, server.address, LOOK);
  const keep = async (name) => {
    const path = join(OUT, `page-${name}.jpg`);
    await page.screenshot({ path, type: "jpeg", quality: 70 });
    if (statSync(path).size > BYTES_MAX) throw new Error(`${path} has ${statSync(path).size} bytes, at most ${BYTES_MAX}`);
    console.log(`${path}: ${statSync(path).size} bytes`);
  };
  const view = (name) => page.getByRole("tab", { name }).click();

  await page.locator(".status", { hasText: "frames/s" }).waitFor();
  await page.getByRole("button", { name: "Capture pair" }).click();
  await page.locator("button[data-layer=surface]:enabled").waitFor(); // its files are there
  await page.getByRole("button", { name: "Region" }).click();
  const box = await page.locator("#view-depth .viewer canvas").boundingBox();
  await page.mouse.move(box.x + 0.4 * box.width, box.y + 0.4 * box.height);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.46 * box.width, box.y + 0.6 * box.height, { steps: 5 });
  await page.mouse.up();
  await page.locator("dt", { hasText: "plane: RMS" }).waitFor();
  await keep("depth");
  await page.getByRole("button", { name: "3-D" }).click();
  await page.locator(".surface[data-triangles] canvas").waitFor();
  await page.waitForTimeout(6000);
  await keep("surface");

  await view("Live");
  await page.locator(".status", { hasText: "frames/s" }).waitFor();
  await page.waitForTimeout(8000); // a course of the focus value
  await keep("live");
  await page.getByRole("button", { name: "Live depth" }).click();
  await page.locator(".status", { hasText: "ms from image to map" }).waitFor();
  await page.waitForTimeout(3000);
  await keep("live-depth");
  await page.keyboard.press("Escape");

  await view("Captures");
  await page.locator(".thumbnail img").first().waitFor();
  await page.getByRole("button", { name: "4 of 5" }).first().click();
  await page.waitForTimeout(800);
  await keep("captures");
  await view("Guides");
  await page.locator("button[data-guide=psf]").click();
  await page.waitForTimeout(800);
  await keep("guide");
  await view("Optics");
  await page.locator(".to-scale").waitFor();
  await page.waitForTimeout(800);
  await keep("optics");
  if (page.complaints.length) throw new Error(page.complaints.join("\n"));

  const files = readdirSync(PAGE, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile() && /\.(html|css|js|svg)$/.test(entry.name))
    .map((entry) => join(entry.parentPath, entry.name)).sort();
  const sums = files.map((file) => `${createHash("sha256").update(readFileSync(file)).digest("hex")}  ${relative(PAGE, file)}\n`);
  writeFileSync(join(OUT, "page.sha256"), sums.join(""));
} finally {
  await browser.close();
  await server.close();
}
