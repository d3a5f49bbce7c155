// SPDX-License-Identifier: Apache-2.0
// The page Calibrate: chart, photographs, verdict, and nothing saved before "Keep it".
import { $, api, attempt, clock, follow, loadPicture, make, put, tell } from "/page.js";

const FULL_SCALE = 0.05;  // lenses: the colours at both ends
const USUAL_PLACES = 4;  // shown from the start
const BAR_LENSES = 0.1, BAR_PIXELS = 400;  // the whole bar of the error
let state = {}, calibration = { stage: "idle", photographs: [] }, possible = false, busy = false, pending = "";

function mayChange() {
  return document.body.dataset.rights === "change" && state.connected;
}

/** Returns whether there is a photograph of a place, used or set aside. */
const isKept = (place) => place.used || place.note !== "";

/** Returns whether the chart is on the panel, so that photographs can be sent. */
const mayTake = () => mayChange() && !busy && !["idle", "kept"].includes(calibration.stage);

function enable() {
  const { stage, next } = calibration;
  const place = calibration.photographs.find((one) => one.place === next);
  $("take").hidden = stage !== "idle" && stage !== "kept" && !place;
  $("take").disabled = !mayTake();
  $("take").textContent = "Take the photograph " + (place ? place.words : "");
  $("distance-label").hidden = calibration.photographs.some(isKept);
  for (const button of document.querySelectorAll("#places button")) button.disabled = !mayTake();
  $("keep").disabled = !mayChange() || busy || stage !== "found";
  $("begin").disabled = !mayChange() || !possible || busy;
  $("begin").textContent = stage === "idle" || stage === "kept" ? "Show the chart" : "Begin again";
}

const svg = (tag, attributes, ...children) => make(tag, { svg: true, ...attributes }, ...children);

/** Draws panel and phone from above; the arrow in the phone shows its upper edge. */
function drawing(place) {
  const x = 60 + 38 * place.side, y = place.side ? 56 : 62;
  const arrow = place.upside_down ? "M0 -5 V4 M-4 0 L0 5 L4 0" : "M0 5 V-4 M-4 0 L0 -5 L4 0";
  return svg("svg", { viewBox: "0 0 120 80", "aria-hidden": "true", class: place.used ? "used" : "" },
    svg("line", { class: "sight", x1: x, y1: y - 8, x2: 28, y2: 12 }),
    svg("line", { class: "sight", x1: x, y1: y - 8, x2: 92, y2: 12 }),
    svg("rect", { class: "panel", x: 26, y: 6, width: 68, height: 6, rx: 1 }),
    svg("g", { transform: `translate(${x} ${y})` },
      svg("rect", { class: "phone", x: -18, y: -10, width: 36, height: 20, rx: 4 }),
      svg("path", { class: "up", d: arrow })));
}

function showPlaces() {
  const shown = calibration.photographs.filter((place, k) =>
    k < USUAL_PLACES || isKept(place) || place.refusal || place.place === calibration.next);
  $("places").replaceChildren(...shown.map((place, k) => {
    const status = place.used ? "\u2713 used" + (place.note ? ", but " + place.note : "")
      : place.note || (place.refusal ? "refused" : "to do");
    const title = place.words.charAt(0).toUpperCase() + place.words.slice(1);
    const lines = [make("p", {}, make("strong", {}, `${k + 1}. ${title}`)),
      make("p", { class: "small" }, place.upside_down ? "phone upside down" : "phone the usual way up"),
      make("p", { class: "small " + (place.note ? "warn" : place.used ? "good" : place.refusal ? "bad" : "soft") }, status)];
    if (place.refusal) lines.push(make("p", { class: "small bad" },
      isKept(place) ? "The newest one was refused: " : "", place.refusal, "."),
    make("p", { class: "small" }, place.remedy));
    const take = () => choose(place.place);
    const buttons = [make("button", { onclick: take, "aria-label":
      `${isKept(place) || place.refusal ? "Take again" : "Take"} ${place.words}` }, isKept(place) || place.refusal ? "Again" : "Take")];
    if (isKept(place)) buttons.push(make("button", { "aria-label": `Remove the photograph ${place.words}`,
      onclick: () => work(() => api("DELETE", "calibration/photograph?place=" + place.place)) }, "Remove"));
    return make("li", { "aria-current": place.place === calibration.next && mayTake() ? "step" : null },
      drawing(place), ...lines, make("div", { class: "row" }, ...buttons));
  }));
}

