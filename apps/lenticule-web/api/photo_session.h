// SPDX-License-Identifier: Apache-2.0
// PhotoSession keeps which photographs of a calibration are used, why others are not, the error
// that their fit states, and the place of the next photograph. It holds no files. The reports of
// the fits come from `lenticule calibrate photos`.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "apps/lenticule-web/http/message.h"
#include "base/text.h"

namespace lenticule::web {

/// CalibrationOutput is what `lenticule calibrate photos --json` printed.
struct CalibrationOutput {
  nlohmann::ordered_json report;  ///< null if it printed no report
  std::string message;            ///< printable lines on standard error
};
[[nodiscard]] inline CalibrationOutput parse_calibration_output(const std::string& output) {
  constexpr size_t kMaxLine = 400, kMaxMessage = 2000;
  CalibrationOutput parsed;
  size_t begin = output.starts_with("{\n") ? 0 : output.find("\n{\n");
  if (begin != std::string::npos)
    parsed.report = nlohmann::ordered_json::parse(output.substr(begin), nullptr, false);
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
/// Returns the first reason of a report; empty if it has none.
[[nodiscard]] inline std::string first_reason(const nlohmann::ordered_json& report) {
  const nlohmann::ordered_json reasons = list_in(member(report, "reasons"));
  return !reasons.empty() && reasons[0].is_string() ? reasons[0].get<std::string>() : "";
}
/// Returns the part of a report that the page shows.
[[nodiscard]] inline nlohmann::ordered_json shown_part(const nlohmann::ordered_json& report) {
  using nlohmann::ordered_json;
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

/// PhotoPlace is a place from which a photograph is asked for.
struct PhotoPlace {
  std::string_view name;   ///< part of addresses and of file names
  std::string_view words;  ///< "from the upper left"
  int side = 0;            ///< -1: left of the middle, 1: right
  bool upside_down = false;
};

/// The first photograph is upside down and those from the sides are not, so that the axis of the
/// phone's camera, which is off the middle of its pictures, cancels; from above the panel shows
/// shifts of that axis (docs/panel/calibration-method.md).
inline constexpr std::array<PhotoPlace, 6> kPhotoPlaces = {
    {{"middle", "from the middle", 0, true},
     {"left", "from the upper left", -1, false},
     {"right", "from the upper right", 1, false},
     {"right-again", "from the upper right again", 1, true},
     {"left-again", "from the upper left again", -1, true},
     {"middle-again", "from the middle again", 0, false}}};
/// So many are enough if they agree; three do not show whether sheet or phone moved between them.
inline constexpr size_t kEnoughPhotos = 4;

/// Thread safety: one thread at a time. Places are indices of kPhotoPlaces.
class PhotoSession {
 public:
  static constexpr double kWantedLenses = 0.02;
  /// A rig that is right to a twentieth of a lens for every eye is better than one that is right
  /// for the place of the first photograph only.
  static constexpr double kUsableLenses = 0.05;

  /// Returns the place of a name. Throws HttpError 400.
  [[nodiscard]] static size_t place_of(std::string_view name) {
    for (size_t k = 0; k < kPhotoPlaces.size(); ++k)
      if (kPhotoPlaces[k].name == name) return k;
    throw HttpError(400, "place: expected middle, left or right, perhaps with -again");
  }
  /// Returns why the photograph of a place cannot be measured; empty if it can. One that only
  /// contradicts the others is kept: with one more, the fit tells which of them is wrong.
  /// `report` is what `lenticule calibrate photos --json` printed.
  [[nodiscard]] static std::string refusal(const nlohmann::ordered_json& report, size_t place) {
    for (const ordered_json& photo : list_in(member(report, "photographs")))
      if (place_of_file(text_in(photo, "name")) == place && member(photo, "used") != true &&
          member(photo, "set_aside") != true)
        return text_in(photo, "reason");
    return {};
  }
  /// Returns what to do better after a refusal.
  [[nodiscard]] static std::string remedy(std::string_view reason) {
    for (const Remedy& one : kRemedies)
      if (reason.find(one.reason) != std::string_view::npos) return std::string(one.words);
    return std::string(kUsualRemedy);
  }

  void accept(size_t place) { entries_[place] = {.present = true}; }
  /// A photograph from this place that was accepted before stays.
  void refuse(size_t place, std::string reason) { entries_[place].refusal = std::move(reason); }
  void remove(size_t place) {
    entries_[place] = {};
    if (count() >= 2) return;
    stated_lenses_ = ordered_json::array();
    reasons_ = ordered_json::array();
  }
  /// Takes places, turns and the stated error from the report of a fit of all accepted photographs.
  /// Photographs that contradict each other state no error.
  void take_report(const nlohmann::ordered_json& report) {
    reasons_ = list_in(member(report, "reasons"));
    for (const ordered_json& photo : list_in(member(report, "photographs"))) take_photograph(photo);
    for (size_t k = 0; k < entries_.size(); ++k) entries_[k].note = note_of(k);
    agree_ = count() >= 2 && !list_in(member(report, "viewpoints")).empty() &&
             (member(report, "verdict") != "refused" ||
              std::ranges::all_of(entries_, [](const Entry& one) { return one.doubt.empty(); }));
    const auto stated = number_of(member(member(report, "drift"), "worst_lenses"));
    if (agree_ && stated) stated_lenses_.push_back(*stated);
    if (stated_lenses_.size() > kMostFits) stated_lenses_.erase(0);
  }

  [[nodiscard]] bool used(size_t place) const {
    return entries_[place].present && entries_[place].aside.empty();
  }
  [[nodiscard]] size_t count() const {
    size_t count = 0;
    for (size_t k = 0; k < entries_.size(); ++k) count += used(k) ? 1 : 0;
    return count;
  }
  /// Returns the place of the photograph that would help most; none if no more is needed.
  [[nodiscard]] std::optional<size_t> next() const {
    const auto stated = stated_lenses();
    if (stated.is_number() && stated <= kWantedLenses && count() >= kEnoughPhotos)
      return std::nullopt;
    for (size_t k = 0; k < entries_.size(); ++k)
      if (!entries_[k].present) return k;
    for (size_t k = 0; k < entries_.size(); ++k)
      if (!entries_[k].note.empty()) return k;
    return std::nullopt;
  }
  /// Returns {"photographs", "fit", "next"}.
  [[nodiscard]] nlohmann::ordered_json to_json() const {
    ordered_json photographs = ordered_json::array();
    for (size_t k = 0; k < entries_.size(); ++k) {
      const Entry& one = entries_[k];
      photographs.push_back({{"place", kPhotoPlaces[k].name},
                             {"words", kPhotoPlaces[k].words},
                             {"side", kPhotoPlaces[k].side},
                             {"upside_down", kPhotoPlaces[k].upside_down},
                             {"used", used(k)},
                             {"refusal", one.refusal},
                             {"remedy", one.refusal.empty() ? "" : remedy(one.refusal)},
                             {"note", one.note}});
    }
    const auto place = next();
    return {{"photographs", photographs},
            {"fit",
             {{"photographs", count()},
              {"stated_lenses", stated_lenses()},
              {"progress_lenses", stated_lenses_},
              {"wanted_lenses", kWantedLenses},
              {"usable_lenses", kUsableLenses},
              {"reasons", reasons_}}},
            {"next", place ? ordered_json(kPhotoPlaces[*place].name) : ordered_json()}};
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  static constexpr size_t kMiddle = 0;
  /// Least tangent of the angle between the normal of the panel and a place at the side.
  static constexpr double kAside = 0.25;
  static constexpr size_t kMostFits = 20;

  /// Returns the error that the newest fit states; null if it states none.
  [[nodiscard]] ordered_json stated_lenses() const {
    return agree_ && !stated_lenses_.empty() ? stated_lenses_.back() : ordered_json();
  }

  struct Remedy {
    std::string_view reason;  ///< part of it
    std::string_view words;
  };

  static constexpr std::array<Remedy, 13> kRemedies = {
      {{"tags were found", "Get the whole panel with all tags into the picture, and sharp."},
       {"tags deviate",
        "Use the main camera of the phone, and get the whole panel with all tags into the "
        "picture."},
       {"another rig",
        "Press \"Begin again\", and photograph the chart that is then on the panel."},
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
  static constexpr std::string_view kUsualRemedy =
      "Take it again: the whole panel in the picture, a dark room, no flash, no zoom.";

  /// Returns the index of the photograph of a file "NAME.jpg".
  static std::optional<size_t> place_of_file(std::string_view file) {
    for (size_t k = 0; k < kPhotoPlaces.size(); ++k)
      if (file.substr(0, file.rfind('.')) == kPhotoPlaces[k].name) return k;
    return std::nullopt;
  }

  static int side_of(double x_mm, double z_mm) {
    return x_mm < -kAside * z_mm ? -1 : x_mm > kAside * z_mm ? 1 : 0;
  }
  struct Entry {
    bool present = false;   ///< a photograph from here is kept
    std::string refusal{};  ///< reason why the newest photograph is not kept
    std::string aside{};    ///< reason why the fit does not use the one that is kept
    std::string note{};
    std::string doubt{};                   ///< contradiction to the other photographs
    std::optional<double> x_mm{}, z_mm{};  ///< place of the camera
    std::optional<double> roll_degrees{};  ///< turn of the picture's rows on the panel
  };
  void take_photograph(const nlohmann::ordered_json& photo) {
    const auto place = place_of_file(text_in(photo, "name"));
    if (!place) return;
    Entry& entry = entries_[*place];
    entry.aside = member(photo, "used") == true ? "" : text_in(photo, "reason");
    entry.doubt = text_in(photo, "doubt");
    entry.roll_degrees = number_of(member(photo, "roll_degrees"));
    const ordered_json& eye = member(photo, "eye_mm");
    if (!eye.is_array() || eye.size() != 3) return;
    entry.x_mm = number_of(eye[0]);
    entry.z_mm = number_of(eye[2]);
  }
  /// Returns how the photograph differs from what was asked for; empty if it does not.
  [[nodiscard]] std::string note_of(size_t place) const {
    const Entry& entry = entries_[place];
    const PhotoPlace& asked = kPhotoPlaces[place];
    if (!entry.present) return {};
    if (!entry.aside.empty()) return "set aside: " + entry.aside;
    if (!entry.doubt.empty()) return "the others contradict it: " + entry.doubt;
    if (entry.x_mm && entry.z_mm && side_of(*entry.x_mm, *entry.z_mm) != asked.side) {
      constexpr std::array<std::string_view, 3> kSides = {"the left", "the middle", "the right"};
      const auto seen = kSides[static_cast<size_t>(side_of(*entry.x_mm, *entry.z_mm) + 1)];
      if (asked.side == 0) return fmt::format("it was taken from {}", seen);
      return fmt::format("it was taken from {}: go at least {:.0f} mm to the {}", seen,
                         2.0 * kAside * *entry.z_mm, asked.side < 0 ? "left" : "right");
    }
    const Entry& first = entries_[kMiddle];
    if (place == kMiddle || !used(kMiddle) || !first.roll_degrees || !entry.roll_degrees) return {};
    constexpr double kAlike = 0.5;  // sixty degrees
    const double alike =
        std::cos((*entry.roll_degrees - *first.roll_degrees) * std::numbers::pi / 180.0);
    const bool wants_alike = asked.upside_down == kPhotoPlaces[kMiddle].upside_down;
    if (wants_alike && alike < kAlike) return "the phone was not upside down, as in the first one";
    if (!wants_alike && alike > -kAlike)
      return "in the file the panel is the same way up as in the first one: turn the phone by half "
             "a "
             "turn between them";
    return {};
  }

  std::array<Entry, kPhotoPlaces.size()> entries_;
  ordered_json stated_lenses_ = ordered_json::array();  ///< what each fit states, the newest last
  bool agree_ = false;
  nlohmann::ordered_json reasons_ = nlohmann::ordered_json::array();
};

}  // namespace lenticule::web
