// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_output.h"
#include "base/numbers.h"
#include "base/text.h"
#include "optics/eye_simulator.h"

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

namespace {

/// Targets of a calibration. The phase is in lenses.
constexpr double kWantedRmsLenses = 0.007;
constexpr double kWantedMaxLenses = 0.02;
constexpr double kWantedHeldOutMaxLenses = 0.05;
constexpr double kWantedPredictedLenses = 0.03;
constexpr double kWantedContrast = 0.25;

/// Largest phase error, in lenses, that remains invisible.
constexpr double kVisiblePhaseLenses = 0.02;
/// Relative change of pitch per kelvin of a free sheet of acrylic on the panel.
constexpr double kPitchPerKelvin = 7e-5;

bool any_contrast_below(const Calibration& calibration, double wanted) {
  return std::any_of(calibration.viewpoints.begin(), calibration.viewpoints.end(),
                     [&](const Viewpoint& v) { return v.contrast > 0.0 && v.contrast < wanted; });
}

void add_link_advice(const LinkCheck& link, std::vector<std::string>& out) {
  if (link.scaled)
    out.emplace_back(
        "Show the panel's own resolution and switch off overscan and zoom: the picture is being "
        "scaled, so that no subpixel is in its place.");
  if (link.chroma_subsampled)
    out.emplace_back(
        "Set the input of the television to PC or to RGB 4:4:4: colour arrives at half resolution, "
        "so that red and blue cannot be controlled separately.");
  if (link.channels_swapped)
    out.emplace_back(
        "Write layout = \"bgr\" into the rig and calibrate again: red and blue stripes are "
        "swapped.");
}

void add_measurement_advice(const Calibration& calibration, std::vector<std::string>& out) {
  if (any_contrast_below(calibration, kWantedContrast))
    out.emplace_back(
        "Look at the sheet: the fringes are weak. It may be loose or upside down, be covered by "
        "dust or a film, or the camera's aperture may be too wide.");
  const ResidualSummary used = residual_summary(calibration, false);
  if (used.max_lenses > kWantedMaxLenses || used.rms_lenses > kWantedRmsLenses)
    out.emplace_back(
        "Look at the maps of residuals: patches suggest bubbles or a bent sheet, slopes suggest a "
        "camera that moved or a sheet that was still warming up.");
  if (residual_summary(calibration, true).max_lenses > kWantedHeldOutMaxLenses)
    out.emplace_back(
        "Measure again from more places: the one kept aside is predicted too badly to trust places "
        "that were not measured.");
}

std::string place_of_first_eye(const Calibration& calibration) {
  for (const Viewpoint& v : calibration.viewpoints)
    if (!v.held_out)
      return fmt::format("{:.0f} mm from the panel, {:.0f} mm right and {:.0f} mm above its centre",
                         v.eye_mm.z, v.eye_mm.x, v.eye_mm.y);
  return "the place it was measured from";
}

void add_verdict_advice(const Calibration& calibration, std::vector<std::string>& out) {
  switch (calibration.verdict) {
    case Verdict::Intrinsic:
      out.emplace_back(
          "Use the rig. If the picture drifts as the panel warms up, trim offset and pitch while "
          "it plays; calibrate again after the sheet was taken off or pressed on.");
      return;
    case Verdict::Effective:
      out.emplace_back(
          fmt::format("Use the rig for viewers near {}.", place_of_first_eye(calibration)));
      out.emplace_back(
          "For viewers elsewhere, calibrate again with the camera also 200 to 300 mm to the left "
          "and to the right, or a third nearer.");
      return;
    case Verdict::Refused:
      out.emplace_back("Do not use these numbers; the previous rig file is still the best one.");
      out.emplace_back("Remove the causes above, darken the room, and calibrate again.");
  }
}

}  // namespace

const char* to_string(Verdict verdict) {
  return verdict == Verdict::Intrinsic   ? "intrinsic"
         : verdict == Verdict::Effective ? "effective"
                                         : "refused";
}

std::string verdict_headline(Verdict verdict) {
  if (verdict == Verdict::Refused) return "Not calibrated";
  return verdict == Verdict::Intrinsic ? "Calibrated" : "Calibrated for one viewing position";
}

std::string verdict_explained(const Calibration& calibration) {
  if (calibration.verdict == Verdict::Refused)
    return "The measurement is not good enough to be used.";
  if (calibration.verdict == Verdict::Intrinsic)
    return fmt::format(
        "Right to {:.3f} lens anywhere in the viewing zone, which is 500 mm wide: the numbers "
        "describe the sheet itself.",
        calibration.drift.worst_lenses);
  return "The numbers are valid at " + place_of_first_eye(calibration) +
         ". Pitch, gap and offset could not be separated.";
}

