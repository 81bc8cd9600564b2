"use strict";
// The probe: the core and the simulated rig as WebAssembly, asked in JSON.
const Probe = (() => {
  let exports;
  const encoder = new TextEncoder();
  const decoder = new TextDecoder();

  // The module stands in the page itself, so that the page works from a file, too.
  async function load() {
    exports = (await WebAssembly.instantiate(inPage("wasm"), {})).instance.exports;
    write(inPage("trials"));
    exports.world();
  }

  // Bytes that stand in the page.
  function inPage(id) {
    const binary = atob(document.getElementById(id).textContent.trim());
    const bytes = new Uint8Array(binary.length);
    for (let n = 0; n < binary.length; n++) bytes[n] = binary.charCodeAt(n);
    return bytes;
  }

  // Asks for something, and gets what the core says. An error of the core is an Error with its sentence.
  const ask = request => to("ask", request);
  // The same of a probe at a line.
  const remote = request => to("remote", request);

  // The same of the user's own files, and such a file.
  const own = request => to("own", request);
  function give(path, bytes) {
    const name = encoder.encode(path), all = new Uint8Array(name.length + bytes.length);
    all.set(name);
    all.set(bytes, name.length);
    write(all);
    exports.file(name.length);
  }

  function write(bytes) {
    const at = exports.request(bytes.length);
    new Uint8Array(exports.memory.buffer, at, bytes.length).set(bytes);
  }

  function to(whom, request) {
    write(encoder.encode(JSON.stringify(request)));
    const length = exports[whom]();
    const reply = JSON.parse(decoder.decode(new Uint8Array(exports.memory.buffer, exports.reply(), length)));
    if (reply.is === "error") throw new Error(reply.why);
    return reply;
  }

  const bytes = () => exports.memory.buffer.byteLength;
  return { load, ask, remote, own, give, bytes };
})();
