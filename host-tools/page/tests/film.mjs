// The README's moving picture, from the page: node film.mjs INDEX.HTML OUT.webp CHROMIUM
// Chromium's screenshots of one exploration, put one after the other into an animated WebP: no program that makes films is needed.
import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { launch, tab } from "./browser.mjs";

const [page, out, chromium] = process.argv.slice(2);
const WIDTH = 1280, HIGH = 830, A_SECOND = 4, SECONDS = 30, LAST_S = 4, QUALITY = 45, MOST_BYTES = 2_000_000;
// one that takes two slides or more, so that it is seen to choose
const LINK = "#n=117&t=0.9999&x=80&seed=5";

const browser = await launch(chromium);
const frames = [];
try {
  const it = await tab(browser, { width: WIDTH, height: HIGH });
  await it.open(`${pathToFileURL(page)}${LINK}`);
  await it.until("the probe is ready", "window.tactus?.ready > 0");
  // without the title: the rig and what it knows fill the picture
  await it.evaluate("scrollBy({ top: document.querySelector('.stage').getBoundingClientRect().top - 10, behavior: 'instant' })");
  const began = Date.now();
  let over = null;
  for (let n = 0; ; n++) {
    const { data } = await it.send("Page.captureScreenshot", { format: "webp", quality: QUALITY });
    frames.push({ at: (Date.now() - began) / 1000, data });
    const seconds = (Date.now() - began) / 1000;
    const { busy, verdict } = await it.evaluate("tactus.now()");
    if (!busy && verdict) over ??= seconds;
    if (over !== null && seconds > over + 1 || seconds > SECONDS) break;
    const due = (n + 1) / A_SECOND * 1000 - (Date.now() - began);
    if (due > 0) await new Promise(done => setTimeout(done, due));
  }
  if (over === null) throw new Error(`no answer in ${SECONDS} s: choose another link`);
  if (it.errors.length) throw new Error(it.errors.join("\n"));
} finally {
  await browser.kill();
}

// a picture like the one before lasts longer instead
const shown = frames.filter(({ data }, n) => n === 0 || data !== frames[n - 1].data);
const until = n => n + 1 < shown.length ? shown[n + 1].at : shown[n].at + LAST_S;

const number = (value, bytes) => Buffer.from(Array.from({ length: bytes }, (_, n) => (value >>> (8 * n)) & 0xff));
const chunk = (name, ...parts) => {
  const content = Buffer.concat(parts);
  return Buffer.concat([Buffer.from(name), number(content.length, 4), content, Buffer.alloc(content.length % 2)]);
};
/// The chunks of a WebP file that are its picture.
function picture(file) {
  const parts = [];
  for (let at = 12; at + 8 <= file.length;) {
    const length = file.readUInt32LE(at + 4), end = at + 8 + length + length % 2;
    if (["VP8 ", "VP8L", "ALPH"].includes(file.toString("latin1", at, at + 4))) parts.push(file.subarray(at, end));
    at = end;
  }
  return Buffer.concat(parts);
}
// the container of RFC 9649: what it is, that it goes on for ever, and each picture over the one before
const size = Buffer.concat([number(WIDTH - 1, 3), number(HIGH - 1, 3)]);
const film = [chunk("VP8X", number(0x02, 4), size), chunk("ANIM", number(0xffffffff, 4), number(0, 2))];
shown.forEach(({ at, data }, n) => {
  const lasts = number(Math.round(1000 * (until(n) - at)), 3);
  film.push(chunk("ANMF", number(0, 6), size, lasts, number(0x02, 1), picture(Buffer.from(data, "base64"))));
});
const webp = chunk("RIFF", Buffer.from("WEBP"), ...film);
if (webp.length > MOST_BYTES) throw new Error(`${webp.length} bytes, ${MOST_BYTES} are allowed: fewer pictures, or a lower quality`);
writeFileSync(out, webp);
console.log(`${out}: ${shown.length} pictures, ${until(shown.length - 1).toFixed(0)} s, ${webp.length} bytes`);
