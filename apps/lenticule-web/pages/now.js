// SPDX-License-Identifier: Apache-2.0
// The page Now: what plays, the list, the files.
import { $, api, attempt, baseName, clock, count, follow, make, plain, put, refreshPicture, tell } from "/page.js";

const PART = 4 * 1024 * 1024;  // an upload is sent in parts of this size
const INSTEAD = { black: "a black frame", card: "a test card", views: "the chart of the page Trim",
  chart: "the chart of the page Calibrate", code: "the code of an address" };
const TRANSITIONS = { cut: "cut", fade: "fade through black", cross: "cross-fade" };
let state = {};
let saved = null;   // the list as the player has it
let items = null;   // the list as it is edited
let saving = false;
let changedBy = ""; // who changed the list since it was read
let silent = [];    // why items of the saved list will not play
let upload = null;

// --- playback ---

function showState(now) {
  state = now;
  const status = now.status;
  const place = status && status.displayed;
  const doing = status ? status.state + (status.reason ? ": " + plain(status.reason) : "") : "";
  $("playing").textContent = !now.connected ? "The player does not answer"
    : now.shown_instead ? "Shown instead of the content: " + (INSTEAD[now.shown_instead] || now.shown_instead)
      : place ? baseName(place.source) : "Nothing is playing";
  $("where").textContent = !now.connected ? plain(now.problem)
    : place ? `${doing}, frame ${place.frame}` + (place.item === null ? ""
      : `, item ${place.item + 1} of ${status.reading ? status.reading.items : 1}`)
      : doing;
  $("problem").textContent = !status ? "" : status.last_problem ? "Last problem: " + plain(status.last_problem) : "";
  const paused = Boolean(status && status.state === "paused");
  $("pause").textContent = paused ? "Play" : "Pause";
  $("pause").setAttribute("aria-pressed", String(paused));
  $("black").textContent = now.shown_instead === "black" ? "Back to the content" : "Show black";
  const machine = now.machine || { temperatures: [], clocks: [] };
  $("figures").textContent = [status ? `${count(status.frames_shown, "frame")} shown` : "",
    ...machine.temperatures.map((one) => `${one.name} ${one.celsius.toFixed(0)} °C`),
    ...machine.clocks.slice(0, 1).map((one) => `${one.mhz.toFixed(0)} MHz`)].filter(Boolean).join(" · ");
  showSound(status && status.sound);
  markPlaying();
}

function markPlaying() {
  const place = state.status && state.status.displayed;
  [...$("list").children].forEach((row, k) => {
    const playing = Boolean(place && !state.shown_instead && items === saved.items && place.item === k);
    row.classList.toggle("now", playing);
    if (playing) row.setAttribute("aria-current", "true");
    else row.removeAttribute("aria-current");
  });
}

for (const verb of ["previous", "next"])
  $(verb).onclick = () => attempt(() => api("POST", verb));
$("pause").onclick = () =>
  attempt(() => api("POST", $("pause").getAttribute("aria-pressed") === "true" ? "play" : "pause"));
$("black").onclick = () =>
  attempt(() => api("POST", "show", { what: state.shown_instead === "black" ? "content" : "black" }));

// --- sound ---

const SILENCE_DB = -80;
let asked = null;    // the volume that is sent next
let sending = false;
let unmuted = 0;     // the volume before it was muted

function showVolume(db) {
  const text = db <= SILENCE_DB ? "silence" : `${db > 0 ? "+" : ""}${db.toFixed(0)} dB`;
  $("volume").value = db;
  $("volume").setAttribute("aria-valuetext", text);
  $("volume-db").textContent = text;
  $("mute").setAttribute("aria-pressed", String(db <= SILENCE_DB));
  if (db > SILENCE_DB) unmuted = db;
}

function showSound(sound) {
  $("sound").hidden = !sound;
  if (!sound) return;
  if (!sending) showVolume(sound.volume_db);
  $("sound-state").textContent = `Sound: ${sound.state}` + (sound.device ? `, device ${plain(sound.device)}` : "")
    + (sound.source ? `, ${baseName(sound.source)}` : "")
    + (sound.bed ? `; under the list: ${sound.bed.state}, ${baseName(sound.bed.source)}` : "");
  $("sound-problem").textContent = sound.problem ? "Last problem of the sound: " + plain(sound.problem) : "";
}

