// A serial port for a page: `navigator.serial` in the browser, a TCP port at the other end. The page's content-security policy
// forbids it any connection, so bytes go through the pipe that drives the browser.
import { connect } from "node:net";

const SHIM = `(() => {
  // as the Web Serial specification has it: an error ends a stream; after those that are not fatal the port has another one
  let state = "closed", gone = false, readable = null, writable = null, come = null;
  const text = bytes => btoa(String.fromCharCode(...bytes));
  window.tactusSerialCame = base64 => { port.readable; come?.enqueue(Uint8Array.from(atob(base64), c => c.charCodeAt(0))); };
  window.tactusSerialFails = (name, fatal) => {
    const failed = come;
    gone = fatal;
    readable = come = null;
    failed?.error(new DOMException("A read has failed.", name));
  };
  window.tactusSerialGone = () => { if (state === "opened" && !gone) tactusSerialFails("NetworkError", true); };
  const port = {
    getInfo: () => ({ usbVendorId: 0x0483, usbProductId: 0x374b }),
    async open({ baudRate }) {
      if (state !== "closed") throw new DOMException("The port is already open.", "InvalidStateError");
      if (baudRate !== 921600) throw new Error("another baud rate: " + baudRate);
      [state, gone] = ["opened", false];
      tactusSerial(JSON.stringify({ open: true }));
    },
    get readable() {
      if (state !== "opened" || gone) return null;
      readable ??= new ReadableStream({ start(to) { come = to; }, cancel() { come = null; } });
      return readable;
    },
    get writable() {
      if (state !== "opened" || gone) return null;
      writable ??= new WritableStream({ write(bytes) { tactusSerial(JSON.stringify({ send: text(bytes) })); } });
      return writable;
    },
    async close() {
      await Promise.all([readable?.cancel(), writable?.abort()]);
      [state, readable, writable, come] = ["closed", null, null, null];
      tactusSerial(JSON.stringify({ open: false }));
    },
  };
  Object.defineProperty(navigator, "serial", { configurable: true, value: { requestPort: async () => port } });
})()`;

/// Gives a tab a serial port at whose other end is the TCP port HOST:PORT; before the tab opens the page. `unplug` pulls
/// the plug while the page looks, `end` when it does not any more.
export async function serial(it, address) {
  let socket = null;
  const [host, port] = [address.slice(0, address.lastIndexOf(":")), Number(address.slice(address.lastIndexOf(":") + 1))];
  let sending = Promise.resolve();
  const call = expression => { sending = sending.then(() => it.evaluate(expression)).catch(() => {}); };
  const gone = () => { if (socket) { socket.destroy(); socket = null; call("tactusSerialGone()"); } };
  await it.binding("tactusSerial", payload => {
    const { send, open } = JSON.parse(payload);
    if (send !== undefined) socket?.write(Buffer.from(send, "base64"));
    if (open === true) {
      const here = socket = connect({ host, port, noDelay: true });
      here.on("data", bytes => { if (here === socket) call(`tactusSerialCame("${bytes.toString("base64")}")`); });
      here.on("close", () => { if (here === socket) gone(); });
      here.on("error", () => {});
    }
    if (open === false) { const old = socket; socket = null; old?.destroy(); }
  });
  await it.before(SHIM);
  // a probe serves one host after the other
  const end = () => { const old = socket; socket = null; old?.destroy(); };
  return { unplug: gone, end };
}
