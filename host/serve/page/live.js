// The live image with what one focuses by: histogram, saturation, peaking, focus value; and live depth.
import { act, hasControl, ended, get, on, onJob, store } from "./link.js";
import { h, button, choice, field, keep, notice, number, numeric, panel, rows, say, write } from "./ui.js";
import { Viewer } from "./viewer.js";
import { Plot, bars } from "./plot.js";
import { bar, paintCodes } from "./maps.js";
import { key } from "./keys.js";
import * as capture from "./capture.js";
import * as camera from "./camera.js";

const MEASURES = [["modified-laplacian", "Modified Laplacian"], ["tenengrad", "Tenengrad"], ["fft-sum", "FFT sum (Li 2014)"]];
const REMEMBERED = 300;
/** Difference of neighbours, of 255, from which an edge counts as sharp. */
const SHARP = 26;
/** Codes, of 255, between which the brightest pixels are well exposed, and the one aimed at: as `farnear rig capture --auto-exposure`. */
const [DARKEST, AIM, BRIGHTEST] = [190, 204, 220];
/** Ends of the codes of a pixel. */
const CODES = [0, 255];
/** Exposure times that are tried. */
const TRIES = 8;
/** From one change of the curves, figures and words beside the image to the next, ms: the page is laid out anew for each, which takes
 * longer than to paint the image, and nobody reads faster. */
const READ = 200;