/** Sends the newest volume, one request after the other. */
async function setVolume(db) {
  showVolume(asked = db);
  if (sending) return;
  sending = true;
  while (asked !== null) {
    const next = asked;
    asked = null;
    await attempt(() => api("POST", "volume", { db: next }));
  }
  sending = false;
}

$("volume").oninput = () => setVolume(Number($("volume").value));
$("mute").onclick = () => setVolume($("mute").getAttribute("aria-pressed") === "true" ? unmuted : SILENCE_DB);

// --- the list ---

function describe(item) {
  const parts = [];
  if (item.loops !== undefined) parts.push(item.loops === "forever" ? "forever" : item.loops === 1 ? "once" : `${item.loops} times`);
  if (item.duration_s !== undefined) parts.push(`${item.duration_s} s`);
  if (item.transition) parts.push(`begins with a ${TRANSITIONS[item.transition]}`);
  if (item.overlay) parts.push(count(item.overlay.length, "overlay"));
  if (item.schedule) parts.push(`${item.schedule.days.join(" ")} ${item.schedule.from} to ${item.schedule.to}`);
  return parts.join(", ");
}

function edit(change) {
  items = [...items];
  change(items);
  showList();
}

function move(from, to) {
  if (to < 0 || to >= items.length || from === to) return;
  edit((list) => list.splice(to, 0, ...list.splice(from, 1)));
  tell(`${baseName(items[to].source)} is now number ${to + 1}`);
  const grip = $("list").children[to].querySelector(".grip");
  if (grip) grip.focus();
}

/** Lets a pointer, mouse or finger, drag a row to another place. */
function drag(event, from) {
  const rows = [...$("list").children];
  const grip = event.currentTarget;
  grip.setPointerCapture(event.pointerId);
  let to = from;
  grip.onpointermove = (moved) => {
    to = rows.findIndex((row) => moved.clientY < row.getBoundingClientRect().bottom);
    if (to < 0) to = rows.length - 1;
    rows.forEach((row, k) => row.classList.toggle("over", k === to));
  };
  grip.onpointerup = grip.onpointercancel = () => {
    grip.onpointermove = null;
    rows.forEach((row) => row.classList.remove("over"));
    move(from, to);
  };
}

function showList() {
  const may = document.body.dataset.rights === "change" && saved.editable;
  $("list").replaceChildren(...items.map((item, k) => {
    const name = baseName(item.source);
    const row = make("li", {},
      make("span", { class: "name" }, `${k + 1}. ${name} `, make("span", { class: "soft" }, describe(item))));
    if (!may) return row;
    row.prepend(make("button", { class: "grip", "aria-label": `Move ${name}: arrow keys, or drag`,
      onpointerdown: (event) => drag(event, k),
      onkeydown: (event) => {
        const by = { ArrowUp: -1, ArrowDown: 1 }[event.key];
        if (by) { event.preventDefault(); move(k, k + by); }
      } }, "↕"));
    row.append(make("span", { class: "row" },
      make("button", { "aria-label": `Play ${name} now`, disabled: items !== saved.items,
        onclick: () => attempt(() => api("POST", "seek", { item: k, frame: 0 })) }, "Play"),
      make("button", { "aria-label": `Remove ${name} from the list`, disabled: items.length < 2,
        onclick: () => edit((list) => list.splice(k, 1)) }, "Remove")));
    return row;
  }));
  const changed = items !== saved.items;
  $("save").disabled = !changed || !may || Boolean(changedBy);
  $("reset").disabled = !changed || !may;
  $("transition").disabled = !may;
  $("reset").textContent = changedBy ? "Read again" : "Discard changes";
  $("list-note").textContent = !saved.editable ? "The player plays a folder, or a list outside of the media folder; it cannot be changed here."
    : changedBy ? `${changedBy} changed the list meanwhile. Read it again; your changes here are then lost.`
      : (changed ? "Changed, not saved. " : saved.file ? "" : "The player plays one source. A changed list begins with it. ")
        + (saved.by_hand && may ? "This list was written by hand. Saving writes it without its comments, and the files of a folder one by one; the original stays below Earlier versions." : "");
  if (silent.length && !changed) $("list-note").textContent += `Will not play: ${silent.map(plain).join("; ")}.`;
  $("list-note").className = changedBy || (silent.length && !changed) ? "warn" : "soft";
  markPlaying();
}

