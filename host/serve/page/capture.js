// Capturing: a pair, a series, a still, a stack; and depth at once where that is wished.
import { act, hasControl, ended, on, store } from "./link.js";
import { h, allow, button, choice, field, numeric, panel } from "./ui.js";
import { key } from "./keys.js";

/** @type {HTMLElement | null} */
let warnings = null;
/** @type {(name: string) => void} */
let depths = () => {};
/** The capture whose depth is wished as soon as there is any. @type {string | null} */
let awaited = null;

/** Told by the page: what opens the depth of a capture, and what shows it before it is in any file. */
export function whenCaptured(open, show) {
  depths = open;
  on("fresh", (header, pixels) => {
    if (header.capture !== awaited) return;
    awaited = null;
    show(header, pixels);
  });
}

/** What makes the image that is seen now unfit for depth. */
export function warn(found) {
  if (warnings) {
    warnings.replaceChildren(...found.map((text) => h("li", {}, text)));
    warnings.hidden = !found.length;
  }
}

/** The panel. */
export function make() {
  const depth = h("input", { type: "checkbox", checked: true });
  const averaged = h("input", { type: "number", value: 1, min: 1, max: 256, "aria-label": "Exposures of each image, averaged" });
  const ambient = h("input", { type: "checkbox" });
  const subtract = h("label", { class: "check" }, ambient, "subtract images without the board's light");
  const amount = h("input", { type: "number", value: 10, min: 1, max: 500, "aria-label": "Pairs of the series" });
  const every = h("input", { type: "number", value: 0, min: 0, max: 86400, step: "any", "aria-label": "Seconds from pair to pair; 0 is at once" });
  const axis = choice([["fine", "Piezo"], ["coarse", "Coarse"], ["lens", "Lens"]], "fine", () => {}, { "aria-label": "Axis of the stack" });
  const [from, to, steps] = [["From", 20], ["To", 180], ["Images", 17]].map(([text, value]) => field(text, h("input", { type: "number", value, step: "any" }), text === "Images" ? "" : "µm"));
  const value = (place) => numeric(place.querySelector("input"));
  warnings = h("ul", { class: "warnings", hidden: true, "aria-label": "Before you capture" });
  const pair = button("Capture pair", () => take(() => ({ kind: "pair", averaged: Math.round(numeric(averaged)), subtract_ambient: ambient.checked }), depth.checked), { class: "primary", title: "C", "data-capture": "" });
  const all = [
    pair,
    button("Series", () => take(() => ({ kind: "series", pairs: Math.round(numeric(amount)), interval_s: numeric(every) }), false), { "data-capture": "" }),
    button("Still", () => take({ kind: "still" }, false), { "data-capture": "", title: "One image where the sensor stands" }),
    button("Stack", () => take(() => ({ kind: "stack", axis: axis.value, from_um: value(from), to_um: value(to), steps: value(steps) }), false), { "data-capture": "" }),
  ];
  on("state", (state) => {
    const able = hasControl() && state.rig.phase === "ready" && state.job?.phase !== "running";
    for (const control of all) allow(control, able);
    const lit = state.live.light_percent.some((percent) => percent > 0);
    ambient.disabled = !lit;
    ambient.checked &&= lit;
    subtract.title = lit ? "" : "The board's light is off: set Light 1 or Light 2 under Camera first";
  });
  key("c", "Capture a pair", () => !pair.disabled && pair.click());
  return panel("Capture", warnings, h("div", { class: "capture" }, pair, h("label", { class: "check" }, depth, "compute depth")),
    h("details", {}, h("summary", {}, "Average, series, still, stack"),
      h("div", { class: "row" }, h("span", {}, "Average"), averaged, h("span", { class: "unit" }, "exposures")),
      subtract,
      h("div", { class: "row" }, all[1], amount, h("span", { class: "unit" }, "pairs, every"), every, h("span", { class: "unit" }, "s")),
      h("div", { class: "row" }, all[2], h("span", { class: "dim" }, "at the present focus")),
      h("div", { class: "row" }, all[3], axis), h("div", { class: "three" }, from, to, steps)));
}

async function take(wish, depth) {
  const begun = await act("/api/captures", wish);
  if (!begun) return;
  awaited = depth ? begun.names[0] : null;
  const job = await ended("job", begun.job);
  performance.mark("captured");
  if (job.phase !== "done" || !depth) return;
  const [name] = begun.names;
  const computing = await act(`/api/captures/${encodeURIComponent(name)}/depth`, { uncertainty: "estimated" });
  if (!computing) return;
  const computed = await ended("computation", computing.job);
  if (computed.phase !== "done" || awaited !== name) return;
  awaited = null;
  depths(name);
}

/** Whether a job is under way. */
export function busy() {
  return store.state?.job?.phase === "running";
}
