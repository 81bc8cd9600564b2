"use strict";
// What is set, and the link that says it: everything after the # of the address.
const Settings = (() => {
  const THRESHOLDS = [0.5, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999];
  const ALARMS = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2];
  const usual = { n: 20, paper: false, t: 0.99, fa: 0.02, d: 1, world: 1, seed: 1, x: 0, wear: 0, speed: "auto" };
  const number = (text, low, high, otherwise) => {
    const value = Number(text);
    return text !== null && text !== "" && Number.isFinite(value) && value >= low && value <= high ? value : otherwise;
  };

  function read() {
    const given = new URLSearchParams(location.hash.slice(1));
    const nearest = (value, all) => all.reduce((a, b) => Math.abs(b - value) < Math.abs(a - value) ? b : a);
    const whole = (name, low, high) => Math.round(number(given.get(name), low, high, usual[name]));
    return {
      n: whole("n", 3, 117),
      paper: given.get("m") === "paper",
      t: nearest(number(given.get("t"), 0, 1, usual.t), THRESHOLDS),
      fa: nearest(number(given.get("fa"), 0, 1, usual.fa), ALARMS),
      d: number(given.get("d"), 0, 3, usual.d),
      world: whole("world", 1, 9999),
      seed: whole("seed", 1, 4294967295),
      x: whole("x", 0, 117),
      wear: number(given.get("wear"), 0, 1, usual.wear),
      speed: ["auto", "1", "4", "16", "max"].includes(given.get("speed")) ? given.get("speed") : usual.speed,
    };
  }

  function write(now) {
    const link = new URLSearchParams();
    for (const [key, value] of Object.entries({ ...now, m: now.paper ? "paper" : "" })) {
      if (key === "paper" || value === "" || value === usual[key]) continue;
      link.set(key, value);
    }
    const hash = `#${link}`;
    if (location.hash !== hash && !(hash === "#" && location.hash === "")) history.replaceState(null, "", hash);
  }

  const driftName = d => d === 0 ? "none" : d === 1 ? "usual" : `${d} times the usual`;
  const share = p => `${+(100 * p).toFixed(2)} %`;
  // ---- what the controls show

  const element = id => document.getElementById(id);
  function outputs() {
    element("o-count").textContent = element("count").value;
    element("o-threshold").textContent = share(THRESHOLDS[element("threshold").value]);
    element("o-alarm").textContent = share(ALARMS[element("alarm").value]);
    element("o-drift").textContent = driftName(Number(element("drift").value));
    element("o-force").textContent = `${Number(element("force").value).toFixed(2)} N`;
    element("o-mms").textContent = `${element("mms").value} mm/s`;
    const wear = Number(element("wear").value);
    element("o-wear").textContent = wear === 0 ? "new" : wear === 1 ? "no ridges left" : `${Math.round(100 * wear)} % gone`;
  }

  function controls(set) {
    element("count").value = set.n;
    element("method").value = set.paper ? "paper" : "fused";
    element("threshold").value = THRESHOLDS.indexOf(set.t);
    element("alarm").value = ALARMS.indexOf(set.fa);
    element("drift").value = set.d;
    element("world").value = set.world;
    element("wear").value = set.wear;
    element("speed").value = set.speed;
    outputs();
  }

  function choices(list, all, known, chosen) {
    const nameOf = number => all[number - 1], isKnown = number => known.numbers.includes(number);
    const option = number => new Option(nameOf(number), number);
    const group = (label, numbers) => {
      const element = document.createElement("optgroup");
      element.label = label;
      element.append(...numbers.map(option));
      return element;
    };
    const numbers = all.map((_, n) => n + 1).sort((a, b) => nameOf(a).localeCompare(nameOf(b), "en"));
    const unknown = numbers.filter(number => !isKnown(number));
    list.replaceChildren(group("It knows", numbers.filter(isKnown)));
    if (unknown.length) list.append(group("It does not know", unknown));
    if (chosen > 0) list.value = chosen;
  }

  return { THRESHOLDS, ALARMS, read, write, outputs, controls, choices };
})();
