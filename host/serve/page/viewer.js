// A picture that is zoomed and moved: by wheel and drag, by fingers, and by + - 0 and the arrows.
import { h } from "./ui.js";

const NEAREST = 40;

export class Viewer {
  /** `label` is what a screen reader calls it. */
  constructor(label) {
    this.canvas = h("canvas", { tabindex: 0, role: "application", "aria-label": `${label}; plus, minus and arrows zoom and move, 0 fits` });
    this.element = h("div", { class: "viewer" }, this.canvas);
    this.source = document.createElement("canvas");
    /** @type {HTMLCanvasElement | null} */
    this.second = null;
    this.wipe = 1;
    this.tool = "pan";
    this.fit = true;
    this.scale = 1;
    this.left = 0;
    this.top = 0;
    /** @type {{ kind: string, from: number[], to: number[], open: boolean } | null} */
    this.shape = null;
    this.pointers = new Map();
    /** Told of the pixel under the pointer, `[x, y]`, or null. @type {((at: number[] | null) => void) | undefined} */
    this.onprobe = undefined;
    /** Told of a region or line that was drawn. @type {((kind: string, from: number[], to: number[]) => void) | undefined} */
    this.onshape = undefined;
    /** Draws above the picture. @type {((context: CanvasRenderingContext2D, point: (x: number, y: number) => number[]) => void) | undefined} */
    this.overlay = undefined;
    /** Told when a picture is painted. @type {(() => void) | undefined} */
    this.onpainted = undefined;
    this.frame = 0;
    new ResizeObserver(() => this.draw()).observe(this.element);
    this.listen();
  }

  /** Shows a picture; `second` beside it, right of the wipe. @param {ImageData} image @param {ImageData | null} second */
  show(image, second = null) {
    put(this.source, image);
    this.second = second ? put(this.second ?? document.createElement("canvas"), second) : null;
    this.draw();
  }

  /** Removes the picture. */
  clear() {
    [this.source.width, this.source.height, this.second] = [0, 0, null];
    this.draw();
  }

  /** Takes a region or a line from now on: `pan`, `region`, `line`. */
  use(tool) {
    this.tool = tool;
    this.canvas.dataset.tool = tool;
  }

  draw() {
    cancelAnimationFrame(this.frame);
    this.frame = requestAnimationFrame(() => this.paint());
  }

  paint() {
    const { canvas, source } = this;
    const [width, height] = [this.element.clientWidth, this.element.clientHeight];
    const ratio = devicePixelRatio || 1;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    if (this.fit && source.width) {
      this.scale = Math.min(width / source.width, height / source.height);
      this.left = (width - source.width * this.scale) / 2;
      this.top = (height - source.height * this.scale) / 2;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (!source.width) return;
    context.imageSmoothingEnabled = this.scale < 2;
    /** @type {[number, number, number, number]} */
    const place = [this.left, this.top, source.width * this.scale, source.height * this.scale];
    context.drawImage(source, ...place);
    if (this.second) this.paintSecond(context, place, height);
    this.paintShape(context);
    this.onpainted?.();
    this.overlay?.(context, (x, y) => [this.left + x * this.scale, this.top + y * this.scale]);
  }

  /** @param {CanvasRenderingContext2D} context @param {number[]} place @param {number} bottom */
  paintSecond(context, [left, top, width, height], bottom) {
    const at = left + width * this.wipe;
    context.save();
    context.beginPath();
    context.rect(at, 0, left + width - at, bottom);
    context.clip();
    context.clearRect(at, top, left + width - at, height);
    if (this.second) context.drawImage(this.second, left, top, width, height);
    context.restore();
    context.fillStyle = "#fff";
    context.fillRect(at - 1, top, 2, height);
  }

  paintShape(context) {
    if (!this.shape) return;
    const { from, to, kind } = this.shape;
    /** @param {number[]} at @returns {[number, number]} */
    const point = ([x, y]) => [this.left + (x + 0.5) * this.scale, this.top + (y + 0.5) * this.scale];
    const [a, b] = [point(from), point(to)];
    for (const [colour, width] of [["#000", 3], ["#fff", 1.5]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      if (kind === "line") {
        context.moveTo(...a);
        context.lineTo(...b);
      } else context.rect(Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.abs(b[0] - a[0]), Math.abs(b[1] - a[1]));
      context.stroke();
    }
  }

  /** The pixel under a place of the page; null outside. */
  pixel(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = Math.floor((event.clientX - box.left - this.left) / this.scale);
    const y = Math.floor((event.clientY - box.top - this.top) / this.scale);
    return x >= 0 && y >= 0 && x < this.source.width && y < this.source.height ? [x, y] : null;
  }

  zoom(factor, x = this.element.clientWidth / 2, y = this.element.clientHeight / 2) {
    const scale = Math.max(0.1, Math.min(NEAREST, this.scale * factor));
    this.left = x - ((x - this.left) * scale) / this.scale;
    this.top = y - ((y - this.top) * scale) / this.scale;
    this.scale = scale;
    this.fit = false;
    this.draw();
  }

  move(x, y) {
    this.left += x;
    this.top += y;
    this.fit = false;
    this.draw();
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const box = canvas.getBoundingClientRect();
      this.zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.refit());
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.up(event));
    canvas.addEventListener("pointerleave", () => this.onprobe?.(null));
    canvas.addEventListener("keydown", (event) => {
      const step = 40;
      const actions = {
        "+": () => this.zoom(1.25), "=": () => this.zoom(1.25), "-": () => this.zoom(0.8), 0: () => this.refit(),
        ArrowLeft: () => this.move(step, 0), ArrowRight: () => this.move(-step, 0),
        ArrowUp: () => this.move(0, step), ArrowDown: () => this.move(0, -step),
      };
      if (actions[event.key]) {
        event.preventDefault();
        actions[event.key]();
      }
    });
  }

  refit() {
    this.fit = true;
    this.draw();
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const at = this.pixel(event);
    if (this.tool !== "pan" && at) this.shape = { kind: this.tool, from: at, to: at, open: true };
  }

  moved(event) {
    const at = this.pixel(event);
    this.onprobe?.(at);
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      /** @param {number[]} at */
      const apart = ([x, y]) => Math.hypot(x - other[0], y - other[1]) || 1;
      const box = this.canvas.getBoundingClientRect();
      this.zoom(apart(now) / apart(before), other[0] - box.left, other[1] - box.top);
    } else if (this.shape?.open) {
      if (at) this.shape.to = at;
      this.draw();
    } else this.move(now[0] - before[0], now[1] - before[1]);
    this.pointers.set(event.pointerId, now);
  }

  up(event) {
    this.pointers.delete(event.pointerId);
    if (!this.shape?.open) return;
    this.shape.open = false;
    const { kind, from, to } = this.shape;
    this.onshape?.(kind, from, to);
    this.draw();
  }
}

function put(canvas, image) {
  if (canvas.width !== image.width) canvas.width = image.width;
  if (canvas.height !== image.height) canvas.height = image.height;
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}
