"use strict";
// The picture of one frame and its layers on a canvas. Coordinates are pixels of the frame as
// filmed, their centres at integers.

const DIGIT_COLOURS = ["#e69f00", "#56b4e9", "#00be82", "#f0e442", "#e079bb"];
const PALM_COLOUR = "#d8dde2";
const digitColour = (digit) => (digit < 0 ? PALM_COLOUR : DIGIT_COLOURS[digit]);

const LAYERS = [
  { name: "picture", label: "Picture", colour: "#8a8f94", on: true },
  { name: "contour", label: "Contour", colour: "#00e0ff", on: true },
  { name: "edges", label: "Edges", colour: "#ffe14d", on: false },
  { name: "pairs", label: "Matches", colour: "#ff4fd8", on: false },
  { name: "patches", label: "Model", colour: "#7fb7ff", on: true },
  { name: "keypoints", label: "Keypoints", colour: "#ffffff", on: true },
  { name: "cloud", label: "Cloud", colour: "#ff9a3d", on: false },
];
const TRUE_LAYER = { name: "truth", label: "Truth", colour: "#b6ff5c", on: false };

class Painter {
  constructor(canvas, facts) {
    this.canvas = canvas;
    this.facts = facts;
    this.zoomed = false;
    this.box = null; // what is looked at when zoomed in, in frame pixels
  }

  // Paint a frame with the layers that are on; `truth` has its true keypoints, or is null.
  paint({ image, layers }, on, truth) {
    const { canvas, facts } = this, ctx = canvas.getContext("2d");
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    const box = this.view(layers);
    const scale = Math.min(canvas.width / box.w, canvas.height / box.h);
    ctx.translate((canvas.width - scale * box.w) / 2, (canvas.height - scale * box.h) / 2);
    ctx.scale(scale, scale);
    ctx.translate(0.5 - box.x, 0.5 - box.y);
    ctx.beginPath();
    ctx.rect(-0.5, -0.5, facts.size[0], facts.size[1]);
    ctx.clip();
    ctx.fillStyle = "#24282c";
    ctx.fillRect(-0.5, -0.5, facts.size[0], facts.size[1]);
    if (image && on.picture) ctx.drawImage(image, -0.5, -0.5, facts.size[0], facts.size[1]);
    ctx.lineJoin = ctx.lineCap = "round";
    const px = ratio / scale; // one pixel of the screen
    if (on.patches) paintPatches(ctx, layers, px);
    if (on.edges) paintEdges(ctx, layers, px);
    if (on.contour) paintContour(ctx, layers, px);
    if (on.pairs) paintPairs(ctx, layers, px);
    if (on.cloud) paintTips(ctx, layers, px);
    if (on.truth && truth) paintTruth(ctx, truth, facts.parents, px);
    if (on.keypoints) paintBones(ctx, layers.keypoints, facts.parents, px);
  }

  view(layers) {
    const [width, height] = this.facts.size;
    if (!this.zoomed) { this.box = null; return { x: 0, y: 0, w: width, h: height }; }
    const [x, y] = layers.keypoints;
    if (Number.isFinite(x[0])) {
      const left = Math.min(...x), right = Math.max(...x), top = Math.min(...y), foot = Math.max(...y);
      const side = 1.45 * Math.max(right - left, foot - top, 20);
      this.box = { x: (left + right - side) / 2, y: (top + foot - side) / 2, w: side, h: side };
    }
    return this.box || { x: 0, y: 0, w: width, h: height };
  }
}

function paintPatches(ctx, layers, px) {
  const [x, y] = layers.points("patch"), v = layers.number("patch_v");
  const digit = layers.part("polygon", "patch_digit"), seen = layers.part("polygon", "patch_seen");
  const palm = new Path2D();
  for (let p = 0; p < digit.length; p++) if (!digit[p]) addPolygon(palm, x, y, p * v, (p + 1) * v);
  paintUnion(ctx, palm, PALM_COLOUR, px);
  for (let p = 0; p < digit.length; p++) {
    if (!digit[p]) continue;
    const hidden = seen[p] < 0.5 * 255, path = new Path2D();
    addPolygon(path, x, y, p * v, (p + 1) * v);
    ctx.fillStyle = digitColour(digit[p] - 1);
    ctx.globalAlpha = hidden ? 0.06 : 0.2;
    ctx.fill(path);
    ctx.globalAlpha = hidden ? 0.4 : 0.95;
    ctx.setLineDash(hidden ? [2 * px, 4 * px] : []);
    stroke(ctx, path, digitColour(digit[p] - 1), (hidden ? 0.9 : 1.3) * px);
  }
  ctx.globalAlpha = 1;
  ctx.setLineDash([]);
}

function addPolygon(path, x, y, from, to) {
  path.moveTo(x[from], y[from]);
  for (let i = from + 1; i < to; i++) path.lineTo(x[i], y[i]);
  path.closePath();
}

