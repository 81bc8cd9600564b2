"use strict";
// The textures in a plane, and where slides land among them.
const Places = (() => {
  const WIDE = 500, HIGH = 400, EDGE = 34;
  let svg, known, movement = 0, dots = [], labels = [], landed = [], scale;

  function build(element) {
    svg = element;
    svg.setAttribute("viewBox", `0 0 ${WIDE} ${HIGH}`);
  }

  function fit() {
    const all = known.maps.flat();
    const of = axis => { const v = all.map(p => p[axis]); return [Math.min(...v), Math.max(...v)]; };
    const [left, right] = of(0), [low, high] = of(1);
    const size = Math.min((WIDE - 2 * EDGE) / Math.max(1e-6, right - left), (HIGH - 2 * EDGE) / Math.max(1e-6, high - low));
    scale = ([x, y]) => [WIDE / 2 + (x - (left + right) / 2) * size, HIGH / 2 - (y - (low + high) / 2) * size];
  }

  const inside = ([x, y]) => [Math.min(WIDE - 8, Math.max(8, x)), Math.min(HIGH - 8, Math.max(8, y))];

  function know(now) {
    known = now;
    movement = Math.min(movement, known.maps.length - 1);
    landed = [];
    svg.replaceChildren();
    fit();
    const radius = known.textures.length > 60 ? 3 : 4.5;
    dots = known.textures.map(name => {
      const dot = Rig.make(svg, "circle", { class: "dot", r: radius });
      Rig.make(dot, "title", {}, name);
      return dot;
    });
    labels = known.textures.map(name => Rig.make(svg, "text", { "text-anchor": "middle", visibility: "hidden" }, name));
    move();
  }

  function move() {
    known.maps[movement].forEach((place, n) => {
      const [x, y] = scale(place);
      dots[n].style.transform = `translate(${x}px, ${y}px)`;
      labels[n].setAttribute("x", x); labels[n].setAttribute("y", y - 9);
    });
    for (const one of landed) one.ring.setAttribute("visibility", one.movement === movement ? "visible" : "hidden");
    tidy();
  }

  function turn(to) {
    if (known && to !== null && to !== movement && known.maps[to]) { movement = to; move(); }
  }

  let posterior = [];
  function likely(now) {
    posterior = now;
    tidy();
  }

  // Names of what is likely; where they would lie over each other, the likelier one's.
  function tidy() {
    const order = dots.map((_, n) => n).sort((a, b) => (posterior[b] ?? 0) - (posterior[a] ?? 0));
    const few = dots.length <= 24, taken = [];
    order.forEach((n, rank) => {
      const p = posterior[n] ?? 0;
      dots[n].setAttribute("class", `dot${p > 0.01 ? rank === 0 ? " likely best" : " likely" : ""}`);
      const place = scale(known.maps[movement][n]);
      const half = known.textures[n].length * 4.2;
      const x = Math.min(WIDE - half - 4, Math.max(half + 4, place[0])), y = Math.max(16, place[1] - 9);
      const free = !taken.some(other => Math.abs(other.x - x) < other.half + half + 4 && Math.abs(other.y - y) < 17);
      const shown = free && (p > 0.01 || few);
      labels[n].setAttribute("visibility", shown ? "visible" : "hidden");
      labels[n].setAttribute("x", x); labels[n].setAttribute("y", y);
      if (shown) taken.push({ x, y, half });
    });
  }

  function land(at, place, now) {
    if (at === null || !place) return;
    turn(at);
    landed = landed.filter(one => { if (one.now) one.ring.remove(); return !one.now; });
    for (const one of landed) one.ring.setAttribute("class", "slide old");
    const [x, y] = inside(scale(place));
    const ring = Rig.make(svg, "circle", { class: now ? "slide now" : "slide", r: now ? 4 : 9, cx: x, cy: y });
    landed.push({ ring, movement: at, now });
  }

  function clear() {
    for (const one of landed) one.ring.remove();
    landed = [];
  }

  return { build, know, turn, likely, land, clear };
})();