async function readList(force) {
  const list = await attempt(async () => {
    try {
      return await api("GET", "list");
    } catch (error) {
      if (!/no media folder/.test(error.message)) throw error;
      for (const id of ["list-title", "media-title"]) $(id).parentElement.hidden = true;
      return undefined;
    }
  });
  if (!list || (!force && saved && items !== saved.items)) return;
  if (!saved || saved.version !== list.version) silent = [];
  saved = list;
  items = list.items;
  $("transition").value = list.transition;
  changedBy = "";
  showList();
  const { versions } = await api("GET", "list/versions");
  $("versions").replaceChildren(make("option", { value: "" }, "choose"), ...versions.map((one) =>
    make("option", { value: one.name }, `${one.name === "0" ? "The original" : clock(one.time)}, ${one.who}, ${count(one.items, "item")}`)));
}

$("save").onclick = async () => {
  $("save").disabled = true;
  saving = true;
  tell("Saving; the player checks the list.");
  const done = await attempt(() => api("PUT", "list",
    { version: saved.version, loop: saved.loop, shuffle: saved.shuffle, transition: $("transition").value,
      transition_seconds: saved.transition_seconds, sound: saved.sound, sound_volume: saved.sound_volume,
      overlay: saved.overlay, default: saved.default, items }).catch((error) => {
    if (error.status === 409 && saved.editable) changedBy = "Somebody";
    throw error;
  }));
  saving = false;
  if (done) {
    tell(done.warnings.length ? "Saved; not every item will play." : "Saved; the player plays this list.");
    await readList(true);
    silent = done.warnings;
  }
  showList();
};
$("reset").onclick = () => readList(true);
$("transition").onchange = () => edit(() => {});
$("restore").onclick = async () => {
  if (!$("versions").value) { tell("Choose a version first."); return; }
  if (await attempt(() => api("POST", "list/restore", { name: $("versions").value }))) readList(true);
};

// --- files ---

function size(bytes) {
  const unit = Math.min(4, Math.floor(Math.log2(Math.max(1, bytes)) / 10));
  return `${(bytes / 1024 ** unit).toFixed(unit ? 1 : 0)} ${["B", "KiB", "MiB", "GiB", "TiB"][unit]}`;
}

function verdict(check) {
  if (!check) return make("span", { class: "soft" }, "not checked");
  if (check.plays && check.too_slow) return make("span", { class: "warn" }, "fits this panel; was read too slowly beside what plays");
  if (check.plays) return make("span", { class: "good" }, "plays on this panel");
  return make("span", { class: "bad" }, plain(check.problems.join("; ")));
}

async function readFiles() {
  if ($("media-title").parentElement.hidden) return;
  const media = await attempt(() => api("GET", "media"));
  if (!media) return;
  const may = document.body.dataset.rights === "change";
  $("free").textContent = `${size(media.free_bytes)} free`;
  $("files").replaceChildren(...media.files.map((file) => {
    const whole = file.bytes !== null;
    const row = make("li", {}, make("span", { class: "name" }, file.name + " ",
      make("span", { class: "soft" }, whole ? size(file.bytes) : `${size(file.received)} received, not complete`)),
    whole ? verdict(file.check) : "");
    if (!may) return row;
    if (whole) row.append(
      make("button", { "aria-label": `Check ${file.name}`, onclick: () => check(file.name) }, "Check"),
      make("button", { "aria-label": `Add ${file.name} to the list`,
        disabled: !saved || !saved.editable || Boolean(file.check && !file.check.plays),
        title: !file.check || file.check.plays ? null : "It does not play on this panel.",
        onclick: () => { edit((list) => list.push({ source: file.source })); tell(`${file.name} was added; save the list.`); } }, "Add"));
    if (file.earlier !== null) row.append(make("button", { "aria-label": `Put back the earlier ${file.name}`, onclick: async () => {
      tell(`The earlier ${file.name} is checked.`);
      if (await attempt(() => api("POST", `media/${encodeURIComponent(file.name)}/restore`))) tell(`The earlier ${file.name} is back.`);
      readFiles();
    } }, "Earlier file"));
    row.append(make("button", { "aria-label": `Delete ${file.name}`, onclick: async () => {
      if (!confirm(`Delete ${file.name}${file.earlier === null ? "" : " and the file that it replaced"}?`)) return;
      if (await attempt(() => api("DELETE", "media/" + encodeURIComponent(file.name)))) readFiles();
    } }, "Delete"));
    return row;
  }));
}

