"use strict";
// The first visit: an exploration with a line of text at each step, which waits for its reader.
const Story = (() => {
  // as published, one property a slide: three slides, each another movement
  const FIRST = { n: 20, paper: true, t: 0.99, fa: 0.02, d: 1, world: 1, seed: 2, x: 8, wear: 0, speed: "auto" };
  const element = id => document.getElementById(id);
  let on = false, left = 0, panel = null, seen = new Set(), asked = null, next = [];

  // A line about a panel, after those that wait: time stands still for so many seconds, and until the panel has been on the screen.
  function tell(...line) {
    next.push(line);
    if (left === 0) show();
  }

  function show() {
    const [text, about, seconds] = next.shift();
    panel?.classList.remove("told");
    panel = document.querySelector(`.${about}`);
    panel.classList.add("told");
    left = 1000 * seconds;
    element("tale").hidden = false;
    element("tale-say").textContent = text;
  }

  function isSeen() {
    if (seen.has(panel)) return true;
    const { top, bottom, height } = panel.getBoundingClientRect();
    const high = innerHeight - element("tale").offsetHeight;
    if (Math.min(bottom, high) - Math.max(top, 0) >= 0.6 * Math.min(height, high)) seen.add(panel);
    return seen.has(panel);
  }

  // True if the reader needs time, of which so much has passed.
  function holds(passed_ms) {
    if (!on) return false;
    const waits = !isSeen();
    element("tale-show").hidden = !waits;
    if (!waits) left = Math.max(0, left - passed_ms);
    if (!waits && left === 0 && next.length) {
      show();
      return true;
    }
    return waits || left > 0;
  }

  function begin(name, textures) {
    on = true;
    left = 0;
    next = [];
    seen = new Set();
    tell(`${name} lies under the finger. The probe is not told: to it, all ${textures} textures are equally likely, ${Mind.percent(1 / textures)} each.`, "mind", 2.3);
  }

  const all = names => names.length < 2 ? names.join("") : `${names.slice(0, -1).join(", ")} and ${names.at(-1)}`;

  function happened(one, known, posterior) {
    if (!on) return;
    if (one.what === "chosen") {
      const best = one.expected.find(each => each.movement === one.movement && each.property === one.property);
      asked = `${Mind.movementName(known.movements[one.movement])}, for ${one.property}`;
      tell(`Movement ${one.slide}: ${asked}. Of ${one.expected.length} choices it takes away the most doubt: ${Mind.halves(Mind.doubt(posterior), best.uncertainty)}.`, "next", 1.8);
    }
    if (one.what === "slide") {
      const likely = one.standing.posterior.map((p, n) => [p, known.textures[n]]).filter(([p]) => p > 0.05).sort((a, b) => b[0] - a[0]);
      if (likely.length > 1) tell(`After slide ${one.slide}: ${all(likely.map(([p, name]) => `${name} ${Mind.percent(p)}`))}. Not sure enough: it slides again, another way.`, "mind", 1.8);
    }
    if (one.what === "verdict") {
      tell(`It is ${one.texture}, ${Mind.percent(one.probability).replace(">", "more than")} sure after ${one.slides} slides. It answers when one texture has more than 99 %. By all features of each slide at once, as from here on, the firmware often needs only one.`, "stage", 0);
      on = false;
      element("tale-more").hidden = false;
    }
  }

  function phase(now) {
    if (on && now === "Sliding") tell(`It slides (${asked}). The ridges of the skin shake the fluid in the finger: this is what it feels.`, "feel", 0);
  }

  function end() {
    on = false;
    panel?.classList.remove("told");
    for (const id of ["tale", "tale-show", "tale-more"]) element(id).hidden = true;
  }

  element("tale-show").addEventListener("click", () => panel.scrollIntoView({ block: "center" }));
  element("tale-end").addEventListener("click", end);
  return { FIRST, begin, happened, phase, holds, end, isOn: () => on };
})();