// Polygons that overlap as one patch: its outline, without the lines inside it.
function paintUnion(ctx, path, colour, px) {
  const other = paintUnion.canvas || (paintUnion.canvas = document.createElement("canvas"));
  other.width = ctx.canvas.width;
  other.height = ctx.canvas.height;
  const on = other.getContext("2d");
  on.setTransform(ctx.getTransform());
  stroke(on, path, colour, 2.6 * px);
  on.globalCompositeOperation = "destination-out";
  on.fill(path);
  on.globalCompositeOperation = "source-over";
  on.globalAlpha = 0.14;
  on.fillStyle = colour;
  on.fill(path);
  ctx.save();
  ctx.resetTransform();
  ctx.drawImage(other, 0, 0);
  ctx.restore();
}

function paintEdges(ctx, layers, px) {
  const [x, y] = layers.points("edge"), strength = layers.part("edge", "edge_strength");
  const side = 2.2 * px;
  ctx.fillStyle = "#ffe14d";
  for (let i = 0; i < x.length; i++) {
    ctx.globalAlpha = 0.25 + (0.75 * strength[i]) / 255;
    ctx.fillRect(x[i] - side / 2, y[i] - side / 2, side, side);
  }
  ctx.globalAlpha = 1;
}

// The contour has gaps where the frame ends: a step far longer than the usual one is no line.
function paintContour(ctx, layers, px) {
  const [x, y] = layers.points("contour"), n = x.length;
  if (!n) return;
  const steps = Array.from({ length: n }, (_, i) =>
    Math.hypot(x[i] - x[(i + n - 1) % n], y[i] - y[(i + n - 1) % n]));
  const longest = 3 * steps.slice().sort((a, b) => a - b)[n >> 1] + 2;
  const path = new Path2D();
  path.moveTo(x[n - 1], y[n - 1]);
  for (let i = 0; i < n; i++) {
    if (steps[i] <= longest) path.lineTo(x[i], y[i]); else path.moveTo(x[i], y[i]);
  }
  stroke(ctx, path, "rgb(0 30 40 / 0.55)", 3.2 * px);
  stroke(ctx, path, "#00e0ff", 1.5 * px);
}

function paintPairs(ctx, layers, px) {
  const [x, y] = layers.points("pair");
  const dx = layers.part("pair", "pair_dx"), dy = layers.part("pair", "pair_dy");
  const lines = new Path2D(), ends = new Path2D();
  for (let i = 0; i < x.length; i++) {
    lines.moveTo(x[i], y[i]);
    lines.lineTo(x[i] + dx[i], y[i] + dy[i]);
    ends.moveTo(x[i] + 1.7 * px, y[i]);
    ends.arc(x[i], y[i], 1.7 * px, 0, 7);
  }
  stroke(ctx, lines, "rgb(40 0 30 / 0.5)", 3.2 * px);
  stroke(ctx, lines, "#ff4fd8", 1.6 * px);
  ctx.fillStyle = "#ff4fd8";
  ctx.fill(ends);
}

function paintTips(ctx, layers, px) {
  const x = layers.part("tip", "tip_x"), y = layers.part("tip", "tip_y");
  const weight = layers.part("cloud", "cloud_weight"), digit = layers.part("cloud", "cloud_digit");
  const each = layers.number("cloud_tips");
  for (let i = 0; i < x.length; i++) {
    const member = Math.floor(i / each), share = weight[member] / 255;
    const own = each > 1 ? i % each : digit[member] - 1;
    ctx.globalAlpha = 0.45 + 0.55 * share;
    ctx.fillStyle = digitColour(own);
    ctx.beginPath();
    ctx.arc(x[i], y[i], (1.7 + 2.4 * Math.sqrt(share)) * px, 0, 7);
    ctx.fill();
  }
  ctx.globalAlpha = 1;
}

function paintBones(ctx, [x, y], parents, px) {
  if (!Number.isFinite(x[0])) return;
  for (let k = 1; k < x.length; k++) {
    const bone = new Path2D(), root = parents[k] === 0;
    bone.moveTo(x[parents[k]], y[parents[k]]);
    bone.lineTo(x[k], y[k]);
    stroke(ctx, bone, "rgb(0 0 0 / 0.55)", (root ? 2.6 : 4.6) * px);
    stroke(ctx, bone, digitColour((k - 1) >> 2), (root ? 1.2 : 2.6) * px);
  }
  for (let k = 0; k < x.length; k++) {
    ctx.beginPath();
    ctx.arc(x[k], y[k], 3 * px, 0, 7);
    ctx.fillStyle = k ? digitColour((k - 1) >> 2) : "#ffffff";
    ctx.strokeStyle = "rgb(0 0 0 / 0.75)";
    ctx.lineWidth = 1.2 * px;
    ctx.fill();
    ctx.stroke();
  }
}

function paintTruth(ctx, [x, y], parents, px) {
  if (!Number.isFinite(x[0])) return;
  const path = new Path2D();
  for (let k = 1; k < x.length; k++) {
    path.moveTo(x[parents[k]], y[parents[k]]);
    path.lineTo(x[k], y[k]);
  }
  stroke(ctx, path, "rgb(0 0 0 / 0.6)", 3.4 * px);
  stroke(ctx, path, TRUE_LAYER.colour, 1.6 * px);
}

function stroke(ctx, path, colour, width) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.stroke(path);
}
