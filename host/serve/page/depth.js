// Depth of a capture: map, confidence, deviation, images, surface; probe, profile, region; two layers compared by a wipe.
import { act, bytes, ended, get, on, onJob, store } from "./link.js";
import { h, altered, button, choice, field, number, optional, panel, notice, say } from "./ui.js";
import { Viewer } from "./viewer.js";
import { bars } from "./plot.js";
import { NAMES, bar, paint, range } from "./maps.js";
import { parse } from "./npy.js";
import * as png from "./png.js";
import * as measure from "./measure.js";
import { REASONS, REASON_COLOURS } from "./reasons.js";

const LAYERS = [["depth", "Depth"], ["confidence", "Confidence"], ["deviation", "Deviation"], ["far", "Far image"], ["near", "Near image"], ["reason", "Reason"], ["sharp", "All in focus"], ["surface", "3-D"]];
const FILES = { depth: "depth.npy", confidence: "confidence.npy", deviation: "uncertainty.npy", far: "far.png", near: "near.png", reason: "reason.png", sharp: "all-in-focus.png" };
const UNITS = { depth: "mm", confidence: "", deviation: "mm", difference: "mm", far: "", near: "", reason: "", sharp: "" };
const METHODS = [["whitened", "Whitened (noise limit)"], ["ro", "Rational operators"], ["favaro", "Favaro & Soatto"], ["subbarao", "Subbarao, spatial"], ["subbarao-fourier", "Subbarao, Fourier"]];

const NOTHING = "No depth yet. Capture a pair in Live, or compute one here.";
/** Folder of what is computed from a stack, within its capture. */
const STACK = "focus-stack";
const GREY = ["far", "near", "sharp"];
const OF_STACKS = ["sharp"];
const OF_PAIRS = ["deviation", "near", "reason"];

/** Picture to the right of the wipe, and the figures of a difference.
 * @typedef {{ second?: ImageData, figures?: string }} Compared */

