// Tests of the page: node page.mjs INDEX.HTML MODULE.WASM REPLIES.JSONL CHROMIUM
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { pathToFileURL } from "node:url";
import { Worker } from "node:worker_threads";
import { launch, tab, within } from "./browser.mjs";

const [page, wasm, replies, chromium] = process.argv.slice(2);
const url = hash => `${pathToFileURL(page)}${hash}`;
const folder = dirname(page);
const tests = [];
const test = (name, run) => tests.push({ name, run });
const WIDTHS = [360, 390, 768, 1280, 2560];
const NOW = "tactus.now()";
// all of it, and one test: what takes longer hangs
const ALL_S = Number(process.env.TACTUS_PAGE_LIMIT_S ?? 360), TEST_S = 150;

function module() {
  const instance = new WebAssembly.Instance(new WebAssembly.Module(readFileSync(wasm)), {});
  const { request, ask, reply, memory } = instance.exports;
  return {
    memory,
    ask(text) {
      const bytes = Buffer.from(text);
      const at = request(bytes.length);
      Buffer.from(memory.buffer, at, bytes.length).set(bytes);
      const length = ask();
      return Buffer.from(memory.buffer, reply(), length).toString();
    },
  };
}

test("WebAssembly gives the native replies, byte by byte", async () => {
  const lines = readFileSync(replies, "utf8").trimEnd().split("\n");
  assert.ok(lines.length > 100, `${replies} has ${lines.length} lines`);
  const { ask } = module();
  let explorations = 0;
  for (let n = 0; n < lines.length; n += 2) {
    const here = ask(lines[n]);
    if (here !== lines[n + 1]) {
      const at = [...here].findIndex((c, k) => c !== lines[n + 1][k]);
      assert.fail(`${lines[n]}: at ${at} ${here.slice(at - 80, at + 40)}, native ${lines[n + 1].slice(at - 80, at + 40)}`);
    }
    explorations += here.includes('"what":"verdict"');
  }
  assert.ok(explorations >= 55, `${explorations}`);
  return `${explorations} explorations`;
});

test("memory stays flat over 200 explorations", async () => {
  const { ask, memory } = module();
  ask('{"do":"world","world":1,"textures":20,"paper":false,"drift":1,"trial":1}');
  ask('{"do":"prepare"}');
  const sizes = [];
  for (let n = 1; n <= 200; n++) {
    ask(`{"do":"identify","texture":${n % 117 + 1},"seed":${n},"threshold":0.99,"false_alarm":0.02,"max_slides":3}`);
    let frames = 0;
    for (let frame = '"busy":true'; frame.includes('"busy":true');) {
      frame = ask('{"do":"step","ms":200}');
      assert.ok(++frames < 3000, `exploration ${n} is not over after 10 minutes of rig time`);
    }
    sizes.push(memory.buffer.byteLength);
  }
  const [early, late] = [sizes[19], sizes[199]];
  assert.ok(late - early <= 65536, `${early} to ${late} bytes`);
  return `${(late / 2 ** 20).toFixed(1)} MB`;
});

let browser;
async function opened(hash, options, run) {
  const it = await tab(browser, { width: 1280, height: 900, ...options });
  try {
    await it.open(url(hash));
    await it.until("the probe is ready", "window.tactus?.ready > 0");
    const result = await run(it);
    assert.deepEqual(it.errors, []);
    // it loads itself, and nothing else
    assert.ok(it.loaded.every(one => one.startsWith(String(pathToFileURL(page)))), it.loaded.join("\n"));
    return result;
  } finally {
    await it.close();
  }
}
const press = (it, id) => it.evaluate(`document.getElementById("${id}").click()`);
const set = (it, id, value, event = "input change") => it.evaluate(`(() => { const e = document.getElementById("${id}"); e.value = ${JSON.stringify(value)}; for (const name of ${JSON.stringify(event.split(" "))}) e.dispatchEvent(new Event(name, { bubbles: true })); })()`);
const text = (it, id) => it.evaluate(`document.getElementById("${id}").textContent`);
const answered = it => it.until("an answer", `!${NOW}.busy && ${NOW}.verdict !== null`);

