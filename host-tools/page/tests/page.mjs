// Tests of the page: node page.mjs INDEX.HTML MODULE.WASM REPLIES.JSONL CHROMIUM HOST:PORT
// At HOST:PORT is the serial port of a probe. With TACTUS_PAGE_ONLY=PART those tests alone whose name has that part.
import assert from "node:assert/strict";
import { AsyncLocalStorage } from "node:async_hooks";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { pathToFileURL } from "node:url";
import { Worker } from "node:worker_threads";
import { launch, tab, within } from "./browser.mjs";
import { ports } from "./port.mjs";
import { serial } from "./serial.mjs";

const [page, wasm, replies, chromium, probe] = process.argv.slice(2);
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
  const { request, ask, reply, world, memory } = instance.exports;
  const trials = readFileSync(new URL("../../lab/src/live/world-1.trials", import.meta.url));
  // the memory may grow
  const at = request(trials.length);
  trials.copy(Buffer.from(memory.buffer, at, trials.length));
  world();
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

ports(test);

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
  assert.ok(explorations >= 10, `${explorations}`);
  return `${explorations} explorations`;
});

test("memory stays flat over 60 explorations", async () => {
  const { ask, memory } = module();
  ask('{"do":"world","world":1,"textures":20,"paper":false,"drift":1,"trial":1}');
  ask('{"do":"prepare"}');
  const sizes = [];
  for (let n = 1; n <= 60; n++) {
    ask(`{"do":"identify","texture":${n % 117 + 1},"seed":${n},"threshold":0.99,"false_alarm":0.02,"max_slides":3}`);
    let frames = 0;
    for (let frame = '"busy":true'; frame.includes('"busy":true');) {
      frame = ask('{"do":"step","ms":200}');
      assert.ok(++frames < 3000, `exploration ${n} is not over after 10 minutes of rig time`);
    }
    sizes.push(memory.buffer.byteLength);
  }
  const [early, late] = [sizes[19], sizes[59]];
  assert.ok(late - early <= 65536, `${early} to ${late} bytes`);
  return `${(late / 2 ** 20).toFixed(1)} MB`;
});

