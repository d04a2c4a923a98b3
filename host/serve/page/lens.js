// The optics as they are typed, drawn to scale, and what follows from them.
import { act, call, hasControl, get, on } from "./link.js";
import { h, s, button, choice, field, notice, number, optional, panel, rows } from "./ui.js";
import { Plot } from "./plot.js";

const MODELS = [["pillbox", "Pill-box"], ["gaussian", "Gaussian"], ["generalised", "Generalised Gaussian"]];

/** Makes the view. */
export function make(host) {
  const inputs = {
    focal: input(50), aperture: input(12.8), pixel: input(7.4), far: input(933), blur: input(2.703),
    m1: input("", "–"), m2: input("", "–"), k: input(0.4578), p: input(1.8),
  };
  const model = choice(MODELS, "gaussian", () => later());
  model.append(h("option", { value: "", disabled: true }, "as in the file"));
  const wrong = h("p", { class: "bad", role: "alert" });
  const drawing = h("div", { class: "drawing" });
  const results = h("div", { class: "columns" });
  const place = h("div", {});
  const plot = new Plot(place, { label: "blur radius in both images over the depth", x: "depth, mm", y: "blur, px", height: 190, names: ["far-focused image", "near-focused image"] });
  const use = button("Use these optics", () => save(), { class: "primary" });
  const using = h("p", { class: "dim" });
  const p = field("Exponent p", inputs.p);
  host.append(h("div", { class: "split" },
    h("div", { class: "stage scroll", tabindex: "0", role: "region", "aria-label": "What follows from the optics" }, panel("Drawn to scale", drawing), panel("What follows", results), panel("Blur over the working range", place,
      h("p", { class: "legend" }, h("span", { class: "key a" }), "far-focused image ", h("span", { class: "key b" }), "near-focused image"))),
    h("div", { class: "side" },
      panel("Lens and sensor", field("Focal length", inputs.focal, "mm"), field("Aperture", inputs.aperture, "mm"), field("Pixel", inputs.pixel, "µm")),
      panel("Focus", field("Far focus", inputs.far, "mm"), field("Largest blur", inputs.blur, "px")),
      panel("Micrometer", field("m1, far", inputs.m1, "mm"), field("m2, near", inputs.m2, "mm"),
        h("p", { class: "dim" }, "Of a rig that is turned by hand. With m1 alone, m2 follows; with both, the largest blur.")),
      panel("Point spread function", field("Model", model), field("Blur constant k", inputs.k), p),
      h("div", { class: "panel" }, wrong, use, using))));

  let waiting = 0;
  /** Grows with every change: an answer to the fields of before is dropped. */
  let changes = 0;
  /** Whether a change awaits its answer. */
  let stale = false;
  const later = () => {
    changes++;
    stale = Boolean(read);
    clearTimeout(waiting);
    waiting = setTimeout(calculate, 120);
  };
  for (const control of Object.values(inputs)) control.addEventListener("input", later);
  const fields = [...Object.values(inputs), model];
  /** The optics in use. @type {any} */
  let read = null;
  /** Whether one of these fields differs from the optics in use. */
  const changed = (...controls) => controls.some((control) => control.value !== control.dataset.was || control.validity.badInput);

  /** The optics in use with the changed fields: what has no field here stays. A changed lens has no calibration. */
  function typed() {
    const optics = structuredClone(read);
    const { lens, sensor, focus } = optics;
    if (changed(inputs.focal, inputs.aperture)) {
      [lens.focal_length_mm, lens.aperture_mm] = [optional(inputs.focal), optional(inputs.aperture)];
      delete lens.f_number;
    }
    if (changed(inputs.pixel)) sensor.pixel_um = optional(inputs.pixel);
    if (changed(inputs.far)) focus.far_mm = optional(inputs.far);
    if (changed(inputs.blur)) {
      focus.max_blur_px = optional(inputs.blur);
      delete focus.near_mm;
    }
    if (model.value && changed(model, inputs.k, inputs.p)) {
      optics.psf = { model: model.value };
      if (model.value !== "pillbox") optics.psf.k = optional(inputs.k);
      if (model.value === "generalised") optics.psf.p = optional(inputs.p);
    }
    const measured = inputs.m1.value !== "" && inputs.m2.value !== "";
    if (measured || changed(inputs.focal, inputs.aperture, inputs.pixel, inputs.far, inputs.blur, model, inputs.k, inputs.p)) delete optics.stage;
    return optics;
  }

  let complete = null;
  async function calculate() {
    p.hidden = model.value !== "generalised";
    inputs.k.parentElement.hidden = model.value === "pillbox" || model.value === "";
    if (!read) return;
    const asked = ++changes;
    try {
      const readings = { far_mm: optional(inputs.m1), near_mm: optional(inputs.m2) };
      const { figures } = await call("POST", "/api/optics/calculate", { optics: typed(), readings });
      if (asked !== changes) return;
      wrong.textContent = "";
      complete = figures.optics;
      show(figures);
    } catch (error) {
      if (asked !== changes) return;
      complete = null;
      wrong.textContent = error.message;
    }
    stale = false;
    use.disabled = !complete || !hasControl();
  }

  function show(found) {
    const { range } = found;
    const reading = (one) => one && `${number(one.mm, 4)} mm = ${number(one.major_mm, 1)} + ${number(one.minor_mm, 4)}`;
    results.replaceChildren(rows([
      ["near focus", number(range.near_mm, 2, "mm")], ["far focus", number(range.far_mm, 2, "mm")],
      ["working range", number(found.depth_range_mm, 2, "mm")],
      ["sensor, far", number(range.sensor_far_mm, 4, "mm")], ["sensor, near", number(range.sensor_near_mm, 4, "mm")],
      ["sensor travel", number(1e3 * range.sensor_travel_mm, 2, "µm")],
      ["f-number", number(found.f_number, 3)], ["largest blur", number(found.max_blur_px, 3, "px")],
      ["0.1 px of blur", number(found.depth_per_tenth_px_mm, 2, "mm")], ["a pixel sees", number(found.pixel_footprint_mm, 4, "mm")],
      found.reading_far && ["m1", reading(found.reading_far)], found.reading_near && ["m2", reading(found.reading_near)],
    ]));
    const blur = [...found.blur].reverse();
    plot.set([blur.map((at) => at.depth_mm), blur.map((at) => at.far_px), blur.map((at) => at.near_px)]);
    drawing.replaceChildren(toScale(found));
  }

  async function save() {
    while (stale) await calculate(); // pressed before the answer
    if (complete && (await act("/api/optics", { optics: complete }, "PUT"))) using.textContent = "In use for captures from now on.";
  }

  async function load() {
    const { optics } = await get("/api/optics");
    inputs.focal.value = optics.lens.focal_length_mm;
    inputs.aperture.value = Number((optics.lens.aperture_mm ?? optics.lens.focal_length_mm / optics.lens.f_number).toFixed(4));
    inputs.pixel.value = optics.sensor.pixel_um;
    inputs.far.value = optics.focus.far_mm;
    inputs.blur.value = Number((optics.focus.max_blur_px ?? 0).toFixed(4)) || "";
    model.value = MODELS.some(([name]) => name === optics.psf.model) ? optics.psf.model : "";
    if (optics.psf.k != null) inputs.k.value = optics.psf.k;
    if (optics.psf.p != null) inputs.p.value = optics.psf.p;
    using.textContent = optics.stage ? "In use: a lens calibrated from a stack. A changed field removes its calibration." : "";
    read = optics;
    for (const control of fields) control.dataset.was = control.value;
    await calculate();
  }
  let loaded = -1;
  on("state", (state) => {
    use.disabled = !complete || !hasControl();
    // Optics that change while a field is in use are loaded after that.
    if (state.optics === loaded || host.contains(document.activeElement)) return;
    loaded = state.optics;
    load().catch((error) => notice(error.message, "error", error.hint));
  });
  return { shown: () => plot.size() };
}