test("it begins by itself, and answers", () => opened("", {}, async it => {
  const paint = await it.evaluate("performance.getEntriesByType('paint').find(p => p.name === 'first-contentful-paint').startTime");
  const begun = Date.now();
  await answered(it);
  const took = await it.evaluate("performance.now()");
  assert.ok(took < 30000, `${took} ms to the verdict`);
  assert.match(await text(it, "verdict"), /^(It is |It feels like |This is none|Not sure)/);
  assert.match(await text(it, "truth"), /^Under the finger: /);
  const now = await it.evaluate(NOW);
  assert.ok(now.slides >= 1);
  assert.equal(await it.evaluate("document.querySelectorAll('#slides tr').length"), now.slides);
  assert.ok(await it.evaluate("document.querySelectorAll('#map .slide').length") >= 1);
  assert.ok(await it.evaluate("document.querySelectorAll('#posterior li').length") >= 2);
  assert.equal(await it.evaluate("document.querySelectorAll('#benefit li.chosen').length"), 1);
  const inked = id => it.evaluate(`(() => { const c = document.getElementById("${id}"); return c.getContext("2d").getImageData(0, 0, c.width, c.height).data.some(v => v > 0); })()`);
  for (const id of ["pac", "spectrum", "pdc"]) assert.ok(await inked(id), id);
  const fps = await it.evaluate("tactus.framesPerSecond()");
  return `first paint ${paint.toFixed(0)} ms, ready ${(await it.evaluate("tactus.ready")).toFixed(0)} ms, first verdict ${took.toFixed(0)} ms, ${fps.toFixed(0)} frames a second`;
}));

test("a link carries seed and settings, and shows the same again", async () => {
  const hash = "#n=30&t=0.999&fa=0.05&d=0.5&x=10&seed=77&speed=max";
  const told = [];
  for (let n = 0; n < 2; n++) {
    told.push(await opened(hash, {}, async it => {
      await answered(it);
      assert.equal((await it.evaluate(NOW)).known.textures.length, 30);
      assert.equal(await it.evaluate("document.getElementById('threshold').value"), "5");
      assert.equal(await text(it, "o-alarm"), "5 %");
      return `${await text(it, "verdict")} ${JSON.stringify((await it.evaluate(NOW)).verdict)} ${await it.evaluate("location.hash")}`;
    }));
  }
  assert.equal(told[0], told[1]);
  for (const part of hash.slice(1).split("&")) assert.ok(told[0].includes(part), `${part} in ${told[0]}`);
});

test("a texture it does not know is taught and found again", () => opened("#speed=max&seed=5", { motion: "reduce" }, async it => {
  for (let n = 0; ; n++) {
    assert.ok(n < 5, "no texture was new to it");
    await press(it, "unknown");
    await answered(it);
    if ((await it.evaluate(NOW)).verdict.told === "new") break;
  }
  assert.match(await text(it, "verdict"), /^This is none of those I know/);
  assert.equal(await it.evaluate("document.getElementById('teach').hidden"), false);
  await set(it, "name", "my own cloth");
  await press(it, "learn");
  await it.until("it is learned", "!document.getElementById('taught').hidden");
  assert.match(await text(it, "taught-say"), /^Learned: my own cloth, from \d+ slides?\. It knows 21 textures/);
  await press(it, "again");
  await answered(it);
  const { verdict } = await it.evaluate(NOW);
  assert.equal(verdict.texture, "my own cloth");
  assert.match(await text(it, "truth"), /Right\.$/);
}));

test("worn skin is told as changed", () => opened("#speed=max&x=1", { motion: "reduce" }, async it => {
  const told = [];
  for (const wear of [0.1, 0.2, 0.3, 0.5, 0.75, 1]) {
    await set(it, "wear", String(wear));
    await press(it, "play");
    await answered(it);
    told.push((await it.evaluate(NOW)).verdict.told);
  }
  assert.ok(told.includes("changed") || told.includes("new"), told.join(" "));
  assert.notEqual(told.at(-1), "sure");
  return told.join(", ");
}));

