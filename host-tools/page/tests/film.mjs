// Makes the README's film of the first visit: node film.mjs INDEX.HTML CHROMIUM FILM.WEBP
import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { launch, tab } from "./browser.mjs";

const [page, chromium, film] = process.argv.slice(2);
/// Frames a second, how much faster than life, how long the end stands, how well a frame is kept.
const FPS = 8, FASTER = 1.2, END_MS = 2000, QUALITY = 0.33;
const WIDE = 1400, SCALE = 0.7;

// The page's clock stands unless `advance` moves it.
const CLOCK = `(() => { let now = 0, waiting = []; performance.now = () => now; window.requestAnimationFrame = f => waiting.push(f);
  window.advance = ms => { now += ms; const due = waiting; waiting = []; for (const f of due) f(now); }; })();`;
// What is new of a picture: its blocks of 16 pixels that have changed, the others transparent, as a file of WebP.
const CHANGES = `(() => { let shown = null; window.changes = async (png, quality) => {
  const bytes = Uint8Array.from(atob(png), c => c.charCodeAt(0)), picture = await createImageBitmap(new Blob([bytes])), { width, height } = picture;
  const canvas = new OffscreenCanvas(width, height), context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0);
  const now = context.getImageData(0, 0, width, height), before = shown;
  shown = new ImageData(now.data.slice(), width, height);
  let changed = before === null;
  for (let top = 0; before && top < height; top += 16) for (let left = 0; left < width; left += 16) {
    const wide = Math.min(16, width - left), high = Math.min(16, height - top);
    let same = true;
    for (let y = top; same && y < top + high; y++) for (let at = 4 * (y * width + left), end = at + 4 * wide; same && at < end; at++) same = Math.abs(now.data[at] - before.data[at]) < 4;
    if (same) context.clearRect(left, top, wide, high); else changed = true;
  }
  if (!changed) return null;
  const file = new Uint8Array(await (await canvas.convertToBlob({ type: "image/webp", quality })).arrayBuffer());
  let text = "";
  for (const byte of file) text += String.fromCharCode(byte);
  return { width, height, file: btoa(text) };
}; })();`;

const u24 = n => Buffer.from([n & 255, n >> 8 & 255, n >> 16]);
const chunk = (name, ...parts) => {
  const body = Buffer.concat(parts), size = Buffer.alloc(4);
  size.writeUInt32LE(body.length);
  return Buffer.concat([Buffer.from(name), size, body, Buffer.alloc(body.length % 2)]);
};
// The chunks of a still picture that a frame is made of (WebP container specification).
function picture(file) {
  const parts = [];
  for (let at = 12; at < file.length;) {
    const size = file.readUInt32LE(at + 4), end = at + 8 + size + size % 2;
    if (["ALPH", "VP8 ", "VP8L"].includes(file.toString("latin1", at, at + 4))) parts.push(file.subarray(at, end));
    at = end;
  }
  return Buffer.concat(parts);
}

const browser = await launch(chromium);
try {
  // a tab behind another one draws nothing
  const helper = await tab(browser, { width: 100, height: 100 }), it = await tab(browser, { width: WIDE, height: 1700 });
  await it.send("Emulation.setDeviceMetricsOverride", { width: WIDE, height: 1700, deviceScaleFactor: SCALE, mobile: false });
  await it.send("Emulation.setScrollbarsHidden", { hidden: true });
  await it.before(CLOCK);
  await helper.evaluate(CHANGES);
  await it.send("Page.navigate", { url: String(pathToFileURL(page)) });
  await it.until("the probe is ready", "(window.advance?.(20), window.tactus?.ready > 0 && tactus.now().busy)");
  // the controls below are no part of it
  const high = await it.evaluate(`(() => { for (const e of document.querySelectorAll(".set, .finger, .hand, footer")) e.hidden = true;
    return Math.ceil((document.querySelector(".log").getBoundingClientRect().top + 262 + document.getElementById("tale").offsetHeight) / 2) * 2; })()`);
  await it.send("Emulation.setDeviceMetricsOverride", { width: WIDE, height: high, deviceScaleFactor: SCALE, mobile: false });
  const frames = [];
  let size;
  for (let over = false, n = 0; !over; n++) {
    if (n > 40 * FPS) throw new Error("the story has no end");
    over = await it.evaluate("!tactus.now().busy && tactus.now().verdict !== null");
    // what moves by itself gets there
    await new Promise(done => setTimeout(done, over ? 700 : 120));
    const { data } = await it.send("Page.captureScreenshot", { format: "png" });
    const changed = await helper.evaluate(`changes("${data}", ${QUALITY})`);
    if (changed) { size ??= changed; frames.push({ data: picture(Buffer.from(changed.file, "base64")), ms: 0 }); }
    frames.at(-1).ms += over ? END_MS : Math.round(1000 / FPS);
    for (let part = 0; part < 5; part++) await it.evaluate(`advance(${1000 * FASTER / FPS / 5})`);
  }
  const [w, h] = [u24(size.width - 1), u24(size.height - 1)];
  const all = frames.map(({ data, ms }) => chunk("ANMF", u24(0), u24(0), w, h, u24(ms), Buffer.from([0]), data));
  const body = Buffer.concat([Buffer.from("WEBP"), chunk("VP8X", Buffer.from([0x12, 0, 0, 0]), w, h), chunk("ANIM", Buffer.alloc(6)), ...all]);
  const file = chunk("RIFF", body);
  writeFileSync(film, file);
  console.log(`${film}: ${frames.length} frames, ${(frames.reduce((sum, { ms }) => sum + ms, 0) / 1000).toFixed(1)} s, ${size.width} x ${size.height}, ${file.length} bytes`);
} finally {
  await browser.kill();
}
