// Guides with pictures: first power-up, point spread function, flat series, and people before the camera.
import { act, call, hasControl, ended, get, on, onJob, store } from "./link.js";
import { h, allow, button, choice, field, notice, number, numeric, optional, panel, rows } from "./ui.js";
import * as draw from "./guide-pictures.js";
import * as people from "./people.js";
import { Plot } from "./plot.js";

/** Steps of the bring-up checklist as the program names them: what to do, and the picture beside it. */
const STEPS = [
  ["the link", "NUCLEO alone on USB, nothing wired.", "board"], ["who the board is", "The firmware says its name and version.", "board"],
  ["alarms", "No alarm is latched.", "board"], ["memory", "A setting outlasts a reset.", "board"],
  ["end switches by hand", "Motors not connected. Press each switch in turn.", "switch"], ["emergency stop", "Press it: an alarm comes and goes with it.", "stop"],
  ["encoder direction", "Turn each shaft by hand, away from home.", "encoder"],
  ["piezo ready", "Gauge electronics, then the amplifier on. With a second mode: set piezo_second_mode to 1.", "piezo"],
  ["motors on", "24 V off, connect the motors, stages in mid-travel; a hand on the emergency stop; 24 V on.", "motor"],
  ["first slow homing", "Slowly towards its home switch.", "home"], ["homing repeats", "The second time within 1.5 µm.", "home"],
  ["a move at full speed", "To the middle of the travel.", "motor"], ["halt and its alarm", "It stops immediately and raises an alarm.", "stop"],
  ["piezo sweep", "Gauge and amplifier follow.", "piezo"], ["far and near by piezo", "Settled within milliseconds.", "piezo"],
  ["camera and strobe", "Trigger, strobe and image belong together.", "camera"],
];
const SIGNS = { passed: ["✓", "passed"], failed: ["✗", "failed"], "passed-over": ["–", "passed over"] };

/** Makes the view. */
export function make(host) {
  const guides = [
    ["power", "First power-up", draw.board(), powerUp()], ["psf", "Point spread function", draw.target(), psf()],
    ["lens", "Lens from a stack", draw.slices(), lens()],
    ["series", "Flat series and correction", draw.series(), series()], ["shadow", "Shadow by the sun", draw.sun(40, 200, 1.2), people.shadow()],
    ["activity", "Activity of a person", draw.person(), people.activity()],
  ];
  const place = h("div", { class: "guide scroll", tabindex: "0", role: "region", "aria-label": "Guide" });
  const list = h("div", { class: "guide-list", role: "group", "aria-label": "Guides" }, guides.map(([name, title, picture]) =>
    h("button", { type: "button", class: "guide-card", "data-guide": name, onclick: () => pick(name) }, picture, h("span", {}, title))));
  host.append(list, place);
  const pick = (name) => {
    const found = guides.find(([other]) => other === name) ?? guides[0];
    for (const card of list.children) card.setAttribute("aria-pressed", card.dataset.guide === found[0]);
    place.dataset.guide = found[0];
    const card = list.querySelector("[aria-pressed=true]");
    if (list.scrollWidth > list.clientWidth) list.scrollLeft = card.offsetLeft - list.offsetLeft - 40;
    place.replaceChildren(found[3].element);
    found[3].shown?.();
    if (!host.hidden) history.replaceState(null, "", `#guides/${found[0]}`);
    enable();
  };
  const enable = () => {
    if (!store.state) return;
    const { rig, job, computation } = store.state;
    for (const control of host.querySelectorAll("[data-needs=rig]")) allow(control, hasControl() && rig.phase === "ready" && job?.phase !== "running");
    for (const control of host.querySelectorAll("[data-needs=computation]")) allow(control, hasControl() && computation?.phase !== "running");
    for (const control of host.querySelectorAll("[data-needs=client]")) allow(control, store.client !== null && computation?.phase !== "running");
  };
  on("state", enable);
  pick("power");
  return { shown: (name) => pick(name ?? place.dataset.guide) };
}

/** A step of a guide: its picture, what to do, and controls. */
function step(count, title, picture, ...content) {
  return h("section", { class: "panel guide-step" }, h("div", { class: "guide-picture" }, picture), h("div", { class: "guide-words" }, h("h2", {}, `${count}. ${title}`), content));
}

