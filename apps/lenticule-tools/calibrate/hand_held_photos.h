// SPDX-License-Identifier: Apache-2.0
// HandHeldPhotos collects photographs of the photo chart that were taken by hand, and calibrates
// from them; PhotoArrivals finds them in a folder, and a pack keeps them for a report of a fault.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#include "apps/lenticule/cli/command.h"
#include "calib/phone/phone_calibration.h"
#include "calib/photo/photo_folder.h"
#include "optics/rig.h"

namespace lenticule::tools {

/// Thread safety: one thread.
class HandHeldPhotos {
 public:
  /// `focal_px` is the camera's focal length in pixels; without it, the photographs' EXIF data are
  /// used. Throws Error(Input) for a rig whose panel is too small for the chart.
  explicit HandHeldPhotos(const optics::Rig& rig, std::optional<double> focal_px = {});

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
  calib::Estimate focal_px_;
  std::vector<calib::PhonePhoto> photos_;
  std::vector<std::filesystem::path> files_;
  calib::CameraFacts camera_;
};

// PhotoArrivals finds photographs that arrive in a folder.

/// PhotoArrivals reports each photograph once, after its file has stopped growing. Hidden files,
/// which transfers use as temporary names, do not count.
///
/// Thread safety: one thread.
class PhotoArrivals {
 public:
  /// With `existing`, photographs that are in the folder already count as arriving. Throws
  /// Error(Input) if the folder cannot be read.
  explicit PhotoArrivals(std::filesystem::path folder, bool existing = false);

  /// Returns the photographs whose size has not changed since the previous call, in the order of
  /// their names. Throws Error(Input) if the folder cannot be read.
  [[nodiscard]] std::vector<std::filesystem::path> arrived();

 private:
  [[nodiscard]] std::map<std::filesystem::path, uintmax_t> sizes() const;

  std::filesystem::path folder_;
  std::set<std::filesystem::path> known_;
  std::map<std::filesystem::path, uintmax_t> growing_;
};

// write_photo_pack packs photographs of a calibration so that others can repeat it.

/// PhotoPack is what the archive holds. The report becomes report.json.
struct PhotoPack {
  std::vector<std::filesystem::path> sources;  ///< photographs, or folders of photographs
  optics::Rig start;                           ///< becomes start.toml
  std::optional<double> focal_px;
  std::vector<double> distances_mm;  ///< distances of the first sources from the panel
  nlohmann::json report;
};

void declare_pack_flag(CLI::App& app, std::string& archive);

/// Writes a tar archive with one folder, `calibration`, whose README.txt has the command that
/// repeats the calibration. Sources keep their order by numbers before their names. The archive is
/// replaced when it is complete. Throws Error(Failed) if a file cannot be read or written, or if
/// the program tar is missing.
void write_photo_pack(const PhotoPack& pack, const std::filesystem::path& archive);
}  // namespace lenticule::tools
