// Colour maps that every eye tells apart, from a few anchors (viridis: van der Walt & Smith; cividis: Nuñez et al. 2018).
import { pen } from "./ui.js";

const ANCHORS = {
  viridis: ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"],
  cividis: ["00224e", "123570", "3b496c", "575d6d", "707173", "8a8678", "a59c74", "c3b369", "e1cc55", "fee838"],
  grey: ["000000", "ffffff"],
  difference: ["2166ac", "67a9cf", "d1e5f0", "f7f7f7", "fddbc7", "ef8a62", "b2182b"],
};

/** Names of the maps for one-sided values. */
export const NAMES = [["viridis", "Viridis"], ["cividis", "Cividis"], ["grey", "Grey"]];

const tables = new Map();

/** 256 colours as RGB triples. */
export function table(name) {
  if (!tables.has(name)) tables.set(name, build(ANCHORS[name] ?? ANCHORS.viridis));
  return tables.get(name);
}

function build(anchors) {
  const rgb = anchors.map((text) => [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16)));
  const colours = new Uint8ClampedArray(256 * 3);
  for (let at = 0; at < 256; at++) {
    const place = (at / 255) * (rgb.length - 1);
    const low = Math.min(Math.floor(place), rgb.length - 2);
    for (let channel = 0; channel < 3; channel++) {
      colours[3 * at + channel] = rgb[low][channel] + (place - low) * (rgb[low + 1][channel] - rgb[low][channel]);
    }
  }
  return colours;
}

/** @typedef {{ width: number, height: number, data: Float32Array }} NumberMap */

/** A map of numbers as a picture; what has no value is transparent. `fade` (0 to 1 per pixel) pales what is unsure.
 * @param {NumberMap} map @param {number[]} ends @param {string} name @param {ArrayLike<number> | null} [fade] */
export function paint({ width, height, data }, [low, high], name, fade) {
  const colours = table(name);
  const image = new ImageData(width, height);
  const scale = 255 / (high - low || 1);
  for (let at = 0; at < data.length; at++) {
    const value = data[at];
    if (!Number.isFinite(value)) continue;
    const index = 3 * Math.max(0, Math.min(255, Math.round((value - low) * scale)));
    image.data[4 * at] = colours[index];
    image.data[4 * at + 1] = colours[index + 1];
    image.data[4 * at + 2] = colours[index + 2];
    image.data[4 * at + 3] = fade ? 40 + 215 * Math.min(1, 2 * fade[at]) : 255;
  }
  return image;
}

/** Words of 256 colours and 256 opacities. Little-endian, as every computer with a browser is: red, green, blue, alpha from the lowest byte on.
 * @type {Map<string, { colour: Uint32Array, alpha: Uint32Array }>} */
const words = new Map();

/** @param {string} name */
function wordsOf(name) {
  const known = words.get(name);
  if (known) return known;
  const colours = table(name);
  const made = {
    colour: Uint32Array.from({ length: 256 }, (_, at) => colours[3 * at] | (colours[3 * at + 1] << 8) | (colours[3 * at + 2] << 16)),
    alpha: Uint32Array.from({ length: 256 }, (_, at) => Math.round(40 + 215 * Math.min(1, (2 * at) / 255)) << 24),
  };
  words.set(name, made);
  return made;
}

/** Depths as codes of 16 bits (0 = none) as a picture; what is unsure (confidence of 255) is paler.
 * @param {ImageData} image @param {Uint16Array} codes @param {Uint8Array} confidence @param {string} name */
export function paintCodes(image, codes, confidence, name) {
  const { colour, alpha } = wordsOf(name);
  const pixels = new Uint32Array(image.data.buffer);
  for (let at = 0; at < pixels.length; at++) pixels[at] = codes[at] ? colour[codes[at] >> 8] | alpha[confidence[at]] : 0;
  return image;
}

/** The values between which all but the outermost percent lie. @param {NumberMap} map @param {number} outliers @returns {[number, number]} */
export function range({ data }, outliers = 0.01) {
  const some = [];
  const step = Math.max(1, Math.floor(data.length / 20000));
  for (let at = 0; at < data.length; at += step) if (Number.isFinite(data[at])) some.push(data[at]);
  if (!some.length) return [0, 1];
  some.sort((a, b) => a - b);
  const low = some[Math.floor(outliers * (some.length - 1))];
  const high = some[Math.ceil((1 - outliers) * (some.length - 1))];
  return high > low ? [low, high] : [low - 0.5, high + 0.5];
}

/** A bar with ticks for a legend. @param {HTMLCanvasElement} canvas @param {string} name @param {number[]} ends @param {string} unit */
export function bar(canvas, name, [low, high], unit) {
  const colours = table(name);
  const context = pen(canvas);
  canvas.width = 256;
  canvas.height = 1;
  const image = context.createImageData(256, 1);
  for (let at = 0; at < 256; at++) image.data.set([...colours.subarray(3 * at, 3 * at + 3), 255], 4 * at);
  context.putImageData(image, 0, 0);
  canvas.setAttribute("aria-label", `colours from ${low.toFixed(1)} to ${high.toFixed(1)} ${unit}`);
}
