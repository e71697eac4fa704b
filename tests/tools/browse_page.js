// node browse_page.js CHROMIUM PAGE.html FOLDER [WIDTHxHEIGHT [BUDGET]]
// Opens a page of `effuse view` from disk in headless Chromium with the network cut off, and does what a reader does: looks, scrubs with keys and
// with the mouse, plays, turns, changes colours, saves. Prints one JSON document of what it saw; pictures go to FOLDER.
// Speaks the DevTools protocol over --remote-debugging-pipe: no package, no port.
// Exit code 0: the document is whole (its figures are the caller's to judge); 1: the browser or the page broke; 3: no browser.
"use strict";
const { spawn } = require("child_process");
const fs = require("fs");
const os = require("os");
const path = require("path");
const { pathToFileURL } = require("url");

const [, , chromium, page, folder, size = "1280x720"] = process.argv;
const [width, height] = size.split("x").map(Number);
if (!fs.existsSync(chromium)) {
  console.error("browse_page.js: no browser at " + chromium);
  process.exit(3);
}

class Browser {
  constructor() {
    this.profile = fs.mkdtempSync(path.join(os.tmpdir(), "effuse-browser-"));
    this.process = spawn(
      chromium,
      ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-pipe", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update",
        "--disable-extensions", "--disable-sync", "--no-first-run", "--no-default-browser-check", "--mute-audio", "--hide-scrollbars", "--user-data-dir=" + this.profile, `--window-size=${width},${height}`, "about:blank"],
      { stdio: ["ignore", "ignore", "pipe", "pipe", "pipe"] });
    this.said = "";
    this.process.stderr.on("data", (text) => (this.said = (this.said + text).slice(-4000)));
    this.process.on("exit", () => this.fail(new Error("the browser ended: " + this.said)));
    this.waiting = new Map();
    this.heard = [];
    this.number = 0;
    let rest = Buffer.alloc(0);
    this.process.stdio[4].on("data", (bytes) => {
      rest = Buffer.concat([rest, bytes]);
      for (let end; (end = rest.indexOf(0)) >= 0; rest = rest.subarray(end + 1)) this.hear(JSON.parse(rest.subarray(0, end).toString()));
    });
  }
  fail(error) {
    for (const { reject } of this.waiting.values()) reject(error);
    this.waiting.clear();
  }
  hear(message) {
    const asked = this.waiting.get(message.id);
    if (!asked) return this.heard.push(message);
    this.waiting.delete(message.id);
    if (message.error) asked.reject(new Error(asked.method + ": " + message.error.message));
    else asked.resolve(message.result);
  }
  /// whole: asks the browser, not the page.
  send(method, params = {}, whole = false) {
    const id = ++this.number;
    this.process.stdio[3].write(JSON.stringify({ id, method, params, sessionId: whole ? undefined : this.session }) + "\0");
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject, method }));
  }
  /// The value of an expression in the page; promises are waited for.
  async value(expression) {
    const { result, exceptionDetails } = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error((exceptionDetails.exception && exceptionDetails.exception.description) || exceptionDetails.text);
    return result.value;
  }
  close() {
    this.process.removeAllListeners("exit");
    this.process.kill("SIGKILL");
    try {
      fs.rmSync(this.profile, { recursive: true, force: true, maxRetries: 5 });
    } catch {
      // a child of the browser may still write there; the folder is in the system's temporary one
    }
  }
}

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function until(what, limit, test) {
  for (const end = Date.now() + limit; Date.now() < end; await sleep(15)) if (await test()) return;
  throw new Error("waited " + limit / 1000 + " s in vain for " + what);
}

/// Picture of the window as a PNG; saved under that name.
async function picture(browser, name) {
  const { data } = await browser.send("Page.captureScreenshot", { format: "png" });
  fs.writeFileSync(path.join(folder, name + ".png"), Buffer.from(data, "base64"));
}

/// Of the 3-D picture alone, counted in the page: pixels that look like hot lava, all that are not as dark as the void, and a sum that changes with any of them.
const kCount = `(() => {
  const view = document.getElementById("view"), copy = document.createElement("canvas");
  copy.width = 480; copy.height = Math.round(480 * view.height / view.width);
  const c = copy.getContext("2d");
  effuse.render(0);
  c.drawImage(view, 0, 0, copy.width, copy.height);
  const p = c.getImageData(0, 0, copy.width, copy.height).data;
  let hot = 0, lit = 0, sum = 0;
  for (let i = 0; i < p.length; i += 4) {
    if (p[i] > 150 && p[i] > 1.25 * p[i + 1] && p[i + 1] > 1.2 * p[i + 2]) ++hot;
    if (p[i] + p[i + 1] + p[i + 2] > 60) ++lit;
    sum = (sum * 31 + p[i] * 65536 + p[i + 1] * 256 + p[i + 2]) % 4294967291;
  }
  return { hot: hot / (p.length / 4), lit: lit / (p.length / 4), sum };
})()`;

