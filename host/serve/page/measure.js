// Figures of a map at the side: what is under the pointer, a profile, a region with its plane.
import { act } from "./link.js";
import { h, number, panel, rows } from "./ui.js";
import { Plot } from "./plot.js";

/** The panels, and what fills them. */
export function make() {
  const probe = h("div", { class: "probe" });
  const place = h("div", {});
  const region = h("div", {});
  const plot = new Plot(place, { label: "depth along the line, with its deviation", x: "px along the line", y: "mm", height: 170, names: ["depth", "plus deviation", "minus deviation"], band: true });
  const profile = panel("Profile", place);
  const area = panel("Region", region);
  profile.hidden = true;
  area.hidden = true;

  /** Under the pointer. `maps` by name; `at` is [column, row] or null. */
  const under = (maps, at) => {
    const value = (name) => (at && maps[name] ? maps[name].data[at[1] * maps[name].width + at[0]] : null);
    probe.replaceChildren(h("output", { class: "big" }, number(value("depth"), 2, "mm")),
      rows([["pixel", at ? `${at[0]}, ${at[1]}` : "–"], ["± deviation", number(value("deviation"), 2, "mm")], ["confidence", number(value("confidence"), 2)]]));
  };

  /** Of a shape that was drawn. */
  const shape = async (capture, kind, from, to) => {
    if (kind === "line") {
      const found = await act(`/api/captures/${capture}/profile`, { from, to });
      if (!found) return;
      const { points } = found.figures;
      profile.hidden = false;
      const band = (sign) => points.map((p) => (p.depth_mm == null || p.deviation_mm == null ? null : p.depth_mm + sign * p.deviation_mm));
      plot.set([points.map((p) => p.at_px), points.map((p) => p.depth_mm), band(1), band(-1)]);
      plot.size();
      return;
    }
    const [x, y] = [Math.min(from[0], to[0]), Math.min(from[1], to[1])];
    const found = await act(`/api/captures/${capture}/region`, { x, y, width: Math.abs(to[0] - from[0]) + 1, height: Math.abs(to[1] - from[1]) + 1 });
    if (!found) return;
    area.hidden = false;
    region.replaceChildren(figuresOf(found.figures));
  };
  under({}, null);
  return { elements: [panel("Under the pointer", probe), profile, area], under, shape, plot };
}

/** Rows of a region's figures. */
export function figuresOf(found) {
  const { plane } = found;
  return rows([
    ["pixels", `${found.region.width} × ${found.region.height}`],
    ["fill rate", `${number(100 * found.fill_rate, 2)} %`],
    ["mean", number(found.mean_mm, 3, "mm")], ["standard deviation", number(found.standard_deviation_mm, 3, "mm")],
    ["predicted deviation", number(found.predicted_deviation_mm, 3, "mm")],
    found.range_mm && ["range, mm", `${number(found.range_mm[0], 1)} to ${number(found.range_mm[1], 1)}`],
    plane && ["plane: RMS", number(plane.rms_mm, 3, "mm")], plane && ["plane: peak to valley", number(plane.peak_to_valley_mm, 2, "mm")],
    plane && ["plane: tilt", `${number(plane.tilt_deg, 2)}°`],
  ]);
}
