"use strict";
// A log of a session, event by event, or recordings, slide by slide.
const Replay = (() => {
  const at = id => document.getElementById(id);
  let page, events = [], shown = -1;

  function build(callbacks) {
    page = callbacks;
    for (const id of ["l-file", "l-folder"]) {
      at(id).addEventListener("change", () => {
        const files = Files.chosen(at(id).files);
        at(id).value = "";
        if (files.length) open(files);
      });
    }
    at("l-at").addEventListener("input", () => go(Number(at("l-at").value)));
    at("l-back").addEventListener("click", () => go(shown - 1));
    at("l-next").addEventListener("click", () => go(shown + 1));
    for (const name of ["dragover", "drop"]) addEventListener(name, event => event.preventDefault());
    addEventListener("drop", async event => {
      if (!event.dataTransfer) return;
      const files = Files.dropped(event.dataTransfer);
      page.turn("log");
      guarded(async () => { const all = await files; if (all.length) await read(all); });
    });
  }

  const open = files => guarded(() => read(files));

  async function guarded(work) {
    at("l-problem").hidden = true;
    try {
      await work();
    } catch (why) {
      at("l-problem").hidden = false;
      at("l-problem").textContent = page.sentence(why);
    }
  }

  async function read(files) {
    const name = files[0].name.split("/")[0];
    at("l-say").textContent = `Reading ${name}.`;
    // let the browser draw and say that
    await new Promise(done => setTimeout(done));
    let opened;
    try {
      if (files.length === 1 && /\.zip$/i.test(files[0].name)) files = await Files.unzip(files[0]);
      const contents = [];
      for (const { file } of files) contents.push(new Uint8Array(await file.arrayBuffer()));
      contents.forEach(Probe.give);
      opened = Probe.remote({ do: "open", files: files.map(file => file.name) });
    } finally {
      at("l-say").textContent = "";
    }
    const told = [];
    let on = null, begin = null;
    opened.happened.forEach((one, n) => {
      const known = opened.tables.findLast(([from]) => from <= n)?.[1];
      if (!(one.what in names) || !known && one.what !== "recorded") return;
      if (one.what === "recorded") on = one.texture;
      if (one.what === "chosen" && one.slide === 1) begin = told.length;
      if (one.what === "judged" && told.at(-1)?.what !== "judged") begin = told.length;
      told.push({ ...one, known, on, would: opened.happened[n + 1]?.what === "recorded", begin: begin ?? told.length });
      if (one.what === "verdict" || one.what === "verified") begin = null;
    });
    if (!told.some(one => ["chosen", "judged", "recorded"].includes(one.what))) throw new Error(`${name} has no exploration with its table; tactus device identify --log FILE writes one`);
    [events, shown] = [told, -1];
    at("l-say").textContent = `${name}: ${opened.said.trim().split("\n").join(" ")}`;
    page.opens();
    list();
    go(0);
  }

  const likely = ({ standing: { posterior }, known }) => {
    const p = Math.max(...posterior);
    return `${known.textures[posterior.indexOf(p)]}, ${Mind.percent(p)}`;
  };
  const names = {
    chosen: one => `Slide ${one.slide} ${one.would ? "would be" : "chosen:"} ${Mind.movementName(one.known.movements[one.movement])}`,
    look: one => `${one.ms / 1000} s of the slide`,
    slide: one => `Slide ${one.slide} ${one.on ? "taken in" : "made"}: most like ${likely(one)}`,
    recorded: one => `${one.texture}, recorded slide ${one.number}: ${Mind.movementName(one.movement)}`,
    judged: one => one.said,
    rejected: one => `Rejected: ${one.why}`,
    verdict: one => ({ sure: `It is ${one.texture}`, changed: `${one.texture}, but changed`, new: "None of those it knows", undecided: `Not sure; most likely ${one.texture}` })[one.told],
    verified: one => one.said.split("\n")[0],
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
    const { begin, known } = events[shown];
    page.records(events.some(one => one.what === "recorded"));
    page.begins(true);
    if (known) page.knows(known);
    let recorded = null;
    for (let n = begin; n <= shown; n++) {
      if (events[n].what === "recorded") recorded = events[n].at;
      page.happened(events[n]);
    }
    if (recorded !== null) page.feels(Probe.remote({ do: "recorded", at: recorded }).streams);
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