/** Makes the view; gives what is called when it is shown. */
export function make(host) {
  const image = new Viewer("Live image");
  const depth = new Viewer("Live depth");
  const [saturation, peaking] = [check("Saturation", true), check("Focus peaking", false)];
  const region = button("Region", () => {
    if (store.state?.live.region) act("/api/live", { region: [0, 0, 0, 0] });
    else image.use(image.tool === "pan" ? "region" : "pan");
    press();
  }, { "aria-pressed": "false", title: "Drag a rectangle in the image: focus value, histogram, Auto and Find focus use it alone" });
  const press = () => region.setAttribute("aria-pressed", String(image.tool === "region" || Boolean(store.state?.live.region)));
  const focus = h("output", { class: "big", "aria-live": "off" }, "–");
  const histogram = h("canvas", { class: "histogram", role: "img", "aria-label": "histogram of brightness" });
  const figures = h("div", {});
  const warnings = h("ul", { class: "warnings", "aria-live": "polite" });
  const status = h("p", { class: "status" });
  const place = h("div", {});
  const plot = new Plot(place, { label: "focus value over the last frames", height: 110, names: ["focus"] });
  const resting = h("p", { class: "empty", hidden: true }, "The live image is off: L begins it.");
  const [least, most, probe] = [h("span", {}), h("span", {}), h("output", { "aria-label": "Depth under the pointer", "aria-live": "off" })];
  const colours = h("canvas", { class: "legend-bar", role: "img", "aria-label": "colours of live depth" });
  const scale = h("div", { class: "legend", hidden: true }, least, colours, most, probe);
  /** The last live map. @type {{ codes: Uint16Array, width: number, low_mm: number, high_mm: number } | null} */
  let live = null;
  const lead = h("div", { class: "lead", role: "status", hidden: true });
  let pictured = performance.now();
  const homeAndFocus = async () => {
    const homing = await act("/api/rig/home");
    if (homing && (await ended("job", homing.job)).phase === "done") act("/api/rig/goto", { focus: "far" });
  };
  /** What keeps the image from being useful, with the way out. */
  const advise = () => {
    const state = store.state;
    if (!state) return;
    const { rig, live, job } = state;
    const running = job?.phase === "running";
    // The image is held while the rig works.
    if (running) pictured = performance.now();
    const unhomed = rig.phase === "ready" && [rig.info?.coarse, rig.info?.lens].some((stage) => stage && stage.state === "unknown");
    // In steps of ten seconds: a screen reader reads each change.
    const quiet = (performance.now() - pictured) / 1000;
    const silent = live.mode !== "off" && !running && rig.phase !== "connecting" && (rig.phase === "ready" || live.camera_alone) && quiet > 3;
    const what = running ? ["job", job.title, job.said] : live.error ? ["error", live.error] : silent ? ["silent", quiet < 10 ? 3 : 10 * Math.floor(quiet / 10)] : unhomed ? ["unhomed"] : null;
    lead.hidden = !what;
    lead.setAttribute("aria-live", running ? "off" : "polite");
    image.element.style.opacity = what?.[0] === "silent" || what?.[0] === "error" ? "0.35" : "";
    keep(lead, [what, hasControl()], () => {
      if (!what) return [];
      const retry = button("Try again", () => act("/api/live", { mode: "image" }), { disabled: !hasControl() });
      if (what[0] === "job") return [h("strong", {}, String(what[1])), h("span", {}, String(what[2] ?? "starting"))];
      if (what[0] === "error") return [h("span", {}, `No image: ${live.error}`), retry];
      if (what[0] === "silent") return [h("span", {}, `No image for more than ${what[1]} s. Check the camera.`), retry];
      return [h("span", {}, "Stages are not homed: the image is out of focus."), button("Home and focus", homeAndFocus, { class: "primary", disabled: !hasControl() })];
    });
  };
  setInterval(advise, 1000);
  on("state", advise);
  const values = [];
  let best = 0;
  let read = -READ;
  /** Whether it is time for what is read. */
  const due = () => {
    const is = performance.now() - read >= READ;
    if (is) read = performance.now();
    return is;
  };
  let shown = false;
  const off = button("Live image", () => mode("image"), { "aria-pressed": "false", title: "L" });
  const deep = button("Live depth", () => mode("depth"), { "aria-pressed": "false", title: "Pair after pair by the piezo" });
  /** Whether this page ends the recording. */
  let ending = false;
  const record = button("Record", () => {
    ending = Boolean(store.state?.live.recording);
    act("/api/recordings", { on: !ending });
  }, { "aria-pressed": "false", title: "Keeps the pairs of live depth" });
  const recordings = h("select", { "aria-label": "Recording" });
  const fast = h("input", { type: "checkbox" });
  const played = h("p", { class: "dim", "aria-live": "polite" });
  const play = button("Play", async () => {
    // Live pictures would be mixed with those of the recording.
    if (store.state?.live.mode !== "off" && !(await act("/api/live", { mode: "off" }))) return;
    act("/api/recordings/play", { recording: recordings.value, fast: fast.checked });
  });
  onJob("play", ({ phase, result }) => {
    if (phase === "done") played.textContent = `${result.pairs} pairs, ${number(result.maps_per_second, 1)} maps/s, ${number(result.latency_ms, 1)} ms a map (median)`;
  });
  const lost = h("p", { class: "bad", "aria-live": "polite" });
  /** Tells of a recording that this page did not end; the program's log knows its pairs. */
  const sayEnded = async (name) => {
    const { lines } = await get("/api/log").catch(() => ({ lines: [] }));
    const line = lines.findLast(({ text }) => text.startsWith(`recorded ${name}: `));
    const pairs = line && /: (\d+) pairs/.exec(line.text)?.[1];
    if (!store.state?.live.recording) lost.textContent = `Recording ended: ${name}${pairs ? `, ${pairs} pairs` : ""}.`;
  };
  const listed = async () => {
    const { recordings: found } = await get("/api/recordings").catch(() => ({ recordings: [] }));
    const present = recordings.value;
    recordings.replaceChildren(...found.map(({ name, megabytes }) => h("option", { value: name, selected: name === present }, `${name}, ${number(megabytes, 0)} MB`)));
    play.disabled = !found.length;
  };
  const exposure = h("input", { type: "number", min: 1, max: 1000000, step: 100, inputmode: "numeric" });
  exposure.addEventListener("change", () => act("/api/live", () => ({ exposure_us: Math.round(numeric(exposure)) })));
  /** Exposure times that may still be tried. */
  let tries = 0;
  const auto = button("Auto", () => { tries = TRIES; }, { title: "Finds the time at which the brightest pixels have 80 % of white" });
  const meter = ({ figures, exposure_us }) => {
    if (exposure_us !== store.state?.live.exposure_us) return; // of the time before
    const code = brightest(figures.histogram);
    const factor = code === 255 ? 0.4 : Math.min(AIM / Math.max(code, 1), 8);
    const next = Math.min(Math.max(Math.round(exposure_us * factor), Number(exposure.min)), Number(exposure.max));
    tries -= 1;
    if (code >= DARKEST && code <= BRIGHTEST) tries = 0;
    else if (next === exposure_us || !tries) {
      tries = 0;
      notice(`The brightest pixels have ${number((100 * code) / 255, 0)} % of white at ${exposure_us} µs: change the light or the gain.`, "warning");
    } else act("/api/live", { exposure_us: next });
  };
  const light = [0, 1].map(() => h("input", { type: "number", min: 0, max: 100, step: 0.1, title: "Light output of the board during captures and live depth" }));
  for (const level of light) level.addEventListener("change", () => act("/api/live", () => ({ light_percent: light.map(numeric) })));
  const forgetValues = () => { values.length = 0; best = 0; };
  const measure = choice(MEASURES, MEASURES[0][0], (name) => { forgetValues(); act("/api/live", { measure: name }); });
  const forget = button("Reset", forgetValues, { title: "Forgets the largest value" });

  host.append(h("div", { class: "split" },
    h("div", { class: "stage" },
      h("div", { class: "toolbar" }, h("div", { class: "group" }, off, deep), record, region, saturation.label, peaking.label,
        h("span", { class: "grow" }), status),
      scale,
      h("div", { class: "viewers" }, image.element, depth.element, resting, lead)),
    h("div", { class: "side" },
      capture.make(),
      panel("Focus value", h("div", { class: "reading" }, focus, forget), place, field("Measure", measure)),
      panel("Recordings", h("div", { class: "row record-row" }, play, recordings), h("label", { class: "check" }, fast, "as fast as it goes"), played, lost),
      panel("Camera", field("Exposure", exposure, "µs"), h("div", { class: "row" }, auto), ...light.map((level, at) => field(`Light ${at + 1}`, level, "%")), histogram, figures, warnings, camera.make()))));
  image.onshape = (_, [x0, y0], [x1, y1]) => {
    image.use("pan");
    act("/api/live", { region: [Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0) + 1, Math.abs(y1 - y0) + 1] });
  };
  image.onprobe = (at, keyed) => at && keyed && say(`pixel ${at.join(", ")}`);
  depth.element.hidden = true;
  depth.onprobe = (at, keyed) => {
    const code = at && live ? live.codes[at[1] * live.width + at[0]] : 0;
    probe.textContent = at ? (code && live ? number(live.low_mm + ((code - 1) * (live.high_mm - live.low_mm)) / 65534, 2, "mm") : "no depth") : "";
    if (at && keyed) say(`${probe.textContent}, pixel ${at.join(", ")}`);
  };
  /** Nothing of the mode before is shown as if it were new. */
  const forgetShown = (mode) => {
    [live, shown, pictured] = [null, false, performance.now()];
    scale.hidden = true;
    for (const viewer of [image, depth]) viewer.clear();
    forgetValues();
    focus.replaceChildren("–");
    plot.set([[], []]);
    bars(histogram, [], CODES);
    figures.replaceChildren(mode === "depth" ? h("p", { class: "dim" }, "Live depth has no focus value and no histogram.") : "");
    keep(warnings, [], () => []);
    write(status, { image: "waiting for the first image", depth: "waiting for the first map" }[mode] ?? "live is off");
  };
  key("l", "Live image on or off", () => mode("image"));

  const mode = (wanted) => act("/api/live", { mode: store.state?.live.mode === wanted ? "off" : wanted });

  on("state", (state, before) => {
    const { live, rig } = state;
    off.setAttribute("aria-pressed", live.mode === "image");
    deep.setAttribute("aria-pressed", live.mode === "depth");
    const seen = rig.phase === "ready" || live.camera_alone;
    for (const control of [off, exposure, measure]) control.disabled = !hasControl() || !seen;
    auto.disabled = region.disabled = exposure.disabled || live.mode !== "image";
    if (auto.disabled) {
      tries = 0;
      image.use("pan");
    }
    press();
    if (!image.shape?.open) {
      const [x, y, width, height] = live.region ?? [];
      image.shape = live.region && live.mode === "image" ? { kind: "region", from: [x, y], to: [x + width - 1, y + height - 1], open: false } : null;
      image.draw();
    }
    if (before && String(before.live.region) !== String(live.region)) forgetValues();
    light.forEach((level, at) => {
      level.disabled = !hasControl() || rig.phase !== "ready";
      if (document.activeElement !== level) level.value = String(Number(live.light_percent[at].toFixed(1))); // the board's resolution
    });
    deep.disabled = !hasControl() || rig.phase !== "ready";
    if (document.activeElement !== exposure) exposure.value = live.exposure_us;
    measure.value = live.measure;
    const playing = state.computation?.kind === "play" && state.computation.phase === "running";
    if (before && before.live.mode !== live.mode && live.mode !== "off") forgetShown(live.mode);
    resting.hidden = live.mode !== "off" || !seen || playing || shown;
    depth.element.hidden = live.mode !== "depth" && !playing;
    if (depth.element.hidden) scale.hidden = true;
    record.disabled = !hasControl() || live.mode !== "depth";
    record.setAttribute("aria-pressed", Boolean(live.recording));
    write(record, live.recording ? "Stop recording" : "Record");
    if (before?.live.recording !== live.recording) {
      listed();
      lost.textContent = "";
      if (before?.live.recording && !live.recording && !ending) sayEnded(before.live.recording);
      ending = false;
    }
    if (before && live.recording_ended && live.recording_ended !== before.live.recording_ended) notice(live.recording_ended, "warning");
    const moving = state.job?.phase === "running";
    if (!seen) write(status, "");
    else if (live.error) write(status, live.error);
    else if (live.mode === "off" && !playing) write(status, "live is off");
    else if (moving && live.mode !== "off") write(status, "held while the rig works");
  });

  on("image", (header, pixels) => {
    pictured = performance.now();
    if (host.hidden) return;
    const found = header.figures;
    shown = true;
    image.show(shade(blank(header, reused.image), pixels, saturation.box.checked, peaking.box.checked));
    time(image, header);
    if (tries) meter(header);
    values.push(found.focus ?? null);
    if (values.length > REMEMBERED) values.shift();
    best = Math.max(best, found.focus ?? 0);
    if (!due()) return;
    status.textContent = `${number(header.rate_hz, 1)} frames/s`;
    focus.replaceChildren(found.focus == null ? "–" : `${found.focus.toPrecision(4)}`, h("small", {}, best ? ` ${number((100 * (found.focus ?? 0)) / best, 0)} % of the largest` : ""));
    plot.set([values.map((_, at) => at - values.length + 1), values]);
    bars(histogram, found.histogram, CODES, "", (at) => at === CODES[1]);
    figures.replaceChildren(rows([["mean", `${number(100 * found.mean, 1)} %`], ["saturated", `${number(100 * found.saturated_fraction, 2)} %`], ["contrast", number(found.contrast, 3)]]));
    keep(warnings, found.warnings, () => found.warnings.map((text) => h("li", {}, text)));
    capture.warn(found.warnings);
  });

  on("depth", (header, pixels) => {
    pictured = performance.now();
    if (host.hidden) return;
    const { width, height, low_mm, high_mm } = header;
    const count = width * height;
    const codes = new Uint16Array(pixels.buffer, pixels.byteOffset, count);
    shown = true;
    live = { codes, width, low_mm, high_mm };
    scale.hidden = false;
    bar(colours, "viridis", [low_mm, high_mm], "mm");
    [least.textContent, most.textContent] = [number(low_mm, 0, "mm"), number(high_mm, 0, "mm")];
    depth.show(paintCodes(blank(header, reused.depth), codes, pixels.subarray(2 * count, 3 * count), "viridis"));
    image.show(shade(blank(header, reused.image), pixels.subarray(3 * count, 4 * count), false, false));
    time(depth, header);
    if (due()) status.textContent = `${number(header.rate_hz, 1)} maps/s · ${number(header.latency_ms, 0)} ms from image to map · ${number(low_mm, 0)} to ${number(high_mm, 0)} mm`;
  });
  return { shown: () => { image.draw(); plot.size(); } };
}