/** Makes the view. `open(name)` shows a capture. */
export function make(host, remember) {
  const viewer = new Viewer("Depth map");
  const surface = h("div", { class: "surface", hidden: true });
  const side = measure.make();
  /** `of` is the capture of the maps; while another one is loaded it differs from `name`.
   * @type {{ name: string | null, of: string | null, layer: string, colours: string, other: string, maps: any, loading: number, painting: number, capture: any, mesh?: Promise<ArrayBuffer> | null }} */
  const show = { name: null, of: null, layer: "depth", colours: "viridis", other: "", maps: {}, loading: 0, painting: 0, capture: null };
  const captures = h("select", { "aria-label": "Capture", onchange: (event) => open(event.target.value) });
  const layers = h("div", { class: "group", role: "group", "aria-label": "Layer" }, LAYERS.map(([name, text]) => button(text, () => pick(name), { "data-layer": name })));
  const tools = h("div", { class: "group", role: "group", "aria-label": "Tool" }, [["pan", "Probe"], ["line", "Profile"], ["region", "Region"]].map(([name, text]) => button(text, () => use(name), { "data-tool": name })));
  const legend = h("canvas", { class: "legend-bar", role: "img", "aria-label": "colours, without a map yet" });
  const [low, high] = [h("span", {}), h("span", {})];
  const reasons = h("div", { class: "reasons" });
  const [least, most] = ["Low", "High"].map((text) => h("input", { type: "number", step: "any", placeholder: "auto", "aria-label": `${text} end of the colours, mm`, onchange: () => refresh() }));
  /** Ends of the colours that were typed. @returns {[number, number] | null} */
  const manual = () => (!altered(least) && !altered(most) && least.value !== "" && most.value !== "" && Number(least.value) < Number(most.value) ? [Number(least.value), Number(most.value)] : null);
  const histogram = h("canvas", { class: "histogram", role: "img", "aria-label": "distribution of the values" });
  const empty = h("p", { class: "empty" }, NOTHING);
  const other = h("select", { "aria-label": "Compare with", onchange: (event) => { show.other = event.target.value; refresh(); } });
  const wipe = h("input", { type: "range", min: 0, max: 100, value: 50, "aria-label": "Wipe", oninput: () => { viewer.wipe = wipe.value / 100; viewer.draw(); } });
  const against = h("div", {});
  const settings = compute(() => show.name, (variant) => {
    show.layer = "depth";
    show.other = variant ? `variant:${variant}` : show.other;
    open(show.name, true);
  });
  const stacking = computeStack(() => show.name, () => {
    show.layer = "depth";
    open(show.name, true);
  });

  host.append(h("div", { class: "split" },
    h("div", { class: "stage" },
      h("div", { class: "toolbar" }, captures, layers, tools),
      h("div", { class: "viewers" }, viewer.element, surface, empty),
      h("div", { class: "legend" }, low, legend, high, reasons, choice(NAMES, "viridis", (name) => { show.colours = name; refresh(); }, { "aria-label": "Colours" }))),
    h("div", { class: "side" }, side.elements, panel("Distribution", histogram, field("Colours from", least, "mm"), field("to", most, "mm")),
      panel("Compare", field("With", other), field("Wipe", wipe), against), settings, stacking,
      panel("Files", links(() => show.name)))));

  viewer.onprobe = (at, keyed) => {
    const words = side.under(show.maps, at, viewer.source);
    if (at && keyed) say(`${words}, pixel ${at.join(", ")}`);
  };
  viewer.overlay = (context, point) => {
    const picture = viewer.source;
    const middle = show.maps.depth ? range(show.maps.depth, 0.5)[0] : show.capture?.optics?.focus?.far_mm;
    // A map of averaged pixels has fewer of them than the image.
    const mm = (pixelAt(middle, show.capture?.optics) * show.capture?.width) / picture.width;
    if (mm > 0) viewer.canvas.dataset.scale = scaleBar(context, point, picture, mm);
    else delete viewer.canvas.dataset.scale;
  };
  const has_map = (capture) => capture?.has_depth || capture?.variants.includes(STACK);
  viewer.onshape = (kind, from, to) => {
    const { name, of, maps, capture } = show;
    if (!name || of !== name || !maps.depth || !has_map(capture)) return;
    side.shape(name, kind, measure.pixelOf(maps.depth, from, viewer.source), measure.pixelOf(maps.depth, to, viewer.source));
  };

  const use = (tool) => {
    viewer.use(tool);
    for (const control of tools.children) control.setAttribute("aria-pressed", control.dataset.tool === tool);
  };
  use("pan");

  /** Ends the surface that turns. @type {(() => void) | null} */
  let turning = null;
  /** The mesh that turns: what is loaded after it must not restart it. */
  let turned = null;
  /** Told once of the next picture that is painted. @type {(() => void) | undefined} */
  let aged;
  const pick = (layer) => {
    show.layer = layer;
    refresh();
  };

  /** Selects a capture. A comparison with another map of the capture before ends. @param {string} name */
  const select = (name) => {
    if (name !== show.name && /^(variant|minus):/.test(show.other)) other.value = show.other = "";
    show.name = captures.value = name;
  };
  /** Replaces the maps. Figures and surface of those before are removed. */
  const replace = (maps) => {
    [show.of, show.maps, show.mesh, viewer.shape] = [show.name, maps, null, null];
    side.forget();
    turning?.();
    turning = null;
  };

  async function list() {
    const wanted = show.other;
    const found = (await get("/api/captures")).captures.filter((capture) => !capture.broken);
    captures.replaceChildren(...found.map((capture) => h("option", { value: capture.name, selected: capture.name === show.name }, capture.name + (capture.has_depth ? "" : capture.kind === "pair" ? " (no depth)" : ` (${capture.images.length} image${capture.images.length === 1 ? "" : "s"})`))));
    const present = show.other;
    const option = (value, text) => h("option", { value, selected: value === present }, text);
    const own = found.find((capture) => capture.name === show.name);
    // It was deleted or renamed: its maps do not stay under the name of another.
    if (!own && show.capture && show.capture.name === show.name) {
      show.loading++;
      replace({});
      [show.name, show.of, show.capture] = [null, null, null];
      refresh();
    }
    other.replaceChildren(option("", "nothing"),
      ...LAYERS.slice(0, -1).map(([name, text]) => option(`layer:${name}`, text)),
      ...(own?.variants ?? []).map((name) => option(`variant:${name}`, `this, by ${name}`)),
      ...(own?.variants ?? []).map((name) => option(`minus:${name}`, `difference: ${name} minus this`)),
      ...found.filter((capture) => capture.has_depth && capture.name !== show.name).flatMap((capture) => [option(`depth:${capture.name}`, `depth of ${capture.name}`), option(`difference:${capture.name}`, `difference to ${capture.name}`)]));
    // The compared map may have been deleted. A choice made while the list was loaded stays.
    if (show.other === wanted && other.value !== wanted) {
      other.value = show.other = "";
      refresh();
    }
    const pairs = found.filter((capture) => capture.kind === "pair");
    if (!show.name && found.length) open((pairs.at(-1) ?? found.at(-1)).name);
    return found;
  }

  async function open(name, again = false) {
    if (!name || (name === show.name && name === show.of && !again)) return;
    const loading = ++show.loading;
    select(name);
    remember(name);
    const replaced = [];
    try {
      const { capture } = await get(`/api/captures/${encodeURIComponent(name)}`);
      const names = Object.keys(FILES).filter((layer) => capture.files.includes(FILES[layer]));
      if (loading !== show.loading) return;
      show.capture = capture;
      pages(capture);
      if (capture.kind !== "pair") return await stack(name, capture, loading);
      if (!names.includes(show.layer) && !(show.layer === "surface" && capture.has_depth)) show.layer = capture.has_depth ? "depth" : "far";
      // The visible layer is loaded first, the rest after it is drawn.
      const first = names.filter((layer) => layer === show.layer || layer === "confidence" || (show.layer === "surface" && layer === "depth"));
      for (const part of [first, names.filter((layer) => !first.includes(layer))]) {
        const loaded = await Promise.all(part.map((layer) => load(`/api/captures/${encodeURIComponent(name)}/files/${FILES[layer]}`)));
        if (loading !== show.loading) return;
        // A capture that is loaded again keeps its maps on screen and its buttons in use until then.
        if (part === first) replace(show.of === name ? Object.fromEntries(names.filter((layer) => show.maps[layer]).map((layer) => [layer, show.maps[layer]])) : {});
        part.forEach((layer, at) => { show.maps[layer] = loaded[at]; });
        replaced.push(...part);
        await refresh();
      }
      await list();
    } catch (error) {
      if (loading !== show.loading) return;
      notice(error.message, "error", error.hint);
      // Maps of before stay neither next to new ones nor under this name.
      if (replaced.length) show.maps = Object.fromEntries(replaced.map((layer) => [layer, show.maps[layer]]));
      else {
        replace({});
        [show.capture, show.of] = [null, null]; // it can be opened again
      }
      refresh();
    }
  }

  /** Images of a still or a stack are chosen by a slider. */
  const index = h("input", { type: "range", min: 0, value: 0, "aria-label": "Image of the stack" });
  const which = h("span", { class: "dim" });
  const slider = h("div", { class: "toolbar", hidden: true }, index, which);
  host.querySelector(".stage .toolbar").after(slider);
  index.addEventListener("input", () => show.capture && stack(show.name, show.capture, ++show.loading).catch((error) => notice(error.message, "error", error.hint)));

  function pages({ kind, images }) {
    settings.hidden = kind !== "pair";
    stacking.hidden = kind === "pair" || images.length < 3;
    slider.hidden = kind === "pair" || images.length < 2;
    index.max = String(images.length - 1);
    index.value = "0";
  }

  async function stack(name, capture, loading) {
    const at = `/api/captures/${encodeURIComponent(name)}`;
    const of = capture.variants.includes(STACK) ? ["depth", "confidence", "sharp"] : [];
    const image = load(`${at}/files/${encodeURIComponent(capture.images[Number(index.value)])}`);
    const computed = await Promise.all(of.map((layer) => load(`${at}/variants/${STACK}/${FILES[layer]}`)));
    /** @type {Record<string, import("./maps.js").NumberMap>} */
    const maps = { far: await image, ...Object.fromEntries(of.map((layer, at) => [layer, computed[at]])) };
    if (loading !== show.loading) return;
    replace(maps);
    if (!(show.layer in maps) && !(show.layer === "surface" && maps.depth)) show.layer = "far";
    which.textContent = `${Number(index.value) + 1} of ${capture.images.length}: ${capture.images[Number(index.value)]}`;
    await refresh();
    await list();
  }

  /** Depth of a pair that was just taken; what is measured and kept is computed from its files, and follows. */
  function fresh(header, pixels) {
    show.loading++; // pending requests belong to another capture
    select(header.capture);
    show.capture = null;
    show.layer = "depth";
    replace(decoded(header, pixels));
    // As in live.js: both have one clock where the program runs on this computer.
    aged = () => { viewer.canvas.dataset.ageMs = String(Math.round(performance.timeOrigin + performance.now() - header.arrived_ms)); };
    refresh();
  }

  async function refresh() {
    const { layer, maps } = show;
    const painting = ++show.painting;
    empty.hidden = Boolean(maps.far || maps.depth);
    empty.textContent = show.name && show.of !== show.name ? `Loading ${show.name} …` : NOTHING;
    for (const control of layers.children) {
      control.setAttribute("aria-pressed", control.dataset.layer === layer);
      control.hidden = (show.capture && show.capture.kind !== "pair" ? OF_PAIRS : OF_STACKS).includes(control.dataset.layer);
      control.disabled = control.dataset.layer === "surface" ? !maps.depth || !has_map(show.capture) : !maps[control.dataset.layer];
    }
    const solid = layer === "surface" && maps.depth;
    surface.hidden = !solid;
    viewer.element.hidden = Boolean(solid);
    reasons.replaceChildren(...(layer === "reason" && maps.reason ? reasonLegend(maps.reason) : []));
    for (const part of [low, legend, high]) part.hidden = layer === "reason";
    if (solid) {
      const ends = range(maps.depth, 0);
      bar(legend, "viridis", ends, "mm");
      [low.textContent, high.textContent] = ends.map((mm) => number(mm, 2, "mm"));
      bars(histogram, counts(maps.depth, ends), ends, "mm");
      return turn();
    }
    turning?.();
    turning = null;
    const map = maps[layer];
    if (!map) {
      viewer.clear();
      delete viewer.canvas.dataset.layer;
      return;
    }
    const ends = limits(layer, map);
    const picture = layer === "reason" ? paintReasons(map) : paint(map, ends, colours(layer), layer === "depth" ? maps.confidence?.data : null);
    viewer.wipe = wipe.value / 100;
    const { second = null, figures = "" } = await compared().catch(/** @returns {Compared} */ (error) => {
      if (painting === show.painting) notice(error.message, "error", error.hint);
      return {};
    });
    // A later choice is painted instead.
    if (painting !== show.painting) return;
    against.replaceChildren(...(figures ? [h("p", { class: "dim" }, figures)] : []));
    viewer.onpainted = () => { performance.mark("depth-shown"); aged?.(); [viewer.onpainted, aged] = [undefined, undefined]; };
    viewer.show(picture, second);
    viewer.canvas.dataset.layer = layer;
    bar(legend, colours(layer), ends, UNITS[layer]);
    const decimals = layer === "confidence" ? 1 : 2;
    low.textContent = number(ends[0], decimals, UNITS[layer]);
    high.textContent = number(ends[1], decimals, UNITS[layer]);
    bars(histogram, counts(map, ends), ends, UNITS[layer]);
  }

  /** Another map minus this one, with its figures. @param {import("./maps.js").NumberMap} map @returns {Compared} */
  function minus(map) {
    const own = show.maps.depth;
    if (map.width !== own.width || map.height !== own.height) throw new Error(`The maps have different sizes, ${map.width} × ${map.height} and ${own.width} × ${own.height} pixels: they have no difference.`);
    const data = map.data.map((value, at) => value - own.data[at]);
    const found = data.filter(Number.isFinite);
    const mean = found.reduce((sum, value) => sum + value, 0) / found.length;
    const sd = Math.sqrt(found.reduce((sum, value) => sum + (value - mean) ** 2, 0) / found.length);
    const difference = { ...map, data };
    const most = Math.max(...range(difference, 0.02).map(Math.abs));
    return { second: paint(difference, [-most, most], "difference"), figures: `${found.length} pixels: mean ${number(mean, 3)}, SD ${number(sd, 3)}, RMS ${number(Math.hypot(mean, sd), 3)} mm; blue to red = ∓${number(most, 1)} mm` };
  }

  const colours = (layer) => (GREY.includes(layer) ? "grey" : show.colours);
  const limits = (layer, map) => (layer === "confidence" ? [0, 1] : layer === "reason" ? [0, REASONS.length - 1] : layer === "depth" && manual() ? /** @type {[number, number]} */ (manual()) : GREY.includes(layer) ? [0, 255] : layer === "deviation" ? [0, range(map, 0.03)[1]] : range(map));

  /** Picture to the right of the wipe. @returns {Promise<Compared>} */
  async function compared() {
    const [, kind, name] = /^(\w+):(.+)$/.exec(show.other) ?? []; // a name may have a colon, too
    if (!name) return {};
    if (kind === "layer") {
      const map = show.maps[name];
      return !map ? {} : { second: name === "reason" ? paintReasons(map) : paint(map, limits(name, map), colours(name)) };
    }
    const own = `/api/captures/${encodeURIComponent(show.name ?? "")}`;
    const variant = `${own}/variants/${encodeURIComponent(name)}/depth.npy`;
    // Depth on the right uses the scale of this capture's depth, also next to another layer.
    const depths = (map) => ({ second: paint(map, show.maps.depth ? limits("depth", show.maps.depth) : range(map), show.colours) });
    if (kind === "minus" && show.maps.depth) return minus(await load(variant));
    if (kind === "variant") return depths(await load(variant));
    if (kind === "depth") return depths(await load(`/api/captures/${encodeURIComponent(name)}/files/depth.npy`));
    if (kind !== "difference") return {};
    const path = `${own}/difference/${encodeURIComponent(name)}`;
    const { figures } = await get(path);
    const map = await load(`${path}/map.npy`);
    const most = Math.max(...range(map, 0.02).map(Math.abs));
    return { second: paint(map, [-most, most], "difference"), figures: `mean ${number(figures.mean_mm, 3)}, SD ${number(figures.standard_deviation_mm, 3)}, RMS ${number(figures.rms_mm, 3)} mm; blue to red = ∓${number(most, 1)} mm` };
  }

  async function turn() {
    // Calls share one pending request.
    const mesh = (show.mesh ??= bytes(`/api/captures/${encodeURIComponent(show.name ?? "")}/mesh.ply`));
    try {
      const [buffer, { show: begin, sorry }] = await Promise.all([mesh, import("./mesh.js")]);
      if (show.layer !== "surface" || show.mesh !== mesh || (turning && turned === mesh)) return;
      turned = mesh;
      try {
        turning = begin(surface, buffer);
      } catch (error) {
        sorry(surface, error);
      }
    } catch (error) {
      if (show.mesh !== mesh) return;
      show.mesh = null; // requested again by the next look
      surface.replaceChildren(h("p", { class: "empty" }, `No surface: ${error.message}${error.hint ? ` ${error.hint}` : ""}`));
    }
  }

  // The files of the capture that is shown have changed.
  onJob("depth", ({ phase, title }, old) => { if (phase === "done" && !old && title === `Depth of ${show.name}`) open(show.name, true); });
  let seen = -1;
  on("state", (state) => {
    if (state.captures === seen || host.hidden) return;
    seen = state.captures;
    list().catch(() => {});
  });
  return {
    open,
    fresh,
    shown: (name) => {
      seen = store.state?.captures ?? -1;
      list().then(() => name && open(name)).catch(() => {});
      viewer.draw();
    },
  };
}

