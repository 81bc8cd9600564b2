"use strict";
// Files that the page gives to its user.
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

  return { keep, keepFolder, kept };
})();
