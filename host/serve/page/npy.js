// NumPy's file format, as far as farnear writes it: two-dimensional float32, little-endian, row by row.

/** Width, height and data of a map. */
export function parse(buffer) {
  const view = new DataView(buffer);
  const version = view.getUint8(6);
  const length = version === 1 ? view.getUint16(8, true) : view.getUint32(8, true);
  const begin = (version === 1 ? 10 : 12) + length;
  const header = new TextDecoder().decode(new Uint8Array(buffer, begin - length, length));
  const shape = /'shape':\s*\((\d+),\s*(\d+)\)/.exec(header);
  if (!header.includes("<f4") || !shape) throw new Error(`not a map of float32: ${header}`);
  const [height, width] = [Number(shape[1]), Number(shape[2])];
  // A copy, so that it begins where floats may.
  return { width, height, data: new Float32Array(buffer.slice(begin, begin + 4 * width * height)) };
}