/** Depth, confidence, the far image, deviation and reasons of a new pair from the socket, as numbers. @param {any} header @param {Uint8Array} pixels */
function decoded({ width, height, low_mm, high_mm }, pixels) {
  const count = width * height;
  const codes = new Uint16Array(pixels.buffer, pixels.byteOffset, count);
  const map = (value) => {
    const data = new Float32Array(count);
    for (let at = 0; at < count; at++) data[at] = value(at);
    return { width, height, data };
  };
  const step = (high_mm - low_mm) / 65534;
  return {
    depth: map((at) => (codes[at] ? low_mm + (codes[at] - 1) * step : NaN)),
    confidence: map((at) => pixels[2 * count + at] / 255),
    far: map((at) => pixels[3 * count + at]),
    deviation: { width, height, data: new Float32Array(pixels.buffer, pixels.byteOffset + 4 * count, count) },
    reason: map((at) => pixels[8 * count + at]),
  };
}

/** @param {import("./maps.js").NumberMap} map */
function paintReasons({ width, height, data }) {
  const image = new ImageData(width, height);
  const colours = REASON_COLOURS.map((text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16)));
  data.forEach((code, at) => image.data.set([...(colours[code] ?? colours[9]), 255], 4 * at));
  return image;
}

/** The reasons that occur, with their part of the map. @param {import("./maps.js").NumberMap} map */
function reasonLegend({ data }) {
  const found = REASONS.map(() => 0);
  for (const code of data) if (code in found) found[code]++;
  return REASONS.flatMap((text, code) => (found[code] ? [h("span", {}, h("i", { style: { background: REASON_COLOURS[code] } }), `${text} ${number((100 * found[code]) / data.length, 1)} %`)] : []));
}

