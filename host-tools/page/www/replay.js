"use strict";
// A log of a session, event by event.
const Replay = (() => {
  const at = id => document.getElementById(id);
  let page, events = [], shown = -1;

  function build(callbacks) {
    page = callbacks;
    at("l-file").addEventListener("change", () => open(at("l-file").files[0]));
    at("l-at").addEventListener("input", () => go(Number(at("l-at").value)));
    at("l-back").addEventListener("click", () => go(shown - 1));
    at("l-next").addEventListener("click", () => go(shown + 1));
    for (const name of ["dragover", "drop"]) addEventListener(name, event => event.preventDefault());
    addEventListener("drop", event => {
      const file = event.dataTransfer?.files[0];
      if (file) { page.turn("log"); open(file); }
    });
  }

  async function open(file) {
    at("l-problem").hidden = true;
    if (!file) return;
    try {
      if (!/\.jsonl?$/i.test(file.name)) throw new Error(`${file.name} is no session log: drop a .jsonl file, as the page or tactus device identify --log FILE writes it`);
      const log = Probe.remote({ do: "replay", log: await file.text() });
      const told = [];
      log.happened.forEach((one, n) => {
        const known = log.tables.findLast(([from]) => from <= n)?.[1];
        if (known && one.what in names) told.push({ ...one, known });
      });
      if (!told.some(one => one.what === "chosen")) throw new Error(`${file.name} has no exploration with its table; tactus device identify --log FILE writes one`);
      [events, shown] = [told, -1];
      at("l-say").textContent = `${file.name}: ${log.said.trim().split("\n").join(" ")}`;
      list();
      go(0);
    } catch (why) {
      at("l-problem").hidden = false;
      at("l-problem").textContent = page.sentence(why);
    }
  }

  const names = {
    chosen: one => `Slide ${one.slide} chosen: ${Mind.movementName(one.known.movements[one.movement])}`,
    look: one => `${one.ms / 1000} s of the slide`,
    slide: one => `Slide ${one.slide} made`,
    rejected: one => `Rejected: ${one.why}`,
    verdict: one => ({ sure: `It is ${one.texture}`, changed: `${one.texture}, but changed`, new: "None of those it knows", undecided: `Not sure; most likely ${one.texture}` })[one.told],
    refused: one => one.why,
    learned: one => `Learned ${one.name}`,
  };

  function list() {
    at("l-at").max = events.length - 1;
    at("l-list").replaceChildren(...events.map((one, n) => {
      const item = document.createElement("li"), button = document.createElement("button");
      button.type = "button";
      button.className = one.what;
      button.textContent = names[one.what](one);
      button.addEventListener("click", () => go(n));
      item.append(button);
      return item;
    }));
    at("l-all").hidden = false;
  }

  // What was known after this event: everything from the first choice of its exploration on is heard again.
  function go(to) {
    shown = Math.max(0, Math.min(events.length - 1, to));
    let from = shown;
    while (from > 0 && !(events[from].what === "chosen" && events[from].slide === 1)) from -= 1;
    page.begins(true);
    page.knows(events[from].known);
    for (let n = from; n <= shown; n++) page.happened(events[n]);
    at("l-at").value = shown;
    at("l-at").setAttribute("aria-valuetext", names[events[shown].what](events[shown]));
    at("l-back").disabled = shown === 0;
    at("l-next").disabled = shown === events.length - 1;
    [...at("l-list").querySelectorAll("button")].forEach((button, n) => {
      if (n === shown) { button.setAttribute("aria-current", "step"); button.scrollIntoView({ block: "nearest" }); } else button.removeAttribute("aria-current");
    });
  }

  return { build, open };
})();
