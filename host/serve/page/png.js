// PNG as numbers. A canvas changes the values of colours by their profile and alpha, and all values in a browser that protects against
// fingerprinting, so usual images are decoded here.
import { h } from "./ui.js";

const [IHDR, IDAT] = [0x49484452, 0x49444154];
/** Channels by the type of colour: grey, red-green-blue, each also with alpha. @type {Record<number, number>} */
const CHANNELS = { 0: 1, 2: 3, 4: 2, 6: 4 };

/** Width, height and data of the grey or the red of an image, 0 to 255. @param {ArrayBuffer} buffer @returns {Promise<import("./maps.js").NumberMap>} */
export async function parse(buffer) {
  const view = new DataView(buffer);
  const parts = [];
  let [width, height, bits, channels] = [0, 0, 0, 0];
  for (let at = 8; at + 12 <= buffer.byteLength; at += 12 + view.getUint32(at)) {
    const [length, name] = [view.getUint32(at), view.getUint32(at + 4)];
    if (name === IHDR) {
      [width, height, bits] = [view.getUint32(at + 8), view.getUint32(at + 12), view.getUint8(at + 16)];
      if (bits >= 8 && view.getUint8(at + 20) === 0) channels = CHANNELS[view.getUint8(at + 17)] ?? 0;
    } else if (name === IDAT) parts.push(buffer.slice(at + 8, at + 8 + length));
  }
  if (!channels) return painted(buffer);
  const lines = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(lines).arrayBuffer());
  const step = (channels * bits) / 8;
  const data = new Float32Array(width * height);
  for (let row = 0; row < height; row++) {
    const begin = row * (width * step + 1) + 1;
    restore(raw, begin, width * step, step, row === 0);
    // The high byte of 16 bits comes first.
    for (let at = 0; at < width; at++) data[row * width + at] = raw[begin + at * step];
  }
  return { width, height, data };
}

/** Undoes the filter of a line in place. @param {Uint8Array} raw @param {number} begin @param {number} length @param {number} step @param {boolean} first */
function restore(raw, begin, length, step, first) {
  const filter = raw[begin - 1];
  if (filter === 0) return;
  for (let at = 0; at < length; at++) {
    const left = at < step ? 0 : raw[begin + at - step];
    const above = first ? 0 : raw[begin + at - length - 1];
    const corner = first || at < step ? 0 : raw[begin + at - length - 1 - step];
    raw[begin + at] += filter === 1 ? left : filter === 2 ? above : filter === 3 ? (left + above) >> 1 : nearest(left, above, corner);
  }
}

/** Paeth's predictor. @param {number} left @param {number} above @param {number} corner */
function nearest(left, above, corner) {
  const [byLeft, byAbove, byCorner] = [Math.abs(above - corner), Math.abs(left - corner), Math.abs(left + above - 2 * corner)];
  return byLeft <= byAbove && byLeft <= byCorner ? left : byAbove <= byCorner ? above : corner;
}

/** The red of an image with a palette, few bits or interlacing. @param {ArrayBuffer} buffer */
async function painted(buffer) {
  const picture = await createImageBitmap(new Blob([buffer]));
  const { width, height } = picture;
  const canvas = h("canvas", { width, height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  return { width, height, data: Float32Array.from({ length: data.length / 4 }, (_, at) => data[4 * at]) };
}
