// SPDX-License-Identifier: Apache-2.0
// HandHeldPhotos collects photographs of the photo chart that were taken by hand, and calibrates
// from them.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "calib/phone/phone_calibration.h"
#include "calib/photo/photo_folder.h"

namespace lenticule::tools {

/// PhotoReader reads a photograph with its pixels in the order of the file: the axis of the camera
/// is then at one place in all photographs of a phone.
using PhotoReader = std::function<calib::CameraPicture(const std::filesystem::path&)>;

/// Thread safety: one thread.
class HandHeldPhotos {
 public:
  /// `focal_px` is the camera's focal length in pixels; without it, the photographs' EXIF data are
  /// used. Throws Error(Input) for a rig whose panel is too small for the chart.
  explicit HandHeldPhotos(const optics::Rig& rig, std::optional<double> focal_px = {},
                          PhotoReader read = calib::read_photograph);

  [[nodiscard]] const calib::SinglePhotoChart& chart() const { return chart_; }

  /// Measures a photograph. Returns the reason why it cannot be used, or an empty text. Throws
  /// Error(Input) for a file that is not a readable picture.
  std::string add(const std::filesystem::path& file);
  /// Measures photographs, two at once, and adds them in their order. Calls `goes_on` with the
  /// number of photographs added; stops when it returns false. Throws as add() does.
  void add_all(const std::vector<std::filesystem::path>& files,
               const std::function<bool(size_t)>& goes_on);

  /// Returns the files so far, usable or not.
  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }
  [[nodiscard]] size_t usable() const;
  /// Returns the rig from which to plan the chart again if the last photograph shows that the start
  /// is too far off; see calib::better_start().
  [[nodiscard]] std::optional<optics::Rig> better_start() const;
  /// Calibrates from all photographs so far; see calib::calibrate_phone() for `most_lenses`.
  [[nodiscard]] calib::Calibration calibrate(double most_lenses = 0.0) const;
  /// Returns for each photograph whether it was used or the reason why not, the place of the camera
  /// and how it was held: the angle by which the rows of the picture are turned on the panel.
  [[nodiscard]] nlohmann::json to_json(const calib::Calibration& found) const;
  [[nodiscard]] calib::RecordDetails details() const;

 private:
  struct Measured {
    calib::PhonePhoto photo;
    calib::Estimate focal;
    int width, height;  ///< size of the picture, pixels
  };
  [[nodiscard]] Measured measure(const std::filesystem::path& file) const;
  std::string keep(const std::filesystem::path& file, Measured measured);

  calib::SinglePhotoChart chart_;
  std::optional<double> given_focal_px_;
  PhotoReader read_;
  calib::Estimate focal_px_;
  std::vector<calib::PhonePhoto> photos_;
  std::vector<std::filesystem::path> files_;
  calib::CameraFacts camera_;
};

}  // namespace lenticule::tools
