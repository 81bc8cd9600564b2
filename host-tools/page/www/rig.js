"use strict";
// Side view of the rig in millimetres: x from the finger, y downwards from the steel plate.
const Rig = (() => {
  const SVG = "http://www.w3.org/2000/svg";
  const SAMPLE = 75, MARGIN = 5, LENS = 10;
  // samples that are thinner lie on shims up to here, so that the finger's way down is short
  const SHIMMED = 11, SHEET = 1.6;
  let parts;
  let samples = new Map();

  function make(parent, name, attributes, text) {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    if (text !== undefined) element.textContent = text;
    parent.append(element);
    return element;
  }

  // The fingertip, its undeformed lowest point at the origin: a core with a nail under a skin with ridges.
  function finger(parent) {
    make(parent, "path", { class: "skin", d: "M-7.5 -27 V-9 C-7.5 -3.5 -4 0 0 0 S7.5 -3.5 7.5 -9 V-27 Z" });
    make(parent, "path", { class: "bone", d: "M-4.6 -27 V-9.5 C-4.6 -5 -2.6 -2.6 0 -2.6 S4.6 -5 4.6 -9.5 V-27 Z" });
    make(parent, "path", { class: "nail", d: "M7.5 -21 V-12 C8.3 -13 8.3 -20 7.5 -21 Z" });
    for (let n = -5; n <= 5; n++) make(parent, "path", { class: "ridge", d: `M${n * 0.75} ${-0.02 - n * n * 0.028} v-.55` });
  }

  // A look of its own for every texture: a colour, and a row of marks.
  function look(texture) {
    if (!samples.has(texture)) {
      let state = texture * 2654435761 >>> 0;
      const next = () => (state = (state * 1664525 + 1013904223) >>> 0) / 4294967296;
      const hue = Math.round(next() * 360), tone = 38 + next() * 22, rough = 0.05 + next() * 0.35, wide = 0.5 + next() * 2.5;
      let top = "";
      for (let x = 0; x < SAMPLE; x += wide) top += `q${wide / 2} ${-rough * (0.6 + next())} ${Math.min(wide, SAMPLE - x)} 0`;
      samples.set(texture, { fill: `hsl(${hue} 28% ${tone}%)`, top });
    }
    return samples.get(texture);
  }

  function build(svg) {
    make(svg, "path", { class: "ground", d: "M-84 12 H84" });
    const lens = make(svg, "clipPath", { id: "lens-clip" });
    make(lens, "circle", { cx: 58, cy: -27, r: 15 });
    const stage = make(svg, "g", {});
    const shims = make(stage, "path", { class: "shim" });
    const sample = make(stage, "path", { class: "sample" });
    make(stage, "rect", { class: "plate", x: -2, y: 0, width: SAMPLE + 4, height: 3, rx: 0.6 });
    make(stage, "rect", { class: "lever", x: SAMPLE / 2 - 14, y: 3, width: 28, height: 5, rx: 0.8 });
    make(svg, "rect", { class: "lever", x: -80, y: 8, width: 160, height: 2.5, rx: 0.8 });
    const tip = make(svg, "g", {});
    make(tip, "path", { class: "lever", d: "M-9 -27 H9 V-33 H5.5 V-120 H-5.5 V-33 H-9 Z" });
    finger(tip);
    const arrow = make(svg, "path", { class: "arrow", d: "", visibility: "hidden" });
    // ten times as large
    const ray = make(svg, "path", { class: "ray" });
    const close = make(svg, "g", { "clip-path": "url(#lens-clip)" });
    make(close, "circle", { class: "lens", cx: 58, cy: -27, r: 15 });
    const under = make(close, "path", { class: "sample" });
    const skin = make(close, "path", { class: "skin" });
    const ridges = make(close, "path", { class: "ridge", "stroke-width": 1 });
    make(svg, "circle", { class: "lens", cx: 58, cy: -27, r: 15, "fill-opacity": 0 });
    make(svg, "text", { class: "unit", id: "lens-say", x: 58, y: -43.4, "text-anchor": "middle" }, "10 times as large");
    // a scale
    make(svg, "path", { class: "tick", d: "M-49 -36 v-1.5 M-49 -36.75 h20 M-29 -36 v-1.5" });
    make(svg, "text", { class: "unit", x: -39, y: -38.4, "text-anchor": "middle" }, "20 mm");
    parts = { svg, ray, stage, shims, sample, tip, arrow, under, skin, ridges, now: svg.querySelector("desc") };
    fit();
    addEventListener("resize", fit);
  }

  // What the fingertip looks like in the lens, pressed in by so many mm onto a surface at y.
  function closeUp(pressed, x, texture) {
    const cx = 58, level = -22;
    const gap = Math.max(0, -pressed) * LENS, flat = Math.sqrt(Math.max(0, pressed) * 2 * 6) * LENS;
    const reach = Math.min(gap, 18), half = Math.min(flat, 14);
    const bottom = level - reach;
    parts.skin.setAttribute("d", `M${cx - 30} ${bottom - 26} C${cx - 24} ${bottom - 5} ${cx - 14 - half / 2} ${bottom} ${cx - half} ${bottom} H${cx + half} C${cx + 14 + half / 2} ${bottom} ${cx + 24} ${bottom - 5} ${cx + 30} ${bottom - 26} Z`);
    let ridges = "";
    for (let n = -4; n <= 4; n++) ridges += `M${cx + n * 4} ${bottom - 0.4 - Math.max(0, Math.abs(n * 4) - half) ** 2 * 0.02} v-3`;
    parts.ridges.setAttribute("d", ridges);
    const { fill } = look(texture);
    const shift = ((x * LENS) % 6 + 6) % 6;
    let top = `M${cx - 24 - shift} ${level} `;
    for (let n = 0; n < 10; n++) top += "q1.5 -1.1 3 0 t3 0 ";
    parts.under.setAttribute("d", `${top} V0 H${cx - 30} Z`);
    parts.under.setAttribute("fill", fill);
  }

  function show(frame) {
    if (!parts) return;
    // what is over the plate where the finger is: lever and sample in the same measure
    const top = Math.min(16, Math.max(0.5, frame.tip_mm + frame.indentation_mm));
    const x = MARGIN - frame.stage_mm;
    const { fill, top: outline } = look(frame.texture);
    parts.stage.setAttribute("transform", `translate(${x.toFixed(3)} 0)`);
    const under = top < SHIMMED + 0.05 ? top - SHEET : 0;
    parts.shims.setAttribute("d", under > 0 ? `M1 0 V${-under} H${SAMPLE - 1} V0 Z M1 ${-under / 2} H${SAMPLE - 1}` : "");
    parts.sample.setAttribute("d", `M0 ${-under} V${-top} ${outline} V${-under} Z`);
    parts.sample.setAttribute("fill", fill);
    parts.ray.setAttribute("d", `M2 ${1 - top} L45.5 -18.7 M2 ${-1 - top} L47 -37`);
    parts.tip.setAttribute("transform", `translate(0 ${(-frame.tip_mm).toFixed(3)})`);
    const moves = Math.abs(frame.speed_mm_s) > 1;
    parts.arrow.setAttribute("visibility", moves ? "visible" : "hidden");
    if (moves) {
      const to = -Math.sign(frame.speed_mm_s), length = 8 + Math.min(14, Math.abs(frame.speed_mm_s) / 5);
      parts.arrow.setAttribute("d", `M${-to * 6} 13.2 h${to * length} m${-to * 2} -1.4 l${to * 2} 1.4 l${-to * 2} 1.4`);
    }
    closeUp(frame.indentation_mm, frame.stage_mm, frame.texture);
  }

  // On a narrow screen the ends of the stage's way are left out.
  function fit() {
    parts.svg.setAttribute("viewBox", innerWidth < 500 ? "-52 -47 128 62" : "-84 -47 168 62");
  }

  function say(text) {
    if (parts && parts.now.textContent !== text) parts.now.textContent = text;
  }

  return { build, show, say, make };
})();