async function check(name) {
  tell(`Checking ${name}.`);
  if (await attempt(() => api("POST", `media/${encodeURIComponent(name)}/check`))) tell(`${name} was checked.`);
  readFiles();
}

/** Sends the file from where an earlier upload ended. */
async function sendFile(file) {
  const no = (text) => { tell(text); $("file").value = ""; };
  if (file.size === 0) return no(`${file.name} is empty; it was not uploaded.`);
  const media = await api("GET", "media").catch(() => ({ files: [] }));
  const known = media.files.find((one) => one.name === file.name) || {};
  const replaces = known.bytes !== undefined && known.bytes !== null;
  if (replaces && !confirm(`There is a file ${file.name}. Replace it? The new file is checked first, and the present one is kept as its earlier file.`))
    return no(`${file.name} was not uploaded.`);
  const address = "/api/v1/media/" + encodeURIComponent(file.name) + (replaces ? "?replace=yes" : "");
  let at = known.received && known.received < file.size ? known.received : 0;
  upload = { request: null };
  $("upload").hidden = false;
  const progress = (bytes) => {
    $("progress").value = bytes / file.size;
    $("upload-text").textContent = `${file.name}: ${size(bytes)} of ${size(file.size)}`;
  };
  try {
    while (at < file.size) {
      const end = Math.min(file.size, at + PART);
      const begin = at;
      const part = put(address, file.slice(begin, end), (bytes) => progress(begin + bytes),
        "choose the file again to continue", { "Content-Range": `bytes ${begin}-${end - 1}/${file.size}` });
      upload.request = part.request;
      await part.answer;
      at = end;
    }
    tell(`${file.name} is there.`);
    check(file.name);
  } catch (error) {
    tell(error.message.startsWith(file.name) ? error.message : `${file.name}: ${error.message}`);
  }
  upload = null;
  $("upload").hidden = true;
  $("file").value = "";
  readFiles();
}

$("file").onchange = () => { if ($("file").files[0]) sendFile($("file").files[0]); };
$("stop").onclick = () => upload && upload.request && upload.request.abort();

// --- begin ---

addEventListener("beforeunload", (event) => { if (upload || (saved && items !== saved.items)) event.preventDefault(); });

refreshPicture($("woven"), () => "/api/v1/frame.jpg?width=640", 1000,
  (problem) => { $("woven-state").textContent = problem; });
let eye = null;
attempt(async () => { eye = await api("GET", "optics"); });
refreshPicture($("seen"), () =>
  `/api/v1/eye.jpg?x=0&y=${eye ? eye.viewing_height_mm : 0}&z=${eye && eye.viewing_distance_mm || 700}&width=640`, 2000);
setInterval(() => {
  if (!document.hidden) attempt(async () => showState({ ...state, machine: (await api("GET", "state")).machine }));
}, 10000);
follow((now, changed) => {
  showState(now);
  $("list-title").parentElement.inert = !now.connected;
  if (changed && now.connected) readList(false).then(readFiles);
  else if (changed) readFiles();
}, (name, event) => {
  if (name === "list" && saved && items !== saved.items && !saving) {
    changedBy = `\u201c${event.who}\u201d`;
    showList();
  } else if (name === "list" || name === "replaced") {
    readList(false);
  }
  if (name === "bad_item" || name === "not_replaced") tell(plain(event.cause));
});