function input(value, placeholder = "") {
  return h("input", { type: "number", step: "any", inputmode: "decimal", value, placeholder });
}

/** Object side and image side, each to its scale. */
function toScale({ range, aperture_mm: aperture, optics }) {
  const [width, middle] = [640, 92];
  const lens = 430;
  const perMm = (lens - 24) / range.far_mm;
  const at = (mm) => lens - mm * perMm;
  const sensors = [range.sensor_far_mm, range.sensor_near_mm];
  const zoom = 40 / (sensors[1] - sensors[0]);
  const sensor = (mm) => 560 + (mm - sensors[0]) * zoom;
  const tall = Math.max(26, Math.min(64, (aperture / optics.lens.focal_length_mm) * 220));
  const line = (x, cls, y = 30) => s("line", { x1: x, y1: middle - y, x2: x, y2: middle + y, class: cls });
  const text = (x, y, words, anchor = "middle", cls = "") => s("text", { x, y, "text-anchor": anchor, class: cls }, words);
  return s("svg", { viewBox: `0 0 ${width} 190`, class: "to-scale", role: "img", "aria-label": `working range from ${number(range.near_mm, 1)} to ${number(range.far_mm, 1)} mm before the lens` },
    s("line", { x1: 10, y1: middle, x2: width - 10, y2: middle, class: "axis" }),
    s("path", { d: `M${at(range.far_mm)} ${middle} L${lens} ${middle - tall / 2} L${sensor(sensors[0])} ${middle} L${lens} ${middle + tall / 2} Z`, class: "rays" }),
    s("path", { d: `M${at(range.near_mm)} ${middle} L${lens} ${middle - tall / 2} L${sensor(sensors[1])} ${middle} L${lens} ${middle + tall / 2} Z`, class: "rays b" }),
    s("rect", { x: at(range.far_mm), y: middle - 42, width: at(range.near_mm) - at(range.far_mm), height: 84, class: "range" }),
    line(at(range.far_mm), "far", 42), line(at(range.near_mm), "near", 42), line(at(range.alpha0_mm), "middle", 34),
    s("path", { d: `M${lens} ${middle - tall / 2 - 6} q14 ${tall / 2 + 6} 0 ${tall + 12} q-14 ${-tall / 2 - 6} 0 ${-tall - 12}`, class: "lens" }),
    line(sensor(sensors[0]), "far"), line(sensor(sensors[1]), "near"),
    text(at(range.far_mm), middle - 50, `${number(range.far_mm, 1)} mm`, "start"),
    text(at(range.near_mm) + 4, middle + 58, `${number(range.near_mm, 1)} mm`, "start"),
    text(lens, middle + tall / 2 + 24, `⌀ ${number(aperture, 1)} mm`),
    text(sensor(sensors[0]), middle - 38, number(sensors[0], 4), "end"), text(sensor(sensors[1]), middle + 46, number(sensors[1], 4), "end"),
    text(10, 182, "object distances to scale", "start", "faint"),
    text(width - 10, 182, `sensor travel ${number(zoom / perMm, 0)} times enlarged`, "end", "faint"));
}
