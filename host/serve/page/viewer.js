// A picture that is zoomed, moved, probed and measured: by wheel and drag, by fingers, and by keys.
import { h } from "./ui.js";

const NEAREST = 40;

export class Viewer {
  /** `label` is what a screen reader calls it. */
  constructor(label) {
    this.canvas = h("canvas", { tabindex: 0, role: "application", "aria-label": `${label}; plus, minus and arrows zoom and move, 0 fits; Shift and arrows probe, Enter begins and ends a region or line` });
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
    /** The shape that a new one replaces when it is ended. @type {Viewer["shape"]} */
    this.before = null;
    this.pointers = new Map();
    /** The pixel that the keys have chosen. @type {number[] | null} */
    this.cursor = null;
    /** Told of the pixel under the pointer, `[x, y]`, or null; `keyed`: the keys have chosen it. @type {((at: number[] | null, keyed?: boolean) => void) | undefined} */
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
    if (image.width !== this.source.width || image.height !== this.source.height) this.cursor = null;
    put(this.source, image);
    this.second = second ? put(this.second ?? document.createElement("canvas"), second) : null;
    this.draw();
  }

  /** Removes the picture. */
  clear() {
    [this.source.width, this.source.height, this.second, this.cursor] = [0, 0, null, null];
    this.draw();
  }

  /** Takes a region or a line from now on: `pan`, `region`, `line`. */
  use(tool) {
    this.drop();
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
    this.paintCursor(context);
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

  paintCursor(context) {
    if (!this.cursor) return;
    const [x, y] = [this.left + (this.cursor[0] + 0.5) * this.scale, this.top + (this.cursor[1] + 0.5) * this.scale];
    for (const [colour, width] of [["#000", 3], ["#fff", 1.5]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      context.moveTo(x - 9, y);
      context.lineTo(x + 9, y);
      context.moveTo(x, y - 9);
      context.lineTo(x, y + 9);
      context.stroke();
    }
  }

  /** The pixel under a place of the page; null outside. */
  pixel(event) {
    const [x, y] = this.place(event);
    return x >= 0 && y >= 0 && x < this.source.width && y < this.source.height ? [x, y] : null;
  }

  /** Column and row under a place of the page; outside, those that the picture would have there. */
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [Math.floor((event.clientX - box.left - this.left) / this.scale), Math.floor((event.clientY - box.top - this.top) / this.scale)];
  }

  /** The pixel that is nearest to a column and a row. @param {number[]} place */
  within([x, y]) {
    const { width, height } = this.source;
    return [Math.max(0, Math.min(width - 1, x)), Math.max(0, Math.min(height - 1, y))];
  }

  /** Moves the cursor of the keys by four pixels of the screen, and by one pixel of the picture at least. @param {number} x @param {number} y */
  step(x, y) {
    const { width, height } = this.source;
    if (!width) return;
    const by = this.cursor ? Math.max(1, Math.round(4 / this.scale)) : 0;
    const [column, row] = this.cursor ?? [Math.floor(width / 2), Math.floor(height / 2)];
    this.cursor = this.within([column + x * by, row + y * by]);
    if (this.shape?.open) this.shape.to = this.cursor;
    this.onprobe?.(this.cursor, true);
    this.draw();
  }

  /** Begins a region or a line at the cursor of the keys, or ends it there. */
  mark() {
    if (this.tool === "pan") return;
    if (!this.cursor) this.step(0, 0);
    if (this.shape?.open) this.finish();
    else if (this.cursor) this.begin(this.cursor);
    this.draw();
  }

  zoom(factor, x = this.element.clientWidth / 2, y = this.element.clientHeight / 2) {
    const { element, source } = this;
    // A large picture fits at less than a tenth.
    const least = Math.min(0.1, this.scale, element.clientWidth / (source.width || 1), element.clientHeight / (source.height || 1));
    const scale = Math.max(least, Math.min(NEAREST, this.scale * factor));
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
    // A finger that is lifted leaves, too: the value under it must remain readable.
    canvas.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && this.onprobe?.(null));
    canvas.addEventListener("keydown", (event) => {
      const step = 40;
      const actions = {
        "+": () => this.zoom(1.25), "=": () => this.zoom(1.25), "-": () => this.zoom(0.8), 0: () => this.refit(),
        ArrowLeft: () => this.move(step, 0), ArrowRight: () => this.move(-step, 0),
        ArrowUp: () => this.move(0, step), ArrowDown: () => this.move(0, -step),
      };
      const probing = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      if (event.shiftKey && probing[event.key]) this.step(probing[event.key][0], probing[event.key][1]);
      else if (event.key === "Enter" && !event.repeat) this.mark();
      else if (actions[event.key]) actions[event.key]();
      else return;
      event.preventDefault();
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
    this.cursor = null;
    this.onprobe?.(at);
    // Two fingers zoom: what the first one has begun is dropped.
    if (this.pointers.size > 1) this.drop();
    else if (this.tool !== "pan" && at) this.begin(at);
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
      this.shape.to = this.within(this.place(event));
      this.draw();
    } else this.move(now[0] - before[0], now[1] - before[1]);
    this.pointers.set(event.pointerId, now);
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    if (event.type === "pointercancel") this.drop();
    else if (this.shape?.open) this.finish();
  }

  /** Begins a region or a line. @param {number[]} at */
  begin(at) {
    if (!this.shape?.open) this.before = this.shape;
    this.shape = { kind: this.tool, from: at, to: at, open: true };
  }

  /** Tells of the region or line. A click draws none. */
  finish() {
    if (!this.shape) return;
    const { kind, from, to } = this.shape;
    if (String(from) === String(to)) return this.drop();
    this.shape.open = false;
    this.onshape?.(kind, from, to);
    this.draw();
  }

  /** Removes a region or a line that is not ended: the one before stays. */
  drop() {
    if (this.shape?.open) this.shape = this.before;
    this.draw();
  }
}

function put(canvas, image) {
  if (canvas.width !== image.width) canvas.width = image.width;
  if (canvas.height !== image.height) canvas.height = image.height;
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}
