"use strict";
// A probe at a serial port: bytes between the browser's port and the module, and what is asked for.
const Usb = (() => {
  const BAUD = 921600, EVERY_MS = 20, CLOSING_MS = 1000, MOST_BYTES = 1 << 20;
  // of ST, who makes the NUCLEO's ST-LINK
  const BOARDS = [{ usbVendorId: 0x0483 }];
  const at = id => document.getElementById(id);
  // of a port that is open: its streams' reader and writer, what came and is not read yet, and the writing under way
  let page, line = null, choosing = false, frame = null, closing = Promise.resolve(), lossTold = -Infinity;

  let buttons = [];
  const pause = ms => new Promise(done => { const timer = setInterval(() => { clearInterval(timer); done(); }, ms); });
  const moved = () => ({ yes: true, no: false })[at("u-moved").value] ?? null;
  const seed = () => crypto.getRandomValues(new Uint32Array(1))[0];
  const now = () => Math.round(performance.now());

  function build(callbacks) {
    page = callbacks;
    const has = "serial" in navigator;
    at("u-none").hidden = has;
    at("u-all").hidden = !has;
    const works = {
      "u-status": () => ({ do: "status" }),
      "u-home": () => ({ do: "home" }),
      "u-identify": () => ({ do: "identify", threshold: page.settings().t, false_alarm: page.settings().fa, max_slides: 10, seed: seed() }),
      "u-teach": () => ({ do: "teach", name: at("u-name").value }),
      "u-train": () => ({ do: "train", name: at("u-name").value, trials: whole("u-trials"), moved: moved(), seed: seed() }),
      "u-verify": () => ({ do: "verify", name: at("u-known").value, threshold: page.settings().t, max_slides: 10, seed: seed() }),
      "u-record": () => ({ do: "record", name: at("u-name").value, slides: whole("u-slides"), moved: moved(), seed: seed() }),
      "u-pull": () => ({ do: "pull" }),
      "u-rename": () => ({ do: "rename", from: at("u-which").value, to: at("u-new").value }),
      "u-forget": () => ({ do: "forget", name: at("u-which").value }),
      "u-training": () => ({ do: "forget-training", name: at("u-new").value }),
      "u-self": () => ({ do: "forget-self-learned" }),
      "u-factory": () => ({ do: "factory" }),
      "u-settings": () => ({ do: "settings" }),
      "u-alarm": () => ({ do: "false-alarm", share: at("u-share").value === "" ? null : Number(at("u-share").value) }),
      "u-high": () => ({ do: "high-force", on: true }),
      "u-low": () => ({ do: "high-force", on: false }),
    };
    buttons = Object.keys(works);
    for (const [id, wanted] of Object.entries(works)) at(id).addEventListener("click", () => work(wanted()));
    at("u-connect").addEventListener("click", async () => {
      if (line) return leave(true);
      // a second click while a port is chosen
      if (choosing) return;
      choosing = true;
      try { await connect(); } finally { choosing = false; }
    });
    at("u-stop").addEventListener("click", () => step({ do: "stop" }));
    at("u-log").addEventListener("click", () => step({ do: "log" }));
    at("u-yes").addEventListener("click", () => step({ do: "answer", yes: true }));
    at("u-no").addEventListener("click", () => step({ do: "answer", yes: false }));
    at("u-push").addEventListener("change", async () => {
      const file = at("u-push").files[0];
      at("u-push").value = "";
      if (!file) return;
      if (file.size > MOST_BYTES) return problem(`${file.name} has ${file.size} bytes: it is no table of a probe. Choose one that tactus learn wrote.`);
      let bytes;
      try { bytes = new Uint8Array(await file.arrayBuffer()); } catch (why) { return problem(`${file.name} cannot be read: ${why.message}. Choose it again.`); }
      work({ do: "push", file: file.name, bytes: [...bytes] });
    });
    show();
  }

  function whole(id) {
    const value = Math.round(Number(at(id).value));
    return Math.min(Number(at(id).max), Math.max(Number(at(id).min), value || 1));
  }

  async function connect() {
    problem();
    let port;
    try {
      port = await navigator.serial.requestPort({ filters: BOARDS });
    } catch (why) {
      // nobody chose one
      if (why.name !== "NotFoundError") problem(`The browser gives no port: ${why.message}`);
      return;
    }
    try {
      // the same port may still be closing
      await closing;
      await port.open({ baudRate: BAUD, bufferSize: 65536 });
    } catch (why) {
      problem(`The port does not open: ${why.message} Is it open in another tab, a terminal or another tactus? Close that, then connect again.`);
      return;
    }
    const here = line = { port, reader: null, writer: null, came: [], writing: Promise.resolve(), timer: null };
    at("u-said").textContent = "";
    let info;
    try { info = port.getInfo(); } catch { /* it is called a serial port then */ }
    const { usbVendorId: vendor, usbProductId: product } = info ?? {};
    const hex = number => number.toString(16).padStart(4, "0");
    const name = vendor === undefined ? "the serial port" : `USB ${hex(vendor)}:${hex(product ?? 0)}`;
    read(here);
    page.begins();
    step({ do: "connect", port: name, now_ms: now() });
    here.timer = setInterval(tick, EVERY_MS);
  }

  // A framing, break, parity or overrun error ends the port's stream, and the port has another one then; a port that is
  // gone has none.
  async function read(of) {
    while (line === of && of.port.readable) {
      try {
        of.reader = of.port.readable.getReader();
        for (;;) {
          const { value, done } = await of.reader.read();
          if (done) { if (line === of) leave(); return; }
          of.came.push(value);
        }
      } catch (why) {
        if (line === of && of.port.readable) loses(why);
      }
      try { of.reader?.releaseLock(); } catch { /* it has no stream any more */ }
      // a line that does nothing but fail leaves time for the page
      await pause(EVERY_MS);
    }
    if (line === of) leave();
  }

  // The probe's messages have checksums: what is lost is asked for again, or told by the module.
  function loses(why) {
    if (now() - lossTold > 1000) say(`The line is disturbed, and bytes are lost: ${why.name}.\n`);
    lossTold = now();
  }

  function tick() {
    const received = line.came.flatMap(part => [...part]);
    line.came = [];
    step({ do: "step", now_ms: now(), received });
  }

  // The port is left: by the user, or since it has failed. A step that fails keeps no other one from being done.
  function leave(wanted) {
    const old = line;
    line = null;
    clearInterval(old.timer);
    const told = [
      () => take({ ...Probe.remote({ do: "closed" }), ...(wanted ? { failed: null } : {}) }, old),
      () => { frame = null; },
      () => page.ends(),
      show,
    ];
    for (const step of told) try { step(); } catch (why) { problem(page.sentence(why)); }
    closing = close(old);
  }

  async function close(old) {
    const steps = [
      () => old.reader?.cancel(),
      () => old.reader?.releaseLock(),
      () => old.writing,
      () => old.writer?.releaseLock(),
      () => old.port.close(),
    ];
    for (const step of steps) try { await Promise.race([step(), pause(CLOSING_MS)]); } catch { /* a port that is gone */ }
  }

  // An error ends this stream, too; the next bytes ask for another one.
  async function write(to, bytes) {
    to.writer = to.port.writable?.getWriter();
    try { await to.writer?.write(bytes); } catch { /* a port that is gone is told by its reader */ }
    try { to.writer?.releaseLock(); } catch { /* it was released with the port */ }
  }

  function work(wanted) {
    problem();
    page.begins(wanted.do === "identify");
    step({ do: "work", work: wanted });
  }

  function step(request) {
    try {
      take(Probe.remote(request));
    } catch (why) {
      problem(page.sentence(why));
    }
  }

  function take(now, to = line) {
    frame = now;
    if (now.send.length && to) {
      const bytes = Uint8Array.from(now.send);
      // in order
      to.writing = to.writing.then(() => write(to, bytes)).catch(() => {});
    }
    if (now.known) { page.knows(now.known); choices(now.known.textures); }
    if (now.said) say(now.said);
    page.hears(now);
    for (const { name, bytes } of now.files) Files.keep(name, Uint8Array.from(bytes));
    for (const folder of now.folders) Files.keepFolder(folder);
    if (now.failed) {
      problem(page.sentence(new Error(now.failed)));
      page.fails();
      // nobody answers there
      if (line && !now.connected && !now.busy) leave(true);
    }
    show();
  }

  function say(text) {
    const box = at("u-said"), end = box.scrollTop + box.clientHeight >= box.scrollHeight - 4;
    box.textContent = (box.textContent + text).slice(-60000);
    if (end) box.scrollTop = box.scrollHeight;
  }

  function choices(names) {
    for (const id of ["u-known", "u-which"]) {
      const before = at(id).value;
      at(id).replaceChildren(...names.map(name => new Option(name, name)));
      if (names.includes(before)) at(id).value = before;
    }
    at("u-names").replaceChildren(...names.map(name => new Option(name)));
  }

  function problem(why) {
    at("u-problem").hidden = !why;
    at("u-problem").textContent = why ?? "";
  }

  // What can be asked for now.
  function show() {
    const there = frame?.connected === true, busy = frame?.busy === true;
    at("u-connect").textContent = line ? "Disconnect" : "Connect a probe";
    at("u-stop").disabled = !line || !busy;
    at("u-log").disabled = !line;
    at("u-push").disabled = !there || busy;
    for (const id of buttons) at(id).disabled = !there || busy;
    const asked = frame?.question ?? null;
    at("u-question").hidden = asked === null;
    if (asked !== null && at("u-asked").textContent !== asked.asked) at("u-asked").textContent = asked.asked;
    at("u-yes").textContent = asked?.yes ?? "Yes";
    at("u-no").textContent = asked?.no ?? "No";
    at("u-say").textContent = !line ? "No probe is connected." : !frame || busy && !there ? "Looking for a probe at this port." : there ? busy ? "The probe is at work." : "The probe waits." : "No probe answers here.";
  }

  return { build, now: () => frame };
})();
