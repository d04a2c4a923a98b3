// The two stages as a picture: lens and sensor on their rails, with limits, and where far and near focus lie.
import { h, s, number } from "./ui.js";

const WIDTH = 300;
const RAIL = [14, WIDTH - 14];

/** Positions of far and near focus from the optics' sensor distances (mm) and where the stages stand; the piezo's in um. */
export function focusPositions(info, range) {
  if (!info || !range) return null;
  const base = info.datum_mm + info.lens.measured_um / 1e3;
  const fine = (mm) => (mm - base) * 1e3 - info.coarse.measured_um;
  const middle = (info.fine_min_um + info.fine_max_um) / 2;
  const coarse = ((range.sensor_far_mm + range.sensor_near_mm) / 2 - base) * 1e3 - middle;
  return { coarse, far: fine(range.sensor_far_mm), near: fine(range.sensor_near_mm) };
}

/** Calls `go` with the axis and the position, um, of a click on its rail; not for an absent stage. @param {HTMLElement} host @param {(axis: string, um: number) => void} go */
export function listen(host, go) {
  host.addEventListener("click", ({ clientX, clientY }) => {
    // The rails may be redrawn between press and release, so the target of the click may not exist any more.
    const rail = /** @type {SVGElement | null | undefined} */ (document.elementFromPoint(clientX, clientY)?.closest("svg[data-axis]"));
    if (!rail) return;
    const { axis, low, high } = rail.dataset;
    const box = rail.getBoundingClientRect();
    const part = (((clientX - box.left) / box.width) * WIDTH - RAIL[0]) / (RAIL[1] - RAIL[0]);
    const travel = Number(high) - Number(low);
    const digit = 10 ** Math.floor(Math.log10(travel / (RAIL[1] - RAIL[0])));
    const um = Number(low) + Math.max(0, Math.min(1, part)) * travel;
    go(String(axis), Number((Math.round(um / digit) * digit).toFixed(3)));
  });
}

/** Draws the rails into `host`. */
export function draw(host, info, range) {
  const focus = focusPositions(info, range);
  const distance = info.datum_mm + (info.coarse.measured_um + info.fine.measured_um + info.lens.measured_um) / 1e3;
  const marks = (list) => list.filter(([, at]) => Number.isFinite(at));
  host.replaceChildren(
    scene(info, focus, distance),
    rail("lens", "Lens", info.lens, [info.lens_min_um, info.lens_max_um], [], !info.has_lens_stage),
    rail("coarse", "Coarse", info.coarse, [info.coarse_min_um, info.coarse_max_um], focus ? marks([["focus", focus.coarse]]) : []),
    rail("fine", "Piezo", info.fine, [info.fine_min_um, info.fine_max_um], focus ? marks([["far", focus.far], ["near", focus.near]]) : []),
  );
}

/** The optical axis from the side: object, lens, sensor. */
function scene(info, focus, distance) {
  const part = (value, low, high) => (value - low) / (high - low || 1);
  const lens = 92 - 34 * part(info.lens.measured_um, info.lens_min_um, info.lens_max_um);
  const span = [172, 272];
  const place = (um) => span[0] + (span[1] - span[0]) * part(um, info.coarse_min_um, info.coarse_max_um);
  const sensor = place(info.coarse.measured_um);
  const inside = focus && focus.coarse >= info.coarse_min_um && focus.coarse <= info.coarse_max_um;
  const label = `Lens and sensor from the side, ${number(distance, 4)} mm apart`;
  return s("svg", { viewBox: `0 0 ${WIDTH} 96`, class: "scene", role: "img", "aria-label": label },
    s("line", { x1: 4, y1: 42, x2: WIDTH - 4, y2: 42, class: "axis" }),
    s("path", { d: `M4 42 L${lens} 20 L${sensor} 42 L${lens} 64 Z`, class: "rays" }),
    s("path", { d: `M${lens} 14 q9 28 0 56 q-9 -28 0 -56`, class: "lens" }),
    bracket(58, 92), bracket(...span),
    inside ? s("path", { d: `M${place(focus.coarse)} 70 l-4 8 h8 z`, class: "focus" }) : null,
    s("rect", { x: sensor - 2.5, y: 22, width: 5, height: 40, rx: 1, class: "sensor" }),
    s("line", { x1: lens, y1: 84, x2: sensor, y2: 84, class: "measure" }),
    s("line", { x1: lens, y1: 80, x2: lens, y2: 88, class: "measure" }),
    s("line", { x1: sensor, y1: 80, x2: sensor, y2: 88, class: "measure" }),
    s("text", { x: (lens + sensor) / 2, y: 80, "text-anchor": "middle" }, `${number(distance, 4)} mm`),
    s("text", { x: 6, y: 36, class: "faint" }, "object"));
}

function bracket(from, to) {
  return s("path", { d: `M${from} 8 v-4 H${to} v4`, class: "limits" });
}

/** One axis: its rail with limits, where it is, where it was sent, and the marks. */
function rail(key, name, axis, [low, high], marks, absent = false) {
  const place = (um) => RAIL[0] + ((RAIL[1] - RAIL[0]) * (um - low)) / (high - low || 1);
  const inside = (um) => Math.max(RAIL[0] - 7, Math.min(RAIL[1] + 7, place(um)));
  const state = absent ? "absent" : axis.moving ? "moving" : axis.state;
  const text = `${name} ${number(axis.measured_um, 3, "µm")}, ${state}; limits ${low} to ${high} µm`;
  // Marks that would lie on each other share their words.
  const shared = marks.length === 2 && Math.abs(inside(marks[0][1]) - inside(marks[1][1])) < 26;
  const words = (at) => (!shared ? marks[at][0] : at === 0 ? marks.map(([mark]) => mark).join(", ") : "");
  return h("div", { class: "rail", "data-state": state },
    h("div", { class: "rail-head" }, h("span", { class: "rail-name" }, name), h("span", { class: "state" }, state),
      h("output", { "aria-live": "off" }, number(axis.measured_um, 3, "µm"))),
    s("svg", { viewBox: `0 0 ${WIDTH} 30`, role: "img", "aria-label": text, ...(absent ? {} : { "data-axis": key, "data-low": low, "data-high": high }) },
      s("rect", { x: RAIL[0], y: 10, width: RAIL[1] - RAIL[0], height: 5, rx: 2.5, class: "track" }),
      marks.map(([, um], at) => s("g", { class: um < low || um > high ? "mark outside" : "mark" },
        s("line", { x1: inside(um), y1: 7, x2: inside(um), y2: 18 }),
        s("text", { x: inside(um), y: 28, "text-anchor": um < low + 0.1 * (high - low) ? "start" : um > high - 0.1 * (high - low) ? "end" : "middle" }, words(at)))),
      s("circle", { cx: inside(axis.asked_um), cy: 12.5, r: 5.5, class: "asked" }),
      s("circle", { cx: inside(axis.measured_um), cy: 12.5, r: 3.5, class: "measured" })));
}