function powerUp() {
  const said = h("p", { class: "status", "aria-live": "polite" });
  const verdicts = new Map();
  const items = STEPS.map(([name, what, picture], at) => {
    const sign = h("span", { class: "verdict", "aria-hidden": "true" }, String(at + 1));
    const found = h("p", { class: "dim" }, what);
    verdicts.set(name, { sign, found, what });
    return h("li", { class: "check-step" }, draw[picture](), sign, h("div", {}, h("h3", {}, name), found));
  });
  const show = (result) => {
    for (const { step: name, verdict, detail } of result.steps) {
      const { sign, found, what } = verdicts.get(name) ?? {};
      if (!sign) continue;
      sign.textContent = SIGNS[verdict][0];
      sign.dataset.verdict = verdict;
      found.textContent = `${SIGNS[verdict][1]}: ${detail || what}`;
    }
    said.textContent = `${result.passed} passed, ${result.failed} failed, ${result.passed_over} passed over`;
  };
  onJob("check", ({ phase, result, error }) => {
    if (phase === "done") show(result);
    else if (phase === "running") for (const { sign } of verdicts.values()) delete sign.dataset.verdict;
    else said.textContent = error ?? "stopped";
  });
  on("state", ({ job }) => { if (job?.kind === "check" && job.phase === "running") said.textContent = job.said ?? "…"; });
  const element = h("div", { class: "guide-body" },
    h("section", { class: "panel" }, h("h2", {}, "First power-up"),
      h("p", {}, "Take the next step only when the one before succeeded. The board measures what it can; the page asks for manual steps. The first seven steps are done with the motors disconnected."),
      h("div", { class: "buttons" }, button("Start the checklist", () => act("/api/rig/check"), { class: "primary", "data-needs": "rig" })), said),
    h("ol", { class: "check-steps" }, items));
  return { element };
}