test("pause, go on, next slide, stop of time", () => opened("#speed=1&x=1", { motion: "reduce" }, async it => {
  await press(it, "play");
  await it.until("time passes", `${NOW}.last?.at_ms > 0`);
  await press(it, "play");
  const at = (await it.evaluate(NOW)).last.at_ms;
  await new Promise(done => setTimeout(done, 300));
  assert.equal((await it.evaluate(NOW)).last.at_ms, at);
  assert.equal(await text(it, "play"), "Go on");
  await press(it, "step");
  assert.equal((await it.evaluate(NOW)).slides, 1);
  for (let n = 0; n < 12 && (await it.evaluate(NOW)).busy; n++) await press(it, "step");
  await answered(it);
}));

test("the paper's way, and a movement by hand", () => opened("#m=paper&n=12&speed=max&x=1", { motion: "reduce" }, async it => {
  await press(it, "play");
  await answered(it);
  assert.match(await text(it, "why"), /for (traction|roughness|fineness)/);
  await set(it, "force", "0.8");
  await set(it, "mms", "40");
  await press(it, "move");
  await it.until("it is measured", "/^Measured: traction/.test(document.getElementById('moved').textContent)");
}));

test("another number of textures, and another world", () => opened("#speed=max", { motion: "reduce" }, async it => {
  await set(it, "count", "117");
  await press(it, "apply");
  await it.until("it knows all", `${NOW}.known?.textures.length === 117`);
  assert.equal(await it.evaluate("document.getElementById('unknown').disabled"), true);
  await set(it, "count", "3");
  await set(it, "world", "2");
  await press(it, "apply");
  await it.until("it has learned another world", `${NOW}.known?.textures.length === 3`);
  await press(it, "surprise");
  await answered(it);
}));

test("all of it by keyboard, with names and visible focus", () => opened("#speed=max", { motion: "reduce" }, async it => {
  const seen = [];
  for (let n = 0; n < 40; n++) {
    await it.key("Tab", 9);
    const now = await it.evaluate(`(() => { const e = document.activeElement; if (!e || e === document.body) return null;
      const style = getComputedStyle(e); return { id: e.id, tag: e.tagName, ring: style.outlineStyle !== "none" }; })()`);
    if (!now) break;
    assert.ok(now.ring, `no focus ring at ${now.tag} ${now.id}`);
    seen.push(now.id);
  }
  for (const id of ["play", "step", "speed", "texture", "surprise", "unknown", "force", "mms", "move", "wear", "count", "method", "threshold", "alarm", "drift", "world", "apply", "link"])
    assert.ok(seen.includes(id), `${id} is not reached: ${seen}`);
  const { nodes } = await it.send("Accessibility.getFullAXTree");
  const nameless = nodes.filter(node => !node.ignored && ["button", "slider", "combobox", "textbox", "spinbutton", "meter", "progressbar", "image"].includes(node.role?.value) && !node.name?.value);
  assert.deepEqual(nameless.map(node => node.role.value), []);
  await it.evaluate("document.getElementById('surprise').focus()");
  await it.key("Enter", 13, "\r");
  await answered(it);
  assert.match(await text(it, "aloud"), /\w/);
}));

test("who wants no motion begins it", () => opened("", { motion: "reduce" }, async it => {
  await new Promise(done => setTimeout(done, 300));
  assert.equal((await it.evaluate(NOW)).busy, false);
}));

