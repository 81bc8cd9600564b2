"use strict";
// Recordings of the user's own: dropped, read by the command's importer, shown, and judged.
const Own = (() => {
  const element = id => document.getElementById(id);
  let asked = 0, found = null, given = [];

  // The files below what was dropped, each with its path.
  async function below(entry, path = "") {
    if (entry.isFile) return [{ path: path + entry.name, file: await new Promise((done, failed) => entry.file(done, failed)) }];
    const reader = entry.createReader(), all = [];
    for (;;) {
      const some = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (!some.length) return all;
      for (const one of some) all.push(...await below(one, `${path}${entry.name}/`));
    }
  }

  // Folders above all of them say nothing.
  function bare(files) {
    while (files.length && files.every(({ path }) => path.includes("/") && path.split("/")[0] === files[0].path.split("/")[0]) && files.some(({ path }) => path.split("/").length > 2))
      files = files.map(({ path, file }) => ({ path: path.slice(path.indexOf("/") + 1), file }));
    return files;
  }

  function problem(why) {
    element("o-problem").hidden = !why;
    element("o-problem").textContent = why ?? "";
  }

  const pause = () => new Promise(done => setTimeout(done));

  async function look(sentence) {
    const mine = ++asked;
    problem();
    found = null;
    element("o-found").hidden = true;
    element("o-say").textContent = "Reading";
    await pause();
    try {
      for (const { path, file } of given) Probe.give(path, new Uint8Array(await file.arrayBuffer()));
      const settings = {};
      for (const name of ["rate", "texture", "channel"]) {
        const value = element(`o-${name}`).value.trim();
        if (value) settings[name] = name === "rate" ? Number(value) : value;
      }
      const now = Probe.own({ do: "look", settings });
      if (mine !== asked) return;
      found = now;
      show();
      const judged = [];
      for (let fold = 0; fold < found.folds; fold++) {
        element("o-say").textContent = `Table ${fold + 1} of ${found.folds}, learned without the slides that it judges`;
        await pause();
        if (mine !== asked) return;
        judged.push(...Probe.own({ do: "judge", fold }).slides);
      }
      tell(judged);
    } catch (why) {
      element("o-say").textContent = "";
      problem(sentence(why));
    }
  }

  const count = (n, of) => `${n} ${of}${n === 1 ? "" : "s"}`;

  function show() {
    const { slides, known, kind, rate_hz: rate, channel, notes, left_out: out } = found;
    element("o-found").hidden = false;
    document.body.dataset.found = "";
    element("o-what").textContent = [`${count(slides.length, "slide")} of ${count(known.textures.length, "texture")} (${kind}, ${+rate.toFixed(1)} Hz, channel ${channel}).`,
      ...notes.map(note => `Note: ${note}.`), ...out.slice(0, 5).map(one => `Left out: ${one}.`)].join(" ");
    Places.know(known);
    for (const { texture, movement, place } of slides) Places.mark(movement, place, known.textures.indexOf(texture));
    Traces.rows(element("o-spectra"), slides.map(({ spectrum }) => spectrum));
    element("o-order").textContent = known.textures.map(name => `${name} (${slides.filter(({ texture }) => texture === name).length})`).join(", ");
    element("o-slides").replaceChildren();
  }

  // Verdicts of tables that have not seen the slide.
  function tell(judged) {
    const sums = { right: 0, wrong: 0, new: 0, "not sure": 0, "not judged": 0 };
    for (const { slide, answer } of judged.sort((a, b) => a.slide - b.slide)) {
      const { texture, recording } = found.slides[slide];
      const told = !answer ? "not judged" : answer.told === "new" ? "new" : ["sure", "changed"].includes(answer.told) ? answer.texture === texture ? "right" : "wrong" : "not sure";
      sums[told] += 1;
      const words = !answer ? "too few slides of its movement" : answer.told === "new" ? `most like ${answer.texture}, too far from it` : `${answer.texture}, ${Mind.percent(answer.probability)}${answer.told === "changed" ? ", but changed" : ""}`;
      element("o-slides").append(Mind.cells([recording, texture, told, words]));
    }
    const unseen = found.by_recording ? "recording" : "slide";
    element("o-say").textContent = `${sums.right} of ${judged.length} right${Object.entries(sums).filter(([told, n]) => n && told !== "right").map(([told, n]) => `, ${n} ${told}`).join("")}, one slide each, by tables that have not seen the ${unseen}.${found.by_recording ? "" : " Slides of one recording are more alike than those of two: with three recordings of each texture, whole ones are kept back."}`;
  }

  function build(sentence) {
    const take = files => {
      if (!files.length) return;
      given = bare(files);
      look(sentence);
    };
    element("o-files").addEventListener("change", () => take([...element("o-files").files].map(file => ({ path: file.webkitRelativePath || file.name, file }))));
    const zone = element("o-drop");
    zone.addEventListener("dragover", event => { event.preventDefault(); zone.classList.add("over"); });
    zone.addEventListener("dragleave", () => zone.classList.remove("over"));
    zone.addEventListener("drop", async event => {
      event.preventDefault();
      zone.classList.remove("over");
      const entries = [...event.dataTransfer.items].map(item => item.webkitGetAsEntry()).filter(Boolean);
      try {
        take((await Promise.all(entries.map(entry => below(entry)))).flat());
      } catch (why) {
        problem(sentence(why));
      }
    });
    element("o-again").addEventListener("click", () => given.length && look(sentence));
  }

  return { build, now: () => found };
})();