function psf() {
  const pairs = h("ul", { class: "choose" });
  const taught = h("div", {});
  const result = h("div", { "aria-live": "polite" });
  const model = choice([["gaussian", "Gaussian: k"], ["generalised", "Generalised Gaussian: p and k"]], "gaussian", () => {});
  let useSeries = null;
  /** What was entered for a pair, by its name: the list is built again after each capture. @type {Map<string, { checked: boolean, mm: string }>} */
  const entered = new Map();
  const remember = () => {
    for (const row of pairs.querySelectorAll("[data-name]")) entered.set(row.dataset.name, { checked: row.querySelector("[type=checkbox]").checked, mm: row.querySelector("[type=number]").value });
  };
  const capture = async () => {
    const begun = await act("/api/captures", { kind: "pair" });
    if (begun && (await ended("job", begun.job)).phase === "done") await shown();
  };
  const find = () => act("/api/calibrate/psf", () => {
    const targets = [...pairs.querySelectorAll("li")].filter((row) => row.querySelector("[type=checkbox]")?.checked).map((row) => {
      const mm = optional(row.querySelector("[type=number]"));
      return mm === null ? { capture: row.dataset.name } : { capture: row.dataset.name, depth_mm: mm };
    });
    return { targets, series: Boolean(useSeries?.checked), model: model.value };
  });
  const show = (found) => {
    const apply = async () => {
      const { optics } = await get("/api/optics");
      optics.psf = found.p == null ? { model: "gaussian", k: found.k } : { model: "generalised", p: found.p, k: found.k };
      if (await act("/api/optics", { optics }, "PUT")) notice("In use for captures from now on.");
    };
    const targets = found.targets_mm ?? [found.target_mm];
    result.replaceChildren(rows([["point spread function", found.psf], ["residual", number(found.residual, 5)], ["pairs", targets.length], ["targets", targets.map((mm) => number(mm, 1)).join(", ") + " mm"]]),
      button("Use it", apply, { class: "primary", "data-needs": "rig" }));
  };
  onJob("psf", ({ phase, result: found }) => { if (phase === "done") show(found); });
  async function shown() {
    try {
      const [{ captures }, found] = await Promise.all([get("/api/captures"), get("/api/calibrate")]);
      remember();
      const withSeries = Boolean(useSeries?.checked);
      pairs.replaceChildren(...captures.filter(({ kind, broken }) => kind === "pair" && !broken).map(({ name }) => h("li", { "data-name": name },
        h("label", { class: "check" }, h("input", { type: "checkbox", checked: entered.get(name)?.checked }), name),
        h("input", { type: "number", step: "any", value: entered.get(name)?.mm, placeholder: "at its focus", "aria-label": `Distance of the target of ${name}, mm` }), h("span", { class: "unit" }, "mm"))));
      if (!pairs.children.length) pairs.append(h("li", { class: "dim" }, "No pair yet."));
      useSeries = h("input", { type: "checkbox", disabled: !found.series_mm.length, checked: withSeries && found.series_mm.length > 0 });
      taught.replaceChildren(h("label", { class: "check" }, useSeries, `the flat series: ${found.series_mm.length} targets at known distances`));
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  }
  const element = h("div", { class: "guide-body" },
    step(1, "Place the target", draw.target(), h("p", {}, "A flat, finely textured target, square to the rig: at the far or the near focus, or at a distance that you know. Several distances determine p and k better.")),
    step(2, "Capture", draw.camera(), h("p", {}, "A far- and a near-focused image. Repeat steps 1 and 2 for more distances."), h("div", { class: "buttons" }, button("Capture pair", capture, { "data-needs": "rig" }))),
    step(3, "Choose and find", draw.spread(), pairs, taught, field("Model", model), h("div", { class: "buttons" }, button("Find", find, { class: "primary", "data-needs": "client" })), result));
  return { element, shown };
}

/** Blur, response and errors of a lens that a stack has calibrated. */
function lens() {
  const slices = h("input", { type: "number", value: 21, min: 11, max: 101 });
  const result = h("div", { "aria-live": "polite" });
  const plots = [
    { label: "Blur radius", x: "slices from the focus", y: "px" },
    { label: "Response", x: "measured normalised depth", y: "true" },
    { label: "Held-out errors: RMS (dark), predicted SD (light)", x: "true normalised depth", y: "mm", names: ["RMS error", "predicted SD"] },
  ].map((options) => {
    const place = h("div", {});
    return { element: h("section", { class: "panel", hidden: true }, h("h2", {}, options.label), place), plot: new Plot(place, { height: 180, ...options }) };
  });
  const columns = (points) => [0, 1].map((at) => points.map((point) => point[at]));
  const show = (found) => {
    const apply = async () => { if (await act("/api/optics", { optics: found.optics }, "PUT")) notice("In use for captures from now on."); };
    result.replaceChildren(rows([["verdict", found.verdict], ["largest blur", number(found.max_blur_px, 2, "px")], ["point spread function", found.psf], ["working range", number(found.range_mm, 2, "mm")],
      ["error on parts left out, RMS", number(found.rms_mm, 3, "mm")], ["slope", number(found.slope, 3)], ["target with a depth", number(100 * found.fill, 1, "%")], ["errors within three SD", number(100 * found.within_three, 1, "%")]]),
      h("div", { class: "buttons" }, button("Use it", apply, { class: "primary", "data-needs": "rig" })));
    for (const { element } of plots) element.hidden = false;
    plots[0].plot.set(columns(found.blur));
    plots[1].plot.set(columns(found.response));
    plots[2].plot.set([found.by_depth.map(({ depth }) => depth), found.by_depth.map(({ rms_mm }) => rms_mm), found.by_depth.map(({ predicted_mm }) => predicted_mm)]);
  };
  onJob("lens-stack", ({ phase, result: found }) => { if (phase === "done") show(found); });
  const start = () => act("/api/calibrate/stack", () => ({ slices: Math.round(numeric(slices)) }));
  const element = h("div", { class: "guide-body" },
    step(1, "Place the target", draw.target(), h("p", {}, "A flat, finely textured target that fills the image, in the middle of the working range. A slight tilt helps. The emulated rig places its own.")),
    step(2, "Take the stack", draw.slices(), h("p", {}, "Finds the focus and takes slices on both sides of it, a fifth of a pair's sensor travel apart. The slices stay in the session."), field("Slices", slices),
      h("div", { class: "buttons" }, button("Calibrate the lens", start, { class: "primary", "data-needs": "rig" }))),
    panel("Result", result), ...plots.map(({ element }) => element));
  return { element };
}

function series() {
  const count = h("input", { type: "number", value: 6, min: 2, max: 60 });
  const own = h("input", { type: "text", placeholder: "e.g. 890, 905, 930", "aria-label": "Distances in mm" });
  const captured = h("p", { class: "status", "aria-live": "polite" });
  const [taken, learned] = [h("div", { "aria-live": "polite" }), h("div", { "aria-live": "polite" })];
  const method = h("select", {});
  const distances = async () => {
    const { optics } = await get("/api/optics");
    const text = own.value.trim();
    if (text) {
      // With semicolons between the distances, a comma is the decimal mark.
      const parts = (text.includes(";") ? text.replaceAll(",", ".").split(";") : text.split(/[\s,]+/)).map((part) => part.trim()).filter(Boolean);
      const focal = optics.lens.focal_length_mm;
      const wrong = parts.find((part) => !(Number.isFinite(Number(part)) && Number(part) > focal));
      if (wrong !== undefined) throw Object.assign(new Error(`Distance ${wrong}: expected a number of mm above the focal length, ${focal} mm.`), { hint: "Separate distances by commas; with decimal commas, by semicolons." });
      return parts.map(Number);
    }
    const { range } = (await call("POST", "/api/optics/calculate", { optics })).figures;
    const steps = Math.max(2, Math.round(numeric(count)));
    // To a tenth of a millimetre, which can be set on a rail.
    return Array.from({ length: steps }, (_, at) => Number((range.near_mm + ((range.far_mm - range.near_mm) * at) / (steps - 1)).toFixed(1)));
  };
  const start = () => act("/api/calibrate/series", async () => ({ distances: await distances() }));
  const learn = () => act("/api/calibrate/correction", { method: method.value });
  onJob("flat-series", ({ phase, result }) => {
    if (phase === "done") taken.replaceChildren(rows([["targets", result.targets], ["error before correction, RMS", number(result.rmse_mm, 2, "mm")]]));
    if (phase !== "running") shown();
  });
  onJob("correction", ({ phase, result: found }) => {
    if (phase !== "done") return;
    learned.replaceChildren(rows([["method", found.method], ["targets", found.patterns], ["range", `${number(found.near_mm, 1)} to ${number(found.far_mm, 1)} mm`],
      ["RMS before", number(found.rmse_before_mm, 3, "mm")], ["RMS after", number(found.rmse_after_mm, 3, "mm")]]),
      h("p", { class: "dim" }, "In Depth, under Compute, tick “correction of this session”."));
    shown();
  });
  onJob("forget", ({ phase }) => { if (phase === "done") shown(); });
  async function shown() {
    try {
      const { series_mm, corrected, methods } = await get("/api/calibrate");
      captured.textContent = series_mm.length ? `${series_mm.length} targets: ${series_mm.map((mm) => number(mm, 1)).join(", ")} mm${corrected ? " · a correction is learned" : ""}` : "No target yet.";
      if (!series_mm.length) for (const place of [taken, learned]) place.replaceChildren();
      if (!method.children.length) method.append(...methods.map((name) => h("option", { value: name }, name)));
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  }
  const element = h("div", { class: "guide-body" },
    step(1, "Flat targets through the range", draw.series(), h("p", {}, "A flat, textured target at several known distances; the page asks for each. On the emulated rig it moves automatically. An interrupted series continues where it stopped."),
      field("Targets", count), field("Distances", own, "mm"), h("div", { class: "buttons" }, button("Capture the series", start, { class: "primary", "data-needs": "rig" }), button("Forget it", () => act("/api/calibrate/series/forget"), { "data-needs": "rig" })), captured),
    step(2, "Learn the correction", draw.curve(), h("p", {}, "What the lens bends is learned from the maps of planes, and taken off other maps."), field("Method", method), h("div", { class: "buttons" }, button("Learn", learn, { class: "primary", "data-needs": "client" }))),
    panel("Result", taken, learned));
  return { element, shown };
}
