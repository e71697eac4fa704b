// The page itself: what the controls do, and when something is drawn.

const byId = (id) => document.getElementById(id);

function complain(error) {
  byId("problem").textContent = error.message || String(error);
  byId("problem").hidden = false;
  document.body.classList.remove("waiting");
}

const kStillSamples = 16, kRestAfter = 140;      // of a still picture; [ms]
const kScales = [1, 0.75, 0.55, 0.42, 0.32];     // of the picture's size while it moves
const kSlow = 1000 / 32, kFast = 1000 / 52;      // [ms] a picture

class View {
  constructor() {
    const page = (this.page = JSON.parse(byId("about").textContent));
    const canvas = (this.canvas = byId("view"));
    this.renderer = new Renderer(canvas, page);
    this.frames = new Frames(page, JSON.parse(byId("meshes").textContent), this.renderer);
    this.camera = new Camera(canvas, () => this.changed());
    this.camera.limits.size = this.renderer.size;
    this.look = { mode: "lava", channel: -1, ofRange: [0, 1], map: null, wire: false, contours: true, ground: true, day: 0.38, contour: this.contourStep() };
    this.index = -1;        // shown
    this.wanted = 0;
    this.direction = 1;
    this.playing = false;
    this.rate = 1;
    this.scale = this.renderer.software ? 2 : 0;  // of kScales
    this.paces = [];
    this.lastMove = -1e9;
    this.sample = 0;        // 0: moving
    this.statistics = { shown: 0, drawn: 0 };
    this.shownWaiters = [];
    this.makeControls();
    this.resize();
    this.aim();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.go(this.firstFrame());
    requestAnimationFrame((now) => this.tick(now));
  }

