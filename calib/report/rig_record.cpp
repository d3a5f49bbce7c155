// SPDX-License-Identifier: Apache-2.0
#include "calib/report/rig_record.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "base/numbers.h"
#include "base/text.h"
#include "calib/report/report.h"

namespace lenticule::calib {
namespace {

using Entries = std::vector<std::pair<std::string, std::string>>;

// Limits of the rig file (optics/rig.h, validate_rig).
constexpr size_t kMaxEntries = 256;
constexpr size_t kMaxTextBytes = 4096;
constexpr std::string_view kHistory = "history_";
constexpr std::string_view kDropped = "history_dropped";

/// Returns the number of an entry "history_NUMBER". At most nine digits are accepted, so that a
/// larger number, written by hand, cannot cause an overflow.
std::optional<uint64_t> history_number(std::string_view key) {
  if (!key.starts_with(kHistory)) return std::nullopt;
  const std::string_view digits = key.substr(kHistory.size());
  return digits.size() <= 9 ? number_from<uint64_t>(digits) : std::nullopt;
}

void add(Entries& entries, std::string key, const std::string& text) {
  if (!text.empty()) entries.emplace_back(std::move(key), shortened(escaped(text), kMaxTextBytes));
}

std::string joined(const std::vector<std::string>& texts) {
  std::string out;
  for (const std::string& text : texts) out += (out.empty() ? "" : "; ") + text;
  return out;
}

std::string panel_text(const optics::Rig& rig) {
  const optics::PanelIdentity& id = rig.identity;
  std::string out = fmt::format("{} x {} pixels", rig.panel.width_px, rig.panel.height_px);
  if (!id.manufacturer.empty()) out += ", manufacturer " + id.manufacturer;
  if (id.product) out += fmt::format(", product {}", *id.product);
  if (!id.serial.empty()) out += ", serial " + id.serial;
  if (!id.edid_sha256.empty()) out += ", EDID " + id.edid_sha256;
  return out;
}

std::string viewpoints_text(const Calibration& calibration) {
  std::vector<std::string> places;
  for (const Viewpoint& v : calibration.viewpoints)
    places.push_back(fmt::format("{} ({:.1f}, {:.1f}, {:.1f}){}", v.name, v.eye_mm.x, v.eye_mm.y,
                                 v.eye_mm.z, v.held_out ? " kept aside" : ""));
  return joined(places);
}

std::string errors_text(const Calibration& calibration) {
  std::vector<std::string> errors;
  for (const Parameter& p : calibration.parameters)
    errors.push_back(fmt::format("{} {:.3g}", p.name, p.estimate.sigma));
  return joined(errors);
}

/// Returns the validity for readers of the file and for programs that must not use the rig
/// elsewhere.
std::string validity_text(const Calibration& calibration) {
  if (calibration.verdict == Verdict::Intrinsic) return "every eye";
  if (calibration.verdict == Verdict::Refused) return "refused: not to be used";
  std::string out = "effective: holds only at the eye it was measured from";
  for (const Viewpoint& v : calibration.viewpoints)
    if (!v.held_out)
      return out + fmt::format(", ({:.1f}, {:.1f}, {:.1f}) mm", v.eye_mm.x, v.eye_mm.y, v.eye_mm.z);
  return out;
}

void add_number(Entries& entries, std::string key, double value) {
  if (std::isfinite(value)) add(entries, std::move(key), fmt::format("{:.5g}", value));
}

void add_quality(Entries& entries, const Calibration& calibration) {
  add(entries, "verdict", to_string(calibration.verdict));
  add(entries, "valid_for", validity_text(calibration));
  add(entries, "reasons", joined(calibration.reasons));
  add(entries, "viewpoints_mm", viewpoints_text(calibration));
  const ResidualSummary used = residual_summary(calibration, false);
  add_number(entries, "residual_rms_lenses", used.rms_lenses);
  add_number(entries, "residual_max_lenses", used.max_lenses);
  add_number(entries, "held_out_max_lenses", residual_summary(calibration, true).max_lenses);
  add(entries, "standard_errors", errors_text(calibration));
}

Entries new_entries(const Calibration& calibration, const RecordDetails& details) {
  Entries entries;
  add(entries, "date", iso_utc(details.when));
  add(entries, "tool", std::string("lenticule ") + LENTICULE_VERSION);
  add(entries, "method", details.method);
  add(entries, "camera", details.camera.name);
  add(entries, "camera_identity", details.camera.identity);
  add(entries, "camera_pixel_format", details.camera.pixel_format);
  if (details.temperature_celsius)
    add_number(entries, "temperature_celsius", *details.temperature_celsius);
  add(entries, "panel", panel_text(calibration.rig));
  add_quality(entries, calibration);
  return entries;
}

/// History holds the earlier provenance, newest first; numbers increase with time.
struct History {
  std::vector<std::pair<uint64_t, std::string>> states;
  uint64_t dropped = 0;
};

History history_of(const Entries& provenance) {
  History history;
  std::string last;
  uint64_t newest = 0;
  for (const auto& [key, text] : provenance) {
    if (key == kDropped) {
      history.dropped = number_from<uint64_t>(text).value_or(0);
    } else if (const auto number = history_number(key)) {
      history.states.emplace_back(*number, text);
      newest = std::max(newest, *number);
    } else {
      last += fmt::format("{}{}: {}", last.empty() ? "" : " | ", key, text);
    }
  }
  if (!last.empty())
    history.states.emplace_back(newest + 1, shortened(escaped(last), kMaxTextBytes));
  std::sort(history.states.begin(), history.states.end(), std::greater<>());
  return history;
}

void add_history(Entries& entries, History history) {
  const size_t room = kMaxEntries - entries.size() - 1;  // one for the count
  if (history.states.size() > room) {
    history.dropped += history.states.size() - room;
    history.states.resize(room);
  }
  for (const auto& [number, text] : history.states)
    entries.emplace_back(fmt::format("{}{}", kHistory, number), text);
  if (history.dropped > 0)
    entries.emplace_back(std::string(kDropped), std::to_string(history.dropped));
}

}  // namespace

std::string iso_utc(std::chrono::system_clock::time_point when) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(when);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(seconds)));
}

optics::Rig with_record(const Calibration& calibration, const RecordDetails& details) {
  optics::Rig rig = calibration.rig;
  Entries entries = new_entries(calibration, details);
  add_history(entries, history_of(rig.provenance));
  rig.provenance = std::move(entries);
  return rig;
}

}  // namespace lenticule::calib
