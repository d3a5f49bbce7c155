// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/photo_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "apps/lenticule-web/http/message.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMiddle = 0;
/// Least tangent of the angle between the normal of the panel and a place at the side.
constexpr double kAside = 0.25;

struct Remedy {
  std::string_view reason;  ///< part of it
  std::string_view words;
};
constexpr std::array<Remedy, 13> kRemedies = {
    {{"tags were found", "Get the whole panel with all nine tags into the picture, and sharp."},
     {"tags deviate",
      "Use the main camera of the phone, and get the whole panel with all nine tags into the "
      "picture."},
     {"another rig", "Press \"Begin again\", and photograph the chart that is then on the panel."},
     {"another size", "Use one phone, in one setting, and send the files as it stored them."},
     {"focal length differs", "Use no zoom, and the same camera of the phone for all."},
     {"cropped", "Use no zoom, and send the whole photograph as the phone stored it."},
     {"clipped", "Tap on the panel, and lower the brightness of the camera."},
     {"faint", "Darken the room, switch off the flash, and hold the phone still."},
     {"blurred", "Tap on the panel to focus, and hold the phone still."},
     {"hand moved", "Hold the phone with both hands, and switch HDR off."},
     {"fringes are in the picture",
      "Get the whole panel into the picture, with nothing before it."},
     {"took too long", "The machine is busy. Pause the content, and send the photograph again."},
     {"stated error", "Hold the phone as the drawing shows, and send the file as it is."}}};
constexpr std::string_view kUsualRemedy =
    "Take it again: the whole panel in the picture, a dark room, no flash, no zoom.";

std::optional<double> number_in(const ordered_json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

/// Returns the index of the photograph of a file "NAME.jpg".
std::optional<size_t> place_of_file(std::string_view file) {
  for (size_t k = 0; k < kPhotoPlaces.size(); ++k)
    if (file.substr(0, file.rfind('.')) == kPhotoPlaces[k].name) return k;
  return std::nullopt;
}

int side_of(double x_mm, double z_mm) {
  return x_mm < -kAside * z_mm ? -1 : x_mm > kAside * z_mm ? 1 : 0;
}

/// Returns a member of an object; null if there is none.
const ordered_json& member(const ordered_json& object, const char* key) {
  static const ordered_json none;
  if (!object.is_object()) return none;
  const auto found = object.find(key);
  return found != object.end() ? *found : none;
}

std::string text_in(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : std::string();
}

ordered_json list_in(const ordered_json& value) {
  return value.is_array() ? value : ordered_json::array();
}

constexpr size_t kMaxLine = 400, kMaxMessage = 2000;

}  // namespace

CalibrationOutput parse_calibration_output(const std::string& output) {
  CalibrationOutput parsed;
  size_t begin = output.starts_with("{\n") ? 0 : output.find("\n{\n");
  if (begin != std::string::npos)
    parsed.report = ordered_json::parse(output.substr(begin), nullptr, false);
  if (!parsed.report.is_object()) {
    parsed.report = nullptr;
    begin = output.size();
  }
  const std::string_view before = std::string_view(output).substr(0, begin);
  for (size_t at = 0; at < before.size() && parsed.message.size() < kMaxMessage;) {
    const size_t end = std::min(before.find('\n', at), before.size());
    // Progress rewrites its line after '\r': only the last state counts.
    std::string_view line = before.substr(at, end - at);
    line.remove_prefix(std::min(line.size(), line.rfind('\r') + 1));
    if (!line.empty())
      parsed.message +=
          (parsed.message.empty() ? "" : "\n") + shortened(escaped(std::string(line)), kMaxLine);
    at = end + 1;
  }
  return parsed;
}

ordered_json shown_part(const ordered_json& report) {
  ordered_json result;
  for (const char* key : {"verdict", "reasons", "warnings", "advice", "parameters"})
    result[key] = report.value(key, ordered_json());
  const ordered_json viewpoints = report.value("viewpoints", ordered_json::array());
  const ordered_json place =
      viewpoints.is_array() && !viewpoints.empty() ? viewpoints[0] : ordered_json::object();
  for (const char* key : {"eye_mm", "covered", "rms_lenses", "max_lenses", "residual_lenses"})
    result[key] = place.value(key, ordered_json());
  result["photographs"] = viewpoints.size();
  return result;
}

size_t PhotoSession::place_of(std::string_view name) {
  for (size_t k = 0; k < kPhotoPlaces.size(); ++k)
    if (kPhotoPlaces[k].name == name) return k;
  throw HttpError(400, "place: expected middle, left, right or right-again");
}

std::string PhotoSession::refusal(const ordered_json& report, size_t place) {
  std::string others;
  for (const ordered_json& photo : list_in(member(report, "photographs"))) {
    const auto at = place_of_file(text_in(member(photo, "name")));
    if (!at || member(photo, "used") == true) continue;
    const std::string reason = text_in(member(photo, "reason"));
    if (*at == place) return reason;
    others = fmt::format("this photograph and the one {} contradict each other: {}",
                         kPhotoPlaces[*at].words, reason);
  }
  if (!others.empty()) return others;
  if (!list_in(member(report, "viewpoints")).empty()) return {};
  const ordered_json reasons = list_in(member(report, "reasons"));
  return reasons.empty() ? "the photographs could not be fitted" : text_in(reasons[0]);
}

