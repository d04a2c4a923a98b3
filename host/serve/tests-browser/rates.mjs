// How fast the page is on this computer: `FARNEAR=.../release/farnear npm run rates`. Figures, no tests: they depend on what else runs.
// Playwright has every message of a socket copied to itself, which costs the browser more than showing it; so the browser is asked by its
// own protocol here, for no more than what scripts of the page give.
// Ages are from the arrival of a picture at the program to its pixels on the page's canvas, median and 95 of 100.
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { cpus, loadavg } from "node:os";
import { join } from "node:path";
import { plain, serve } from "./server.mjs";

const [WIDTH, HEIGHT] = [640, 480];
const SECONDS = 10;
const alone = ["--camera", `command:${WIDTH}x${HEIGHT}:gray:${process.execPath} ${join(import.meta.dirname, "camera.mjs")}`];
const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/** Milliseconds of the processor that a process has taken, with all its threads. */
function processor(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, "utf8").split(") ").at(-1).split(" ");
  return 10 * (Number(fields[11]) + Number(fields[12]));
}

const LIVE = '[aria-label^="Live image;"]';
const DEPTH = '[aria-label^="Live depth;"]';

/** What the page paints while `during` lasts. */
async function painted(page, canvas, pid, during) {
  const count = () => page(`Number(document.querySelector('${canvas}').dataset.painted ?? 0)`);
  await page(`globalThis.ages = []; {
    const canvas = document.querySelector('${canvas}');
    new MutationObserver(() => globalThis.ages.push(Number(canvas.dataset.ageMs))).observe(canvas, { attributeFilter: ["data-painted"] });
  }`);
  const [begin, first, taken] = [performance.now(), await count(), processor(pid)];
  const said = await during();
  const seconds = (performance.now() - begin) / 1000;
  const pictures = (await count()) - first;
  const ages = (await page("globalThis.ages")).sort((a, b) => a - b);
  const age = (part) => ages[Math.floor(part * (ages.length - 1))];
  const each = (processor(pid) - taken) / Math.max(1, said?.pairs ?? pictures);
  return `${(pictures / seconds).toFixed(1)} painted a second, ${age(0.5)} ms old (95 %: ${age(0.95)}), ${each.toFixed(1)} ms of farnear's processor time each`;
}

/** Pairs as `farnear serve` records them, 30 a second: a texture, and the same a little softer. */
function recording(optics, pairs) {
  const texture = (at) => 60 + ((Math.imul(at, 2654435761) >>> 13) % 90);
  /** A flat scene near the middle of the range; the weight of the four neighbours gives the blur. */
  const image = (weight) => {
    const codes = Buffer.alloc(2 * WIDTH * HEIGHT);
    for (let at = 0; at < WIDTH * HEIGHT; at++) {
      const around = texture(at - 1) + texture(at + 1) + texture(at - WIDTH) + texture(at + WIDTH);
      codes.writeUInt16LE(Math.round((texture(at) + weight * around) / (1 + 4 * weight)), 2 * at);
    }
    return codes;
  };
  const [far, near] = [0.1, 0.25].map(image);
  const length = Buffer.alloc(4);
  length.writeUInt32LE(optics.length);
  const parts = [Buffer.from("FNPAIRS1"), length, optics];
  for (let at = 0; at < pairs; at++) {
    const head = Buffer.alloc(13);
    head.writeBigUInt64LE(BigInt(Math.round((at * 1e6) / 30)));
    head.writeUInt16LE(WIDTH, 8);
    head.writeUInt16LE(HEIGHT, 10);
    head.writeUInt8(8, 12);
    parts.push(head, far, near);
  }
  return Buffer.concat(parts);
}

/** Waits until this is true on the page. */
async function until(page, what) {
  for (const begin = performance.now(); performance.now() - begin < 120_000; await wait(50)) if (await page(what)) return;
  throw new Error(`never: ${what}`);
}

const click = (page, text) => page(`[...document.querySelectorAll("button")].find((button) => button.textContent === "${text}").click()`);
const shown = (phase) => `document.querySelector("#link")?.dataset.phase === "${phase}"`;

async function imageAndPlay(browser) {
  const server = await serve(alone);
  try {
    mkdirSync(join(server.session, "recordings"));
    writeFileSync(join(server.session, "recordings", "live-001.pairs"), recording(readFileSync(join(server.session, "optics.toml")), 30 * SECONDS));
    const page = await browser.open(server.address);
    await until(page, `${shown("absent")} && document.querySelector('${LIVE}').dataset.painted > 5`);
    console.log(`live image, 30 a second come: ${await painted(page, LIVE, server.pid, () => wait(1000 * SECONDS))}`);
    await click(page, "Live image"); // off
    await until(page, 'document.querySelector("[aria-label=Recording] option")');
    for (const fast of [false, true]) {
      const before = (await server.ask("/api/state")).computation?.id;
      const played = async () => {
        if (fast) await page('[...document.querySelectorAll("label.check")].find((label) => label.textContent === "as fast as it goes").click()');
        await click(page, "Play");
        for (;;) {
          const { computation } = await server.ask("/api/state");
          if (computation && computation.id !== before && computation.phase !== "running") return computation.result;
          await wait(100);
        }
      };
      const text = await painted(page, DEPTH, server.pid, played);
      const { result } = (await server.ask("/api/state")).computation;
      console.log(`recorded stream, ${fast ? "as fast as it goes" : "30 a second"}: ${result.maps_per_second} maps a second of ${result.latency_ms} ms; ${text}`);
    }
  } finally {
    await server.close();
  }
}

async function pair(browser) {
  const server = await serve();
  try {
    const page = await browser.open(server.address);
    await until(page, shown("ready"));
    const [ages, whole] = [[], []];
    for (let round = 0; round < 8; round++) {
      await page('document.querySelector("#tab-live").click(); performance.clearMarks()');
      await wait(1000);
      await click(page, "Capture pair");
      await until(page, 'performance.getEntriesByName("depth-shown").length > 1 && document.querySelector("button[data-layer=surface]:enabled") != null');
      if (!round) continue; // the first one homes
      ages.push(await page('Number(document.querySelector("#view-depth .viewer canvas").dataset.ageMs)'));
      whole.push(await page('Math.round(performance.getEntriesByName("depth-shown").at(-1).startTime - performance.getEntriesByName("depth-shown")[0].startTime)'));
    }
    console.log(`fresh pair: depth on the page ${ages.join(", ")} ms after its near image; its files written and shown ${whole.join(", ")} ms later`);
  } finally {
    await server.close();
  }
}

async function emulated(browser) {
  const server = await serve();
  try {
    const page = await browser.open(server.address);
    await until(page, shown("ready"));
    await click(page, "Live depth"); // homes first
    await until(page, `document.querySelector('${DEPTH}').dataset.painted > 5`);
    console.log(`live depth of the emulated rig: ${await painted(page, DEPTH, server.pid, () => wait(1000 * SECONDS))}`);
  } finally {
    await server.close();
  }
}

console.log(`${cpus().length} x ${cpus()[0].model}, load ${loadavg()[0].toFixed(1)}, ${WIDTH}x${HEIGHT} px`);
const browser = plain();
try {
  await imageAndPlay(browser);
  await pair(browser);
  await emulated(browser);
} finally {
  await browser.close();
}
