"use strict";
// Pictures and layers of the frames near the one shown. A chunk is a script (a page from disk may
// run scripts, not read files); its pictures are H.264 packets that the browser's decoder is given
// with the frame's number as time stamp, so a picture knows which frame it is.

const handtrack = { arrived: new Map(), ms: null };
handtrack.chunk = (number, packets, block) => {
  handtrack.arrived.set(number, { packets, block });
};
handtrack.times = (ms) => { handtrack.ms = ms; };

function loadScript(name) {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = `report_files/${name}.js`;
    script.onload = () => { script.remove(); resolve(); };
    script.onerror = () => { script.remove(); reject(new Error(`${script.src} is missing`)); };
    document.head.append(script);
  });
}

// Keeps the `most` values that were asked for last.
class Recent {
  constructor(most, drop = () => {}) { this.most = most; this.drop = drop; this.map = new Map(); }
  get(key, make) {
    let value = this.map.get(key);
    if (value === undefined) value = make(key); else this.map.delete(key);
    this.map.set(key, value);
    while (this.map.size > this.most) {
      const [oldest, dropped] = this.map.entries().next().value;
      this.map.delete(oldest);
      this.drop(dropped);
    }
    return value;
  }
  forget(key) { this.map.delete(key); }
}

class Clip {
  constructor(facts) {
    this.facts = facts;
    this.chunks = new Recent(5);
    this.gops = new Recent(6, (entry) => entry.promise.then(closeAll, () => {}));
    this.tail = Promise.resolve();
    this.fault = null; // why there are no pictures
    if (!("VideoDecoder" in window)) {
      this.fault = "This browser has no WebCodecs, so there are no pictures; any current one does.";
    }
  }

  // Layers and picture of frame k; `image` is null where there are no pictures.
  async frame(k) {
    const [chunk, images] = await Promise.all([this.chunk(k).promise, this.gop(k).promise]);
    return this.joined(k, chunk, images);
  }

  // The same at once, or null if it has to be loaded or decoded first (which this begins).
  frameNow(k) {
    const chunk = this.chunk(k), gop = this.gop(k), ahead = k + this.facts.gop;
    if (ahead < this.facts.n) this.gop(ahead);
    return chunk.done && gop.done ? this.joined(k, chunk.done, gop.done) : null;
  }

  joined(k, chunk, images) {
    const image = images[k % this.facts.gop] || null;
    if (image && image.k !== k) throw new Error(`picture ${image.k} in the place of ${k}`);
    return { k, image: image && image.bitmap, layers: new Layers(chunk, k % this.facts.chunk) };
  }

  chunk(k) {
    return this.chunks.get(Math.floor(k / this.facts.chunk), (number) => entryOf(this.load(number)));
  }

  async load(number) {
    await loadScript(String(number).padStart(6, "0"));
    const { packets, block } = handtrack.arrived.get(number);
    handtrack.arrived.delete(number);
    const columns = await unpackColumns(block);
    return { columns, starts: startsOf(columns), packets };
  }

  gop(k) {
    return this.gops.get(Math.floor(k / this.facts.gop), (number) => {
      const work = this.tail.then(() => this.decode(number));
      this.tail = work.catch(() => {});
      return entryOf(work);
    });
  }

  // The pictures of a group, in order.
  async decode(number) {
    const { gop, chunk: inChunk, film_size: size, film_used: used, codec } = this.facts;
    const first = number * gop;
    if (this.fault) return [];
    const chunk = await this.chunk(first).promise;
    const packets = chunk.packets.slice(first % inChunk, (first % inChunk) + gop);
    const waiting = [];
    let failed = null;
    const decoder = new VideoDecoder({
      output: (frame) => waiting.push(pictureOf(frame, used)),
      error: (error) => { failed = error; },
    });
    try {
      decoder.configure({
        codec, codedWidth: size[0], codedHeight: size[1], optimizeForLatency: true,
      });
      packets.forEach((text, i) => decoder.decode(new EncodedVideoChunk({
        type: i ? "delta" : "key", timestamp: 1000 * (first + i), data: bytesOf(text),
      })));
      await decoder.flush();
    } catch (error) {
      failed = failed || error;
    } finally {
      if (decoder.state !== "closed") decoder.close();
    }
    if (failed) {
      this.fault = `This browser does not show the pictures (${failed.message}).`;
      return [];
    }
    const pictures = await Promise.all(waiting);
    return pictures.sort((a, b) => a.k - b.k);
  }
}

async function pictureOf(frame, used) {
  const k = Math.round(frame.timestamp / 1000);
  const bitmap = await createImageBitmap(frame, 0, 0, used[0], used[1]);
  frame.close();
  return { k, bitmap };
}

function closeAll(pictures) { pictures.forEach((picture) => picture.bitmap.close()); }

function entryOf(promise) {
  const entry = { promise, done: null };
  promise.then((value) => { entry.done = value; }, () => {});
  return entry;
}

// Where each frame's part of a list begins.
function startsOf(columns) {
  const starts = {};
  for (const name of ["contour", "edge", "pair", "patch", "cloud"]) {
    const n = columns[`${name}_n`], start = new Uint32Array(n.length + 1);
    for (let i = 0; i < n.length; i++) start[i + 1] = start[i] + n[i];
    starts[name] = start;
  }
  const vertices = columns.patch_v, tips = columns.cloud_tips, n = vertices.length;
  starts.polygon = new Uint32Array(n + 1);
  starts.tip = new Uint32Array(n + 1);
  for (let i = 0; i < n; i++) {
    starts.polygon[i + 1] = starts.polygon[i] + columns.patch_n[i] / vertices[i];
    starts.tip[i + 1] = starts.tip[i] + columns.cloud_n[i] * tips[i];
  }
  return starts;
}

// The layers of one frame, in its pixels.
class Layers {
  constructor(chunk, i) { this.columns = chunk.columns; this.starts = chunk.starts; this.i = i; }
  part(list, column) {
    const start = this.starts[list];
    return this.columns[column].subarray(start[this.i], start[this.i + 1]);
  }
  points(list) { return [this.part(list, `${list}_x`), this.part(list, `${list}_y`)]; }
  get keypoints() {
    const at = 21 * this.i;
    return [this.columns.key_x.subarray(at, at + 21), this.columns.key_y.subarray(at, at + 21)];
  }
  number(column) { return this.columns[column][this.i]; }
}
