"use strict";
// Which frame is shown. A frame is painted in one go, picture and layers, once both are at hand;
// while they are not, whatever was shown before stays, and of the frames asked for in between only
// the last is fetched.

class Player {
  // `shown(frame)` paints one; `moved(k)` follows the frame that is asked for at once.
  constructor(clip, t, { shown, moved, failed, changed }) {
    Object.assign(this, { clip, t, shown, moved, failed, changed });
    this.k = 0; // asked for
    this.painted = -1; // on the screen
    this.playing = false;
    this.speed = 1;
    this.busy = false;
  }

  get last() { return this.t.length - 1; }

  seek(k) {
    this.k = Math.max(0, Math.min(this.last, Math.round(k)));
    this.clock = null;
    this.moved(this.k);
    return this.fetch();
  }

  step(by) {
    this.pause();
    return this.seek(this.k + by);
  }

  async fetch() {
    if (this.busy) return;
    this.busy = true;
    try {
      while (this.painted !== this.k) this.paint(await this.clip.frame(this.k));
    } catch (error) {
      this.painted = this.k;
      this.failed(error);
    } finally {
      this.busy = false;
    }
  }

  paint(frame) {
    this.painted = frame.k;
    this.shown(frame);
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.k === this.last) this.seek(0);
    this.playing = true;
    this.clock = null;
    this.changed();
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.playing = false;
    this.changed();
  }

  // The clip's own time stamps, times the speed; the clock waits for frames that are not there yet.
  tick(now) {
    if (!this.playing) return;
    if (!this.clock) this.clock = { now, time: this.t[this.k] };
    const time = this.clock.time + (this.speed * (now - this.clock.now)) / 1000;
    let k = this.k;
    while (k < this.last && this.t[k + 1] <= time) k++;
    if (k !== this.painted) {
      const frame = this.clip.frameNow(k);
      if (frame) {
        this.k = k;
        this.moved(k);
        this.paint(frame);
      } else this.clock = { now, time: Math.min(time, this.t[k]) };
    }
    if (this.k === this.last) this.pause();
    else requestAnimationFrame((then) => this.tick(then));
  }
}
