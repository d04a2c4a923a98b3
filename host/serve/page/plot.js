// Curves and histograms in the page's colours.
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
    if (this.plot) this.plot.setData(data);
    else this.size();
  }

  /** Light and dark have other colours. */
  restyle() {
    if (this.plot) this.make();
  }
}

/** Bars on a canvas: `counts` from left to right; the marked ones in the warning colour.
 * @param {HTMLCanvasElement} canvas @param {number[]} counts @param {(at: number) => boolean} marked */
export function bars(canvas, counts, marked = () => false) {
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