std::string PhotoSession::remedy(std::string_view reason) {
  for (const Remedy& one : kRemedies)
    if (reason.find(one.reason) != std::string_view::npos) return std::string(one.words);
  return std::string(kUsualRemedy);
}

void PhotoSession::accept(size_t place) {
  entries_[place] = {.used = true};
}

void PhotoSession::refuse(size_t place, std::string reason) {
  entries_[place].refusal = std::move(reason);
}

void PhotoSession::remove(size_t place) {
  entries_[place] = {};
  if (count() < 2) {
    stated_lenses_.reset();
    reasons_ = ordered_json::array();
  }
}

size_t PhotoSession::count() const {
  return static_cast<size_t>(
      std::count_if(entries_.begin(), entries_.end(), [](const Entry& one) { return one.used; }));
}

void PhotoSession::take_photograph(const ordered_json& photo) {
  const auto place = place_of_file(text_in(member(photo, "name")));
  if (!place) return;
  Entry& entry = entries_[*place];
  entry.roll_degrees = number_in(member(photo, "roll_degrees"));
  const ordered_json& eye = member(photo, "eye_mm");
  if (!eye.is_array() || eye.size() != 3) return;
  entry.x_mm = number_in(eye[0]);
  entry.z_mm = number_in(eye[2]);
}

void PhotoSession::take_report(const ordered_json& report) {
  stated_lenses_ = number_in(member(member(report, "drift"), "worst_lenses"));
  reasons_ = list_in(member(report, "reasons"));
  for (const ordered_json& photo : list_in(member(report, "photographs"))) take_photograph(photo);
  for (size_t k = 0; k < entries_.size(); ++k) entries_[k].note = note_of(k);
}

/// Returns how the photograph differs from what was asked for; empty if it does not.
std::string PhotoSession::note_of(size_t place) const {
  const Entry& entry = entries_[place];
  const PhotoPlace& asked = kPhotoPlaces[place];
  if (!entry.used) return {};
  if (entry.x_mm && entry.z_mm && side_of(*entry.x_mm, *entry.z_mm) != asked.side) {
    constexpr std::array<std::string_view, 3> kSides = {"the left", "the middle", "the right"};
    const auto seen = kSides[static_cast<size_t>(side_of(*entry.x_mm, *entry.z_mm) + 1)];
    if (asked.side == 0) return fmt::format("it was taken from {}", seen);
    return fmt::format("it was taken from {}: go at least {:.0f} mm to the {}", seen,
                       2.0 * kAside * *entry.z_mm, asked.side < 0 ? "left" : "right");
  }
  const Entry& first = entries_[kMiddle];
  if (place == kMiddle || !first.used || !first.roll_degrees || !entry.roll_degrees) return {};
  constexpr double kAlike = 0.5;  // sixty degrees
  const double alike =
      std::cos((*entry.roll_degrees - *first.roll_degrees) * std::numbers::pi / 180.0);
  const bool wants_alike = asked.upside_down == kPhotoPlaces[kMiddle].upside_down;
  if (wants_alike && alike < kAlike) return "the phone was not upside down, as in the first one";
  if (!wants_alike && alike > -kAlike)
    return "in the file the panel is the same way up as in the first one: turn the phone by half a "
           "turn between them";
  return {};
}

std::optional<size_t> PhotoSession::next() const {
  constexpr size_t kEnough = 4;  // three do not show whether sheet or phone moved between them
  if (stated_lenses_ && *stated_lenses_ <= kWantedLenses && count() >= kEnough) return std::nullopt;
  for (size_t k = 0; k < entries_.size(); ++k)
    if (!entries_[k].used) return k;
  for (size_t k = 0; k < entries_.size(); ++k)
    if (!entries_[k].note.empty()) return k;
  return std::nullopt;
}

ordered_json PhotoSession::to_json() const {
  ordered_json photographs = ordered_json::array();
  for (size_t k = 0; k < entries_.size(); ++k) {
    const Entry& one = entries_[k];
    photographs.push_back({{"place", kPhotoPlaces[k].name},
                           {"words", kPhotoPlaces[k].words},
                           {"side", kPhotoPlaces[k].side},
                           {"upside_down", kPhotoPlaces[k].upside_down},
                           {"used", one.used},
                           {"refusal", one.refusal},
                           {"remedy", one.refusal.empty() ? "" : remedy(one.refusal)},
                           {"note", one.note}});
  }
  const auto place = next();
  return {{"photographs", photographs},
          {"fit",
           {{"photographs", count()},
            {"stated_lenses", stated_lenses_ ? ordered_json(*stated_lenses_) : ordered_json()},
            {"wanted_lenses", kWantedLenses},
            {"usable_lenses", kUsableLenses},
            {"reasons", reasons_}}},
          {"next", place ? ordered_json(kPhotoPlaces[*place].name) : ordered_json()}};
}

}  // namespace lenticule::web