async function main() {
  const seen = { width, height };
  const browser = new Browser();
  try {
    const { targetInfos } = await browser.send("Target.getTargets");
    const target = targetInfos.find((t) => t.type === "page");
    browser.session = (await browser.send("Target.attachToTarget", { targetId: target.targetId, flatten: true })).sessionId;
    for (const domain of ["Page", "Runtime", "Log", "Network"]) await browser.send(domain + ".enable");
    await browser.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: width < 500 });
    await browser.send("Network.emulateNetworkConditions", { offline: true, latency: 0, downloadThroughput: 0, uploadThroughput: 0 });
    await browser.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: path.resolve(folder), eventsEnabled: true });

    // The first picture: from asking for the page to the first frame drawn.
    const started = Date.now();
    await browser.send("Page.navigate", { url: pathToFileURL(path.resolve(page)).href });
    await until("the first picture", 60000, () => browser.value(`typeof effuse === "object" && effuse.statistics.drawn > 0 && !document.body.classList.contains("waiting")`).catch(() => false));
    seen.first_picture_s = (Date.now() - started) / 1000;
    await until("the page to load", 60000, () => browser.value(`document.readyState === "complete"`));
    seen.loaded_s = (Date.now() - started) / 1000;
    seen.frames = await browser.value("effuse.page.frames.length");
    seen.renderer = await browser.value(`(() => { const gl = document.createElement("canvas").getContext("webgl2"); const i = gl.getExtension("WEBGL_debug_renderer_info"); return i ? gl.getParameter(i.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER); })()`);
    const rest = () => until("the picture to rest", 60000, () => browser.value("effuse.resting"));
    await rest();
    seen.opened = await browser.value(kCount);
    await rest();
    await picture(browser, "opened");

    // Scrubbing by keys: to the first frame, on, and to the last.
    const key = async (name, code) => {
      await browser.send("Input.dispatchKeyEvent", { type: "keyDown", key: name, code: name === " " ? "Space" : name, windowsVirtualKeyCode: code, text: name === " " ? " " : undefined });
      await browser.send("Input.dispatchKeyEvent", { type: "keyUp", key: name, code: name === " " ? "Space" : name, windowsVirtualKeyCode: code });
    };
    const shown = (index) => until("frame " + index, 20000, () => browser.value(`effuse.index === ${index} && !effuse.dirty`));
    await key("Home", 36);
    await shown(0);
    seen.first = await browser.value(kCount);
    await key("ArrowRight", 39);
    await shown(Math.min(1, seen.frames - 1));
    seen.after_arrow = await browser.value("effuse.index");
    await key("End", 35);
    await shown(seen.frames - 1);
    seen.last = await browser.value(kCount);
    seen.readout = await browser.value(`document.getElementById("readout").textContent`);

    // Scrubbing as fast as the page draws: every frame once, there and back.
    await browser.value("effuse.show(0)");
    const busy = async () => {
      const { processInfo } = await browser.send("SystemInfo.getProcessInfo", {}, true);
      return processInfo.reduce((sum, one) => sum + one.cpuTime, 0);
    };
    const before_scrub = await busy();
    seen.scrub = await browser.value(`(async () => {
      const n = effuse.page.frames.length, run = async (order) => {
        const started = performance.now(); let triangles = 0;
        for (const i of order) { await effuse.show(i); triangles += effuse.scene.lava ? effuse.scene.lava.about.triangles : 0; }
        const s = (performance.now() - started) / 1000;
        return { frames: order.length, per_second: order.length / s, triangles: Math.round(triangles / order.length), pixels: effuse.canvas.width * effuse.canvas.height };
      };
      const up = [...Array(n).keys()];
      return { first_time: await run(up), again: await run(up.slice().reverse()) };
    })()`);
    // Of all the browser's processes, on this machine's cores, whatever else they do: the wall's clock alone says little on a busy one.
    seen.scrub.processor_s_a_frame = ((await busy()) - before_scrub) / (2 * seen.frames);

    // With the mouse, along the slider.
    const slider = await browser.value(`(() => { const r = document.getElementById("scrub").getBoundingClientRect(); return { x: r.left, y: r.top + r.height / 2, w: r.width }; })()`);
    const mouse = (type, x, y, more = {}) => browser.send("Input.dispatchMouseEvent", { type, x, y, button: "left", buttons: 1, clickCount: 1, ...more });
    await mouse("mousePressed", slider.x + 8, slider.y);
    const shownBefore = await browser.value("effuse.statistics.shown");
    for (let k = 1; k <= 20; ++k) {
      await mouse("mouseMoved", slider.x + 8 + (k / 20) * 0.5 * (slider.w - 16), slider.y);
      await sleep(15);
    }
    await mouse("mouseReleased", slider.x + slider.w / 2, slider.y, { buttons: 0 });
    await until("the slider's frame", 20000, () => browser.value("effuse.index === effuse.wanted && !effuse.dirty"));
    seen.dragged = { index: await browser.value("effuse.index"), shown: (await browser.value("effuse.statistics.shown")) - shownBefore };

    // Turning, pushing, nearing.
    const camera = () => browser.value("[effuse.camera.azimuth, effuse.camera.elevation, effuse.camera.distance, ...effuse.camera.target]");
    const before = await camera();
    const [cx, cy] = [width * 0.45, height * 0.4];
    await mouse("mousePressed", cx, cy);
    await mouse("mouseMoved", cx + 60, cy + 20);
    await mouse("mouseReleased", cx + 60, cy + 20, { buttons: 0 });
    const turned = await camera();
    await browser.send("Input.dispatchMouseEvent", { type: "mousePressed", x: cx, y: cy, button: "right", buttons: 2, clickCount: 1 });
    await browser.send("Input.dispatchMouseEvent", { type: "mouseMoved", x: cx - 50, y: cy, button: "right", buttons: 2 });
    await browser.send("Input.dispatchMouseEvent", { type: "mouseReleased", x: cx - 50, y: cy, button: "right", buttons: 0 });
    const pushed = await camera();
    await browser.send("Input.dispatchMouseEvent", { type: "mouseWheel", x: cx, y: cy, deltaX: 0, deltaY: -240 });
    await until("the wheel", 5000, async () => (await camera())[2] < pushed[2]);
    const neared = await camera();
    seen.camera = { turned: Math.abs(turned[0] - before[0]), pushed: Math.hypot(...[3, 4, 5].map((k) => pushed[k] - turned[k])), neared: neared[2] / pushed[2] };
    await key("r", 82);
    await until("the camera to be home", 5000, async () => Math.abs((await camera())[2] - before[2]) < 1e-6 * before[2]);

    // Colours.
    seen.modes = {};
    for (const mode of await browser.value(`[...document.querySelectorAll("#modes button")].map((b) => b.dataset.mode)`)) {
      await browser.value(`document.querySelector("#modes [data-mode=${mode}]").click()`);
      await rest();
      seen.modes[mode] = await browser.value(kCount);
      await rest();
      await picture(browser, "mode-" + mode);
    }
    await browser.value(`document.querySelector("#modes [data-mode=lava]").click(); document.getElementById("wire").click()`);
    await rest();
    seen.wire = await browser.value(kCount);
    await rest();
    await picture(browser, "wire");
    await browser.value(`document.getElementById("wire").click()`);

    // Play: a second of it, from the start.
    await key("Home", 36);
    await shown(0);
    await key(" ", 32);
    await sleep(1000);
    await key(" ", 32);
    seen.played = { index: await browser.value("effuse.index"), playing: await browser.value("effuse.playing") };

    // Files of the frame in the middle.
    await browser.value(`effuse.show(${Math.floor(seen.frames / 2)})`);
    seen.saved = {};
    for (const kind of ["ply", "glb", "png"]) {
      const name = await browser.value(`effuse.fileName("${kind}")`);
      await browser.value(`document.getElementById("${kind}").click()`);
      const file = path.join(folder, name);
      let last = -1;
      await until(name, 20000, async () => {
        await sleep(100);
        const now = fs.existsSync(file) ? fs.statSync(file).size : -1;
        const same = now > 0 && now === last;
        last = now;
        return same;
      });
      seen.saved[kind] = { name, bytes: last };
    }

    seen.problem = await browser.value(`document.getElementById("problem").hidden ? "" : document.getElementById("problem").textContent`);
    const text = (message) => (message.params.args || []).map((a) => a.value || a.description || "").join(" ");
    seen.console = [
      ...browser.heard.filter((m) => m.method === "Runtime.consoleAPICalled" && ["error", "warning", "assert"].includes(m.params.type)).map(text),
      ...browser.heard.filter((m) => m.method === "Runtime.exceptionThrown").map((m) => m.params.exceptionDetails.text + " " + ((m.params.exceptionDetails.exception || {}).description || "")),
      ...browser.heard.filter((m) => m.method === "Log.entryAdded" && ["error", "warning"].includes(m.params.entry.level)).map((m) => m.params.entry.text),
    ];
    seen.requests = browser.heard.filter((m) => m.method === "Network.requestWillBeSent").map((m) => m.params.request.url).filter((url) => !/^(file|blob|data):/.test(url));
    console.log(JSON.stringify(seen, null, 1));
  } finally {
    browser.close();
  }
}

main().catch((error) => {
  console.error("browse_page.js: " + error.message);
  process.exit(1);
});
