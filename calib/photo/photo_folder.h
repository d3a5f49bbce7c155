// SPDX-License-Identifier: Apache-2.0
// PhotoFolder is a Camera that delivers a user's photographs of the panel, in the order of their
// names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "optics/rig.h"

namespace lenticule::calib {

/// PhotoFolder reads the PNG, JPEG, TIFF and EXR files of a folder, except files whose name begins
/// with a dot. Integer files are assumed to be sRGB. Pictures have three channels and keep the
/// camera's orientation: the orientation tag is ignored.
class PhotoFolder final : public Camera {
 public:
  /// Throws Error(Input) if the folder cannot be read, more than `may_lack` of the `wanted`
  /// photographs are missing, one is unreadable, or two have different sizes.
  explicit PhotoFolder(const std::filesystem::path& folder, size_t wanted = 1, size_t may_lack = 0);

  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  /// Returns the next photograph at once. Returns Gone after the last one, and for a file that
  /// changed since the folder was opened.
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds timeout,
                                Nanoseconds not_before = Nanoseconds::min()) override;
  /// Returns the time of the next photograph. The photographs have a simulated clock: the first is
  /// taken at 0 s, the next at 1 s.
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

/// Reads one photograph. Throws Error(Input) if it cannot be read.
[[nodiscard]] CameraPicture read_photograph(const std::filesystem::path& file);

/// Name of the manifest in the patterns' own folder, or copied beside their photographs.
inline constexpr const char* kPatternManifest = "patterns.json";

/// PatternManifest is a file beside written patterns that records their rig.
struct PatternManifest {
  std::string rig_name;
  std::string fingerprint;
  double pitch_subpx = 0.0;
  double slant = 0.0;
  int patterns = 0;
};

[[nodiscard]] PatternManifest manifest_of(const optics::Rig& rig, size_t patterns);

/// Writes the manifest into the folder, which must exist. Throws Error(Failed).
void write_manifest(const PatternManifest& manifest, const std::filesystem::path& folder);

/// Reads a folder's manifest; returns nothing if there is none. Throws Error(Input) for an invalid
/// manifest.
[[nodiscard]] std::optional<PatternManifest> read_manifest(const std::filesystem::path& folder);

/// Throws Error(Input) that names both rigs unless the manifest belongs to the rig.
void check_manifest(const PatternManifest& manifest, const optics::Rig& rig,
                    const std::filesystem::path& folder);

}  // namespace lenticule::calib
