// Time on the player: play, stop, scrub, speed.

export class Player {
  // controls: {play, scrub, speed, clock}; show(t) draws a moment.
  constructor(controls, show) {
    Object.assign(this, { controls, show, t: 0, end_s: 1, playing: false });
    controls.play.addEventListener("click", () => this.toggle());
    controls.scrub.addEventListener("input", () => {
      this.stop();
      this.seek(Number(controls.scrub.value) * this.end_s);
    });
  }

  // A run of another length, from its start.
  load(end_s) {
    this.stop();
    this.end_s = Math.max(end_s, 0.05);
    this.controls.scrub.step = Math.min(0.01, 0.02 / this.end_s);
    this.seek(0);
  }

  seek(t) {
    this.t = Math.min(this.end_s, Math.max(0, t));
    this.controls.scrub.value = this.t / this.end_s;
    this.controls.scrub.setAttribute("aria-valuetext", `${this.t.toFixed(2)} s of ${this.end_s.toFixed(2)} s`);
    this.controls.clock.textContent = `${this.t.toFixed(2)} / ${this.end_s.toFixed(2)} s`;
    this.show(this.t);
  }

  toggle() {
    if (this.playing) this.stop();
    else this.play();
  }

  play() {
    if (this.t >= this.end_s) this.seek(0);
    this.playing = true;
    this.say("pause");
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const passed = Math.max(0, now - before);
      before = now;
      this.seek(this.t + (passed / 1000) * Number(this.controls.speed.value));
      if (this.t >= this.end_s) this.stop();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  stop() {
    this.playing = false;
    this.say("play");
  }

  say(what) {
    this.controls.play.textContent = what === "play" ? "▶ play" : "❚❚ pause";
    this.controls.play.setAttribute("aria-pressed", String(what === "pause"));
  }
}
