// Pictures of the guides, drawn in the colours of the page.
import { s, number } from "./ui.js";

const picture = (about, ...parts) => s("svg", { viewBox: "0 0 120 80", class: "guide-svg", role: "img", "aria-label": about }, parts.flat(2));
const box = (x, y, width, height, cls = "part") => s("rect", { x, y, width, height, rx: 2, class: cls });
const line = (d, cls = "wire") => s("path", { d, class: cls });
const round = (cx, cy, r, cls = "part") => s("circle", { cx, cy, r, class: cls });
const words = (x, y, text) => s("text", { x, y, "text-anchor": "middle" }, text);

/** The NUCLEO on its USB cable. */
export const board = () => picture("a board on a USB cable", box(48, 16, 56, 48), box(60, 26, 14, 14, "dark"), box(82, 26, 12, 6, "dark"), line("M8 40 H48"), box(40, 36, 10, 8, "dark"), words(76, 58, "NUCLEO"));
/** A finger at an end switch. */
export const end = () => picture("an end switch that is pressed", box(66, 34, 34, 24), line("M66 34 L92 22", "accent"), line("M30 12 q14 -4 22 4 l16 10", "hand"), words(82, 72, "switch"));
export { end as switch };
/** The emergency stop. */
export const stop = () => picture("an emergency stop", box(28, 44, 64, 26), s("ellipse", { cx: 60, cy: 38, rx: 26, ry: 14, class: "red" }), words(60, 63, "STOP"));
/** A shaft that is turned by hand. */
export const encoder = () => picture("a shaft that is turned by hand, with its encoder", box(16, 28, 34, 26), box(50, 37, 36, 8, "dark"), round(92, 41, 12), line("M82 22 q14 -10 24 4 m0 -7 v7 h-7", "accent"), words(33, 66, "encoder"));
/** A motor on its stage. */
export const motor = () => picture("a stage with its motor", box(10, 26, 26, 30), line("M36 41 H108", "dark-line"), box(62, 22, 22, 38), line("M60 70 h28 m-6 -4 l6 4 l-6 4", "accent"), words(23, 70, "24 V"));
/** A stage that goes to its home switch. */
export const home = () => picture("a stage that moves to its home switch", line("M8 56 H112", "dark-line"), box(60, 26, 26, 30), box(12, 36, 10, 20, "accent-part"), line("M54 40 H32 m6 -5 l-6 5 l6 5", "accent"), words(18, 72, "home"));
/** The piezo flexure. */
export const piezo = () => picture("the piezo moves the sensor", box(14, 22, 12, 40, "dark"), line("M26 30 l6 6 l-6 6 l6 6 l-6 6", "accent"), box(34, 28, 16, 28, "accent-part"), box(56, 18, 8, 48), line("M72 42 H104 m-26 -5 l-6 5 l6 5 m20 -10 l6 5 l-6 5", "accent"), words(88, 66, "200 µm"));
/** Trigger and strobe of the camera. */
export const camera = () => picture("trigger and strobe of the camera", box(12, 14, 40, 28), round(52, 28, 9, "glass"), line("M12 58 h24 v-8 h34 v8 h38", "accent"), line("M12 74 h28 v-8 h34 v8 h34", "weak"), words(98, 54, "trigger"), words(99, 70, "strobe"));

const texture = (x, y) => Array.from({ length: 24 }, (_, at) => box(x + (at % 3) * 4, y + Math.floor(at / 3) * 5, (at * 7) % 3 ? 3 : 2, (at * 5) % 4 ? 3 : 2, "dark"));
/** The rig before a flat target. */
export const target = () => picture("a flat textured target before the rig", box(8, 16, 14, 48), texture(9, 19), s("ellipse", { cx: 84, cy: 40, rx: 4, ry: 18, class: "glass" }), box(98, 28, 6, 24), line("M22 40 L84 22 L98 40 L84 58 Z", "rays"));
/** Flat targets through the working range. */
export const series = () => picture("a flat target at several distances", [8, 22, 36, 50].map((x, at) => box(x, 18 + at, 5, 44 - 2 * at, at === 3 ? "accent-part" : "part")), s("ellipse", { cx: 88, cy: 40, rx: 4, ry: 16, class: "glass" }), box(102, 30, 6, 20), line("M10 72 H56 m-6 -4 l6 4 l-6 4", "accent"));
/** A point and its blur. */
export const spread = () => picture("a point and how it spreads", line("M8 66 H112", "dark-line"), line("M30 66 V16", "accent"), line("M58 66 C74 66 76 26 84 26 C92 26 94 66 110 66", "weak"));
/** The sensor steps through the focus of a flat target. */
export const slices = () => picture("the sensor steps through the focus of a flat target", box(8, 16, 14, 48), texture(9, 19), s("ellipse", { cx: 58, cy: 40, rx: 4, ry: 18, class: "glass" }), [76, 84, 92, 100, 108].map((x, at) => box(x, 28, 3, 24, at === 2 ? "accent-part" : "part")), line("M22 40 L58 22 L93 40 L58 58 Z", "rays"), line("M76 66 H110 m-6 -4 l6 4 l-6 4", "accent"));
/** What a lens bends, and the straight line. */
export const curve = () => picture("a bent surface is made flat", line("M14 56 Q60 14 106 56", "weak"), line("M14 60 H106", "accent"), line("M60 38 V54 m-4 -5 l4 6 l4 -6", "dark-line"));
/** Somebody, seen and cut out. */
export const person = () => picture("a person and the silhouette", figure(34, "part"), figure(84, "accent-part"), line("M52 40 h14 m-5 -4 l5 4 l-5 4", "dark-line"));
const figure = (x, cls) => [round(x, 18, 7, cls), s("path", { d: `M${x - 8} 28 h16 l-2 22 h-3 v22 h-3 v-20 v20 h-3 v-22 h-3 z`, class: cls })];

/** Sun, person and shadow, from the side and from above: elevation and shadow's direction in degrees, its length per height. */
export function sun(elevation, direction, length) {
  const up = Number.isFinite(length) && elevation > 0;
  const angle = (elevation * Math.PI) / 180;
  const at = [92 - 62 * Math.cos(angle), 66 - 58 * Math.sin(angle)];
  const shade = up ? Math.min(46, 24 * length) : 0;
  const turn = ((direction - 90) * Math.PI) / 180;
  const reach = up ? Math.min(15, 8 * length) : 0;
  const label = up ? `sun ${number(elevation, 1)} degrees high, shadow ${number(length, 2)} times as long as the person` : "the sun is below the horizon";
  return s("svg", { viewBox: "0 0 180 80", class: "guide-svg", role: "img", "aria-label": label },
    line("M6 66 H126", "dark-line"), up ? [round(at[0], at[1], 6, "sun"), line(`M${at[0]} ${at[1]} L${78 + shade} 66`, "rays")] : words(46, 30, "no sun"),
    round(78, 36, 4, "accent-part"), box(75, 41, 6, 25, "accent-part"), up ? box(78, 64, shade, 4, "shade") : null,
    round(154, 40, 20, "well"), words(154, 17, "N"), round(154, 40, 3, "accent-part"),
    up ? line(`M154 40 l${reach * Math.cos(turn)} ${reach * Math.sin(turn)}`, "shade-line") : null);
}
