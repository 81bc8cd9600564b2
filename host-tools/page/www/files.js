"use strict";
// Files that the page gives to whoever uses it, and those that it gets.
const Files = (() => {
  const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n >>> 0;
  });

  function crc32(bytes) {
    let crc = 0xffffffff;
    for (const byte of bytes) crc = TABLE[(crc ^ byte) & 0xff] ^ (crc >>> 8);
    return (crc ^ 0xffffffff) >>> 0;
  }

  // A zip file without compression: local headers with the files, then the directory (APPNOTE.TXT, 4.3).
  function zip(files) {
    const encoder = new TextEncoder(), parts = [], directory = [];
    let at = 0;
    for (const { name, bytes } of files) {
      const called = encoder.encode(name), crc = crc32(bytes);
      // version 2.0, names in UTF-8, stored, 1 January 1980
      const common = [[20, 2], [0x0800, 2], [0, 2], [0, 2], [0x21, 2], [crc, 4], [bytes.length, 4], [bytes.length, 4], [called.length, 2], [0, 2]];
      const local = [...numbers([[0x04034b50, 4], ...common]), ...called];
      directory.push(...numbers([[0x02014b50, 4], [20, 2], ...common, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]]), ...called);
      parts.push(Uint8Array.from(local), bytes);
      at += local.length + bytes.length;
    }
    const end = numbers([[0x06054b50, 4], [0, 2], [0, 2], [files.length, 2], [files.length, 2], [directory.length, 4], [at, 4], [0, 2]]);
    parts.push(Uint8Array.from(directory), Uint8Array.from(end));
    const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
    let to = 0;
    for (const part of parts) { whole.set(part, to); to += part.length; }
    return whole;
  }

  // The files of a zip file, by its directory: stored, or deflated, which the browser unpacks.
  async function unzip(zip) {
    const bytes = new Uint8Array(await zip.file.arrayBuffer()), view = new DataView(bytes.buffer), decoder = new TextDecoder();
    const broken = why => new Error(`${zip.name}: the zip file cannot be read (${why}): copy it again, or give the folder itself`);
    let end = bytes.length - 22;
    while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end -= 1;
    if (end < 0) throw broken("its end is missing");
    const files = [];
    try {
      let at = view.getUint32(end + 16, true);
      for (let left = view.getUint16(end + 10, true); left > 0; left--) {
        if (view.getUint32(at, true) !== 0x02014b50) throw new Error("its directory is damaged");
        const how = view.getUint16(at + 10, true), packed = view.getUint32(at + 20, true), called = view.getUint16(at + 28, true);
        const name = decoder.decode(bytes.subarray(at + 46, at + 46 + called)), local = view.getUint32(at + 42, true), crc = view.getUint32(at + 16, true);
        const from = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
        at += 46 + called + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
        if (name.endsWith("/")) continue;
        if (how !== 0 && how !== 8) throw new Error(`${name} is packed in way ${how}`);
        const inside = new Blob([bytes.subarray(from, from + packed)]);
        const content = new Uint8Array(await (how === 0 ? inside : new Response(inside.stream().pipeThrough(new DecompressionStream("deflate-raw")))).arrayBuffer());
        if (crc32(content) !== crc) throw new Error(`${name} is damaged`);
        files.push({ name, file: new Blob([content]) });
      }
    } catch (why) {
      throw broken(why.message);
    }
    if (!files.length) throw new Error(`${zip.name}: there is no file in it; give a folder of recordings, which has a manifest.csv, or a zip file of one`);
    return files;
  }

  const numbers = all => all.flatMap(([value, length]) => Array.from({ length }, (_, n) => (value >>> (8 * n)) & 0xff));

  // Has the browser keep a file.
  function keep(name, bytes) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([bytes], { type: "application/octet-stream" }));
    link.download = name;
    link.click();
    // it is read when the browser has begun
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    kept.push({ name, bytes });
    if (kept.length > 20) kept.shift();
  }
  const kept = [];

  const keepFolder = ({ name, files }) =>
    keep(`${name}.zip`, zip(files.map(file => ({ name: `${name}/${file.name}`, bytes: Uint8Array.from(file.bytes) }))));

  // What was dropped, folders with all that lies in them: names with their folders, and the files.
  async function dropped(data) {
    // all at once: later the browser has forgotten them
    const items = [...data.items].filter(item => item.kind === "file"), files = chosen(data.files);
    const entries = items.map(item => item.webkitGetAsEntry?.());
    if (!entries.some(entry => entry?.isDirectory)) return files;
    // of a page that lies in a folder itself, Chromium opens no entries, but handles
    if (items[0].getAsFileSystemHandle) return fromHandles(await Promise.all(items.map(item => item.getAsFileSystemHandle())));
    return fromEntries(entries.filter(entry => entry));
  }

  async function fromHandles(handles) {
    const files = [];
    const walk = async (handle, folder) => {
      const name = folder + handle.name;
      if (handle.kind === "file") files.push({ name, file: await handle.getFile() });
      else for await (const one of handle.values()) await walk(one, `${name}/`);
    };
    for (const handle of handles) await walk(handle, "");
    return files;
  }

  async function fromEntries(entries) {
    const files = [];
    const walk = async (entry, folder) => {
      const name = folder + entry.name;
      if (entry.isFile) {
        files.push({ name, file: await new Promise((done, failed) => entry.file(done, failed)) });
        return;
      }
      const reader = entry.createReader();
      // it gives a part at a time
      for (let part; (part = await new Promise((done, failed) => reader.readEntries(done, failed))).length;) {
        for (const one of part) await walk(one, `${name}/`);
      }
    };
    for (const entry of entries) await walk(entry, "");
    return files;
  }

  // The same of what was chosen.
  const chosen = files => [...files].map(file => ({ name: file.webkitRelativePath || file.name, file }));

  return { keep, keepFolder, zip, unzip, kept, dropped, chosen };
})();
