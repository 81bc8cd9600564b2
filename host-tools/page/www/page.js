"use strict";
// The page: what is pressed, what happens, and how time goes on.
(() => {
  const at = id => document.getElementById(id);
  const sentences = {
    Parked: "The rig waits.", Homing: "The finger goes up to its limit switch.", Ready: "The finger is lifted.",
    Positioning: "The stage goes to where the slide begins.", Pressing: "The finger comes down.",
    Background: "It touches, and listens to the still finger first.", Sliding: "It slides.",
    Lifting: "The finger is lifted.", Unloaded: "The stage moves without load.", Faulted: "Something went wrong: the finger is lifted.",
  };
  let set = Settings.read();
  let known = null;
  let all = [];
  let source = "sim";
  let playing = false, busy = false, asked = null, slides = 0, last = null, verdict = null;
  let isTold = false, frames = [], began = performance.now();
  const ink = document.createElement("span");
  ink.hidden = true;
  document.body.append(ink);
  const canvases = { pac: at("pac"), spectrum: at("spectrum"), pdc: at("pdc"), ink };

  // Numbers that are drawn from the seed: the same link shows the same.
  function draw() {
    set.seed = (Math.imul(set.seed, 1664525) + 1013904223) >>> 0 || 1;
    return set.seed / 4294967296;
  }

  const nameOf = number => all[number - 1] ?? `texture ${number}`;
  const isKnown = number => known.numbers.includes(number);
  function say(doing) { if (at("doing").textContent !== doing) at("doing").textContent = doing; }
  function aloud(text) { at("aloud").textContent = text; }
  function problem(why) {
    if (source === "usb") { at("u-problem").hidden = !why; at("u-problem").textContent = why ?? ""; return; }
    at("problem").hidden = !why;
    at("problem").textContent = why ?? "";
  }
  function headline(parts, kind = "") {
    at("verdict").className = `verdict ${kind}`;
    at("verdict").replaceChildren(...parts.map(part => {
      if (typeof part === "string") return part;
      const b = document.createElement("b");
      b.textContent = part.name;
      return b;
    }));
    aloud(at("verdict").textContent);
  }

  function enable(on) {
    for (const id of ["play", "step", "replay", "surprise", "move", "apply", "learn", "confirm", "again", "worn"]) at(id).disabled = !on;
    at("unknown").disabled = !on || known === null || known.textures.length >= 117;
    at("play").textContent = playing && busy ? "Pause" : busy ? "Go on" : "Start";
    at("tale-pause").textContent = playing ? "Pause" : "Go on";
    at("tale-pause").hidden = !busy;
  }

  // ---- the world

  async function makeWorld() {
    busy = false; playing = false; known = null; verdict = null;
    enable(false);
    forget();
    const drawn = { world: set.world, textures: set.n, paper: set.paper, drift: set.d, trial: set.seed % 1000 };
    let reply = Probe.ask({ do: "world", ...drawn });
    at("work").hidden = false;
    while (reply.is === "preparing") {
      at("progress").max = reply.of;
      at("progress").value = reply.done;
      if (reply.done < reply.of) {
        say("Getting ready");
        headline([`It slides over the textures of world ${set.world} to learn them: ${reply.done} of ${reply.of}.`]);
        // let the browser draw and hear
        await new Promise(done => setTimeout(done));
      }
      reply = Probe.ask({ do: "prepare" });
    }
    at("work").hidden = true;
    delete reply.is;
    knows(reply);
    if (set.wear > 0) Probe.ask({ do: "skin", wear: set.wear });
    const frame = Probe.ask({ do: "step", ms: 0 });
    Rig.show(frame);
    say("Ready");
    headline([`It knows ${known.textures.length} textures. Have it touch one.`]);
    enable(true);
  }

  function knows(now) {
    known = now;
    Places.know(known);
    Settings.choices(at("texture"), all, known, set.x);
    even();
    at("figures").textContent = `The table: ${known.textures.length} textures, ${(known.bytes / 1024).toFixed(0)} KB, checksum ${known.crc.toString(16).padStart(8, "0")} (tells it from other tables). ${known.figures ?? ""}`;
  }

  function even() {
    posterior = known.textures.map(() => 1 / known.textures.length);
    Mind.posterior(at("posterior"), at("others"), known.textures, posterior);
  }

  function forget() {
    slides = 0;
    Places.clear();
    Traces.clear();
    at("slides").replaceChildren(Mind.cells(["None yet."], 6));
    at("benefit").replaceChildren();
    at("novel").classList.remove("known");
    at("teach").hidden = true;
    at("taught").hidden = true;
    at("truth").textContent = "";
    problem();
  }

  // ---- requests

  function identify(number) {
    if (busy || !known) return;
    forget();
    set.x = number;
    at("texture").value = number;
    begin(number, { do: "identify", texture: number, seed: set.seed, threshold: set.t, false_alarm: set.fa, max_slides: 10 });
    if (!busy) return;
    verdict = null;
    document.body.dataset.told = "";
    even();
    Places.likely([]);
    headline(["What is this?"]);
    if (!Story.isOn()) Settings.write(set);
  }

  function begin(number, request) {
    try {
      Probe.ask(request);
    } catch (why) {
      problem(sentence(why));
      return;
    }
    asked = { number, by: request.do };
    busy = true;
    playing = true;
    last = null;
    at("truth").textContent = `Under the finger: ${nameOf(number)}${isKnown(number) ? "" : ", which it has never touched"}. The probe is not told.`;
    enable(true);
    lock();
  }

  // A name of a file keeps its letters.
  const sentence = ({ message: text }) => `${/^\S+\.\w/.test(text) ? text[0] : text[0].toUpperCase()}${text.slice(1)}${text.endsWith(".") ? "" : "."}`;

  // While it is at work, what would disturb it waits.
  function lock() {
    for (const id of ["surprise", "unknown", "move", "apply", "worn"]) at(id).disabled = busy || !known;
    if (!busy && known && known.textures.length >= 117) at("unknown").disabled = true;
  }

  function surprise() {
    if (source !== "sim" || busy || !known) return;
    const numbers = known.numbers.filter(number => number !== null);
    identify(numbers[Math.floor(draw() * numbers.length)]);
  }

  function unknown() {
    if (source !== "sim" || busy || !known) return;
    const numbers = all.map((_, n) => n + 1).filter(number => !isKnown(number));
    if (numbers.length) identify(numbers[Math.floor(draw() * numbers.length)]);
  }

  // ---- what happens

  function stands(standing) {
    if (!standing) return;
    posterior = standing.posterior;
    Mind.posterior(at("posterior"), at("others"), known.textures, standing.posterior);
    Places.likely(standing.posterior);
    const novel = standing.log_odds !== null;
    at("novel").classList.toggle("known", novel);
    if (novel) {
      const [place, zone] = Mind.novelty(standing);
      at("needle").style.left = `${place}%`;
      const meter = at("novel-meter");
      meter.setAttribute("aria-valuenow", place.toFixed(0));
      meter.setAttribute("aria-valuetext", { known: "like a texture it knows", changed: "like one it knows, but not as it learned it", new: "less like any texture it knows than it may be: new" }[zone]);
      meter.dataset.zone = zone;
    }
  }

  function happened(one) {
    switch (one.what) {
      case "chosen": {
        if (slides === 0 && one.slide === 1) Places.clear();
        Mind.benefit(at("benefit"), known.movements, one.expected, one);
        Places.turn(one.movement);
        const { uncertainty } = one.expected.find(each => each.movement === one.movement && each.property === one.property);
        at("why").textContent = `Chosen for slide ${one.slide}: ${Mind.movementName(known.movements[one.movement])}${one.property ? `, for ${one.property}` : ""}. Doubt is the chance that a name drawn by the shares is wrong; this movement should bring it ${Mind.halves(Mind.doubt(posterior), uncertainty)}. One bit halves the doubt. A bar is longer by a quarter for each factor of ten.`;
        break;
      }
      case "look":
        stands(one.standing);
        Places.land(source !== "sim" || asked?.by === "identify" ? lookedAt : null, one.place, true);
        if (one.standing) say(`After ${one.ms / 1000} s of sliding: most like ${known.textures[Mind.most(one.standing.posterior)]}.`);
        break;
      case "slide": {
        stands(one.standing);
        Places.land(one.movement, one.place, false);
        if (slides === 0) at("slides").replaceChildren();
        slides += 1;
        at("slides").append(Mind.slide(one, known));
        break;
      }
      case "moved": {
        const [traction, roughness, fineness] = Mind.measured(one.measured);
        Places.land(one.movement, one.place, false);
        at("moved").textContent = `Measured: traction ${traction}, roughness ${roughness}, fineness ${fineness}. ${one.movement === null ? "The probe has learned nothing at this movement, so the map has no place for it." : "The ring in the map is this slide."}`;
        headline(["Measured by hand."]);
        break;
      }
      case "judged":
        say(one.said);
        headline(["Is it this one?"]);
        break;
      case "verified": {
        const [answer, ...worth] = one.said.split("\n");
        verdict = one;
        headline([answer], { same: "sure", different: "new" }[one.answer] ?? "");
        at("truth").textContent = worth.join(" ");
        break;
      }
      case "rejected":
        say(`The slide does not count: ${one.why}.`);
        break;
      case "refused":
        problem(`${one.why}.`.replace("..", "."));
        break;
      case "verdict":
        verdict = one;
        document.body.dataset.told = one.told;
        answer(one);
        break;
      case "learned":
        if (source !== "sim") { aloud(`Learned: ${one.name}.`); break; }
        knows(one.known);
        at("teach").hidden = true;
        at("taught").hidden = false;
        at("taught-say").textContent = `Learned: ${one.name}, from ${one.slides} ${one.slides === 1 ? "slide" : "slides"}. It knows ${one.known.textures.length} textures now. Put it under the finger again?`;
        aloud(at("taught-say").textContent);
        break;
      case "done":
        if (source !== "sim") break;
        busy = false;
        playing = false;
        say(asked?.by === "identify" && verdict ? "Its answer" : "Done");
        enable(true);
        lock();
        break;
    }
    if (one.what === "chosen") lookedAt = one.movement;
    if (source === "sim") Story.happened(one, known, posterior);
  }
  let lookedAt = null, posterior = [];

  const sure = p => p >= 0.9995 ? "more than\u00a099.9\u00a0%" : Mind.percent(p);

  function answer(one) {
    const of = `after ${one.slides} ${one.slides === 1 ? "slide" : "slides"}`;
    const name = { name: one.texture };
    if (one.told === "sure") headline(["It is ", name, `, ${sure(one.probability)} sure ${of}.`], "sure");
    if (one.told === "changed") headline(["It is ", name, `, but not as I learned it: ${sure(one.probability)} sure ${of}.`], "changed");
    if (one.told === "new") {
      headline([`This is none of those I know, ${of}.`], "new");
      at("others").textContent = Mind.insteadOfNew(known.textures.length);
    }
    if (one.told === "most-like") headline(["It is most like ", name, `, ${Mind.percent(one.probability)} among those I know ${of}.`]);
    if (one.told === "undecided") headline(["Not sure; most likely ", name, `, ${Mind.percent(one.probability)} ${of}.`]);
    if (source !== "sim") {
      at("truth").textContent = "";
      if (one.wants_label) at("u-name").value = one.told === "new" ? "" : one.texture;
      return;
    }
    const truth = nameOf(asked.number);
    const taught = known.numbers[one.index] === null ? one.texture : null;
    const right = one.told === "new" ? !isKnown(asked.number) && !lessons.has(asked.number) : one.texture === truth || taught !== null && lessons.get(asked.number) === taught;
    const judged = ["undecided", "most-like"].includes(one.told) ? "" : right ? " Right." : " That is wrong.";
    at("truth").textContent = `Under the finger: ${truth}.${judged}`;
    if (one.wants_label) {
      at("teach").hidden = false;
      at("name").value = lessons.get(asked.number) ?? truth.slice(0, 31);
      const changed = one.told === "changed";
      at("teach-say").textContent = changed ? `Is it ${one.texture}?` : one.told === "new" ? "What is it called? It learns it from these slides." : "It wants to know: what is it?";
      at("teach-yes").hidden = !changed;
      at("teach-label").textContent = changed ? "No, its name is" : "Its name";
    }
  }

  // Names that were taught here, by number of the texture.
  const lessons = new Map();
  function label(name) {
    problem();
    lessons.set(asked.number, name);
    try {
      Probe.ask({ do: "label", name });
      take(Probe.ask({ do: "step", ms: 0 }));
    } catch (why) {
      problem(sentence(why));
    }
  }

  // ---- time

  const AUTO = { Sliding: 1.5, Background: 2, Pressing: 10, Positioning: 8, Lifting: 10 };
  function speedNow(phase) {
    if (set.speed === "auto") return AUTO[phase] ?? 12;
    return set.speed === "max" ? 60 : Number(set.speed);
  }

  function take(frame) {
    last = frame;
    Traces.take(frame);
    for (const one of frame.happened) happened(one);
  }

  function show(frame) {
    Rig.show(frame);
    at("g-force").textContent = `${Math.max(0, frame.force_n).toFixed(2)} N`;
    at("g-speed").textContent = `${Math.abs(frame.speed_mm_s).toFixed(0)} mm/s`;
    at("g-shear").textContent = `${Math.abs(frame.shear_n).toFixed(2)} N`;
    at("g-time").textContent = `${(frame.at_ms / 1000).toFixed(1)} s`;
    if (busy && frame.phase !== shownPhase) {
      shownPhase = frame.phase;
      Story.phase(frame.phase);
      say(sentences[frame.phase] ?? "");
      Rig.say(sentences[frame.phase] ?? "");
    }
  }
  let shownPhase = null;

  let before = 0, owed = 0;
  function tick(now) {
    const passed = Math.min(100, now - before);
    before = now;
    if (playing && busy) {
      frames.push(now);
      if (frames.length > 240) frames.shift();
      owed += Story.holds(passed) ? 0 : passed * speedNow(last?.phase);
      let ms = Math.min(500, Math.floor(owed));
      owed -= ms;
      // a slide does not begin in the middle of a quick step
      while (ms > 0 && busy && !Story.holds(0)) {
        const part = Math.min(ms, 40), phase = last?.phase;
        take(Probe.ask({ do: "step", ms: part }));
        ms -= part;
        if (last.phase !== phase && (Story.isOn() || speedNow(last.phase) < speedNow(phase))) { owed = 0; break; }
      }
      if (last) show(last);
    }
    Traces.draw(canvases);
    requestAnimationFrame(tick);
  }

  function onwards() {
    // to the end of the next slide, at once
    if (!busy) return then(surprise)();
    playing = false;
    for (let n = 0; n < 4000 && busy; n++) {
      take(Probe.ask({ do: "step", ms: 50 }));
      if (last.happened.some(one => one.what === "slide" || one.what === "verdict")) break;
    }
    if (last) show(last);
    enable(true);
    lock();
  }

  // ---- controls

  async function apply() {
    if (busy) return;
    const world = Math.round(Number(at("world").value));
    if (!(world >= 1 && world <= 9999)) return problem("The world is a number from 1 to 9999.");
    set = { ...set, n: Number(at("count").value), paper: at("method").value === "paper", d: Number(at("drift").value), world };
    lessons.clear();
    isTold = false;
    Story.end();
    Settings.write(set);
    await guarded(makeWorld);
  }

  async function guarded(work) {
    try {
      await work();
    } catch (why) {
      at("work").hidden = true;
      headline(["This did not work."]);
      problem(sentence(why));
      for (const id of ["apply"]) at(id).disabled = false;
    }
  }

  function play() {
    if (!busy && isTold && verdict === null) return tell();
    if (!busy) return at("texture").value ? identify(Number(at("texture").value)) : surprise();
    playing = !playing;
    enable(true);
    lock();
  }

  // The first visit's exploration, in a world as made for it.
  function tell() {
    Story.begin(nameOf(set.x), known.textures.length);
    identify(set.x);
  }

  // After the story the probe is the usual one again.
  const then = work => async () => {
    if (isTold && !busy && known) await guarded(async () => {
      isTold = false;
      Story.end();
      set = { ...set, paper: false };
      Settings.controls(set);
      await makeWorld();
    });
    work();
  };

  // The same exploration again, from the same beginning, unless it was taught something.
  const replay = () => guarded(async () => {
    if (busy && lessons.size) return;
    if (!lessons.size) await makeWorld();
    if (isTold) tell(); else identify(set.x);
  });

  for (const id of ["play", "tale-pause"]) at(id).addEventListener("click", () => busy || verdict === null ? play() : then(play)());
  for (const id of ["replay", "tale-again"]) at(id).addEventListener("click", replay);
  at("step").addEventListener("click", onwards);
  for (const id of ["surprise", "tale-more"]) at(id).addEventListener("click", then(surprise));
  at("unknown").addEventListener("click", then(unknown));
  at("speed").addEventListener("change", () => { set.speed = at("speed").value; owed = 0; Settings.write(set); });
  at("texture").addEventListener("change", () => { set.x = Number(at("texture").value); Settings.write(set); });
  at("move").addEventListener("click", () => {
    if (busy || !known) return;
    problem();
    const number = Number(at("texture").value) || known.numbers[0];
    draw();
    begin(number, { do: "move", texture: number, seed: set.seed, force_n: Number(at("force").value), speed_mm_s: Number(at("mms").value) });
    if (busy) headline(["A movement by hand."]);
  });
  at("wear").addEventListener("change", () => {
    set.wear = Number(at("wear").value);
    Settings.write(set);
    if (known) Probe.ask({ do: "skin", wear: set.wear });
  });
  for (const id of ["threshold", "alarm"]) {
    at(id).addEventListener("change", () => {
      set.t = Settings.THRESHOLDS[at("threshold").value];
      set.fa = Settings.ALARMS[at("alarm").value];
      Settings.write(set);
    });
  }
  for (const id of ["count", "threshold", "alarm", "drift", "force", "mms", "wear"]) at(id).addEventListener("input", Settings.outputs);
  at("apply").addEventListener("click", apply);
  at("teach").addEventListener("submit", event => {
    event.preventDefault();
    const name = at("name").value.trim();
    if (!name) return problem("Give it a name first.");
    label(name);
  });
  at("confirm").addEventListener("click", () => verdict && label(verdict.texture));
  at("again").addEventListener("click", () => { draw(); identify(asked.number); });
  at("link").addEventListener("click", async () => {
    Settings.write(set);
    try {
      await navigator.clipboard.writeText(location.href);
      at("linked").textContent = "Copied.";
    } catch {
      at("linked").textContent = "The address of this page is the link: copy it from there.";
    }
  });
  at("worn").addEventListener("click", then(() => {
    if (busy || !known) return;
    at("wear").value = Math.min(1, Number(at("wear").value) + Number(at("wear").step));
    Settings.outputs();
    at("wear").dispatchEvent(new Event("change"));
    identify(set.x || known.numbers.find(number => number !== null));
  }));
  addEventListener("resize", Traces.again);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", Traces.again);

  // ---- which probe

  const FAILED = "This did not work.";
  const idle = () => `It knows ${known?.textures.length ?? 0} textures. Have it touch one.`;

  // What a probe at a port and a log show with.
  const outside = {
    settings: () => set,
    sentence,
    knows: now => {
      delete document.body.dataset.blank;
      if (JSON.stringify(now) !== JSON.stringify(known)) knows(now);
    },
    // an exploration, or other work
    begins: explores => {
      problem();
      if (!explores) {
        if (at("verdict").textContent === FAILED) headline([idle()]);
        return;
      }
      forget();
      document.body.dataset.told = "";
      verdict = null;
      Places.likely([]);
      if (known) even();
      headline(["What is this?"]);
    },
    happened,
    hears: frame => {
      Traces.take({ ...frame, pdc: [] });
      for (const one of frame.happened) happened(one);
      at("g-force").textContent = `${Math.max(0, frame.force_n).toFixed(2)} N`;
      at("g-speed").textContent = `${Math.abs(frame.speed_mm_s).toFixed(0)} mm/s`;
      at("g-time").textContent = `${(frame.at_ms / 1000).toFixed(1)} s`;
      if (frame.phase) say(sentences[frame.phase] ?? "");
      else say(frame.connected ? "Ready" : "");
      if (!frame.busy && frame.connected && verdict === null && slides === 0 && ![idle(), FAILED].includes(at("verdict").textContent)) headline([idle()]);
    },
    fails: () => headline([FAILED]),
    ends: () => { if (source === "usb") headline(["No probe is connected."]); },
  };

  async function turn(to) {
    if (to === source) return;
    if (source === "sim" && busy) { try { Probe.ask({ do: "stop" }); } catch { /* nothing was asked for */ } }
    busy = false; playing = false;
    Story.end();
    delete document.body.dataset.found;
    source = to;
    document.body.dataset.source = to;
    // nothing is known of a probe that is not there
    if (to === "sim") delete document.body.dataset.blank; else { document.body.dataset.blank = ""; at("figures").textContent = ""; known = null; }
    for (const name of ["sim", "usb", "own"]) at(`from-${name}`).setAttribute("aria-pressed", String(name === to));
    forget();
    Places.likely([]);
    document.body.dataset.told = "";
    verdict = null;
    say("");
    if (to === "sim") return guarded(makeWorld);
    if (to === "own") return;
    headline(["No probe is connected."]);
  }
  for (const name of ["sim", "usb", "own"]) at(`from-${name}`).addEventListener("click", () => turn(name));

  // ---- the beginning

  async function start() {
    if (!location.hash) { set = { ...Story.FIRST }; isTold = true; }
    Settings.controls(set);
    Rig.build(at("rig"));
    Places.build(at("map"));
    // the first picture before the work
    await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    if (typeof WebAssembly !== "object") throw new Error("this browser has no WebAssembly: take a newer one");
    await Probe.load();
    all = Probe.ask({ do: "textures" }).names;
    Usb.build(outside);
    Own.build(sentence);
    await makeWorld();
    window.tactus.ready = performance.now() - began;
    before = performance.now();
    requestAnimationFrame(tick);
    // someone who wants no motion begins it
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) {
      if (isTold) tell(); else if (set.x > 0) identify(set.x); else surprise();
    }
  }

  // for tests: what is under way, and how fast
  window.tactus = {
    ready: null,
    usb: Usb.now,
    own: Own.now,
    files: () => Files.kept.map(({ name, bytes }) => ({ name, bytes: [...bytes] })),
    now: () => ({ source, busy, playing, slides, verdict, last, set, known, memory: Probe.bytes() }),
    framesPerSecond: () => frames.length < 2 ? 0 : 1000 * (frames.length - 1) / (frames.at(-1) - frames[0]),
  };
  guarded(start);
})();