/** Shows the error that the fit of all photographs states, as a number and as a bar. */
function showError() {
  const { fit, result } = calibration;
  $("error").hidden = fit.stated_lenses === null || calibration.stage === "kept";
  if ($("error").hidden) return;
  const error = fit.stated_lenses;
  const grade = error <= fit.wanted_lenses ? "good" : error <= fit.usable_lenses ? "warn" : "bad";
  const words = {
    good: "It is small enough for every eye" + (calibration.next ? " if nothing moved; one more photograph checks that." : "."),
    warn: "It can be kept; one more photograph makes it better.",
    bad: "That is too much to keep; take one more photograph." }[grade];
  $("error-text").replaceChildren("Error for every eye by the fit of all ",
    `${fit.photographs} photographs, which 97 of 100 such results do not exceed: `,
    fit.progress_lenses.slice(0, -1).map((one) => `${one.toFixed(3)}, then `).join(""), make("strong", { class: grade }, `${error.toFixed(3)} lens`),
    ` (wanted: ${fit.wanted_lenses}). `, grade === "warn" && !calibration.next ? "It can be kept." : words,
    grade === "bad" && result && result.photographs === 1 ? " Until then the first photograph alone gives the result." : "");
  const at = (lenses) => Math.min(1, lenses / BAR_LENSES) * BAR_PIXELS;
  const mark = (lenses, text) => [svg("line", { x1: at(lenses), x2: at(lenses), y1: 0, y2: 26 }),
    svg("text", { x: at(lenses), y: 41 }, text)];
  $("error-bar").setAttribute("aria-label", `${error.toFixed(3)} lens of error; wanted are ${fit.wanted_lenses}`);
  $("error-bar").replaceChildren(svg("rect", { class: "track", x: 0, y: 4, width: BAR_PIXELS, height: 18, rx: 4 }),
    svg("rect", { class: grade, x: 0, y: 4, width: at(error), height: 18, rx: 4 }),
    ...mark(fit.wanted_lenses, `wanted ${fit.wanted_lenses}`), ...mark(fit.usable_lenses, `usable ${fit.usable_lenses}`));
}

/** Draws a field over the panel: blue over white to brown, grey where nothing was measured. */
function drawResidual(field) {
  const canvas = $("residual");
  canvas.width = field.columns;
  canvas.height = field.rows;
  const picture = new ImageData(field.columns, field.rows);
  const ends = [[33, 102, 172], [140, 81, 10]];
  field.values.forEach((value, k) => {
    const share = Math.min(1, Math.abs(value) / FULL_SCALE);
    const end = ends[value < 0 ? 0 : 1];
    const colour = value === null ? [128, 128, 128] : end.map((one) => Math.round(255 + (one - 255) * share));
    picture.data.set([...colour, 255], 4 * k);
  });
  canvas.getContext("2d").putImageData(picture, 0, 0);
}

function sentences(result) {
  const list = (texts) => make("ul", {}, ...texts.map((one) => make("li", {}, one)));
  const parts = [], single = result.photographs === 1;
  if (result.verdict !== "refused" && result.max_lenses !== null)
    parts.push(make("p", {}, `The found sheet explains ${single ? "the photograph" : "the first photograph"} within `
      + `${result.max_lenses.toFixed(3)} lenses; ${(100 * result.covered).toFixed(0)} % of the panel was seen.`));
  if (single && result.verdict !== "refused") parts.push(make("p", {}, "It is right for an eye at the place of that photograph. "
    + "How far it is off for other eyes is not known."));
  if (result.verdict === "refused" && result.reasons.length) parts.push(list(result.reasons));
  if (result.warnings.length) parts.push(make("details", {}, make("summary", {}, "Notes"), list(result.warnings)));
  return parts;
}

function showHistory(history) {
  const may = mayChange();
  $("history").replaceChildren(...(history.length ? [] : [make("li", { class: "soft" }, "No rig was kept from this page yet.")]),
    ...history.map((entry, k) => make("li", {},
      make("span", { class: "name" }, `${entry.number}. ${entry.what} `,
        make("span", { class: "soft" }, [clock(entry.time), entry.who].filter(Boolean).join(", "))),
      k === 0 ? make("span", { class: "soft" }, "the newest")
        : make("button", { disabled: !may, "aria-label": `Back to rig ${entry.number}, ${entry.what}`,
          onclick: () => work(() => api("POST", "calibration/restore", { number: entry.number })) }, "Back to this"))));
}

