// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/pattern_manifest.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <system_error>

#include "base/error.h"
#include "base/file.h"

namespace lenticule::calib {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kFormat = "lenticule-patterns";
constexpr int kVersion = 1;
constexpr size_t kMostBytes = 64 * 1024;

}  // namespace

PatternManifest manifest_of(const optics::Rig& rig, size_t patterns) {
  return {.rig_name = rig.name,
          .fingerprint = optics::fingerprint(rig),
          .pitch_subpx = rig.sheet.pitch.value,
          .slant = rig.sheet.slant,
          .patterns = static_cast<int>(patterns)};
}

void write_manifest(const PatternManifest& manifest, const fs::path& folder) {
  const json out = {{"format", kFormat},
                    {"version", kVersion},
                    {"patterns", manifest.patterns},
                    {"rig",
                     {{"name", manifest.rig_name},
                      {"fingerprint", manifest.fingerprint},
                      {"pitch_subpx", manifest.pitch_subpx},
                      {"slant", manifest.slant}}}};
  write_text_file(folder / kPatternManifest, out.dump(2) + "\n");
}

std::optional<PatternManifest> read_manifest(const fs::path& folder) {
  const fs::path file = folder / kPatternManifest;
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  const std::string text = read_text_file(file, kMostBytes);
  try {
    const json in = json::parse(text);
    if (in.at("format") != kFormat || in.at("version") != kVersion)
      throw Error(ErrorKind::Input, file.string() + ": not a manifest of patterns");
    const json& rig = in.at("rig");
    return PatternManifest{.rig_name = rig.at("name"),
                           .fingerprint = rig.at("fingerprint"),
                           .pitch_subpx = rig.at("pitch_subpx"),
                           .slant = rig.at("slant"),
                           .patterns = in.at("patterns")};
  } catch (const json::exception&) {
    throw Error(ErrorKind::Input, file.string() + ": not a manifest of patterns",
                "write the patterns again with --write-patterns, which writes it");
  }
}

void check_manifest(const PatternManifest& manifest, const optics::Rig& rig,
                    const fs::path& folder) {
  const PatternManifest wanted = manifest_of(rig, 0);
  if (manifest.fingerprint == wanted.fingerprint) return;
  throw Error(ErrorKind::Input,
              fmt::format("{}: these patterns were written for the rig \"{}\" (fingerprint {}, "
                          "pitch {:.5f}, slant {:.5f}), not for \"{}\" ({}, pitch {:.5f}, slant "
                          "{:.5f})",
                          (folder / kPatternManifest).string(), manifest.rig_name,
                          manifest.fingerprint, manifest.pitch_subpx, manifest.slant, rig.name,
                          wanted.fingerprint, wanted.pitch_subpx, wanted.slant),
              "use the rig that the patterns were written for as --rig, or write patterns for this "
              "one and photograph them");
}

}  // namespace lenticule::calib
