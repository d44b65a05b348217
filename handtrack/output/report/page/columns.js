"use strict";
// Blocks of columns: the counterpart of handtrack/output/report/columns.py.

const ARRAYS = {
  u8: Uint8Array, u16: Uint16Array, i16: Int16Array, i32: Int32Array,
  f32: Float32Array, f64: Float64Array,
};
const UNKNOWN_I16 = -32768;

function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The columns of a block by name: typed arrays, quantised ones in their units with NaN for unknown.
async function unpackColumns(base64) {
  const raw = await inflated(bytesOf(base64));
  const length = new DataView(raw.buffer).getUint32(0, true);
  const heads = JSON.parse(new TextDecoder().decode(raw.subarray(4, 4 + length)));
  const found = {};
  let at = 4 + length;
  for (const head of heads) {
    const size = ARRAYS[head.type].BYTES_PER_ELEMENT * head.n;
    found[head.name] = columnOf(head, raw.subarray(at, at + size));
    at += size;
  }
  return found;
}

function columnOf(head, planes) {
  const Kind = ARRAYS[head.type], width = Kind.BYTES_PER_ELEMENT, n = head.n;
  const bytes = new Uint8Array(n * width);
  for (let p = 0; p < width; p++) {
    for (let i = 0, j = p; i < n; i++, j += width) bytes[j] = planes[p * n + i];
  }
  const values = new Kind(bytes.buffer);
  if (head.delta) for (let i = 1; i < n; i++) values[i] += values[i - 1];
  if (!head.scale) return values;
  const units = new Float32Array(n);
  for (let i = 0; i < n; i++) {
    units[i] = values[i] === UNKNOWN_I16 ? NaN : values[i] / head.scale;
  }
  return units;
}