/** Says before the start if the chart does not fit the panel, and what to do instead. */
async function checkPanel() {
  const answer = await api("GET", "calibration/possible");
  possible = answer.possible;
  $("impossible").hidden = possible;
  $("obstacle").textContent = possible ? "" : `Photographs do not work on this panel: ${answer.cause}. What to do instead:`;
  enable();
}

/** Returns title and class of the result. */
function verdict() {
  const { stage, result } = calibration;
  const found = result && result.photographs > 1 ? "for every eye" : "for one place";
  return { refused: ["3. Refused: nothing is saved", "bad"], found: ["3. The sheet was found, " + found, "good"],
    kept: ["3. Saved", "good"] }[stage] || ["3. Result", ""];
}

function show(now) {
  calibration = now;
  const { stage, message, result, history } = now;
  showPlaces();
  enable();
  showHistory(history);
  $("chart-state").textContent = stage === "idle" || stage === "kept" ? "" : "The chart is on the panel.";
  [$("verdict").textContent, $("verdict").className] = verdict();
  $("words").textContent = message;
  $("words").hidden = !message;
  showError();
  $("result").replaceChildren(...(result ? sentences(result)
    : stage === "refused" || stage === "kept" ? [] : [make("p", { class: "soft" }, "No photograph yet.")]));
  $("compare").hidden = stage !== "found";
  hidePictures();
}

function hidePictures() {
  $("pictures").hidden = true;
  $("compare").setAttribute("aria-expanded", "false");
}

/** Shows before and after, below which the rig can be kept. */
async function compare() {
  for (const name of ["before", "after"]) await loadPicture($(name), `/api/v1/calibration/${name}.jpg`);
  const field = calibration.result.residual_lenses;
  $("residual").hidden = !field || !field.columns;
  if (!$("residual").hidden) drawResidual(field);
  $("residual-text").textContent = $("residual").hidden ? ""
    : `What the found sheet leaves unexplained: blue is -${FULL_SCALE} lenses, white 0, brown +${FULL_SCALE}.`;
  $("pictures").hidden = false;
  $("compare").setAttribute("aria-expanded", "true");
  $("pictures-title").focus();
}

/** Opens the camera of the phone, or a list of files. */
function choose(place) {
  pending = place;
  $("photo").click();
}

function send(file, place) {
  const distance = Number($("distance").value);
  const query = `?place=${place}` + (distance > 0 ? `&distance=${distance}` : "");
  return put("/api/v1/calibration/photograph" + query, file, (bytes) => {
    $("progress").value = bytes / file.size;
    $("sending-text").textContent = bytes < file.size ? "Sending the photograph." : "Looking for the lens sheet.";
  }, "choose the photograph again").answer;
}

/** Says what became of a photograph. */
function report(place, now) {
  const one = now.photographs.find((other) => other.place === place);
  if (one.refusal) tell(`Refused: ${one.refusal}. ${one.remedy}`);
  else tell(`The photograph ${one.words} is ${one.used ? "used" : one.note}.`);
  return now;
}

$("photo").onchange = async () => {
  const file = $("photo").files[0];
  if (!file) return;
  const place = pending || calibration.next || "middle";
  pending = "";
  $("progress").value = 0;
  $("sending").hidden = false;
  $("sending-text").textContent = "Sending the photograph.";
  await work(async () => report(place, await send(file, place)));
  $("sending").hidden = true;
  $("photo").value = "";
};
/** Runs an action, and shows its error until the next one. */
async function work(action) {
  busy = true;
  enable();
  try {
    const now = await action();
    busy = false;
    show(now);
  } catch (error) {
    $("words").textContent = error.message;
    $("words").hidden = false;
  }
  busy = false;
  enable();
  if (document.activeElement === document.body && !$("take").hidden) $("take").focus({ preventScroll: true });
}
$("take").onclick = () => choose(calibration.next);
$("compare").onclick = () => attempt(() => $("pictures").hidden ? compare() : hidePictures());
$("begin").onclick = () => {
  tell("Drawing the chart.");
  work(async () => {
    const begun = await api("POST", "calibration/begin");
    tell("The chart is on the panel.");
    return begun;
  });
};
$("discard").onclick = () => work(() => api("POST", "calibration/discard"));
$("keep").onclick = () => work(() => api("POST", "calibration/keep"));

follow((now, changed) => {
  state = now;
  enable();
  if (now.connected && changed) attempt(async () => {
    const optics = await api("GET", "optics");
    if (!$("distance").value && optics.viewing_distance_mm) $("distance").value = Math.round(optics.viewing_distance_mm);
    show(await api("GET", "calibration"));
    await checkPanel();
  });
});
