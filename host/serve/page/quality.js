// How good depth is, as owners of depth cameras ask: fill rate, plane fit, noise over time, accuracy against a known distance.
import { act, get, on, onJob, store } from "./link.js";
import { h, allow, button, field, number, numeric, optional, panel, notice, when } from "./ui.js";

/** Makes the view. */
export function make(host) {
  const pairs = h("input", { type: "number", value: 5, min: 2, max: 50 });
  const distance = h("input", { type: "number", step: "any", placeholder: "not known" });
  const results = h("div", { class: "quality" });
  const records = h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Record of depth quality" });
  const start = button("Measure", measure, { class: "primary", "data-quality": "" });
  host.append(h("div", { class: "split" },
    h("div", { class: "stage scroll" }, panel("Last measurement", results), panel("Record", records)),
    h("div", { class: "side" }, panel("Depth quality", h("p", { class: "dim" }, "Put a flat, textured target square before the rig, inside the working range."),
      field("Pairs", pairs), field("True distance", distance, "mm"), start))));
  results.append(h("p", { class: "empty" }, "Nothing measured yet."));

  function measure() {
    act("/api/quality", () => {
      const true_mm = optional(distance);
      return { pairs: Math.round(numeric(pairs)), ...(true_mm === null ? {} : { true_mm }) };
    });
  }

  function show(found) {
    const tile = (name, value, about) => h("div", { class: "tile", title: about }, h("span", {}, name), h("output", { class: "big" }, value));
    results.replaceChildren(
      tile("fill rate", `${number(100 * found.fill_rate, 2)} %`, "pixels with a depth"),
      tile("plane RMS", number(found.plane_rms_mm, 2, "mm"), "distance of the depths from the plane through them"),
      tile("temporal noise", number(found.temporal_noise_mm, 2, "mm"), "median standard deviation of a pixel over the pairs"),
      tile("predicted noise", number(found.predicted_noise_mm, 2, "mm"), "median of the deviations predicted for each pixel"),
      tile("accuracy", found.accuracy_mm == null ? "–" : number(found.accuracy_mm, 2, "mm"), "mean depth minus the true distance"),
      tile("tilt", `${number(found.tilt_deg, 2)}°`, "of the plane against the rig"));
  }

  async function refresh() {
    try {
      const list = (await get("/api/quality")).records;
      const cell = (value) => h("td", {}, value);
      records.replaceChildren(h("table", {}, h("thead", {}, h("tr", {}, ["when", "pairs", "mean", "fill rate", "plane RMS", "temporal noise", "accuracy"].map((text) => h("th", { scope: "col" }, text)))),
        h("tbody", {}, list.reverse().map((one) => h("tr", {}, cell(one.time ? when(Date.parse(one.time)) : "emulated"), cell(one.pairs), cell(number(one.mean_mm, 2, "mm")), cell(`${number(100 * one.fill_rate, 2)} %`), cell(number(one.plane_rms_mm, 2, "mm")), cell(number(one.temporal_noise_mm, 2, "mm")), cell(number(one.accuracy_mm, 2, "mm")))))));
      if (list.length) show(list[0]);
    } catch (error) {
      notice(error.message, "error", error.hint);
    }
  }
  onJob("quality", ({ phase }, old) => { if (phase === "done" && !old) refresh(); });
  on("state", (state) => { allow(start, state.rig.phase === "ready" && state.job?.phase !== "running" && state.control.holder === store.client?.client); });
  return { shown: refresh };
}
