// The page's side of a serial port, without a browser: ports that fail in one way each. The page says one sentence, goes
// on or connects again, and nothing reaches the console.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import vm from "node:vm";

const SOURCE = readFileSync(new URL("../www/usb.js", import.meta.url), "utf8");
const rest = (ms = 60) => new Promise(done => setTimeout(done, ms));

/// A port as the Web Serial specification has it, apart from what `faults` replaces.
class Port {
  state = "closed"; gone = false; come = null; streams = {}; sent = [];
  constructor(faults = {}) { Object.assign(this, faults); }
  getInfo() { return {}; }
  async open() {
    if (this.state !== "closed") throw new DOMException("The port is already open.", "InvalidStateError");
    this.state = "opened";
    this.gone = false;
  }
  get readable() {
    if (this.state !== "opened" || this.gone) return null;
    return this.streams.readable ??= new ReadableStream({ start: to => { this.come = to; }, cancel() {} });
  }
  get writable() {
    if (this.state !== "opened" || this.gone) return null;
    return this.streams.writable ??= new WritableStream({ write: bytes => this.takes(bytes) });
  }
  takes(bytes) { this.sent.push(...bytes); }
  fails(name, fatal) {
    const come = this.come;
    this.streams.readable = this.come = null;
    this.gone = fatal;
    come.error(new DOMException("a read failed", name));
  }
  async close() {
    await Promise.all([this.streams.readable?.cancel(), this.streams.writable?.abort()]);
    this.streams = {};
    this.state = "closed";
  }
}

/// The page's usb.js with this port; what it shows, and what it asked of the module.
function page(port, more = {}) {
  const parts = {}, asked = [];
  const part = id => parts[id] ??= {
    hidden: false, textContent: "", value: "", max: 10, min: 1, files: [], works: {},
    addEventListener(what, does) { this.works[what] = does; }, replaceChildren() {},
  };
  const frame = { send: [7], said: "", known: null, files: [], folders: [], failed: null, connected: true, busy: false, question: null };
  const remote = request => {
    asked.push(request);
    if (request.do === more.traps) throw new Error("unreachable");
    return request.do === "closed" ? { ...frame, send: [], connected: false, failed: "the port was closed" } : { ...frame };
  };
  const here = {
    document: { getElementById: part }, crypto, performance, Option: class {}, Files: {}, Uint8Array, DOMException, Promise,
    navigator: { serial: { requestPort: more.requestPort ?? (async () => port) } }, Probe: { remote }, setInterval, clearInterval,
  };
  vm.runInNewContext(`${SOURCE}\nglobalThis.Usb = Usb;`, here);
  here.Usb.build({ settings: () => ({}), begins() {}, ends() {}, hears() {}, knows() {}, fails() {}, sentence: why => why.message });
  const problem = () => part("u-problem").hidden ? "" : part("u-problem").textContent;
  const connect = async () => { await part("u-connect").works.click(); await rest(); };
  return { part, asked, problem, connect, says: () => part("u-say").textContent };
}

const unheard = [];
const quiet = async run => {
  const hear = why => unheard.push(why);
  process.on("unhandledRejection", hear);
  await run();
  await rest();
  process.off("unhandledRejection", hear);
  assert.deepEqual(unheard.splice(0), []);
};

const never = () => new Promise(() => {});
const fails = () => { throw new DOMException("it fails", "NetworkError"); };

/// All of them, for a registry of tests.
export function ports(test) {
  for (const name of ["FramingError", "ParityError", "BreakError", "BufferOverrunError", "UnknownError"]) {
    test(`the page goes on after ${name}`, () => quiet(async () => {
      const port = new Port(), it = page(port);
      await it.connect();
      for (let n = 0; n < 3; n++) { port.fails(name, false); await rest(); }
      assert.equal(it.says(), "The probe waits.");
      port.come.enqueue(Uint8Array.of(1, 2, 3));
      await rest();
      assert(it.asked.some(request => request.received?.length === 3));
      await it.connect();
      assert.equal(port.state, "closed");
    }));
  }

  for (const [what, faults, more] of [
    ["a plug is pulled", {}],
    ["a close that fails", { close: fails }],
    ["a close that never ends", { close: never }],
    ["a write that fails", { takes: fails }],
    ["a write that never ends", { takes: never }],
    ["a module that traps when the port goes", {}, { traps: "closed" }],
    ["a port that says nothing of itself", { getInfo: fails }],
  ]) {
    test(`the page connects again after ${what}`, () => quiet(async () => {
      const port = new Port(faults), it = page(port, more);
      await it.connect();
      port.fails("NetworkError", true);
      await rest(200);
      assert.equal(it.says(), "No probe is connected.", what);
      // the port is the system's again
      [port.state, port.streams, port.takes, port.close] = ["closed", {}, () => {}, Port.prototype.close];
      await it.connect();
      assert.equal(it.says(), "The probe waits.", what);
      assert.equal(it.problem(), "", what);
      await it.connect();
    }));
  }

  test("two clicks are one connection", () => quiet(async () => {
    const port = new Port();
    let choose;
    const it = page(port, { requestPort: () => new Promise(done => { choose = () => done(port); }) });
    const click = it.part("u-connect").works.click;
    const both = [click(), click()];
    choose();
    await Promise.all([both[0], Promise.race([both[1], rest()])]);
    await rest();
    assert.deepEqual([it.says(), it.problem()], ["The probe waits.", ""]);
    await click();
  }));

  for (const [what, file, says] of [
    ["is gone", { name: "t", size: 9, arrayBuffer: async () => { throw new DOMException("not found", "NotFoundError"); } }, "not found"],
    ["is a film", { name: "film", size: 5e9, arrayBuffer: () => assert.fail("it is read") }, "film"],
  ]) {
    test(`a table that ${what} is said in a sentence`, () => quiet(async () => {
      const port = new Port(), it = page(port);
      await it.connect();
      it.part("u-push").files = [file];
      await it.part("u-push").works.change();
      assert(it.problem().includes(says), it.problem());
      assert(!it.asked.some(request => request.do === "work"));
      await it.connect();
    }));
  }
}