/** The code below which all but a thousandth of the pixels lie. @param {number[]} histogram */
function brightest(histogram) {
  let above = histogram.reduce((sum, count) => sum + count, 0) / 1000;
  let code = histogram.length - 1;
  while (code > 0 && (above -= histogram[code]) > 0) code -= 1;
  return code;
}

function check(text, checked) {
  const box = h("input", { type: "checkbox", checked });
  return { box, label: h("label", { class: "check" }, box, text) };
}

/** Pictures that are painted over again and again. @type {Record<string, ImageData[]>} */
const reused = { image: [], depth: [] };

/** A picture of this size: the one before, where it has it. @param {{ width: number, height: number }} size @param {ImageData[]} kept */
function blank({ width, height }, kept) {
  if (kept[0]?.width !== width || kept[0]?.height !== height) kept[0] = new ImageData(width, height);
  return kept[0];
}

/** Where the program runs on this computer both have one clock: then the picture says how old it was when it was painted, in ms. */
function time(viewer, { arrived_ms }) {
  viewer.onpainted = () => {
    const { dataset } = viewer.canvas;
    dataset.ageMs = String(Math.round(performance.timeOrigin + performance.now() - arrived_ms));
    dataset.painted = String(Number(dataset.painted ?? 0) + 1);
    viewer.onpainted = undefined;
  };
}

/** Grey pixels as a picture; what is saturated red, sharp edges orange. @param {ImageData} image @param {Uint8Array} pixels */
function shade(image, pixels, saturation, peaking) {
  const { width, height } = image;
  const words = new Uint32Array(image.data.buffer);
  for (let at = 0; at < pixels.length; at++) {
    const grey = pixels[at];
    words[at] = saturation && grey === 255 ? 0xff3030e8 : 0xff000000 | (grey << 16) | (grey << 8) | grey;
  }
  if (peaking) {
    for (let row = 1; row < height; row++) {
      for (let at = row * width + 1; at < (row + 1) * width; at++) {
        const edge = Math.abs(pixels[at] - pixels[at - 1]) + Math.abs(pixels[at] - pixels[at - width]);
        if (edge > SHARP) words[at] = 0xff20a5ff;
      }
    }
  }
  return image;
}