// the browser of the row of tests that asks
const row = new AsyncLocalStorage();
async function opened(hash, options, run) {
  const it = await tab(row.getStore().browser, { width: 1280, height: 900, ...options });
  try {
    if (options.before) await options.before(it);
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

// What the story says, each line with its time.
const LINES = `window.lines = []; addEventListener("DOMContentLoaded", () => new MutationObserver(() => lines.push([performance.now(), document.getElementById("tale-say").textContent])).observe(document.getElementById("tale-say"), { childList: true }));`;

test("the first visit is a story of 15 to 20 s, with a line at each step, a pause and a replay", () => opened("", { height: 2600, before: it => it.before(LINES) }, async it => {
  const paint = await it.evaluate("performance.getEntriesByType('paint').find(p => p.name === 'first-contentful-paint').startTime");
  await answered(it);
  assert.match(await text(it, "verdict"), /^It is Cardboard, /);
  assert.match(await text(it, "truth"), /^Under the finger: Cardboard. Right\.$/);
  const lines = await it.evaluate("lines"), took = (lines.at(-1)[0] - lines[0][0]) / 1000;
  assert.ok(took >= 15 && took <= 20, `${took} s`);
  const chosen = lines.flatMap(([, line]) => line.match(/^Movement \d: (.* mm\/s), for/)?.[1] ?? []);
  assert.equal(new Set(chosen).size, 3, chosen.join("; "));
  assert.deepEqual(lines.map(([, line]) => line.split(" ")[0]), ["Cardboard", ..."Movement It After Movement It After Movement It It".split(" ")]);
  for (const [n, [at]] of lines.slice(1).entries()) assert.ok(at - lines[n][0] >= 500, `"${lines[n][1]}" stands for ${at - lines[n][0]} ms`);
  const now = await it.evaluate(NOW);
  assert.equal(await it.evaluate("document.querySelectorAll('#slides tr').length"), now.slides);
  assert.ok(await it.evaluate("document.querySelectorAll('#map .slide').length") >= 1);
  assert.equal(await it.evaluate("document.querySelectorAll('#posterior li').length"), 6);
  assert.equal(await it.evaluate("document.querySelectorAll('#benefit li.chosen').length"), 1);
  const inked = id => it.evaluate(`(() => { const c = document.getElementById("${id}"); return c.getContext("2d").getImageData(0, 0, c.width, c.height).data.some(v => v > 0); })()`);
  for (const id of ["pac", "spectrum", "pdc"]) assert.ok(await inked(id), id);
  const fps = await it.evaluate("tactus.framesPerSecond()");
  await press(it, "tale-again");
  await it.until("it is replayed", `lines.length > ${lines.length + 1} && ${NOW}.busy`);
  const again = (await it.evaluate("lines")).slice(lines.length);
  assert.deepEqual(again.map(([, line]) => line), lines.slice(0, again.length).map(([, line]) => line));
  await press(it, "tale-pause");
  const stands = (await it.evaluate(NOW)).last?.at_ms, said = (await it.evaluate("lines")).length;
  await new Promise(done => setTimeout(done, 3000));
  assert.deepEqual([(await it.evaluate(NOW)).last?.at_ms, (await it.evaluate("lines")).length, await text(it, "tale-pause")], [stands, said, "Go on"]);
  await press(it, "tale-pause");
  await it.until("it goes on", `lines.length > ${said}`);
  return `${took.toFixed(1)} s; first paint ${paint.toFixed(0)} ms, ready ${(await it.evaluate("tactus.ready")).toFixed(0)} ms, ${fps.toFixed(0)} frames a second`;
}));

test("the story waits for the panels to which the reader has not scrolled, then the probe is the usual one", () => opened("", { width: 390, height: 844, touch: true, before: it => it.before(LINES) }, async it => {
  for (const [panel, first] of [["mind", "Cardboard"], ["next", "Movement"], ["feel", "It slides"]]) {
    await it.until(`it waits for ${panel}`, `lines.at(-1)?.[1].startsWith("${first}") && !document.getElementById("tale-show").hidden`, 20);
    const said = (await it.evaluate("lines")).length;
    await new Promise(done => setTimeout(done, 3000));
    assert.equal((await it.evaluate("lines")).length, said, `it goes on without ${panel}`);
    await press(it, "tale-show");
  }
  await answered(it);
  await press(it, "tale-more");
  await it.until("another exploration", `${NOW}.busy && ${NOW}.set.x !== 8`);
  assert.deepEqual([await it.evaluate("document.getElementById('tale').hidden"), (await it.evaluate(NOW)).set.paper], [true, false]);
}));

test("every number is explained where it stands", () => opened("#m=paper&speed=max&seed=2&x=8", { motion: "reduce", width: 390 }, async it => {
  await press(it, "play");
  await answered(it);
  const rows = await it.evaluate("[...document.querySelectorAll('#benefit .value')].map(e => e.textContent)");
  assert.ok(rows.length === 6 && rows.every(row => /^leaves [<\d]/.test(row)), rows.join("; "));
  const why = await text(it, "why");
  const [, now, then, bits] = why.match(/Doubt is the chance .* from ([\d.]+)\s% to ([\d.]+)\s%, halved [\d.]+ times \(([\d.]+)\sbits\)\. One bit halves the doubt\./) ?? assert.fail(why);
  assert.ok(Math.abs(Math.log2(now / then) - bits) < 0.15, why);
  for (const [panel, words] of [["mind", /share 100/], ["log", /logarithm \(ln\) of the vibration's power in counts².*middle frequency in Hz/], ["feel", /in counts: the converter has 4096/]])
    assert.match(await it.evaluate(`document.querySelector(".${panel}").textContent`), words);
  const cut = await it.evaluate("(e => e.scrollWidth - e.clientWidth)(document.querySelector('.log .scroll'))");
  assert.equal(cut, 0, "the slides are cut off");
}));

test("where it says new, a sentence says what the shares beside it mean", () => opened("#speed=max&seed=5", { motion: "reduce" }, async it => {
  let high = 0;
  for (let n = 0; n < 12; n++) {
    await press(it, n % 3 ? "unknown" : "surprise");
    await answered(it);
    const { verdict } = await it.evaluate(NOW), resolved = /only the least unlike.*it is new\.$/.test(await text(it, "others"));
    assert.equal(resolved, verdict.told === "new", `${verdict.told}: ${await text(it, "others")}`);
    high += verdict.told === "new" && await it.evaluate("document.querySelector('#posterior .value').textContent.includes('99.9')");
  }
  assert.ok(high > 0, "no share of 99.9 % was seen beside new");
  return `${high} of 12 with 99.9 %`;
}));

test("a tab that is pressed can be read under the mouse", () => opened("", { motion: "reduce" }, async it => {
  const [x, y] = await it.evaluate("(b => [b.left + 9, b.top + 9])(document.getElementById('from-sim').getBoundingClientRect())");
  await it.send("Input.dispatchMouseEvent", { type: "mouseMoved", x, y });
  assert.ok(await it.evaluate("document.getElementById('from-sim').matches(':hover')"));
  for (const scheme of ["light", "dark"]) {
    await it.size(1280, 900, false, scheme);
    assert.deepEqual(await it.evaluate(CONTRAST), [], scheme);
  }
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

test("worn skin is told by its name, then as new, and the scale says the same", () => opened("#speed=max", { motion: "reduce" }, async it => {
  const all = [];
  for (const place of [0, 3]) {
    const told = [];
    await set(it, "wear", "0");
    await set(it, "texture", String((await it.evaluate(NOW)).known.numbers[place]));
    for (let step = 0; step < 20 && told.at(-1) !== "new"; step++) {
      await press(it, "worn");
      await answered(it);
      const { verdict } = await it.evaluate(NOW);
      told.push(verdict.told);
      if (["sure", "changed"].includes(verdict.told)) assert.equal(verdict.texture, (await it.evaluate(NOW)).known.textures[place]);
      const zone = await it.evaluate("document.getElementById('novel-meter').dataset.zone");
      if (verdict.told !== "undecided") assert.equal(zone, { sure: "known", changed: "changed", new: "new" }[verdict.told], told.join(" "));
    }
    assert.equal(told[0], "sure", told.join(" "));
    assert.equal(told.at(-1), "new", told.join(" "));
    all.push(told.filter((one, n) => one !== told[n - 1]).join(" to "));
  }
  return all.join("; ");
}));

const OVERLAPS = `(() => {
  const names = [...document.querySelectorAll("#map text")].filter(e => e.getAttribute("visibility") === "visible").map(e => ({ name: e.textContent, box: e.getBoundingClientRect() }));
  const map = document.getElementById("map").getBoundingClientRect();
  const found = names.filter(({ box }) => box.left < map.left - 1 || box.right > map.right + 1 || box.top < map.top - 1 || box.bottom > map.bottom + 1).map(({ name }) => name + " sticks out");
  names.forEach((a, n) => { for (const b of names.slice(n + 1)) if (a.box.left < b.box.right && b.box.left < a.box.right && a.box.top + 2 < b.box.bottom && b.box.top + 2 < a.box.bottom) found.push(a.name + " lies on " + b.name); });
  return { found, names: names.length };
})()`;

test("no name on the map lies on another", async () => {
  const counts = [];
  for (const [hash, width] of [["#speed=max&n=24&seed=3", 1280], ["#speed=max&n=20&seed=8", 390], ["#speed=max&n=117&seed=5", 768]]) {
    await opened(hash, { width, motion: "reduce" }, async it => {
      await press(it, "surprise");
      for (let n = 0; n < 3 && (n === 0 || (await it.evaluate(NOW)).busy); n++) {
        await press(it, "step");
        const { found, names } = await it.evaluate(OVERLAPS);
        assert.deepEqual(found, [], `${hash} ${width}`);
        counts.push(names);
      }
    });
  }
  assert.ok(counts[0] >= 8, counts.join(" "));
  return `${counts.join(", ")} names`;
});

const usb = async run => {
  let line;
  const before = async it => { line = await serial(it, probe); };
  try {
    return await opened("#speed=max&t=0.99", { motion: "reduce", before }, async it => {
      await press(it, "from-usb");
      await press(it, "u-connect");
      await it.until("the probe has said how it is", "tactus.usb()?.connected && !tactus.usb().busy", 30);
      return run(it, line.unplug);
    });
  } finally {
    line?.end();
  }
};
const idle = (it, what, seconds = 60) => it.until(what, "!tactus.usb()?.busy", seconds);
const said = it => text(it, "u-said");
const kept = async it => new Map((await it.evaluate("tactus.files()")).map(({ name, bytes }) => [name, Buffer.from(bytes)]));

test("a probe at a serial port: status, identify, teach, verify, log", () => usb(async it => {
  assert.match(await said(it), /^probe +at USB 0483:374b$/m);
  assert.match(await said(it), /^finger +biotac/m);
  await press(it, "u-identify");
  await it.until("it slides", "tactus.usb().phase === 'Sliding'", 60);
  assert.equal(await it.evaluate("document.getElementById('u-identify').disabled"), true);
  await idle(it, "an answer", 150);
  assert.match(await said(it), /An unknown texture, one of \d+ [^]*Slide 1: [^]*because it should leave/);
  assert.match(await text(it, "verdict"), /^(It is |It feels like |This is none|Not sure)/);
  assert.ok(await it.evaluate("document.querySelectorAll('#map .slide').length") >= 1);
  assert.equal(await it.evaluate("document.querySelectorAll('#slides tr').length"), (await it.evaluate(NOW)).slides);
  writeFileSync(join(folder, "screenshot-identified-1280.png"), await it.screenshot(true));
  await set(it, "u-name", "my own cloth");
  await press(it, "u-teach");
  await idle(it, "it is taught");
  assert.match(await said(it), /The probe has learned my own cloth from \d+ slides?\./);
  assert.equal(await text(it, "u-problem"), "");
  await set(it, "u-known", "my own cloth");
  await press(it, "u-verify");
  await idle(it, "it is verified", 150);
  assert.match(await said(it), /Is it my own cloth\?[^]*The same as my own cloth/);
  await press(it, "u-log");
  const log = (await kept(it)).get("session.jsonl").toString();
  const lines = log.trimEnd().split("\n").map(line => JSON.parse(line));
  assert.deepEqual(Object.keys(lines[0]), ["session"]);
  assert.ok(lines.some(({ report }) => report?.event?.Verdict), "no verdict in the log");
  return `${lines.length} lines of log`;
}));

// Sixteen-bit WAV: noise about a frequency, as loud as this.
function wav(hz, loud, seed, seconds = 3, rate = 4000) {
  const bytes = Buffer.alloc(44 + 2 * seconds * rate);
  bytes.write("RIFF"); bytes.writeUInt32LE(bytes.length - 8, 4); bytes.write("WAVEfmt ", 8); bytes.writeUInt32LE(16, 16); bytes.writeUInt16LE(1, 20); bytes.writeUInt16LE(1, 22);
  bytes.writeUInt32LE(rate, 24); bytes.writeUInt32LE(2 * rate, 28); bytes.writeUInt16LE(2, 32); bytes.writeUInt16LE(16, 34); bytes.write("data", 36); bytes.writeUInt32LE(2 * seconds * rate, 40);
  let state = seed, a = 0, b = 0;
  const turn = 2 * 0.97 * Math.cos(2 * Math.PI * hz / rate);
  for (let n = 0; n < seconds * rate; n++) {
    state = Math.imul(state, 1664525) + 1013904223 >>> 0;
    [a, b] = [turn * a - 0.97 * 0.97 * b + state / 2 ** 31 - 1, a];
    bytes.writeInt16LE(Math.max(-32767, Math.min(32767, Math.round(loud * a))), 44 + 2 * n);
  }
  return bytes;
}
const csv = bytes => Buffer.from("time_s,acc_g\n" + Array.from({ length: (bytes.length - 44) / 2 }, (_, n) => `${n / 4000},${bytes.readInt16LE(44 + 2 * n) / 1000}`).join("\n"));
const give = (it, files) => it.evaluate(`(() => { const to = new DataTransfer(); for (const [name, bytes] of ${JSON.stringify(files.map(([name, bytes]) => [name, bytes.toString("base64")]))}) to.items.add(new File([Uint8Array.from(atob(bytes), c => c.charCodeAt(0))], name));
  const e = document.getElementById("o-files"); e.files = to.files; e.dispatchEvent(new Event("change")); })()`);
const verdicts = it => it.evaluate("[...document.querySelectorAll('#o-slides tr')].map(row => [...row.cells].map(cell => cell.textContent))");
const SOUNDS = [["cork", 150, 200], ["felt", 300, 260], ["silk", 500, 150], ["wool", 800, 300]];
const sounds = (end, as) => SOUNDS.flatMap(([name, hz, loud], t) => [1, 2, 3, 4].map(n => [`${name}-${n}.${end}`, as(wav(hz, loud * (1 + n / 50), 100 * t + n))]));

for (const [end, as] of [["wav", bytes => bytes], ["csv", csv]]) {
  test(`recordings of the user's own, as ${end}: map, spectra, and verdicts of tables that have not seen them`, () => opened("#x=1", { motion: "reduce" }, async it => {
    await press(it, "from-own");
    // one more cork, in truth another texture: a table that had seen it would know it
    await give(it, [...sounds(end, as), [`cork-5.${end}`, as(wav(650, 220, 999))]]);
    await it.until("verdicts", "document.querySelectorAll('#o-slides tr').length > 0 || !document.getElementById('o-problem').hidden");
    assert.equal(await text(it, "o-problem"), "");
    assert.match(await text(it, "o-say"), /^16 of 17 right, 1 (new|not sure|wrong), one slide each, by tables that have not seen the recording\.$/);
    const rows = await verdicts(it);
    for (const [recording, texture, told] of rows) assert.equal(told === "right", recording !== `cork-5.${end}`, `${recording} ${texture} ${told}`);
    assert.equal(await it.evaluate("document.querySelectorAll('#map .mark').length"), 17);
    assert.equal(await it.evaluate("document.querySelectorAll('#map .dot').length"), 4);
    assert.match(await text(it, "o-what"), /^17 slides of 4 textures .* 4000 Hz/);
    // of each slide the spectrum is loudest where its sound is
    for (const { texture, recording, spectrum } of await it.evaluate("tactus.own().slides")) {
      const hz = recording.startsWith("cork-5") ? 650 : SOUNDS.find(([name]) => name === texture)[1], loudest = (spectrum.indexOf(Math.max(...spectrum)) + 0.5) * 17.19;
      assert.ok(Math.abs(loudest - hz) < 40, `${recording}: ${loudest} Hz`);
    }
    assert.ok(await it.evaluate(`(c => c.getContext("2d").getImageData(0, 0, c.width, c.height).data.some(v => v > 0))(document.getElementById("o-spectra"))`));
    await looksRight(it, [390, 1280], async (width, scheme) => writeFileSync(join(folder, `screenshot-own-${end}-${width}-${scheme}.png`), await it.screenshot(true)));
    return text(it, "o-say");
  }));
}

test("recordings of the user's own: what cannot be read is said, then it is read with what was asked for", () => opened("#x=1", { motion: "reduce" }, async it => {
  await press(it, "from-own");
  await give(it, [["notes.csv", Buffer.from("nothing here")]]);
  await it.until("it says why", "!document.getElementById('o-problem').hidden");
  assert.match(await text(it, "o-problem"), /^notes\.csv: /);
  const bare = sounds("csv", csv).map(([name, bytes]) => [name, Buffer.from(bytes.toString().split("\n").map(line => line.split(",")[1]).join("\n"))]);
  await give(it, bare);
  await it.until("it asks for the rate", "/no rate/.test(document.getElementById('o-problem').textContent)");
  await set(it, "o-rate", "4000");
  await press(it, "o-again");
  await it.until("verdicts", "document.querySelectorAll('#o-slides tr').length > 0");
  assert.match(await text(it, "o-say"), /^16 of 16 right, /);
  await press(it, "from-sim");
  await it.until("the probe is back", `${NOW}.known?.textures.length === 20`);
  assert.equal(await it.evaluate("document.querySelectorAll('#map .mark').length"), 0);
}));

// The page as it is, at each of these sizes in light and dark: nothing is clipped, every text can be read.
async function looksRight(it, widths, seen) {
  for (const width of widths) {
    const height = width < 500 ? 844 : 900;
    for (const scheme of ["light", "dark"]) {
      await it.size(width, height, width < 500, scheme);
      await new Promise(done => setTimeout(done, 250));
      const at = `${width} ${scheme}`;
      const wide = await it.evaluate("document.documentElement.scrollWidth");
      assert.ok(wide <= width, `${wide} px in ${at}`);
      assert.deepEqual(await it.evaluate(CLIPPED), [], at);
      assert.deepEqual(await it.evaluate(CONTRAST), [], at);
      if (width < 500) {
        const small = await it.evaluate("[...document.querySelectorAll('button, select, input')].filter(e => e.offsetParent && e.offsetHeight < 36).map(e => e.id)");
        assert.deepEqual(small, [], `too small for a finger: ${at}`);
      }
      await seen(width, scheme);
    }
  }
}

test("the lens's caption lies on nothing, wherever the stage is", () => opened("", { motion: "reduce" }, async it => {
  const found = await it.evaluate(`(() => {
    const caption = document.getElementById("lens-say").getBoundingClientRect(), svg = document.getElementById("rig").getBoundingClientRect(), found = [];
    if (caption.top < svg.top || caption.right > svg.right) found.push("it sticks out");
    for (let stage = 0; stage <= 160; stage += 4) for (const tip of [0.5, 8, 16, 40]) {
      Rig.show({ tip_mm: tip, indentation_mm: -1, stage_mm: stage, speed_mm_s: 60, texture: 40 });
      for (const e of document.querySelectorAll("#rig :is(.sample, .shim, .plate, .lever, .skin, .bone, .ridge, circle.lens)")) {
        if (e.closest("clipPath, [clip-path]")) continue;
        const box = e.getBoundingClientRect();
        if (box.width && box.left < caption.right && caption.left < box.right && box.top < caption.bottom && caption.top < box.bottom) found.push(e.getAttribute("class") + " at " + stage + " " + tip);
      }
    }
    return found;
  })()`);
  assert.deepEqual(found, []);
}));

test("a probe at a serial port: names, settings, and the sample is moved between trials", () => usb(async it => {
  const asks = async (what, words) => {
    await it.until(what, "!document.getElementById('u-question').hidden", 150);
    assert.match(await text(it, "u-asked"), words);
  };
  await set(it, "u-name", "Loden");
  await set(it, "u-trials", "2");
  await press(it, "u-train");
  await asks("it asks", /^Move or turn Loden under the finger, so that the next slide is on another track\.$/);
  assert.equal(await text(it, "u-yes"), "It is moved");
  await press(it, "u-yes");
  await it.until("it is noted", "document.getElementById('u-said').textContent.includes('moved between')", 150);
  await idle(it, "it is trained", 150);
  assert.match(await said(it), /Loden: 6 slides made\.[^]*Its sample was moved between trials\./);
  await set(it, "u-which", "Loden");
  await set(it, "u-new", "Loden, green");
  await press(it, "u-rename");
  await idle(it, "it is renamed");
  assert.match(await said(it), /Loden is Loden, green now\./);
  await set(it, "u-which", "Loden, green");
  await press(it, "u-forget");
  await asks("it asks", /^The probe is to forget Loden, green\.\nThe probe's table is kept: table-[0-9a-f]{8}\.tact\nGo on\?$/);
  await press(it, "u-no");
  await idle(it, "nothing is done");
  assert.equal(await text(it, "u-problem"), "Nothing was changed.");
  await press(it, "u-forget");
  await asks("it asks again", /forget Loden/);
  for (const [width, height] of [[390, 844], [1280, 900]]) {
    await it.send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: width < 500 });
    assert.deepEqual(await it.evaluate(CLIPPED), [], `${width}`);
    assert.deepEqual(await it.evaluate(CONTRAST), [], `${width}`);
    writeFileSync(join(folder, `screenshot-question-${width}.png`), await it.screenshot(true));
  }
  await press(it, "u-yes");
  await idle(it, "it is forgotten");
  assert.match(await said(it), /The probe has forgotten Loden, green\./);
  assert.ok([...(await kept(it)).keys()].some(name => /^table-[0-9a-f]{8}\.tact$/.test(name)));
  await set(it, "u-share", "0.005");
  await press(it, "u-alarm");
  await idle(it, "it is set");
  assert.match(await said(it), /The probe's limits are for 0\.5 % false alarms, as set/);
  await press(it, "u-high");
  await asks("it asks", /a mount whose spring yields[^]*Does the finger's mount yield, or does a stop hold the lever\?$/);
  await press(it, "u-no");
  await idle(it, "it stays");
  await set(it, "u-share", "");
  await press(it, "u-alarm");
  await idle(it, "it is set back");
  assert.match(await said(it), /The probe's limits are for the table's own false alarms/);
  await press(it, "u-factory");
  await asks("it asks", /is replaced[^]*Go on\?$/);
  await press(it, "u-yes");
  await idle(it, "the factory table is in use");
  assert.match(await said(it), /The probe uses the firmware's own table: /);
}));

test("a probe at a serial port: stop, record, tables, and a plug that is pulled", () => usb(async (it, unplug) => {
  await press(it, "u-identify");
  await it.until("it slides", "tactus.usb().phase === 'Sliding'", 60);
  await press(it, "u-stop");
  await idle(it, "it stands", 60);
  assert.equal(await text(it, "u-problem"), "Stopped: the finger is lifted and the stage stands.");
  await set(it, "u-name", "Cloth 2");
  await set(it, "u-slides", "2");
  await press(it, "u-record");
  await idle(it, "it is recorded", 150);
  assert.equal(await text(it, "u-problem"), "");
  await press(it, "u-pull");
  await idle(it, "its table is there");
  let files = await kept(it);
  const zip = files.get("cloth-2.zip");
  assert.equal(zip.readUInt32LE(0), 0x04034b50);
  assert.ok(zip.includes("cloth-2/manifest.csv") && zip.includes("cloth-2/t001_s002_pac.npy"));
  const [table, bytes] = [...files].find(([name]) => name.endsWith(".tact"));
  assert.match(table, /^table-[0-9a-f]{8}\.tact$/);
  const push = content => it.evaluate(`(() => { const to = new DataTransfer(); to.items.add(new File([Uint8Array.from(${JSON.stringify([...content])})], "given.tact")); const e = document.getElementById("u-push"); e.files = to.files; e.dispatchEvent(new Event("change")); })()`);
  const damaged = Buffer.from(bytes);
  damaged[40] ^= 1;
  await push(damaged);
  await it.until("a damaged table is refused", "document.getElementById('u-problem').textContent.startsWith('given.tact: ')", 20);
  await push(bytes);
  await it.until("the table is there, or a question", "/given.tact: the probe uses it now/.test(document.getElementById('u-said').textContent) || !document.getElementById('u-question').hidden", 30);
  unplug();
  await it.until("it is told", "/closed the port; open it again/.test(document.getElementById('u-problem').textContent)", 20);
  assert.equal(await text(it, "u-connect"), "Connect a probe");
}));

test("a probe at a serial port: a line that is disturbed, and a plug that comes back", () => usb(async (it, unplug) => {
  const works = async () => {
    const before = (await said(it)).split("table ").length;
    await press(it, "u-status");
    await idle(it, "it says how it is");
    assert.ok((await said(it)).split("table ").length > before, await said(it));
    assert.equal(await text(it, "u-problem"), "");
  };
  await works();
  for (const name of ["FramingError", "BreakError", "ParityError", "BufferOverrunError", "UnknownError"]) {
    await it.evaluate(`tactusSerialFails("${name}", false)`);
    await it.until("it reads again", "document.getElementById('u-said').textContent.length > 0");
    await works();
    assert.equal(await text(it, "u-connect"), "Disconnect", name);
  }
  assert.match(await said(it), /The line is disturbed, and bytes are lost: FramingError\./);
  await it.evaluate("for (let n = 0; n < 20; n++) setTimeout(() => tactusSerialFails('BreakError', false), 10 * n)");
  await new Promise(done => setTimeout(done, 300));
  await works();
  for (let n = 0; n < 2; n++) {
    unplug();
    await it.until("it is told", "/closed the port; open it again/.test(document.getElementById('u-problem').textContent)", 20);
    assert.equal(await text(it, "u-connect"), "Connect a probe");
    await press(it, "u-connect");
    await it.until("it is connected again", "tactus.usb()?.connected && !tactus.usb().busy", 30);
    await works();
  }
  await press(it, "u-connect");
  await it.until("it is left", "document.getElementById('u-connect').textContent === 'Connect a probe'");
  await press(it, "u-connect");
  await it.until("it is connected once more", "tactus.usb()?.connected && !tactus.usb().busy", 30);
  await works();
}));

test("without Web Serial it says which browsers have it", () => opened("", { motion: "reduce", before: it => it.before("delete Navigator.prototype.serial") }, async it => {
  await press(it, "from-usb");
  assert.equal(await it.evaluate("document.getElementById('u-all').hidden"), true);
  assert.match(await text(it, "u-none"), /Chrome, Edge and Opera/);
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
const CLIPPED = `[...document.querySelectorAll("body *")].filter(e => !e.closest("svg, .quiet, .hidden, .skip, option, select, script, style, [hidden]") &&
  (e.getBoundingClientRect().right > innerWidth + 1 || (e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== "visible" && e.clientWidth > 0)))
  .map(e => e.tagName + "#" + e.id + "." + e.className + " " + e.textContent.trim().slice(0, 40))`;

test("no clipped text, and contrast AA, at every width in light and dark", async () => {
  const shot = (it, name) => async (width, scheme) => writeFileSync(join(folder, `screenshot-${name}${width}-${scheme}.png`), await it.screenshot(true));
  for (const source of ["usb"]) {
    await opened("", { motion: "reduce", before: it => serial(it, probe) }, async it => {
      await press(it, `from-${source}`);
      await looksRight(it, [390, 1280], shot(it, `${source}-`));
    });
  }
  await opened("#speed=max&x=40&seed=3", {}, async it => {
    await answered(it);
    await looksRight(it, WIDTHS, shot(it, ""));
  });
});

/// Ends everything when the time is up, also while this thread computes without end.
function watch() {
  const guard = new Worker(`
    const { parentPort, workerData } = require("node:worker_threads");
    const { writeSync } = require("node:fs");
    const names = new Map(), browsers = new Set();
    parentPort.on("message", ({ row, name, browser }) => { if (name) names.set(row, name); if (browser) browsers.add(browser); });
    setTimeout(() => {
      writeSync(1, "FAILED " + [...names.values()].join(", or ") + "\\nnot over: all tests together have " + workerData + " s, and are ended now\\n");
      for (const browser of browsers) try { process.kill(-browser, "SIGKILL"); } catch {}
      process.kill(process.pid, "SIGKILL");
    }, 1000 * workerData);
  `, { eval: true, workerData: ALL_S });
  guard.unref();
  return guard;
}

let passed = 0, failed = 0;
const began = Date.now();
const guard = watch();

/// Tests one after the other, in a browser of their own if they want one.
async function each(name, some, wantsBrowser) {
  const here = { browser: null };
  const start = async () => {
    guard.postMessage({ row: name, name: `the start of the browser for ${name}` });
    here.browser = wantsBrowser ? await launch(chromium) : null;
    guard.postMessage({ row: name, browser: here.browser?.pid });
  };
  try {
    await start();
    for (const { name: test, run } of some) {
      guard.postMessage({ row: name, name: test });
      const from = Date.now();
      try {
        const said = await within(TEST_S, `not over in ${TEST_S} s`, row.run(here, run));
        passed += 1;
        console.log(`ok     ${test} (${((Date.now() - from) / 1000).toFixed(1)} s)${said ? `: ${said}` : ""}`);
      } catch (why) {
        failed += 1;
        console.log(`FAILED ${test}\n${why.stack ?? why}`);
        // the next test gets a browser that nothing hangs in
        await here.browser?.kill();
        await start();
      }
    }
  } catch (why) {
    failed += 1;
    console.log(`FAILED the browser\n${why.stack ?? why}`);
  } finally {
    await here.browser?.kill();
  }
}

const wanted = tests.filter(({ name }) => name.includes(process.env.TACTUS_PAGE_ONLY ?? ""));
const isSerial = ({ name }) => name.startsWith("a probe at a serial port");
const isModules = ({ name }) => /^(WebAssembly|memory)/.test(name);
// the module's tests compute in this thread, which carries the probe's bytes; a probe takes its time, and the processor has some left
await each("the module", wanted.filter(isModules), false);
await Promise.all([
  each("the probe", wanted.filter(isSerial), true),
  each("the page", wanted.filter(one => !isSerial(one) && !isModules(one)), true),
]);
console.log(`${passed} of ${passed + failed} passed in ${((Date.now() - began) / 1000).toFixed(0)} s`);
process.exit(failed ? 1 : 0);
