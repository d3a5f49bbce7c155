// SPDX-License-Identifier: Apache-2.0
// The page Trim: correct pitch and offset by eye.
import { $, api, attempt, clock, follow, make, plain, tell } from "/page.js";

const STEPS = { pitch: 1e-5, offset: 0.01 };
let state = {};

function words(trim) {
  return `offset ${trim.offset_lenses.toFixed(3)} lenses, pitch ${(trim.pitch_relative * 1e6).toFixed(1)} ppm`;
}

function show(trim) {
  $("present").textContent = "Now: " + words(trim)
    + (trim.saved === false ? "; in effect, but not saved yet: the player cannot write the file" : "")
    + (trim.advice ? ". " + trim.advice : "");
  const may = document.body.dataset.rights === "change";
  $("history").replaceChildren(...(trim.history.length ? [] : [make("li", { class: "soft" }, "No changes yet.")]), ...trim.history.map((entry) => make("li", {},
    make("span", { class: "name" }, entry.name ? make("strong", {}, entry.name + " ") : "", words(entry) + " ",
      make("span", { class: "soft" }, `${clock(entry.time)}, ${entry.who}`)),
    make("button", { disabled: !may, "aria-label": `Back to ${entry.name || words(entry)}`,
      onclick: () => change("trim/restore", { number: entry.number }) }, "Back to this"))));
}

async function change(path, body) {
  const trim = await attempt(() => api("POST", path, body));
  if (trim) show(trim);
  return trim;
}

for (const button of document.querySelectorAll("[data-by]")) {
  button.onclick = () => {
    const by = button.dataset.by;
    const step = STEPS[by] * Number($("step").value) * Number(button.dataset.sign);
    change("trim", { [by === "pitch" ? "pitch_by_relative" : "offset_by_lenses"]: step });
  };
}
$("undo").onclick = () => change("trim/undo", {});
$("save").onsubmit = async (event) => {
  event.preventDefault();
  if (await change("trim/save", { name: $("name").value })) {
    tell("Saved as " + $("name").value);
    $("name").value = "";
  }
};
$("chart").onclick = () =>
  attempt(() => api("POST", "show", { what: state.shown_instead === "views" ? "content" : "views" }));

const read = () => attempt(async () => show(await api("GET", "trim")));
follow((now, changed) => {
  state = now;
  const shown = now.shown_instead === "views";
  $("chart").setAttribute("aria-pressed", String(shown));
  $("chart").textContent = shown ? "Back to the content" : "Show the chart";
  if (now.connected && changed) read();
  if (!now.connected) $("present").textContent = plain(now.problem);
  $("history").inert = !now.connected;
}, (name) => { if (name === "trim_changed") read(); });
