// Curves and histograms in the page's colours.
import "./language.js";
import uPlot from "./vendor/uplot.js";
import { colour, pen } from "./ui.js";

/** A plot that fills its place. `series` are names; `band` draws ±1 deviation around the first from the next two. */
export class Plot {
  constructor(host, { label, x = "", y = "", height = 140, names = [""], band = false, time = false }) {
    this.host = host;
    this.options = { label, x, y, height, names, band, time };
    host.classList.add("plot");
    host.setAttribute("role", "img");
    host.setAttribute("aria-label", label);
    this.data = [[], ...names.map(() => [])];
    new ResizeObserver(() => this.size()).observe(host);
    addEventListener("restyle", () => this.restyle());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.restyle());
  }

  size() {
    const width = this.host.clientWidth;
    if (width && this.plot && Math.abs(this.plot.width - width) > 1) this.plot.setSize({ width, height: this.options.height });
    else if (width && !this.plot) this.make();
  }

  make() {
    const { x, y, height, names, band } = this.options;
    const [dim, line] = [colour("dim"), colour("line")];
    const axis = (label, size) => ({ stroke: dim, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 }, label: label || undefined, labelSize: label ? 16 : 0, size, font: "11px system-ui", labelFont: "11px system-ui", values: (_, ticks) => ticks.map((tick) => String(Number(tick.toPrecision(5)))) });
    this.plot?.destroy();
    this.plot = new uPlot({
      width: this.host.clientWidth, height,
      legend: { show: false },
      cursor: { drag: { x: false, y: false } },
      scales: { x: { time: false } },
      axes: [axis(x, x ? 44 : 28), axis(y, 54)],
      series: [{}, ...names.map((name, at) => ({ label: name, stroke: !at ? colour("accent") : band ? "transparent" : colour("accent-weak"), width: at ? 1 : 1.5, spanGaps: false, points: { show: false }, pxAlign: 0 }))],
      bands: band ? [{ series: [2, 3], fill: colour("band") }] : [],
    }, this.data, this.host);
  }

  set(data) {
    this.data = data;
    const { label, x, y, names, band } = this.options;
    const about = (band ? names.slice(0, 1) : names).map((name, at) => summary(name, data[0], data[at + 1]));
    this.host.setAttribute("aria-label", `${label}${x && y ? ` (${y} over ${x})` : ""}: ${about.join("; ")}`);
    if (this.plot) this.plot.setData(data);
    else this.size();
  }

  /** Light and dark have other colours. */
  restyle() {
    if (this.plot) this.make();
  }
}

/** A figure in words of a plot. @param {number} value */
const figure = (value) => String(Number(value.toPrecision(5))).replace("-", "−");

/** Values in words: how many, between which ends, and where the largest is. @param {string} name @param {number[]} places @param {(number | null)[]} values */
function summary(name, places, values) {
  const known = values.flatMap((value, at) => (value != null && Number.isFinite(value) ? [[value, places[at]]] : []));
  const title = name && `${name}, `;
  if (!known.length) return `${title}no values`;
  const [most, place] = known.reduce((one, other) => (other[0] > one[0] ? other : one));
  const least = Math.min(...known.map(([value]) => value));
  return `${title}${known.length} values from ${figure(least)} to ${figure(most)}, the largest at ${figure(place)}`;
}

/** Names a histogram by its contents. @param {HTMLCanvasElement} canvas @param {number[]} counts @param {number[]} ends @param {string} unit */
function describe(canvas, counts, [low, high], unit) {
  const name = (canvas.dataset.name ??= canvas.getAttribute("aria-label") ?? "");
  const total = counts.reduce((sum, count) => sum + count, 0);
  const peak = low + (counts.indexOf(Math.max(...counts)) * (high - low)) / (counts.length - 1);
  const [from, to, near] = [low, high, peak].map((value) => `${figure(value)}${unit && ` ${unit}`}`);
  canvas.setAttribute("aria-label", `${name}: ${total ? `${total} pixels from ${from} to ${to}, most near ${near}` : "no values"}`);
}

/** Bars on a canvas: `counts` from left to right, between the `ends` of their values; the marked ones in the warning colour.
 * @param {HTMLCanvasElement} canvas @param {number[]} counts @param {number[]} ends @param {string} unit @param {(at: number) => boolean} marked */
export function bars(canvas, counts, ends, unit = "", marked = () => false) {
  describe(canvas, counts, ends, unit);
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width) return;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = pen(canvas);
  context.scale(ratio, ratio);
  const sorted = [...counts].sort((a, b) => a - b);
  const largest = sorted.at(-1) ?? 0;
  // A single full bin, such as saturation, does not flatten the rest.
  const most = Math.max(1, Math.min(largest, 1.5 * sorted[Math.floor(0.98 * (sorted.length - 1))] || largest));
  const each = width / counts.length;
  const [plain, warn] = [colour("accent"), colour("bad")];
  counts.forEach((count, at) => {
    const tall = Math.min(height, (height * count) / most);
    context.fillStyle = marked(at) ? warn : plain;
    context.fillRect(at * each, height - tall, Math.max(each - 0.5, 0.5), tall);
  });
}
