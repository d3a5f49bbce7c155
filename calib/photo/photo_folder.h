// SPDX-License-Identifier: Apache-2.0
// PhotoFolder is a Camera that delivers a user's photographs of the panel, in the order of their
// names.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/text.h"
#include "calib/camera.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "optics/rig.h"

namespace lenticule::calib {

inline constexpr size_t kMaxPhotographs = 10'000;

/// Returns true for a picture file that is not hidden, also for HEIC, which phones store by
/// default.
inline bool is_photograph(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 8> kExtensions = {".jpg", ".jpeg", ".png",  ".tif",
                                                           ".exr", ".tiff", ".heic", ".heif"};
  const std::string extension = lower_case(file.extension().string());
  std::error_code unreadable;  // an unreadable entry counts as not a regular file
  return file.filename().string()[0] != '.' &&
         std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end() &&
         std::filesystem::is_regular_file(file, unreadable);
}

[[noreturn]] inline void reject(const std::filesystem::path& folder, const std::string& cause,
                                const std::string& remedy = {}) {
  throw Error(ErrorKind::Input, folder.string() + ": " + cause, remedy);
}

inline std::vector<std::filesystem::path> photographs_in(const std::filesystem::path& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> files = entries_of(folder, &error);
  if (error) reject(folder, "cannot read the folder: " + error.message());
  std::erase_if(files, std::not_fn(is_photograph));
  if (files.size() > kMaxPhotographs)
    reject(folder, fmt::format("more than {} photographs", kMaxPhotographs));
  return files;
}

/// Reads one photograph. Throws Error(Input) if it cannot be read.
[[nodiscard]] inline CameraPicture read_photograph(const std::filesystem::path& file) {
  const frames::TextureImage image = frames::read_texture(file);
  CameraPicture picture;
  picture.width = image.width;
  picture.height = image.height;
  picture.channels = 3;
  const size_t pixels = static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
  picture.light.resize(3 * pixels);
  std::array<float, 256> light_of{};
  std::ranges::transform(frames::linear_of_codes(), light_of.begin(),
                         [](double light) { return static_cast<float>(light); });
  for (size_t n = 0; n < pixels; ++n)
    for (size_t channel = 0; channel < 3; ++channel) {
      const size_t from = 4 * n + channel;
      picture.light[3 * n + channel] =
          image.codes.empty() ? image.rgba[from] : light_of[image.codes[from]];
    }
  return picture;
}

/// PhotoFolder reads the PNG, JPEG, TIFF, EXR and HEIC files of a folder, except files whose name
/// begins with a dot. Integer files are assumed to be sRGB. Pictures have three channels and keep
/// the camera's orientation: the orientation tag is ignored.
class PhotoFolder final : public Camera {
 public:
  /// Throws Error(Input) if the folder cannot be read, more than `may_lack` of the `wanted`
  /// photographs are missing, one is unreadable, or two have different sizes.
  explicit PhotoFolder(const std::filesystem::path& folder, size_t wanted = 1, size_t may_lack = 0)
      : files_(photographs_in(folder)) {
    if (files_.empty() || files_.size() + may_lack < wanted)
      reject(folder, fmt::format("{} photographs, but {} are needed", files_.size(), wanted),
             "take one of each pattern, in their order, as .png, .jpg, .tif or .exr");
    for (const std::filesystem::path& file : files_) {
      const frames::FrameGeometry size = frames::probe_image(file);
      if (facts_.width == 0) {
        facts_.width = size.width;
        facts_.height = size.height;
      }
      if (size.width != facts_.width || size.height != facts_.height)
        reject(file,
               fmt::format("{} x {} pixels where the first photograph has {} x {}", size.width,
                           size.height, facts_.width, facts_.height),
               "take all photographs with one camera from one place, and rotate none");
    }
    facts_.name = folder.filename().empty() ? folder.parent_path().filename().string()
                                            : folder.filename().string();
    facts_.channels = 3;
    facts_.frames_per_second = 1.0;
    facts_.pixel_format = "photographs";
    facts_.unlocked = {"it cannot be checked whether exposure, focus and colour stayed constant"};
  }

