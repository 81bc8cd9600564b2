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
    others.textContent = order.length > SHOWN ? `${order.length - SHOWN} others together: ${percent(rest)}` : "";
  }

  const movementName = ([force, speed]) => `${force.toFixed(2)} N at ${speed.toFixed(0)} mm/s`;

  function benefit(list, movements, expected, chosen) {
    expected.slice(0, SHOWN).forEach((one, n) => {
      const { item, set } = row(list, n);
      const what = one.property ? `, ${one.property}` : "";
      set(movementName(movements[one.movement]) + what, one.benefit.toFixed(4), Math.min(1, -Math.log10(Math.max(1e-4, 1 - one.benefit)) / 4));
      item.className = one.movement === chosen.movement && one.property === chosen.property ? "chosen" : "";
    });
    while (list.children.length > Math.min(SHOWN, expected.length)) list.lastChild.remove();
  }

  return { posterior, benefit, percent, movementName };
})();
