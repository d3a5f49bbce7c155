// SPDX-License-Identifier: Apache-2.0
// What all pages share: requests, the state of the player, messages.

export const $ = (id) => document.getElementById(id);

let messageTimer = 0;
/** Shows a message, which screen readers read out. */
export function tell(text) {
  $("message").textContent = text;
  clearTimeout(messageTimer);
  messageTimer = setTimeout(() => { $("message").textContent = ""; }, 8000);
}

/** Does fetch(), with words for a server that does not answer. */
export function request(address, options) {
  return fetch(address, options).catch(() => { throw new Error("The server does not answer"); });
}

/** Returns a text of the player without the folders of its paths, which say nothing to an owner. */
export function plain(text) {
  return text.replace(/(^|[\s"'(])\/(?:[^:/\n]+\/)+/g, "$1");
}

/** Sends a request to the API; returns the JSON of its answer. Throws an Error with cause and remedy. */
export async function api(method, path, body) {
  const options = { method, headers: {} };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers["Content-Type"] = "application/json";
  }
  const answer = await request("/api/v1/" + path, options);
  const json = await answer.json().catch(() => ({}));
  if (!answer.ok) {
    const error = json.error || { cause: "the server answered " + answer.status, remedy: "" };
    const failed = new Error(plain(error.cause) + (error.remedy ? ": " + error.remedy : ""));
    failed.status = answer.status;
    throw failed;
  }
  return json;
}

/** Runs an action and shows its error. Returns undefined if it failed. */
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    tell(error.message);
    return undefined;
  }
}

/** Makes an element with attributes and children; text is never read as HTML. */
export function make(tag, attributes = {}, ...children) {
  const svg = ["svg", "g", "rect", "circle", "path", "line", "text", "title"].includes(tag) && attributes.svg;
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag)
    : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "svg") continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Says below the navigation what keeps the page from working; dims what is out of date. */
function warn(text, style) {
  $("notice").textContent = text;
  $("notice").className = style;
}

/** Calls `take` with the state now and after each change, and with true if the player came or went;
    calls `other` with the other events. Buttons with data-changes need the right to change and a
    player, with "server" no player. */
export function follow(take, other = () => {}) {
  let known = {}, connected = null, source = null;
  const show = () => {
    document.body.dataset.rights = known.rights;
    document.body.dataset.player = known.connected ? "there" : "lost";
    $("main").inert = false;
    for (const button of document.querySelectorAll("[data-changes]"))
      button.disabled = known.rights !== "change" || !(known.connected || button.dataset.changes === "server");
    warn(!known.connected ? "The player does not answer. What you see here is from before."
      : known.rights === "see" ? "You may look, but not change anything: your address has the right \u201csee\u201d." : "",
    known.connected ? "" : "lost");
    const changed = known.connected !== connected;
    connected = known.connected;
    take(known, changed);
  };
  const open = () => {
    source = new EventSource("/api/v1/events");
    source.addEventListener("state", (event) => {
      known = { ...known, ...JSON.parse(event.data) };
      show();
    });
    for (const name of ["list", "item_started", "bad_item", "damaged_item", "not_replaced", "replaced",
      "frame_missed", "too_slow", "trim_changed"])
      source.addEventListener(name, (event) => other(name, JSON.parse(event.data)));
    source.onerror = () => {
      $("main").inert = true;
      // The browser gives up after an answer such as 401.
      warn(source.readyState === EventSource.CLOSED ? "This address is not valid any more. Ask for a new one."
        : "The server does not answer; trying again.", "lost");
    };
  };
  open();
  addEventListener("pagehide", () => source.close());
  // The browser keeps a page that was left, and shows it again with "Back".
  addEventListener("pageshow", (event) => { if (event.persisted) open(); });
}

/** Loads a picture into the image. */
export async function loadPicture(image, address) {
  const answer = await request(address);
  if (!answer.ok) throw new Error(plain((await answer.json()).error.cause));
  const old = image.src;
  image.src = URL.createObjectURL(await answer.blob());
  if (old.startsWith("blob:")) URL.revokeObjectURL(old);
}

/** Begins to send a file; returns the request, which can be aborted, and a promise of the JSON of its
    answer. `sent` is called with the number of bytes that were sent. */
export function put(address, body, sent, retry, headers = {}) {
  const request = new XMLHttpRequest();
  const answer = new Promise((resolve, reject) => {
    request.open("PUT", address);
    for (const [name, value] of Object.entries(headers)) request.setRequestHeader(name, value);
    request.upload.onprogress = (event) => sent(event.loaded);
    request.onload = () => {
      const json = JSON.parse(request.responseText || "{}");
      if (request.status < 300) resolve(json);
      else reject(new Error(plain((json.error || {}).cause || "status " + request.status)));
    };
    request.onerror = () => reject(new Error("the connection was lost; " + retry));
    request.onabort = () => reject(new Error("paused; " + retry));
    request.send(body);
  });
  return { request, answer };
}

/** Loads pictures from `address()` into the image, one after the other, `pause` ms apart, while the
    page is visible. */
export function refreshPicture(image, address, pause, after = () => {}) {
  let timer = 0, busy = false, again = false;
  async function load() {
    clearTimeout(timer);
    if (document.hidden) { timer = setTimeout(load, 1000); return; }
    if (busy) { again = true; return; }
    busy = true;
    const begun = performance.now();
    try {
      await loadPicture(image, address());
      after("", performance.now() - begun);
    } catch (error) {
      after(error.message, 0);
    }
    busy = false;
    const now = again;
    again = false;
    timer = setTimeout(load, now ? 0 : Math.max(0, pause - (performance.now() - begun)));
  }
  load();
  return load;
}

/** Returns a number with its noun: "1 item", "2 items". */
export function count(number, noun) {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}

export function clock(seconds) {
  return new Date(seconds * 1000).toLocaleString();
}

export function baseName(path) {
  return path.slice(path.lastIndexOf("/") + 1);
}