  [[nodiscard]] const CameraFacts& facts() const override { return facts_; }
  /// Returns the next photograph at once. Returns Gone after the last one, and for a file that
  /// changed since the folder was opened.
  [[nodiscard]] GrabStatus grab(CameraPicture& out, Nanoseconds /*timeout*/,
                                Nanoseconds /*not_before*/ = Nanoseconds::min()) override {
    if (!failure_.empty()) return GrabStatus::Gone;
    if (next_ == files_.size()) {
      failure_ = fmt::format("{}: there are only {} photographs", facts_.name, files_.size());
      return GrabStatus::Gone;
    }
    try {
      CameraPicture picture = read_photograph(files_[next_]);
      if (picture.width != facts_.width || picture.height != facts_.height)
        throw Error(ErrorKind::Input, files_[next_].string() + ": its size has changed");
      picture.sequence = next_;
      picture.time = now();
      out = std::move(picture);
    } catch (const Error& error) {
      failure_ = error.what();
      return GrabStatus::Gone;
    }
    ++next_;
    return GrabStatus::Ready;
  }
  /// Returns the time of the next photograph. The photographs have a simulated clock: the first is
  /// taken at 0 s, the next at 1 s.
  [[nodiscard]] Nanoseconds now() const override { return std::chrono::seconds(next_); }
  [[nodiscard]] std::vector<std::string> drifted_controls() override { return {}; }
  [[nodiscard]] std::string failure() const override { return failure_; }

  [[nodiscard]] const std::vector<std::filesystem::path>& files() const { return files_; }

 private:
  CameraFacts facts_;
  std::vector<std::filesystem::path> files_;
  size_t next_ = 0;
  std::string failure_;
};

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

inline constexpr const char* kManifestFormat = "lenticule-patterns";
inline constexpr int kManifestVersion = 1;
inline constexpr size_t kMostManifestBytes = 64 * 1024;

[[nodiscard]] inline PatternManifest manifest_of(const optics::Rig& rig, size_t patterns) {
  return {.rig_name = rig.name,
          .fingerprint = optics::fingerprint(rig),
          .pitch_subpx = rig.sheet.pitch.value,
          .slant = rig.sheet.slant,
          .patterns = static_cast<int>(patterns)};
}

/// Writes the manifest into the folder, which must exist. Throws Error(Failed).
inline void write_manifest(const PatternManifest& manifest, const std::filesystem::path& folder) {
  const nlohmann::json out = {{"format", kManifestFormat},
                              {"version", kManifestVersion},
                              {"patterns", manifest.patterns},
                              {"rig",
                               {{"name", manifest.rig_name},
                                {"fingerprint", manifest.fingerprint},
                                {"pitch_subpx", manifest.pitch_subpx},
                                {"slant", manifest.slant}}}};
  write_text_file(folder / kPatternManifest, out.dump(2) + "\n");
}

/// Reads a folder's manifest; returns nothing if there is none. Throws Error(Input) for an invalid
/// manifest.
[[nodiscard]] inline std::optional<PatternManifest> read_manifest(
    const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kPatternManifest;
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return std::nullopt;
  const std::string text = read_text_file(file, kMostManifestBytes);
  try {
    const nlohmann::json in = nlohmann::json::parse(text);
    if (in.at("format") != kManifestFormat || in.at("version") != kManifestVersion)
      throw Error(ErrorKind::Input, file.string() + ": not a manifest of patterns");
    const nlohmann::json& rig = in.at("rig");
    return PatternManifest{.rig_name = rig.at("name"),
                           .fingerprint = rig.at("fingerprint"),
                           .pitch_subpx = rig.at("pitch_subpx"),
                           .slant = rig.at("slant"),
                           .patterns = in.at("patterns")};
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorKind::Input, file.string() + ": not a manifest of patterns",
                "write the patterns again with --write-patterns, which writes it");
  }
}

/// Throws Error(Input) that names both rigs unless the manifest belongs to the rig.
inline void check_manifest(const PatternManifest& manifest, const optics::Rig& rig,
                           const std::filesystem::path& folder) {
  const PatternManifest wanted = manifest_of(rig, 0);
  if (manifest.fingerprint == wanted.fingerprint) return;
  throw input_error(
      "{}: these patterns were written for the rig \"{}\" (fingerprint {}, "
      "pitch {:.5f}, slant {:.5f}), not for \"{}\" ({}, pitch {:.5f}, slant "
      "{:.5f})",
      (folder / kPatternManifest).string(), manifest.rig_name, manifest.fingerprint,
      manifest.pitch_subpx, manifest.slant, rig.name, wanted.fingerprint, wanted.pitch_subpx,
      wanted.slant)
      .remedy(
          "use the rig that the patterns were written for as --rig, or write patterns for this "
          "one and photograph them");
}

}  // namespace lenticule::calib
