// Headless Chromium, driven over a pipe: nothing to install but Chromium and Node.js.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

/// Starts a browser; `close` ends it.
export async function launch(program) {
  const profile = mkdtempSync(join(tmpdir(), "tactus-page-"));
  const options = ["--headless=new", "--remote-debugging-pipe", `--user-data-dir=${profile}`, "--no-first-run", "--disable-gpu",
    "--disable-background-networking", "--disable-component-update", "--mute-audio", "--force-device-scale-factor=1", "about:blank"];
  // in a container root has no sandbox
  if (process.getuid?.() === 0) options.unshift("--no-sandbox");
  const child = spawn(program, options, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  const waiting = new Map(), listeners = [];
  let next = 1, rest = "";
  child.stdio[4].setEncoding("utf8").on("data", text => {
    rest += text;
    for (let end; (end = rest.indexOf("\0")) >= 0;) {
      const message = JSON.parse(rest.slice(0, end));
      rest = rest.slice(end + 1);
      if (message.id) {
        const { done, failed } = waiting.get(message.id);
        waiting.delete(message.id);
        if (message.error) failed(new Error(message.error.message)); else done(message.result);
      } else {
        for (const listener of listeners) listener(message);
      }
    }
  });
  child.on("exit", () => { for (const { failed } of waiting.values()) failed(new Error("the browser has ended")); });
  const send = (method, params = {}, sessionId) => new Promise((done, failed) => {
    waiting.set(next, { done, failed });
    child.stdio[3].write(`${JSON.stringify({ id: next++, method, params, sessionId })}\0`);
  });
  const close = async () => {
    const ended = new Promise(done => child.once("exit", done));
    child.kill();
    await ended;
    rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
  };
  return { send, close, on: listener => listeners.push(listener) };
}

/// A tab that collects what is wrong: errors of scripts, of the console, of the content-security policy, and whatever it loads.
export async function tab(browser, { width, height, touch = false, scheme = "light", motion = "no-preference" }) {
  const { targetId } = await browser.send("Target.createTarget", { url: "about:blank" });
  const { sessionId } = await browser.send("Target.attachToTarget", { targetId, flatten: true });
  const send = (method, params) => browser.send(method, params, sessionId);
  const errors = [], loaded = [];
  browser.on(({ method, params, sessionId: of }) => {
    if (of !== sessionId) return;
    if (method === "Runtime.exceptionThrown") errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled" && ["error", "warning"].includes(params.type)) errors.push(params.args.map(a => a.value ?? a.description).join(" "));
    if (method === "Log.entryAdded" && params.entry.level !== "info" && params.entry.level !== "verbose") errors.push(params.entry.text);
    if (method === "Network.requestWillBeSent" && !params.request.url.startsWith("data:")) loaded.push(params.request.url);
  });
  for (const domain of ["Page", "Runtime", "Log", "Network"]) await send(`${domain}.enable`);
  await send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: touch });
  await send("Emulation.setTouchEmulationEnabled", { enabled: touch });
  await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }, { name: "prefers-reduced-motion", value: motion }] });
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
  const close = () => browser.send("Target.closeTarget", { targetId });
  return { send, evaluate, until, open, key, screenshot, close, errors, loaded };
}
