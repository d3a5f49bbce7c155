// SPDX-License-Identifier: Apache-2.0
// The page Eye: drag an eye through the room and see what it sees.
import { $, api, attempt, follow, make, refreshPicture } from "/page.js";

const WIDTH = 800, HEIGHT = 500, TOP = 30;
let optics = null;
let eye = { x: 0, y: 0, z: 700 };

/** Millimetres per unit of the drawing: the panel and twice the viewing distance fit. */
function scale() {
  const deep = 1.8 * (optics.viewing_distance_mm || 700);
  return Math.max(deep / (HEIGHT - TOP - 20), 1.6 * optics.width_mm / WIDTH);
}
const toRoom = (x, z) => [WIDTH / 2 + x / scale(), TOP + z / scale()];

/** The lobes repeat sideways; a viewer whose eyes are in one lobe sees depth the right way round. */
function lobeOf(x, z) {
  const width = optics.lobe_width_mm * z / optics.viewing_distance_mm;
  return { number: Math.round(x / width), place: x / width - Math.round(x / width), width };
}

function drawRoom() {
  const parts = [];
  if (optics.lobe_width_mm) {
    const far = (HEIGHT - TOP) * scale();
    const lobe = optics.lobe_width_mm * far / optics.viewing_distance_mm;
    const half = optics.width_mm / 2;
    for (let k = -3; k <= 3; ++k) {
      const [left, bottom] = toRoom((k - 0.5) * lobe, far);
      const [right] = toRoom((k + 0.5) * lobe, far);
      const [middle] = toRoom(0, 0);
      parts.push(make("path", { svg: true, class: k % 2 ? "zone odd" : "zone", d: `M${middle} ${TOP}L${left} ${bottom}L${right} ${bottom}Z` }),
        make("path", { svg: true, class: "edge", d: `M${middle} ${TOP}L${left} ${bottom}` }));
    }
    const [left] = toRoom(-half, 0), [right] = toRoom(half, 0);
    parts.push(make("rect", { svg: true, class: "panel", x: left, y: TOP - 12, width: right - left, height: 10 }));
  }
  if (optics.viewing_distance_mm) {
    const [, line] = toRoom(0, optics.viewing_distance_mm);
    parts.push(make("path", { svg: true, d: `M0 ${line}H${WIDTH}`, stroke: "currentColor", "stroke-dasharray": "2 6" }),
      make("text", { svg: true, x: 8, y: line - 6 }, "viewing line"));
  }
  const [x, z] = toRoom(eye.x, eye.z);
  parts.push(make("circle", { svg: true, class: "eye", cx: x, cy: z, r: 16 }));
  $("room").replaceChildren(...parts);
  for (const key of ["x", "y", "z"]) if (document.activeElement !== $(key)) $(key).value = Math.round(eye[key]);
  if (!optics.lobe_width_mm) return;
  const { number, place, width } = lobeOf(eye.x, eye.z);
  const toEdge = (0.5 - Math.abs(place)) * width;
  $("zone").textContent = toEdge < 33
    ? `Near the border of two zones (${toEdge.toFixed(0)} mm): the two eyes see views in the wrong order.`
    : `In ${number === 0 ? "the middle zone" : `zone ${number}`}; it is ${width.toFixed(0)} mm wide here.`;
}

/** The lens spot is a Gaussian in lenses; its weight at the distance of n views is the crosstalk. */
function drawCrosstalk() {
  const view = 1 / optics.views_per_lens;
  const sigma = optics.spot_sigma_lenses;
  const weights = [];
  for (let n = -4; n <= 4; ++n) weights.push(Math.exp(-0.5 * (n * view / sigma) ** 2));
  const all = weights.reduce((a, b) => a + b, 0);
  $("talk").replaceChildren(...weights.map((weight, k) => make("rect", { svg: true,
    class: k === 4 ? "ok" : "missed", x: 10 + k * 43, width: 36,
    y: 120 - 115 * weight / weights[4], height: 115 * weight / weights[4] })));
  $("talk-most").textContent = `${(100 * weights[4] / all).toFixed(0)} %`;
  const others = 100 * (1 - weights[4] / all);
  $("talk-text").textContent = `${others.toFixed(0)} % of the light at the middle of a view comes from its neighbours `
    + `(${optics.views_per_lens.toFixed(2)} subpixels per lens; the spot has a standard deviation of ${sigma} lenses).`;
}

const reload = refreshPicture($("seen"), () =>
  `/api/v1/eye.jpg?x=${eye.x.toFixed(1)}&y=${eye.y.toFixed(1)}&z=${eye.z.toFixed(1)}&width=${innerWidth < 700 ? 640 : 960}`, 500,
(problem, ms) => {
  const side = `${Math.abs(eye.x).toFixed(0)} mm ${eye.x < 0 ? "left" : "right"}`;
  const height = `${Math.abs(eye.y).toFixed(0)} mm ${eye.y < 0 ? "down" : "up"}`;
  $("caption").textContent = problem || `${side}, ${height}, ${eye.z.toFixed(0)} mm away; the picture took ${ms.toFixed(0)} ms`;
});

function moveTo(x, z) {
  eye = { ...eye, x, z: Math.max(50, z) };
  drawRoom();
  reload();
}

function dragged(event) {
  if (!optics || (event.type === "pointermove" && !event.buttons)) return;
  const box = $("room").getBoundingClientRect();
  const u = (event.clientX - box.left) * WIDTH / box.width;
  const v = (event.clientY - box.top) * HEIGHT / box.height;
  moveTo((u - WIDTH / 2) * scale(), (v - TOP) * scale());
}
$("room").onpointerdown = (event) => { $("room").setPointerCapture(event.pointerId); dragged(event); };
$("room").onpointermove = dragged;
for (const key of ["x", "y", "z"]) {
  $(key).oninput = () => {
    const value = Number($(key).value);
    if ($(key).value === "" || !Number.isFinite(value) || (key === "z" && value < 1)) return;
    eye = { ...eye, [key]: value };
    if (optics) drawRoom();
    reload();
  };
}
$("left-eye").onclick = () => moveTo(-32, eye.z);
$("right-eye").onclick = () => moveTo(32, eye.z);

follow((now, changed) => {
  if (now.connected && changed) attempt(async () => {
    const first = optics === null;
    optics = await api("GET", "optics");
    if (first) eye = { x: 0, y: optics.viewing_height_mm, z: optics.viewing_distance_mm || 700 };
    drawRoom();
    drawCrosstalk();
    reload();
  });
});
