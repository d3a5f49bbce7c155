// SPDX-License-Identifier: Apache-2.0
// Photographs that somebody took of the panel, as a camera: one after the other in the order of
// their names.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

/// Whether `a` stands before `b` as people number files: IMG_9 before IMG_10. Letters' case counts
/// only between names that are otherwise equal.
[[nodiscard]] bool stands_before(std::string_view a, std::string_view b);

/// The PNG, JPEG, TIFF and EXR files of a folder; names with a dot in front are nobody's
/// photographs. Integer files are taken for sRGB. Pictures are three channels, and as the camera
/// saved them: a note in the file that it is to be shown turned does not turn it.
class PhotoFolder final : public Camera {
 public:
  /// Throws Error(Input) if the folder cannot be read, holds fewer than `wanted` photographs, one
  /// that cannot be read, or two of different sizes.
  explicit PhotoFolder(const std::filesystem::path& folder, size_t wanted = 1);

  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  /// Never waits: the next photograph at once. Gone after the last, and for one that changed since
  /// the folder was opened.
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before = Nanoseconds::min()) override;
  /// Photographs know no clock here: the first is taken at 0 s, the next at 1 s, and now is when
  /// the next one is taken.
  [[nodiscard]] Nanoseconds now() const override;
  [[nodiscard]] std::vector<std::string> drifted_controls() override { return {}; }
  [[nodiscard]] std::string failure() const override { return failure_; }

  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  CameraFacts facts_;
  std::vector<std::filesystem::path> files_;
  size_t next_ = 0;
  std::string failure_;
};

/// One photograph; throws Error(Input) if it cannot be read.
[[nodiscard]] CameraPicture read_photograph(const std::filesystem::path& file);

}  // namespace lenticule::calib
