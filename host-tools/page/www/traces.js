"use strict";
// Traces that scroll: vibration, its spectrum, pressure.
const Traces = (() => {
  const PAC_HZ = 2200, PDC_HZ = 100;
  const PAC_S = 3, PDC_S = 30;
  const pac = {}, pdc = {};
  // one spectrum every 64 samples
  const COLUMNS = Math.round(PAC_S * PAC_HZ / 64), ROWS = 64;
  let spectra = [];
  let changed = true;

  function add(to, values) {
    to.values.push(...values);
    const most = to.seconds * to.hz;
    if (to.values.length > most) to.values.splice(0, to.values.length - most);
  }

  function take(frame) {
    if (!frame.pac.length && !frame.pdc.length && !frame.spectra.length) return;
    changed = true;
    add(pac, frame.pac);
    add(pdc, frame.pdc);
    spectra.push(...frame.spectra);
    if (spectra.length > COLUMNS) spectra.splice(0, spectra.length - COLUMNS);
  }

  function clear() {
    Object.assign(pac, { seconds: PAC_S, hz: PAC_HZ, values: [] });
    Object.assign(pdc, { seconds: PDC_S, hz: PDC_HZ, values: [] });
    spectra = []; changed = true;
  }
  clear();

  // The drawing surface at the screen's own resolution.
  function surface(canvas) {
    const ratio = Math.min(2, devicePixelRatio || 1);
    const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, wide, high);
    return { context, wide, high, ratio };
  }

  function line(canvas, trace, colour, low, high, unit, faint) {
    const { context, wide, high: tall, ratio } = surface(canvas);
    const most = trace.seconds * trace.hz, from = most - trace.values.length;
    const y = value => tall - (value - low) / (high - low) * tall;
    context.fillStyle = faint;
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.strokeStyle = colour;
    context.lineWidth = 1.2 * ratio;
    context.beginPath();
    // of many samples to a pixel, the lowest and the highest
    const perPixel = most / wide;
    for (let x = Math.max(0, Math.floor(from / perPixel)); x < wide; x++) {
      const begin = Math.max(0, Math.floor(x * perPixel - from)), end = Math.min(trace.values.length, Math.ceil((x + 1) * perPixel - from));
      if (begin >= end) continue;
      let least = Infinity, greatest = -Infinity;
      for (let n = begin; n < end; n++) { const v = trace.values[n]; if (v < least) least = v; if (v > greatest) greatest = v; }
      context.lineTo(x, y(greatest));
      if (least !== greatest) context.lineTo(x, y(least));
    }
    context.stroke();
    context.fillText(unit, 6 * ratio, 14 * ratio);
  }

  function range(values, least) {
    let low = Infinity, high = -Infinity;
    for (const v of values) { if (v < low) low = v; if (v > high) high = v; }
    if (low > high) { low = 0; high = 0; }
    const middle = (low + high) / 2, half = Math.max(least, (high - low) * 0.55);
    return [middle - half, middle + half];
  }

  function heat(canvas, dark) {
    const { context, wide, high } = surface(canvas);
    if (!spectra.length) return;
    const image = context.createImageData(COLUMNS, ROWS);
    for (let n = 0; n < spectra.length; n++) {
      const x = COLUMNS - spectra.length + n;
      for (let row = 0; row < ROWS; row++) {
        const share = Math.min(1, Math.max(0, (spectra[n][row] + 8) / 48));
        const at = ((ROWS - 1 - row) * COLUMNS + x) * 4;
        const [r, g, b] = shade(share, dark);
        image.data[at] = r; image.data[at + 1] = g; image.data[at + 2] = b; image.data[at + 3] = 255 * Math.min(1, share * 3);
      }
    }
    const small = new OffscreenCanvas(COLUMNS, ROWS);
    small.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(small, 0, 0, wide, high);
  }

  // From the ground over blue to the colour of touch: brighter, or on white darker, the louder.
  function shade(share, dark) {
    const stops = dark ? [[30, 40, 60], [90, 130, 190], [243, 148, 104], [255, 240, 210]] : [[222, 226, 228], [110, 160, 195], [168, 61, 24], [60, 14, 2]];
    const at = share * 3, n = Math.min(2, Math.floor(at)), part = at - n;
    return stops[n].map((from, k) => from + (stops[n + 1][k] - from) * part);
  }

  // Spectra as rows, the first one above.
  function rows(canvas, all) {
    canvas.style.height = `${Math.min(480, Math.max(96, 6 * all.length))}px`;
    const { context, wide, high } = surface(canvas), low = Math.min(...all.flat()), span = Math.max(1, Math.max(...all.flat()) - low);
    const small = new OffscreenCanvas(ROWS, all.length), image = new ImageData(ROWS, all.length), dark = matchMedia("(prefers-color-scheme: dark)").matches;
    all.forEach((one, row) => one.forEach((db, n) => image.data.set([...shade((db - low) / span, dark), 255], 4 * (row * ROWS + n))));
    small.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(small, 0, 0, wide, high);
  }

  function draw(canvases) {
    if (!changed) return;
    changed = false;
    const style = getComputedStyle(document.body);
    const of = name => { const probe = canvases.ink; probe.style.color = `var(${name})`; return getComputedStyle(probe).color; };
    void style;
    const [touch, data, soft] = ["--touch", "--data", "--soft"].map(of);
    const [low, high] = range(pac.values, 40);
    line(canvases.pac, pac, touch, low, high, `\u00b1${Math.round((high - low) / 2)} counts`, soft);
    const [down, up] = range(pdc.values, 20);
    line(canvases.pdc, pdc, data, down, up, `${Math.round(down)} to ${Math.round(up)} counts`, soft);
    heat(canvases.spectrum, matchMedia("(prefers-color-scheme: dark)").matches);
  }

  return { take, clear, draw, rows, again: () => { changed = true; } };
})();
