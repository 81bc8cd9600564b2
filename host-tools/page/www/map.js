"use strict";
// The textures in a plane, and where slides land among them.
const Places = (() => {
  const WIDE = 500, HIGH = 400, EDGE = 34;
  let svg, known, movement = 0, dots = [], labels = [], widths = [], landed = [], scale;

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
    widths = [];
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

  // Where a name can stand about its dot: above, below, beside it, at its corners.
  const SPOTS = [[0, -1], [0, 1], [1, 0], [-1, 0], [1, -1], [-1, -1], [1, 1], [-1, 1]];
  const ABOVE = 9, BELOW = 19, BESIDE = 9, UP = 13, DOWN = 5, GAP = 2, EDGES = 3;
  const lies = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;

  function boxAt([x, y], [right, down], width) {
    const half = width / 2;
    const middle = right === 0 ? Math.min(WIDE - half - EDGES, Math.max(half + EDGES, x)) : x + right * (BESIDE + half);
    const line = down < 0 ? y - ABOVE : down > 0 ? y + BELOW : y + DOWN;
    return { middle, line, left: middle - half - GAP, right: middle + half + GAP, top: line - UP - GAP, bottom: line + DOWN };
  }

  // Names of what is likely, each at the first free spot about its dot; one that has none is left out.
  function tidy() {
    const order = dots.map((_, n) => n).sort((a, b) => (posterior[b] ?? 0) - (posterior[a] ?? 0));
    const few = dots.length <= 24, taken = [];
    const places = known.maps[movement].map(scale);
    order.forEach((n, rank) => {
      const p = posterior[n] ?? 0;
      dots[n].setAttribute("class", `dot${p > 0.01 ? rank === 0 ? " likely best" : " likely" : ""}`);
      let best = null;
      if (p > 0.01 || few) {
        const width = widths[n] ||= labels[n].getComputedTextLength();
        for (const spot of SPOTS) {
          const box = boxAt(places[n], spot, width);
          if (box.left < 0 || box.right > WIDE || box.top < 0 || box.bottom > HIGH || taken.some(other => lies(other, box))) continue;
          // a name had better not stand on another one's dot
          const covered = places.filter(([x, y], other) => other !== n && x > box.left && x < box.right && y > box.top && y < box.bottom).length;
          if (best === null || covered < best.covered) best = { ...box, covered };
          if (covered === 0) break;
        }
      }
      labels[n].setAttribute("visibility", best ? "visible" : "hidden");
      if (!best) return;
      labels[n].setAttribute("x", best.middle); labels[n].setAttribute("y", best.line);
      taken.push(best);
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

  // A slide of a texture, small.
  function mark(at, place, texture) {
    if (at === null || !place) return;
    const [x, y] = inside(scale(place));
    const ring = Rig.make(svg, "circle", { class: "mark", r: 3, cx: x, cy: y, fill: `hsl(${texture * 137 % 360} 55% 50%)`, visibility: at === movement ? "visible" : "hidden" });
    landed.push({ ring, movement: at, now: false });
  }

  function clear() {
    for (const one of landed) one.ring.remove();
    landed = [];
  }

  return { build, know, turn, likely, land, mark, clear };
})();