  /// The film opens on a frame that shows something.
  firstFrame() {
    const { frames } = this.page, last = frames.length - 1;
    const asked = /(?:^#|&)frame=(\d+)/.exec(location.hash);
    const at = asked ? frames.findIndex((f) => f.number === Number(asked[1])) : -1;
    return at >= 0 ? at : Math.round(0.6 * last);
  }

  contourStep() {
    const box = this.page.box;
    return box ? niceStep(box[1][2] - box[0][2], 22) : 1;
  }

  /// From below and a little aside, so that the lava comes towards the reader; without lava, the things there are; or else the ground.
  aim() {
    const { lavaBox, firstLava, othersBox, box } = this.page, subject = lavaBox || othersBox;
    let azimuth = -1.1, held = subject || box || [[-1, -1, -1], [1, 1, 1]];
    if (lavaBox && firstLava) {
      const away = sub(middleOf(lavaBox), middleOf(firstLava));
      if (Math.hypot(away[0], away[1]) > 0.02 * sizeOf(lavaBox)) azimuth = Math.atan2(away[1], away[0]) + 0.45;
    }
    if (subject) {
      const out = 0.12 * sizeOf(subject);
      held = [0, 1].map((side) => [0, 1, 2].map((k) => (side ? Math.min(subject[1][k] + out, box[1][k]) : Math.max(subject[0][k] - out, box[0][k]))));
    }
    this.camera.frame(held, azimuth, 0.52, () => {
      const wide = this.canvas.clientWidth, high = this.canvas.clientHeight, panel = byId("charts");
      const covered = wide > 760 && panel.childElementCount > 0 ? panel.offsetWidth + 18 : 0;
      return { x: covered / wide, y: Math.min(130 / high, 0.3) };
    });
  }

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), { canvas } = this;
    this.renderer.resize(Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio));
    this.chartsAt = null;
    this.changed();
  }

  /// Something moved: draw at once, and better when it rests.
  changed() {
    this.lastMove = performance.now();
    this.sample = 0;
    this.dirty = true;
  }

  go(index) {
    const target = clamp(index, 0, this.page.frames.length - 1);
    if (target !== this.wanted) this.direction = target > this.wanted ? 1 : -1;
    this.wanted = target;
    byId("scrub").value = target;
    return this.load();
  }

  /// One at a time, always the newest that is wanted.
  async load() {
    if (this.loading) return this.loading;
    const work = async () => {
      while (this.wanted !== this.index) {
        const i = this.wanted;
        this.scene = await this.frames.scene(i);
        this.index = i;
        this.statistics.shown++;
        this.changed();
        this.frames.prefetch(i, this.direction);
        this.describe();
      }
    };
    this.loading = work().catch(complain).finally(() => {
      this.loading = null;
      if (this.wanted !== this.index && byId("problem").hidden) this.load();
    });
    return this.loading;
  }

  /// The attribute of the look, as this frame's bytes have it.
  setRange() {
    const { look, page, scene } = this;
    look.channel = ["temperature", "speed", "crust", "thickness"].indexOf(look.mode);
    look.map = look.channel < 0 ? null : look.mode;
    if (look.channel < 0 || !scene || !scene.lava) return;
    const [low, high] = page.ranges[look.mode], of = (scene.lava.about.ranges || {})[look.mode] || [0, 1];
    look.ofRange = of.map((v) => (v - low) / Math.max(high - low, 1e-9));
  }

  describe() {
    const frame = this.page.frames[this.index], last = this.page.frames[this.page.frames.length - 1];
    const readout = byId("readout"), small = document.createElement("small");
    readout.replaceChildren("frame " + frame.number, small);
    small.textContent = duration(frame.time, last.time < 20 ? 2 : last.time < 120 ? 1 : 0);
    byId("scrub").style.setProperty("--part", (100 * this.index) / Math.max(this.page.frames.length - 1, 1) + "%");
    byId("scrub").setAttribute("aria-valuetext", readout.textContent);
  }

  /// Still, and as good as it gets.
  get resting() {
    return !this.dirty && !this.playing && this.sample >= this.samples;
  }
  get samples() {
    return this.renderer.software ? 6 : kStillSamples;
  }

  tick(now) {
    requestAnimationFrame((next) => this.tick(next));
    // How long the last picture took: while the card is behind, ticks come late.
    if (this.tickedAt !== undefined && this.drewMoving) this.watchPace(now - this.tickedAt, now);
    this.tickedAt = now;
    this.drewMoving = false;
    if (this.playing) this.play(now);
    if (!this.scene || document.hidden) return;
    // Ten times a second will do for figures where every change of the page is painted by the processor.
    if (this.chartsAt !== this.index && !(this.renderer.software && now - this.markedAt < 100)) {
      if (this.chartsAt === null) this.charts.resize();
      this.charts.mark(this.page.frames[this.index].time);
      this.chartsAt = this.index;
      this.markedAt = now;
    }
    if (this.dirty) {
      this.dirty = false;
      this.drewMoving = true;
      this.render(0);
    } else if (now - this.lastMove >= kRestAfter && !this.playing && this.sample < this.samples) {
      this.render(++this.sample);
    }
  }

  render(sample) {
    this.setRange();
    this.renderer.draw(this.scene, this.camera, this.look, sample > 0 ? 1 : kScales[this.scale], sample);
    this.statistics.drawn++;
    document.body.classList.remove("waiting");
    for (const done of this.shownWaiters.splice(0)) done();
  }

  /// While it moves: fewer pixels when pictures come slowly, more again when they have been fast for some seconds.
  watchPace(pace, now) {
    this.paces.push(pace);
    if (this.paces.length < 5) return;
    const middle = this.paces.sort((a, b) => a - b)[2];
    this.paces = [];
    if (middle > kSlow) {
      this.slowAt = now;
      this.scale = Math.min(this.scale + 1, kScales.length - 1);
    } else if (middle < kFast && this.scale > 0 && now - (this.slowAt || 0) > 4000) {
      --this.scale;
    }
  }

  /// Frames by the clock of the film; one that is not unpacked yet is waited for.
  play(now) {
    const { frames, fps } = this.page;
    if (this.loading) return;
    const filmTime = (i) => frames[i].number / fps;
    if (!this.clock || this.clock.index !== this.index) this.clock = { index: this.index, film: filmTime(this.index), at: this.clock && this.clock.next === this.index ? this.clock.due : now };
    const film = this.clock.film + ((now - this.clock.at) / 1000) * this.rate;
    let next = this.index;
    while (next + 1 < frames.length && filmTime(next + 1) <= film + 1e-6) ++next;
    if (next === this.index && next + 1 === frames.length && film > filmTime(next) + 0.8) next = 0;
    if (next === this.index) return;
    // Late by more than a quarter of a second: the clock waits.
    const due = next > this.index ? this.clock.at + ((filmTime(next) - this.clock.film) * 1000) / this.rate : now;
    this.clock.next = next;
    this.clock.due = now - due > 250 ? now : due;
    this.go(next);
    this.direction = 1;
  }
  setPlaying(playing) {
    this.playing = playing;
    this.clock = null;
    document.body.classList.toggle("playing", playing);
    byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    if (playing && this.wanted === this.page.frames.length - 1) this.go(0);
  }

  goToTime(time) {
    const { frames } = this.page;
    let best = 0;
    frames.forEach((frame, i) => {
      if (Math.abs(frame.time - time) < Math.abs(frames[best].time - time)) best = i;
    });
    this.go(best);
  }

  makeControls() {
    const { page, look } = this;
    byId("title").textContent = page.title;
    byId("facts").textContent = page.facts.map(([name, value]) => (name ? name + " " : "") + value).join(" · ");
    this.charts = new Charts(byId("charts"), page, (time) => this.goToTime(time));

    // Only what some frame has.
    const planes = new Set(this.frames.meshes.flatMap((m) => m.planes));
    const modes = [["lava", "Lava"], ...Object.entries(kAttributes).filter(([name]) => planes.has(name)).map(([name, a]) => [name, a.label])];
    for (const [name, label] of modes) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.mode = name;
      button.setAttribute("role", "radio");
      button.textContent = label;
      button.addEventListener("click", () => this.setMode(name));
      byId("modes").append(button);
    }
    if (!page.lavaBox) byId("modes").hidden = byId("saves").hidden = byId("wire").hidden = true;
    if (page.terrain === null) byId("contours").hidden = byId("ground").hidden = true;
    this.setMode("lava");

    for (const id of ["wire", "contours", "ground"])
      byId(id).addEventListener("click", () => {
        look[id] = !look[id];
        byId(id).setAttribute("aria-pressed", look[id]);
        this.changed();
      });
    const day = () => {
      look.day = byId("day").value / 100;
      byId("day").style.setProperty("--part", byId("day").value + "%");
      this.changed();
    };
    byId("day").addEventListener("input", day);
    day();

    const scrub = byId("scrub");
    scrub.max = page.frames.length - 1;
    scrub.addEventListener("input", () => {
      this.setPlaying(false);
      this.go(Number(scrub.value));
    });
    byId("play").addEventListener("click", () => this.setPlaying(!this.playing));
    const rates = [0.25, 0.5, 1, 2], names = ["¼×", "½×", "1×", "2×"];
    byId("speed").addEventListener("click", () => {
      const k = (rates.indexOf(this.rate) + 1) % rates.length;
      this.rate = rates[k];
      this.clock = null;
      byId("speed").textContent = names[k];
    });
    for (const [id, name] of [["showLooks", "looks"], ["showCharts", "charts"]])
      byId(id).addEventListener("click", () => {
        const open = !document.body.classList.contains(name);
        document.body.classList.remove("looks", "charts");
        document.body.classList.toggle(name, open);
        for (const opener of document.querySelectorAll(".opener")) opener.setAttribute("aria-expanded", open && opener.id === id);
        this.chartsAt = null;
        this.changed();
      });
    for (const kind of ["ply", "glb", "png"]) byId(kind).addEventListener("click", () => this.save(kind).catch(complain));
    window.addEventListener("keydown", (e) => this.key(e));
  }

  setMode(name) {
    this.look.mode = name;
    for (const button of byId("modes").children) button.setAttribute("aria-checked", button.dataset.mode === name);
    const attribute = kAttributes[name], legend = byId("legend");
    legend.hidden = !attribute;
    if (attribute) {
      const [low, high] = this.page.ranges[name], [bar, from, unit, to] = legend.children;
      bar.style.background = mapGradient(name);
      from.textContent = name === "crust" ? "molten" : digits(attribute.shown(low));
      unit.textContent = attribute.unit;
      to.textContent = name === "crust" ? "solid" : digits(attribute.shown(high));
    }
    this.changed();
  }

  key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const inSlider = e.target.tagName === "INPUT", step = e.shiftKey ? 10 : 1, last = this.page.frames.length - 1;
    const moves = { ArrowRight: step, ArrowLeft: -step, PageUp: 10, PageDown: -10 };
    if (e.key === " ") {
      if (e.target.tagName === "BUTTON" && e.target.id !== "play") return;
      this.setPlaying(!this.playing);
    } else if (e.key in moves && !(inSlider && e.target.id !== "scrub")) {
      this.setPlaying(false);
      this.go(this.wanted + moves[e.key]);
    } else if (e.key === "Home" || e.key === "End") {
      this.setPlaying(false);
      this.go(e.key === "Home" ? 0 : last);
    } else if (e.key === "ArrowUp" || e.key === "ArrowDown") {
      if (inSlider) return;
      this.camera.near(e.key === "ArrowUp" ? 0.9 : 1 / 0.9);
      this.changed();
    } else if (e.key >= "1" && e.key <= "5") {
      const button = byId("modes").children[Number(e.key) - 1];
      if (button) button.click();
    } else if (e.key === "w") byId("wire").click();
    else if (e.key === "c") byId("contours").click();
    else if (e.key === "g") byId("ground").click();
    else if (e.key === "r") this.camera.home();
    else return;
    e.preventDefault();
  }

  fileName(ending) {
    const stem = this.page.title.normalize("NFKD").toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "") || "lava";
    return stem + "." + String(this.page.frames[this.index].number).padStart(4, "0") + "." + ending;
  }

  /// The file of the shown frame; null when it has no lava.
  async file(kind) {
    const { page, frames } = this, frame = page.frames[this.index];
    if (kind === "png") {
      for (let k = 1; k <= this.samples; ++k) this.renderer.draw(this.scene, this.camera, this.look, 1, k);
      this.changed();
      return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
    }
    if (frame.lava === null) return null;
    const mesh = await loadMesh(frame.lava, frames.meshes[frame.lava]);
    return kind === "ply" ? plyOf(mesh, page, frame) : glbOf(mesh, page, frame);
  }
  async save(kind) {
    const file = await this.file(kind);
    if (file) offer(file, this.fileName(kind));
  }

  /// Resolves when frame `index` (of those in the page) has been drawn.
  async show(index) {
    await this.go(index);
    while (this.index !== this.wanted) await this.load();
    this.dirty = true;
    return new Promise((resolve) => this.shownWaiters.push(() => resolve(this.index)));
  }
}

if (typeof DecompressionStream === "undefined") complain(new Error("This page needs a browser of 2023 or later (DecompressionStream)."));
else {
  try {
    // For scripts around the page: effuse.show(k), effuse.page.frames, effuse.statistics.
    window.effuse = new View();
    window.addEventListener("error", (e) => complain(e.error || e));
    byId("view").addEventListener("webglcontextlost", () => complain(new Error("The browser took the graphics card away. Load the page again.")));
  } catch (error) {
    complain(error);
    console.error(error);
  }
}
