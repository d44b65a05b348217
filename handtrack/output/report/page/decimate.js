"use strict";
// Curves at the resolution of the screen: of every pixel's worth of frames the extremes, in order.

// Rows of x in [from, to], one more on either side.
function rowsWithin(x, from, to) {
  const first = Math.max(0, lowerBound(x, from) - 1);
  return [first, Math.min(x.length, lowerBound(x, to) + 2)];
}

// First row whose value is not below `value`; x never falls.
function lowerBound(x, value) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

// Data for the library: x, then each column, NaN as null. `modes` says of each column what a
// bucket of frames gives: "both" extremes in the order they come in, or "max" or "min" alone.
function decimated(x, columns, modes, from, to, pixels) {
  const [first, end] = rowsWithin(x, from, to), n = end - first;
  if (n <= 4 * pixels) {
    const rows = Array.from(x.subarray(first, end));
    return [rows, ...columns.map((c) => Array.from(c.subarray(first, end), orNull))];
  }
  const buckets = Math.max(1, Math.round(pixels)), rows = [];
  const found = columns.map(() => []);
  for (let b = 0; b < buckets; b++) {
    const i0 = first + Math.floor((b * n) / buckets);
    const i1 = first + Math.floor(((b + 1) * n) / buckets);
    rows.push(x[i0], x[i1 - 1]);
    columns.forEach((column, c) => found[c].push(...extremes(column, i0, i1, modes[c])));
  }
  return [rows, ...found];
}

function extremes(column, i0, i1, mode) {
  let low = Infinity, high = -Infinity, lowAt = 0, highAt = 0;
  for (let i = i0; i < i1; i++) {
    const value = column[i];
    if (value < low) { low = value; lowAt = i; }
    if (value > high) { high = value; highAt = i; }
  }
  if (high === -Infinity) return [null, null];
  if (mode === "max") return [high, high];
  if (mode === "min") return [low, low];
  return lowAt <= highAt ? [low, high] : [high, low];
}

function orNull(value) { return Number.isFinite(value) ? value : null; }