/** A map or an image as numbers. */
async function load(path) {
  const buffer = await bytes(path);
  return path.endsWith(".npy") ? parse(buffer) : png.parse(buffer);
}

/** @param {import("./maps.js").NumberMap} map @param {number[]} ends */
function counts({ data }, [low, high]) {
  const bins = new Array(96).fill(0);
  const scale = bins.length / (high - low || 1);
  for (const value of data) if (value >= low && value <= high) bins[Math.min(bins.length - 1, Math.floor((value - low) * scale))]++;
  return bins;
}

/** The panel that computes depth again, as a variant or to replace the capture's own map. */
function compute(name, done) {
  const method = choice(METHODS, "whitened", () => {});
  const smooth = h("input", { type: "number", placeholder: "default", min: 1, max: 63, step: 2 });
  const median = choice([["1", "none"], ["3", "3 × 3"], ["5", "5 × 5"], ["7", "7 × 7"]], "3", () => {});
  const filled = h("input", { type: "checkbox" });
  const corrected = h("input", { type: "checkbox" });
  const keep = h("input", { type: "checkbox" });
  const more = furtherOptions("CaptureDepthRequest");
  const start = async () => {
    if (!name()) return;
    /** @type {Record<string, any>} */
    const wish = { method: method.value, median_px: Number(median.value), fill: filled.checked ? "surface" : null, corrected: corrected.checked };
    if (["ro", "whitened"].includes(method.value)) wish.uncertainty = "estimated";
    if (keep.checked) wish.variant = `${method.value}-${smooth.value || "default"}-${median.value}${filled.checked ? "-filled" : ""}${corrected.checked ? "-corrected" : ""}`;
    const begun = await act(`/api/captures/${encodeURIComponent(name())}/depth`, () => ({ ...more.values(), ...(optional(smooth) === null ? {} : { window: smooth.value }), ...wish }));
    if (begun && (await ended("computation", begun.job)).phase === "done") done(wish.variant);
  };
  return panel("Compute", field("Method", method), field("Window", smooth, "px"), field("Median", median),
    h("label", { class: "check" }, filled, "fill low texture"), h("label", { class: "check" }, corrected, "correction of this session"),
    h("label", { class: "check" }, keep, "keep as another map, to compare"),
    more.element, button("Compute depth", start));
}

