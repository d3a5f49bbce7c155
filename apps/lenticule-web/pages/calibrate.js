// SPDX-License-Identifier: Apache-2.0
// The page Calibrate: chart, photograph, verdict, and nothing saved before "Keep it".
import { $, api, attempt, clock, follow, make, tell } from "/page.js";

const FULL_SCALE = 0.05;  // lenses: the colours at both ends
let state = {}, stage = "idle", possible = false;

function mayChange() {
  return document.body.dataset.rights === "change" && state.connected;
}

function enable() {
  $("photo").disabled = !mayChange() || stage === "idle" || stage === "kept";
  $("keep").disabled = !mayChange() || stage !== "found";
  $("begin").disabled = !mayChange() || !possible;
  $("begin").textContent = stage === "idle" || stage === "kept" ? "Show the chart" : "Begin again";
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

async function showPicture(name) {
  const answer = await fetch(`/api/v1/calibration/${name}.jpg`);
  if (!answer.ok) throw new Error((await answer.json()).error.cause);
  const old = $(name).src;
  $(name).src = URL.createObjectURL(await answer.blob());
  if (old.startsWith("blob:")) URL.revokeObjectURL(old);
}

function sentences(result) {
  const list = (texts) => make("ul", {}, ...texts.map((one) => make("li", {}, one)));
  const parts = [];
  if (result.reasons.length) parts.push(list(result.reasons));
  if (result.verdict !== "refused" && result.max_lenses !== null)
    parts.push(make("p", {}, `The found sheet explains the photograph within ${result.max_lenses.toFixed(3)} lenses; `
      + `${(100 * result.covered).toFixed(0)} % of the panel was seen.`));
  if (result.warnings.length) parts.push(make("p", {}, "Notes:"), list(result.warnings));
  if (result.advice.length) parts.push(make("p", {}, "Next:"), list(result.advice));
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
          onclick: () => act(() => api("POST", "calibration/restore", { number: entry.number })) }, "Back to this"))));
}

/** Says before the start if the chart does not fit the panel, and what to do instead. */
async function checkPanel() {
  const answer = await api("GET", "calibration/possible");
  possible = answer.possible;
  $("impossible").hidden = possible;
  $("obstacle").textContent = possible ? "" : `One photograph does not work on this panel: ${answer.cause}. What to do instead:`;
  enable();
}

async function show(calibration) {
  const { message, result } = calibration;
  stage = calibration.stage;
  enable();
  showHistory(calibration.history);
  $("chart-state").textContent = { idle: "", chart: "The chart is on the panel.", kept: "" }[stage] ?? "";
  const verdicts = { idle: ["3. Result", ""], chart: ["3. Result", ""], refused: ["3. Refused: nothing is saved", "bad"],
    found: ["3. The sheet was found", "good"], kept: ["3. Saved", "good"] };
  [$("verdict").textContent, $("verdict").className] = verdicts[stage];
  $("words").textContent = message;
  $("words").hidden = !message;
  $("result").replaceChildren(...(result ? sentences(result)
    : message ? [] : [make("p", { class: "soft" }, "No photograph yet.")]));
  $("rig").hidden = stage !== "found";
  $("pictures").hidden = stage !== "found";
  if (stage !== "found") return;
  const field = result.residual_lenses;
  $("residual").hidden = !field || !field.columns;
  if (!$("residual").hidden) drawResidual(field);
  $("residual-text").textContent = $("residual").hidden ? ""
    : `What the found sheet leaves unexplained: blue is -${FULL_SCALE} lenses, white 0, brown +${FULL_SCALE}.`;
  await showPicture("before");
  await showPicture("after");
}

function send(file) {
  const distance = Number($("distance").value);
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", "/api/v1/calibration/photograph" + (distance > 0 ? `?distance=${distance}` : ""));
    request.upload.onprogress = (event) => {
      $("progress").value = event.loaded / event.total;
      $("sending-text").textContent = event.loaded < event.total ? "Sending the photograph." : "Looking for the lens sheet.";
    };
    request.onload = () => {
      const answer = JSON.parse(request.responseText || "{}");
      if (request.status < 300) resolve(answer);
      else reject(new Error((answer.error || {}).cause || "status " + request.status));
    };
    request.onerror = () => reject(new Error("the connection was lost; choose the photograph again"));
    request.send(file);
  });
}

$("photo").onchange = async () => {
  const file = $("photo").files[0];
  if (!file) return;
  $("sending").hidden = false;
  $("sending-text").textContent = "Sending the photograph.";
  await act(() => send(file));
  $("sending").hidden = true;
  $("photo").value = "";
};
/** Runs an action, and shows its error until the next one. */
async function act(action) {
  try {
    await show(await action());
  } catch (error) {
    $("words").textContent = error.message;
    $("words").hidden = false;
  }
}
$("begin").onclick = () => {
  tell("Drawing the chart.");
  act(async () => {
    const begun = await api("POST", "calibration/begin");
    tell("The chart is on the panel.");
    return begun;
  });
};
$("discard").onclick = () => act(() => api("POST", "calibration/discard"));
$("keep").onclick = () => act(() => api("POST", "calibration/keep"));

let connected = null;
follow((now) => {
  state = now;
  enable();
  if (now.connected && connected !== true) attempt(async () => {
    const optics = await api("GET", "optics");
    if (!$("distance").value && optics.viewing_distance_mm) $("distance").value = Math.round(optics.viewing_distance_mm);
    await show(await api("GET", "calibration"));
    await checkPanel();
  });
  connected = now.connected;
});
