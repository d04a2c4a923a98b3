// Figures of a map at the side: value under the pointer, a profile, a region with its plane.
import { act } from "./link.js";
import { h, button, number, panel, rows } from "./ui.js";
import { Plot } from "./plot.js";
import { REASONS } from "./reasons.js";

/** The panels, and what fills them. */
export function make() {
  const probe = h("div", { class: "probe" });
  const place = h("div", {});
  const region = h("div", {});
  const plot = new Plot(place, { label: "depth along the line, with its deviation", x: "px along the line", y: "mm", height: 170, names: ["depth", "plus deviation", "minus deviation"], band: true });
  /** @type {any[]} */
  let points = [];
  const save = button("CSV", () => download("profile.csv", `at_px,depth_mm,deviation_mm\n${points.map((p) => [p.at_px, p.depth_mm ?? "", p.deviation_mm ?? ""].join(",")).join("\n")}\n`), { title: "Saves the profile" });
  const profile = panel("Profile", place, h("div", { class: "buttons" }, save));
  /** The region before the last one. @type {any} */
  let earlier = null;
  let last = null;
  const area = panel("Region", region);
  profile.hidden = true;
  area.hidden = true;

  /** Answers are awaited one after the other: each is that of the shape drawn last. */
  let waiting = Promise.resolve(null);
  const asking = (path, body) => (waiting = waiting.then(() => act(path, body)));
  /** Grows with every change of the maps: answers about those before are dropped. */
  let changes = 0;
  /** Removes the figures: other maps are shown. */
  const forget = () => {
    changes++;
    [earlier, last, points] = [null, null, []];
    profile.hidden = area.hidden = true;
  };

  /** Under the pointer; gives the depth in words. `maps` by name; `at` is [column, row] of the picture, or null.
   * @param {any} maps @param {number[] | null} at @param {{ width: number, height: number }} [picture] */
  const under = (maps, at, picture) => {
    const value = (name) => {
      const map = maps[name];
      if (!at || !picture || !map) return null;
      const [column, row] = pixelOf(map, at, picture);
      return map.data[row * map.width + column];
    };
    const depth = number(value("depth"), 2, "mm");
    // Only keys announce values to a screen reader: a pointer passes too many.
    probe.replaceChildren(h("output", { class: "big", "aria-live": "off" }, depth),
      rows([["pixel", at ? `${at[0]}, ${at[1]}` : "–"], ["± deviation", number(value("deviation"), 2, "mm")], ["confidence", number(value("confidence"), 2)], maps.reason && ["no depth because", value("reason") ? REASONS[value("reason")] : "–"]]));
    return Number.isFinite(value("depth")) ? depth : `no depth${value("reason") ? `, ${REASONS[value("reason")]}` : ""}`;
  };

  /** Of a shape that was drawn. */
  const shape = async (capture, kind, from, to) => {
    const asked = changes;
    if (kind === "line") {
      const found = await asking(`/api/captures/${encodeURIComponent(capture)}/profile`, { from, to });
      if (!found || asked !== changes) return;
      points = found.figures.points;
      profile.hidden = false;
      const band = (sign) => points.map((p) => (p.depth_mm == null || p.deviation_mm == null ? null : p.depth_mm + sign * p.deviation_mm));
      plot.set([points.map((p) => p.at_px), points.map((p) => p.depth_mm), band(1), band(-1)]);
      plot.size();
      return;
    }
    const [x, y] = [Math.min(from[0], to[0]), Math.min(from[1], to[1])];
    const found = await asking(`/api/captures/${encodeURIComponent(capture)}/region`, { x, y, width: Math.abs(to[0] - from[0]) + 1, height: Math.abs(to[1] - from[1]) + 1 });
    if (!found || asked !== changes) return;
    area.hidden = false;
    [earlier, last] = [last?.capture === capture ? last : null, { capture, ...found.figures }];
    region.replaceChildren(figuresOf(found.figures), earlier ? stepOf(earlier, last) : h("p", { class: "dim" }, "Draw a second region for the step between the two."));
  };
  under({}, null);
  return { elements: [panel("Under the pointer", probe), profile, area], under, shape, forget, plot };
}

/** Pixel of a map under a pixel of the picture. A map of averaged pixels is smaller than the image.
 * @param {{ width: number, height: number }} map @param {number[]} at @param {{ width: number, height: number }} picture */
export function pixelOf(map, [column, row], picture) {
  return [Math.floor(((column + 0.5) * map.width) / picture.width), Math.floor(((row + 0.5) * map.height) / picture.height)];
}

/** Step from one region to the next: difference of their means, with its standard error. */
function stepOf(first, second) {
  const errors = [first.standard_error_mm, second.standard_error_mm];
  const known = errors.every((error) => error != null);
  const about = known ? "from the scatter of the means of 24 × 24 px: neighbouring depths are not independent" : "Each region needs four blocks of 24 × 24 px with depth: neighbouring depths are not independent.";
  return rows([["step to the region before", number(second.mean_mm - first.mean_mm, 3, "mm")],
    ["± of the means", h("span", { title: about }, number(known ? Math.hypot(...errors) : null, 3, "mm"))]]);
}

/** Saves a text as a file. */
function download(name, text) {
  const link = h("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
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
