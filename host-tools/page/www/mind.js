"use strict";
// What it could be, and which movement comes next: rows of bars.
const Mind = (() => {
  const SHOWN = 6;
  // with spaces at which no line ends
  const percent = p => `${p >= 0.9995 ? ">\u00a099.9" : p >= 0.001 ? (100 * p).toFixed(1) : "<\u00a00.1"}\u00a0%`;

  function row(list, n) {
    let item = list.children[n];
    if (!item) {
      item = document.createElement("li");
      const name = document.createElement("span"), value = document.createElement("span"), bar = document.createElement("span");
      name.className = "name"; value.className = "value"; bar.className = "bar";
      bar.append(document.createElement("i"));
      item.append(name, value, bar);
      list.append(item);
    }
    const [name, value, bar] = item.children;
    return { item, set: (text, number, share) => { name.textContent = text; value.textContent = number; bar.firstChild.style.transform = `scaleX(${share})`; } };
  }

  function posterior(list, others, names, values) {
    const order = values.map((p, n) => [p, n]).sort((a, b) => b[0] - a[0]);
    const shown = order.slice(0, SHOWN);
    shown.forEach(([p, n], rank) => {
      const { item, set } = row(list, rank);
      set(names[n], percent(p), p);
      item.className = rank === 0 && p > 0.5 ? "first" : "";
    });
    while (list.children.length > shown.length) list.lastChild.remove();
    const rest = order.slice(SHOWN).reduce((sum, [p]) => sum + p, 0);
    const more = order.length > SHOWN ? `${order.length - SHOWN} others together: ${percent(rest)}. ` : "";
    others.textContent = `${more}The ${order.length} textures it knows share 100\u00a0%.`;
  }

  const movementName = ([force, speed]) => `${force.toFixed(2)} N at ${speed.toFixed(0)} mm/s`;

  // Doubt (eq. 11): the chance that a name drawn by these probabilities is wrong.
  const doubt = posterior => 1 - posterior.reduce((sum, p) => sum + p * p, 0);

  // From one doubt to another, in words and bits.
  function halves(now, then) {
    const bits = Math.log2(now / Math.max(then, 1e-6)), times = bits.toFixed(1);
    if (!(bits >= 0.05)) return "it stays at " + percent(now);
    const words = bits < 0.8 ? `${(100 * (1 - then / now)).toFixed(0)}\u00a0% less` : bits < 1.25 ? "halved" : `halved ${times} times`;
    return `from ${percent(now)} to ${percent(then)}, ${words} (${times}\u00a0${times === "1.0" ? "bit" : "bits"})`;
  }

  function benefit(list, movements, expected, chosen) {
    expected.slice(0, SHOWN).forEach((one, n) => {
      const { item, set } = row(list, n);
      const what = one.property ? `, ${one.property}` : "";
      // one that was made before counts less (eq. 13)
      const again = 1 - one.benefit > one.uncertainty + 0.001 ? ", made before" : "";
      set(movementName(movements[one.movement]) + what + again, `leaves ${percent(one.uncertainty)}`, Math.min(1, -Math.log10(Math.max(1e-4, 1 - one.benefit)) / 4));
      item.className = one.movement === chosen.movement && one.property === chosen.property ? "chosen" : "";
    });
    while (list.children.length > Math.min(SHOWN, expected.length)) list.lastChild.remove();
  }

  // What the shares mean when it says that the texture is new.
  const insteadOfNew = textures => `The shares are among the ${textures} textures it knows, as if it had to be one of these: who has more than 99\u00a0% is only the least unlike. The scale below says that the slides are too far from all of them: it is new.`;

  // Where the slides lie on the scale: known up to 50 %, changed up to 70 %, then new. The core has a limit for each of the two, and
  // says how far the slides are over it; far away the scale is compressed.
  function novelty({ log_odds: over, changed_by: changed }) {
    if (over > 0) return [70 + 30 * Math.tanh(over / 12), "new"];
    if (changed > 0) return [50 + 20 * changed / (changed - over || 1), "changed"];
    return [50 + 50 * Math.tanh((changed ?? over) / 12), "known"];
  }

  function cells(texts, span) {
    const row = document.createElement("tr");
    for (const text of texts) {
      const cell = document.createElement("td");
      cell.textContent = text;
      if (span) cell.colSpan = span;
      row.append(cell);
    }
    return row;
  }

  const fixed = (value, digits, unit = "") => value === null ? "none" : `${value.toFixed(digits)}${unit}`;

  function most(posterior) {
    let best = 0;
    posterior.forEach((p, n) => { if (p > posterior[best]) best = n; });
    return best;
  }

  // Traction, roughness and fineness as text.
  const measured = m => [fixed(m.traction_n, 2, " N"), fixed(m.roughness_ln, 2),
    fixed(m.fineness_ln, 2, m.fineness_ln === null ? "" : `, ${Math.exp(m.fineness_ln).toFixed(0)}\u00a0Hz`)];

  // The row of a slide.
  function slide({ slide: number, measured: m, early_ms: early, standing }, known) {
    const best = most(standing.posterior), ended = early ? `, ended after ${early / 1000} s` : "";
    return cells([String(number), movementName([m.force_n, m.speed_mm_s]) + ended, ...measured(m), `${known.textures[best]}, ${percent(standing.posterior[best])}`]);
  }

  return { cells, slide, measured, most, posterior, benefit, percent, movementName, doubt, halves, insteadOfNew, novelty };
})();
