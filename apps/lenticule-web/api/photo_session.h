// SPDX-License-Identifier: Apache-2.0
// PhotoSession keeps which photographs of a calibration are used, why others are not, the error
// that their fit states, and the place of the next photograph. It holds no files. The reports of
// the fits come from `lenticule calibrate photos`.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace lenticule::web {

/// CalibrationOutput is what `lenticule calibrate photos --json` printed.
struct CalibrationOutput {
  nlohmann::ordered_json report;  ///< null if it printed no report
  std::string message;            ///< printable lines on standard error
};
[[nodiscard]] CalibrationOutput parse_calibration_output(const std::string& output);
/// Returns the part of a report that the page shows.
[[nodiscard]] nlohmann::ordered_json shown_part(const nlohmann::ordered_json& report);

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
inline constexpr std::array<PhotoPlace, 4> kPhotoPlaces = {
    {{.name = "middle", .words = "from the middle", .side = 0, .upside_down = true},
     {.name = "left", .words = "from the upper left", .side = -1, .upside_down = false},
     {.name = "right", .words = "from the upper right", .side = 1, .upside_down = false},
     {.name = "right-again",
      .words = "from the upper right again",
      .side = 1,
      .upside_down = true}}};

/// Thread safety: one thread at a time. Places are indices of kPhotoPlaces.
class PhotoSession {
 public:
  static constexpr double kWantedLenses = 0.02;
  /// A rig that is right to a twentieth of a lens for every eye is better than one that is right
  /// for the place of the first photograph only.
  static constexpr double kUsableLenses = 0.05;

  /// Returns the place of a name. Throws HttpError 400.
  [[nodiscard]] static size_t place_of(std::string_view name);
  /// Returns why the fit of several photographs does not use that of a place; empty if it does.
  /// `report` is what `lenticule calibrate photos --json` printed.
  [[nodiscard]] static std::string refusal(const nlohmann::ordered_json& report, size_t place);
  /// Returns what to do better after a refusal.
  [[nodiscard]] static std::string remedy(std::string_view reason);

  void accept(size_t place);
  /// A photograph from this place that was accepted before stays.
  void refuse(size_t place, std::string reason);
  void remove(size_t place);
  /// Takes places, turns and the stated error from the report of a fit of all accepted photographs.
  void take_report(const nlohmann::ordered_json& report);

  [[nodiscard]] bool used(size_t place) const { return entries_[place].used; }
  [[nodiscard]] size_t count() const;
  /// Returns the place of the photograph that would help most; none if no more is needed.
  [[nodiscard]] std::optional<size_t> next() const;
  /// Returns {"photographs", "fit", "next"}.
  [[nodiscard]] nlohmann::ordered_json to_json() const;

 private:
  struct Entry {
    bool used = false;
    std::string refusal{};  ///< reason why the newest photograph is not used
    std::string note{};
    std::optional<double> x_mm{}, z_mm{};  ///< place of the camera
    std::optional<double> roll_degrees{};  ///< turn of the picture's rows on the panel
  };
  void take_photograph(const nlohmann::ordered_json& photo);
  [[nodiscard]] std::string note_of(size_t place) const;

  std::array<Entry, kPhotoPlaces.size()> entries_;
  std::optional<double> stated_lenses_;
  nlohmann::ordered_json reasons_ = nlohmann::ordered_json::array();
};

}  // namespace lenticule::web
