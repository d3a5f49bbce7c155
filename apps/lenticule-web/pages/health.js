// SPDX-License-Identifier: Apache-2.0
// The page Health: is everything as it should be?
import { $, api, attempt, clock, count, follow, make, plain } from "/page.js";

const NAMES = { shown: "Frames shown", vblanks: "Refreshes of the panel", missed_vblanks: "Frames that came one refresh too late",
  repeated_underrun: "Frames repeated because the next one was not ready", dropped: "Frames left out",
  held: "Refreshes without a new frame due",
  damaged_frames: "Damaged frames", display_returns: "Lost displays that came back",
  log_lines_dropped: "Log lines dropped" };

function row(name, value) {
  return make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, typeof value === "number" ? value.toLocaleString() : value));
}

function late(missed, notReady) {
  return [missed && `${count(missed, "frame")} one refresh too late`, notReady && `${count(notReady, "frame")} not ready in time`]
    .filter(Boolean).join(", ") || "no late frame";
}

/** Says in plain words what the player reported. */
function sentence(fault) {
  const source = plain(fault.source || ""), cause = plain(fault.cause || "").replace(source + ": ", "");
  const figures = fault.figures || {};
  const words = {
    frame_missed: () => late(fault.missed_vblanks, fault.late_frames) + " within a second",
    too_slow: () => `the source is too slow: ${figures.seen_frames_per_s.toFixed(1)} of ${figures.needed_frames_per_s.toFixed(1)} frames per second`,
    bad_item: () => `skipped: ${source}: ${cause}`,
    damaged_item: () => `damaged: ${source}: ${cause}`,
    not_replaced: () => `the old version continues: ${source}: ${cause}`,
  };
  try {
    return words[fault.event]();
  } catch {
    return fault.event.replaceAll("_", " ");
  }
}

function drawHour(history) {
  const worst = Math.max(1, ...history.map((one) => one.missed_vblanks + one.late_frames));
  const last = history.length ? history[history.length - 1].time : 0;
  const bars = [];
  for (let k = 0; k < 60; ++k) {
    const one = history.find((minute) => minute.time === last - (59 - k) * 60);
    const bad = one ? one.missed_vblanks + one.late_frames : 0;
    const high = bad ? Math.max(6, 118 * bad / worst) : 4;
    bars.push(make("rect", { svg: true, class: one ? bad ? "missed" : "ok" : "none",
      x: k * 10 + 1, width: 8, y: 118 - high, height: high },
    make("title", { svg: true }, one ? `${clock(one.time)}: ${late(one.missed_vblanks, one.late_frames)}` : "")));
  }
  $("hour").replaceChildren(...bars);
  const missed = history.reduce((sum, one) => sum + one.missed_vblanks, 0);
  const notReady = history.reduce((sum, one) => sum + one.late_frames, 0);
  $("hour-most").textContent = count(worst, "late frame");
  $("hour-text").textContent = `${count(history.length, "minute")} seen: ${late(missed, notReady)}. One bar is one minute.`;
}

function show(health) {
  const verdicts = { good: ["All is well", "good"], look: ["Something needs a look", "warn"], bad: ["The player does not answer", "bad"] };
  const [text, style] = verdicts[health.verdict];
  $("verdict").textContent = text;
  $("verdict").className = style;
  $("sentences").replaceChildren(...health.sentences.map((one) => make("li", {}, plain(one))));
  const exact = health.exactness;
  $("exact").textContent = exact ? `Subpixels reach the panel unchanged: ${exact.exact}.` + (exact.exact === "yes" ? "" : ` ${exact.reasons.join("; ")}`)
    : health.connected ? "This display has no connection that could change subpixels." : "";
  drawHour(health.history);
  $("figures").replaceChildren(...Object.entries(health.figures).map(([key, value]) => row(NAMES[key] || key, value)));
  $("machine").replaceChildren(
    ...health.machine.temperatures.map((one) => row(one.name, `${one.celsius.toFixed(1)} °C`)),
    ...health.machine.clocks.map((one) => row(one.name, `${one.mhz.toFixed(0)} MHz`)));
  if (!$("machine").children.length) $("machine").append(row("Sensors", "the kernel reports none"));
  $("faults").replaceChildren(...(health.faults.length ? health.faults.map((one) => make("li", {},
    make("span", { class: "name" }, sentence(one)),
    make("span", { class: "soft" }, clock(one.time)))) : [make("li", {}, "None.")]));
}

const read = () => attempt(async () => show(await api("GET", "health")));
setInterval(() => { if (!document.hidden) read(); }, 5000);
follow((now, changed) => { if (changed) read(); });