std::vector<std::string> advice(const Calibration& calibration) {
  std::vector<std::string> out;
  add_link_advice(calibration.link, out);
  add_measurement_advice(calibration, out);
  add_verdict_advice(calibration, out);
  return out;
}

std::string with_error(const Estimate& estimate) {
  if (!std::isfinite(estimate.value)) return "not known";
  if (!(std::isfinite(estimate.sigma) && estimate.sigma > 0.0))
    return fmt::format("{:.6g}", estimate.value);
  const double first_digit = std::floor(std::log10(estimate.sigma));
  const int digits = static_cast<int>(std::clamp(1.0 - first_digit, 0.0, 12.0));
  return fmt::format("{:.{}f} \u00b1 {:.{}f}", estimate.value, digits, estimate.sigma, digits);
}

ResidualSummary residual_summary(const Calibration& calibration, bool held_out) {
  ResidualSummary summary;
  double squares = 0.0;
  for (const Viewpoint& v : calibration.viewpoints) {
    if (v.held_out != held_out) continue;
    ++summary.viewpoints;
    squares += v.rms_lenses * v.rms_lenses;
    summary.max_lenses = std::max(summary.max_lenses, v.max_lenses);
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (summary.viewpoints == 0) return {0, kNone, kNone};
  summary.rms_lenses = std::sqrt(squares / summary.viewpoints);
  return summary;
}

namespace {

/// Situation is a rig seen by an eye.
struct Situation {
  optics::Rig rig;
  optics::Eye eye;
};

struct Change {
  const char* unit;  ///< unit of `amount`
  double amount;
  const char* words;
  void (*apply)(Situation&, double);
};

// The amounts are chosen such that the phase moves by hundredths of a lens on common panels.
constexpr Change kChanges[] = {
    {"K", 1.0, "{} {} warmer or colder, sheet free to expand",
     [](Situation& s, double by) { s.rig.sheet.pitch.value *= 1.0 + kPitchPerKelvin * by; }},
    {"mm", 10.0, "viewer {} {} nearer or farther",
     [](Situation& s, double by) { s.eye.z_mm += by; }},
    {"mm", 5.0, "viewer {} {} to the side", [](Situation& s, double by) { s.eye.x += by; }},
    {"mm", 10.0, "viewer {} {} higher or lower", [](Situation& s, double by) { s.eye.y += by; }},
    {"", 1e-5, "pitch off by {} of itself",
     [](Situation& s, double by) { s.rig.sheet.pitch.value *= 1.0 + by; }},
    {"px/px", 1e-5, "slant off by {} {}", [](Situation& s, double by) { s.rig.sheet.slant += by; }},
    {"lenses", 0.01, "offset off by {} {}",
     [](Situation& s, double by) { s.rig.sheet.offset.value += by; }},
    {"%", 1.0, "gap off by {} {}",
     [](Situation& s, double by) { s.rig.sheet.gap.value *= 1.0 + by / 100.0; }},
};

Sensitivity sensitivity_of(const Change& change, const Situation& now) {
  Situation then = now;
  change.apply(then, change.amount);
  const double worst = optics::largest_phase_difference(now.rig, now.eye, then.rig, then.eye);
  const double allowed = change.amount * kVisiblePhaseLenses / std::max(worst, 1e-12);
  return {.change = fmt::format(fmt::runtime(change.words), change.amount, change.unit),
          .worst_lenses = worst,
          .allowed = fmt::format("{:.2g} {}", allowed, change.unit)};
}

}  // namespace

std::vector<Sensitivity> sensitivities(const optics::Rig& rig, const optics::Eye& eye) {
  std::vector<Sensitivity> out;
  for (const Change& change : kChanges) out.push_back(sensitivity_of(change, {rig, eye}));
  return out;
}

namespace {

using nlohmann::json;

constexpr auto number = finite_or_null;

template <class Item, class Function>
json list(const std::vector<Item>& items, Function&& to_item) {
  json out = json::array();
  for (const Item& item : items) out.push_back(to_item(item));
  return out;
}

json numbers(const std::vector<double>& values) { return list(values, number); }

json texts(const std::vector<std::string>& lines) { return list(lines, escaped); }

json vector(const Vec3& v) { return {number(v.x), number(v.y), number(v.z)}; }

json estimate(const Estimate& e) {
  return {{"value", number(e.value)}, {"sigma", number(e.sigma)}};
}

json field(const PanelField& f) {
  return {{"columns", f.columns}, {"rows", f.rows}, {"values", numbers(f.values)}};
}

json parameter(const Parameter& p) {
  return {{"name", escaped(p.name)},
          {"unit", escaped(p.unit)},
          {"value", number(p.estimate.value)},
          {"sigma", number(p.estimate.sigma)}};
}

json viewpoint(const Viewpoint& v) {
  return {{"name", escaped(v.name)},
          {"eye_mm", vector(v.eye_mm)},
          {"eye_sigma_mm", vector(v.eye_sigma_mm)},
          {"tilt_degrees", number(v.tilt_degrees)},
          {"effective_pitch_subpx", estimate(v.effective_pitch_subpx)},
          {"slant", estimate(v.slant)},
          {"effective_offset_lenses", estimate(v.effective_offset_lenses)},
          {"contrast", number(v.contrast)},
          {"covered", number(v.covered)},
          {"blocks", v.blocks},
          {"rms_lenses", number(v.rms_lenses)},
          {"max_lenses", number(v.max_lenses)},
          {"reprojection_rms_px", number(v.reprojection_rms_px)},
          {"held_out", v.held_out},
          {"foretold_lenses", number(v.predicted_lenses)},
          {"residual_lenses", field(v.residual)}};
}

json spot(const std::optional<LensSpot>& s) {
  if (!s) return nullptr;
  return {{"profile", numbers(s->profile)},
          {"sigma_lenses", number(s->sigma_lenses)},
          {"two_view_crosstalk", number(s->two_view_crosstalk)},
          {"veiling_glare", number(s->veiling_glare)}};
}

json link(const LinkCheck& l) {
  return {{"channels_swapped", l.channels_swapped},
          {"chroma_subsampled", l.chroma_subsampled},
          {"scaled", l.scaled},
          {"chroma_leak", number(l.chroma_leak)},
          {"findings", texts(l.findings)}};
}

json camera_model(const CameraModel& c) {
  return {{"focal_px", number(c.focal_px)},
          {"centre_x_px", number(c.centre_x_px)},
          {"centre_y_px", number(c.centre_y_px)},
          {"k1", number(c.k1)},
          {"k2", number(c.k2)}};
}

json drift(const DriftPrediction& d) {
  return {{"worst_lenses", number(d.worst_lenses)},
          {"panel_x_px", number(d.panel_x_px)},
          {"panel_y_px", number(d.panel_y_px)},
          {"eye_mm", vector(d.eye_mm)}};
}

json sheet(const optics::LensSheet& s) {
  const optics::ResidualMap& map = s.residual;
  return {{"pitch_subpx", number(s.pitch.value)},
          {"slant", number(s.slant)},
          {"offset_lenses", number(s.offset.value)},
          {"gap_mm", number(s.gap.value)},
          {"refraction_shape", number(s.refraction_shape)},
          {"spot_sigma_lenses", number(s.spot_sigma.value)},
          {"channel_offset_subpx",
           {number(s.channel_offset[0].value), number(s.channel_offset[1].value),
            number(s.channel_offset[2].value)}},
          {"residual_lenses", field({map.columns, map.rows, map.lenses})}};
}

json identity(const optics::PanelIdentity& id) {
  return {{"manufacturer", escaped(id.manufacturer)},
          {"product", id.product ? json(*id.product) : json(nullptr)},
          {"serial", escaped(id.serial)},
          {"edid_sha256", escaped(id.edid_sha256)}};
}

json panel(const optics::Panel& p) {
  return {{"width_px", p.width_px},
          {"height_px", p.height_px},
          {"pixel_width_mm", number(p.pixel_width.value)},
          {"pixel_height_mm", number(p.pixel_height.value)},
          {"layout", p.layout.name()}};
}

json rig(const optics::Rig& r) {
  return {{"name", escaped(r.name)},
          {"fingerprint", optics::fingerprint(r)},
          {"panel", panel(r.panel)},
          {"sheet", sheet(r.sheet)},
          {"viewing",
           {{"distance_mm", number(r.viewing.distance.value)},
            {"height_mm", number(r.viewing.height.value)}}},
          {"identity", identity(r.identity)},
          {"provenance", list(r.provenance, [](const auto& entry) {
             return json::array({escaped(entry.first), escaped(entry.second)});
           })}};
}

}  // namespace

json report_json(const Calibration& c) {
  return {{"format", 1},
          {"tool", std::string("lenticule ") + LENTICULE_VERSION},
          {"verdict", to_string(c.verdict)},
          {"reasons", texts(c.reasons)},
          {"warnings", texts(c.warnings)},
          {"advice", texts(advice(c))},
          {"rig", rig(c.rig)},
          {"parameters", list(c.parameters, parameter)},
          {"correlations", list(c.correlations, numbers)},
          {"viewpoints", list(c.viewpoints, viewpoint)},
          {"camera", camera_model(c.camera)},
          {"spot", spot(c.spot)},
          {"link", link(c.link)},
          {"drift", drift(c.drift)},
          {"at_camera_lenses", c.at_camera_lenses > 0.0 ? number(c.at_camera_lenses) : json()},
          {"seconds_computing", number(c.seconds_computing)}};
}

json report_json(const Calibration& calibration, const RecordDetails& details) {
  json out = report_json(calibration);
  const CameraFacts& used = details.camera;
  out["when"] = iso_utc(details.when);
  out["method"] = escaped(details.method);
  out["temperature_celsius"] =
      details.temperature_celsius ? number(*details.temperature_celsius) : json(nullptr);
  out["camera_used"] = {{"name", escaped(used.name)},
                        {"identity", escaped(used.identity)},
                        {"width_px", used.width},
                        {"height_px", used.height},
                        {"channels", used.channels},
                        {"frames_per_second", number(used.frames_per_second)},
                        {"pixel_format", escaped(used.pixel_format)},
                        {"unlocked", texts(used.unlocked)}};
  return out;
}

namespace {

std::string side(double share, const char* low, const char* high) {
  if (share < 1.0 / 3.0) return low;
  return share > 2.0 / 3.0 ? high : "";
}

/// Returns the position on the panel as seen from the front: "top left", "centre".
std::string panel_place(const optics::Panel& panel, double x_px, double y_px) {
  const std::string across = side(x_px / std::max(panel.width_px, 1), "left", "right");
  const std::string down = side(y_px / std::max(panel.height_px, 1), "top", "bottom");
  if (across.empty() && down.empty()) return "centre";
  return down + (across.empty() || down.empty() ? "" : " ") + across;
}

/// Returns the eye for which the page computes the effects of small changes.
optics::Eye usual_eye(const Calibration& c) {
  for (const Viewpoint& v : c.viewpoints)
    if (!v.held_out && is_finite(v.eye_mm) && v.eye_mm.z > 0.0)
      return {v.eye_mm.x, v.eye_mm.y, v.eye_mm.z};
  const optics::ViewingLine& line = c.rig.viewing;
  return {line.centre.value, line.height.value, viewing_distance_mm(c.rig)};
}

json small_changes(const Calibration& c, const optics::Eye& eye) {
  if (optics::find_problem(c.rig)) return json::array();
  return list(sensitivities(c.rig, eye), [](const Sensitivity& s) -> json {
    return {{"change", s.change}, {"worst_lenses", number(s.worst_lenses)}, {"allowed", s.allowed}};
  });
}

}  // namespace

std::string report_html(const Calibration& calibration, const RecordDetails& details) {
  const optics::Eye eye = usual_eye(calibration);
  const DriftPrediction& drift = calibration.drift;
  const json data = {
      {"report", report_json(calibration, details)},
      {"headline", verdict_headline(calibration.verdict)},
      {"explained", verdict_explained(calibration)},
      {"worst_place", panel_place(calibration.rig.panel, drift.panel_x_px, drift.panel_y_px)},
      {"eye_mm", {number(eye.x), number(eye.y), number(eye.z_mm)}},
      {"small_changes", small_changes(calibration, eye)},
      {"limits",
       {{"rms_lenses", kWantedRmsLenses},
        {"max_lenses", kWantedMaxLenses},
        {"held_out_max_lenses", kWantedHeldOutMaxLenses},
        {"predicted_lenses", kWantedPredictedLenses},
        {"contrast", kWantedContrast},
        {"visible_lenses", kVisiblePhaseLenses},
        {"pitch_per_kelvin", kPitchPerKelvin}}}};
  constexpr std::string_view kPlace = "@DATA@";
  const std::string_view page = report_page();
  std::string html(page.substr(0, page.find(kPlace)));
  for (const char c : data.dump())
    if (c == '<')
      html += "\\u003c";  // no text can end the script that contains it
    else
      html += c;
  html += page.substr(page.find(kPlace) + kPlace.size());
  return html;
}

}  // namespace lenticule::calib
