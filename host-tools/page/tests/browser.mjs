// Headless Chromium, driven over a pipe: nothing to install but Chromium and Node.js.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

/// A browser that says nothing for so long does not work any more.
const ANSWER_S = 60;

/// The promise's result, or after so many seconds an error with this sentence.
export function within(seconds, sentence, promise) {
  let timer;
  const late = new Promise((_, failed) => { timer = setTimeout(() => failed(new Error(sentence)), 1000 * seconds); });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

/// Starts a browser; `kill` ends it, whatever it is doing.
export async function launch(program) {
  const profile = mkdtempSync(join(tmpdir(), "tactus-page-"));
  const options = ["--headless=new", "--remote-debugging-pipe", `--user-data-dir=${profile}`, "--no-first-run", "--disable-gpu",
    "--disable-background-networking", "--disable-component-update", "--mute-audio", "--force-device-scale-factor=1", "about:blank"];
  // in a container root has no sandbox, and shared memory is often small
  if (process.getuid?.() === 0) options.unshift("--no-sandbox", "--disable-dev-shm-usage");
  // a group of its own, so that its helpers end with it
  const child = spawn(program, options, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"], detached: true });
  const waiting = new Map(), listeners = [];
  let next = 1, rest = "", over = null;
  const ended = why => {
    over ??= why;
    for (const { failed } of waiting.values()) failed(new Error(over));
    waiting.clear();
  };
  child.on("error", why => ended(`${program} does not start: ${why.message}`));
  child.on("exit", (code, signal) => ended(`the browser has ended (${signal ?? `code ${code}`})`));
  // a pipe that breaks is told by the exit
  for (const pipe of [child.stdio[3], child.stdio[4]]) pipe.on("error", () => {});
  child.stdio[4].setEncoding("utf8").on("data", text => {
    rest += text;
    for (let end; (end = rest.indexOf("\0")) >= 0;) {
      const message = JSON.parse(rest.slice(0, end));
      rest = rest.slice(end + 1);
      if (message.id) {
        const asked = waiting.get(message.id);
        waiting.delete(message.id);
        if (message.error) asked?.failed(new Error(message.error.message)); else asked?.done(message.result);
      } else {
        for (const listener of listeners) listener(message);
      }
    }
  });
  const send = (method, params = {}, sessionId) => {
    if (over) return Promise.reject(new Error(over));
    const id = next++;
    const answer = new Promise((done, failed) => {
      waiting.set(id, { done, failed });
      child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    });
    return within(ANSWER_S, `the browser did not answer ${method} in ${ANSWER_S} s`, answer).finally(() => waiting.delete(id));
  };
  const kill = async () => {
    // its own helpers may outlive it by a moment, and write to the profile
    if (child.pid) try { process.kill(-child.pid, "SIGKILL"); } catch (why) { if (why.code !== "ESRCH") throw why; }
    for (let n = 0; n < 100 && !over; n++) await new Promise(done => setTimeout(done, 50));
    try { rmSync(profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 100 }); } catch (why) { console.error(`${profile} stays: ${why.message}`); }
  };
  try {
    await send("Browser.getVersion");
  } catch (why) {
    await kill();
    throw why;
  }
  return { pid: child.pid, send, kill, on: listener => listeners.push(listener) };
}

/// A tab that collects what is wrong: errors of scripts, all messages of the console, those of the content-security policy, and whatever it loads.
export async function tab(browser, { width, height, touch = false, scheme = "light", motion = "no-preference" }) {
  const { targetId } = await browser.send("Target.createTarget", { url: "about:blank" });
  const { sessionId } = await browser.send("Target.attachToTarget", { targetId, flatten: true });
  const send = (method, params) => browser.send(method, params, sessionId);
  const errors = [], loaded = [];
  browser.on(({ method, params, sessionId: of }) => {
    if (of !== sessionId) return;
    if (method === "Inspector.targetCrashed") errors.push("the page's process has crashed");
    if (method === "Runtime.exceptionThrown") errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled") errors.push(`${params.type}: ` + params.args.map(a => a.value ?? a.description).join(" "));
    if (method === "Log.entryAdded") errors.push(`${params.entry.level}: ${params.entry.text}`);
    if (method === "Network.requestWillBeSent" && !params.request.url.startsWith("data:")) loaded.push(params.request.url);
  });
  for (const domain of ["Page", "Runtime", "Log", "Network"]) await send(`${domain}.enable`);
  /// Gives the page this size and these colours; a narrow one is a phone's.
  const size = async (width, height, touch, scheme = "light") => {
    await send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: touch });
    await send("Emulation.setTouchEmulationEnabled", { enabled: touch });
    await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }, { name: "prefers-reduced-motion", value: motion }] });
  };
  await size(width, height, touch, scheme);
  const evaluate = async expression => {
    const { result, exceptionDetails } = await send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  };
  const until = async (what, expression, seconds = 60) => {
    const end = Date.now() + 1000 * seconds;
    while (!await evaluate(expression)) {
      if (Date.now() > end) throw new Error(`not in ${seconds} s: ${what}\n${await evaluate("document.getElementById('verdict')?.textContent")}\n${errors.join("\n")}`);
      await new Promise(done => setTimeout(done, 40));
    }
  };
  const open = async url => {
    await send("Page.navigate", { url });
    await until("the page is there", "document.readyState === 'complete'");
  };
  const key = async (name, code, text) => {
    const params = { key: name, code: name, windowsVirtualKeyCode: code, text };
    await send("Input.dispatchKeyEvent", { type: "keyDown", ...params });
    await send("Input.dispatchKeyEvent", { type: "keyUp", ...params });
  };
  const screenshot = async whole => {
    const { data } = await send("Page.captureScreenshot", { format: "png", captureBeyondViewport: whole });
    return Buffer.from(data, "base64");
  };
  /// Runs a script in the page before its own.
  const before = source => send("Page.addScriptToEvaluateOnNewDocument", { source });
  /// Gives the page a function of this name: what it is called with comes here.
  const binding = async (name, called) => {
    browser.on(({ method, params, sessionId: of }) => {
      if (of === sessionId && method === "Runtime.bindingCalled" && params.name === name) called(params.payload);
    });
    await send("Runtime.addBinding", { name });
  };
  const close = () => browser.send("Target.closeTarget", { targetId });
  return { send, size, evaluate, until, open, key, screenshot, before, binding, close, errors, loaded };
}