// relative luminance and contrast as WCAG 2.2 defines them
const CONTRAST = `(() => {
  const channel = v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const paper = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgb = colour => { paper.clearRect(0, 0, 1, 1); paper.fillStyle = colour; paper.fillRect(0, 0, 1, 1); return [...paper.getImageData(0, 0, 1, 1).data]; };
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const ground = e => { for (; e; e = e.parentElement) { const c = rgb(getComputedStyle(e).backgroundColor); if (c[3] === 255) return c; } return [255, 255, 255, 255]; };
  const poor = [];
  for (const e of document.querySelectorAll("body *")) {
    if (e.closest("svg, [hidden], .quiet, .hidden, script, style, option, optgroup, noscript") || ![...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())) continue;
    if (e.disabled || e.closest(":disabled")) continue;
    const [a, b] = [light(rgb(getComputedStyle(e).color)), light(ground(e))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) poor.push(e.tagName + "." + e.className + " " + contrast.toFixed(2) + " " + e.textContent.trim().slice(0, 30));
  }
  return poor;
})()`;
const CLIPPED = `[...document.querySelectorAll("body *")].filter(e => !e.closest("svg, .quiet, .hidden, .skip, .scroll, option, select, script, style, [hidden]") &&
  (e.getBoundingClientRect().right > innerWidth + 1 || (e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== "visible" && e.clientWidth > 0)))
  .map(e => e.tagName + "#" + e.id + "." + e.className + " " + e.textContent.trim().slice(0, 40))`;

test("no clipped text, and contrast AA, at every width in light and dark", async () => {
  for (const width of WIDTHS) {
    for (const scheme of ["light", "dark"]) {
      await opened("#speed=max&x=40&seed=3", { width, height: width < 500 ? 844 : 900, touch: width < 500, scheme }, async it => {
        await answered(it);
        await new Promise(done => setTimeout(done, 250));
        const wide = await it.evaluate("document.documentElement.scrollWidth");
        assert.ok(wide <= width, `${wide} px in ${width}`);
        assert.deepEqual(await it.evaluate(CLIPPED), [], `${width} ${scheme}`);
        assert.deepEqual(await it.evaluate(CONTRAST), [], `${width} ${scheme}`);
        if (width < 500) {
          const small = await it.evaluate("[...document.querySelectorAll('button, select, input')].filter(e => e.offsetParent && e.offsetHeight < 36).map(e => e.id)");
          assert.deepEqual(small, [], "too small for a finger");
        }
        writeFileSync(join(folder, `screenshot-${width}-${scheme}.png`), await it.screenshot(true));
      });
    }
  }
});

/// Ends everything when the time is up, also while this thread computes without end.
function watch() {
  const guard = new Worker(`
    const { parentPort, workerData } = require("node:worker_threads");
    const { writeSync } = require("node:fs");
    let name = "the start of the browser", browser = null;
    parentPort.on("message", now => { name = now.name ?? name; browser = now.browser ?? browser; });
    setTimeout(() => {
      writeSync(1, "FAILED " + name + "\\nnot over: all tests together have " + workerData + " s, and are ended now\\n");
      if (browser) try { process.kill(-browser, "SIGKILL"); } catch {}
      process.kill(process.pid, "SIGKILL");
    }, 1000 * workerData);
  `, { eval: true, workerData: ALL_S });
  guard.unref();
  return guard;
}

let passed = 0, failed = 0;
const began = Date.now();
const guard = watch();
const start = async () => {
  browser = await launch(chromium);
  guard.postMessage({ browser: browser.pid });
};
try {
  await start();
  for (const { name, run } of tests) {
    guard.postMessage({ name });
    const from = Date.now();
    try {
      const said = await within(TEST_S, `not over in ${TEST_S} s`, run());
      passed += 1;
      console.log(`ok     ${name} (${((Date.now() - from) / 1000).toFixed(1)} s)${said ? `: ${said}` : ""}`);
    } catch (why) {
      failed += 1;
      console.log(`FAILED ${name}\n${why.stack ?? why}`);
      // the next test gets a browser that nothing hangs in
      await browser.kill();
      await start();
    }
  }
} catch (why) {
  failed += 1;
  console.log(`FAILED the browser\n${why.stack ?? why}`);
} finally {
  await browser?.kill();
}
console.log(`${passed} of ${tests.length} passed in ${((Date.now() - began) / 1000).toFixed(0)} s`);
process.exit(failed ? 1 : 0);