/** Options of a depth request that have a control of their own, or that the page fills in. */
const SHOWN = ["method", "window", "median_px", "fill", "corrected", "variant", "uncertainty", "write"];

/** The panel that computes the depth of a stack. */
function computeStack(name, done) {
  const more = furtherOptions("FocusStackRequest");
  const start = async () => {
    const begun = name() && (await act(`/api/captures/${encodeURIComponent(name())}/stack`, more.values));
    if (begun && (await ended("computation", begun.job)).phase === "done") done();
  };
  const element = panel("Depth from focus", more.element, button("Compute stack", start));
  element.hidden = true;
  return element;
}

/** The options of a request that have no control of their own, from its schema. */
function furtherOptions(request) {
  const place = h("div", { class: "details" });
  const element = h("details", {}, h("summary", {}, "All options"), place);
  /** @type {[string, string, HTMLInputElement][]} */
  let inputs = [];
  element.addEventListener("toggle", async () => {
    if (inputs.length) return;
    try {
      const { components } = await get("/openapi.json");
      const all = /** @type {[string, any][]} */ (Object.entries(components.schemas[request].properties));
      // Lists have no field: they come from the capture's record.
      inputs = all.filter(([name, { type }]) => !SHOWN.includes(name) && ![type].flat().includes("array")).map(([name, { type, default: usual, description }]) => {
        const [kind] = [type].flat();
        const input = /** @type {HTMLInputElement} */ (h("input", { type: kind === "boolean" ? "checkbox" : kind === "string" ? "text" : "number", step: "any", name, title: description, placeholder: usual ?? "default" }));
        return [name, kind, input];
      });
      place.replaceChildren(...inputs.flatMap(([name, , input]) => [field(name.replaceAll("_", " "), input), h("p", { class: "dim about" }, input.title)]));
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  });
  const values = () => Object.fromEntries(inputs.map(([name, kind, input]) => [name, kind === "boolean" ? input.checked || null : kind === "string" ? input.value || null : optional(input)])
    .filter(([, value]) => value !== null));
  return { element, values };
}

/** Lateral size of a pixel of the image at a distance of a thin lens, mm. A lens calibrated from a stack may give that of averaged pixels. */
function pixelAt(mm, optics) {
  const [pixel, focal, far] = [optics?.sensor?.pixel_um / (optics?.stage?.bin ?? 1), optics?.lens?.focal_length_mm, optics?.focus?.far_mm];
  // Rays meet in the front focus, or in a lens that is not telecentric.
  const [centre, distance] = optics?.lens?.telecentric === false ? [0, (focal * far) / (far - focal)] : [focal, focal];
  return pixel > 0 && mm > focal && optics.stage?.scale_known !== false ? ((pixel / 1000) * (mm - centre)) / distance : NaN;
}

/** A bar of 1, 2 or 5 times a power of ten mm, at most a quarter of the picture.
 * @param {CanvasRenderingContext2D} context @param {(x: number, y: number) => number[]} point @param {{ width: number, height: number }} map @param {number} mm of a pixel */
function scaleBar(context, point, map, mm) {
  const most = (mm * map.width) / 4;
  const decade = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((times) => times * decade).find((size) => size <= most) ?? decade;
  const [left, y] = point(0.03 * map.width, 0.95 * map.height);
  const [right] = point(0.03 * map.width + length / mm, 0);
  const text = `${Number(length.toPrecision(1))} mm`;
  context.font = "12px system-ui";
  context.fillStyle = "#000b";
  context.fillRect(left - 5, y - 20, Math.max(right - left, context.measureText(text).width) + 10, 27);
  context.fillStyle = "#fff";
  context.fillRect(left, y, right - left, 3);
  context.fillText(text, left, y - 5);
  return text;
}

function links(name) {
  const go = (path) => () => name() && window.open(`/api/captures/${encodeURIComponent(name())}/${path}`, "_blank", "noopener");
  return h("div", { class: "buttons" }, button("Report", go("report.html")), button("ZIP", go("zip")));
}
