// SPDX-License-Identifier: Apache-2.0
#include "optics/trim.h"

#include <fmt/format.h>

#include <cmath>
#include <locale>
#include <sstream>

#include "base/error_kinds.h"
#include "base/file.h"
#include "optics/rig_file.h"
#include "optics/toml.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMaxFileBytes = 64u << 10;
constexpr std::string_view kSuffix = ".trim.toml";
constexpr std::string_view kOffsetKey = "offset_lenses";
constexpr std::string_view kPitchKey = "pitch_relative";

bool within_limits(const Trim& trim) {
  return std::abs(trim.offset.value) <= kMaxTrimOffsetLenses &&
         std::abs(trim.pitch_relative) <= kMaxTrimPitch;
}

}  // namespace

void validate_trim(const Trim& trim, const std::string& context) {
  if (!(std::abs(trim.offset.value) <= kMaxTrimOffsetLenses))
    throw input_error("{}: offset_lenses: {} is more than a lens", context, trim.offset.value)
        .remedy("that is more than a drift: calibrate again");
  if (!(std::abs(trim.pitch_relative) <= kMaxTrimPitch))
    throw input_error("{}: pitch_relative: {} is more than {}", context, trim.pitch_relative,
                      kMaxTrimPitch)
        .remedy("that is more than a drift: calibrate again");
}

Trim changed_by(const Trim& trim, double offset_lenses, double pitch_relative) {
  constexpr double kPlaces = 1e12;
  const auto rounded = [](double value) { return std::round(value * kPlaces) / kPlaces; };
  return {.offset = Lenses(rounded(trim.offset.value + offset_lenses)),
          .pitch_relative = rounded(trim.pitch_relative + pitch_relative)};
}

Rig trimmed(Rig rig, const Trim& trim) {
  rig.sheet.offset = rig.sheet.offset + trim.offset;
  rig.sheet.pitch = rig.sheet.pitch * (1.0 + trim.pitch_relative);
  return rig;
}

std::filesystem::path trim_file_of(const std::filesystem::path& rig_file) {
  std::filesystem::path file = rig_file;
  if (file.extension() == ".toml") file.replace_extension();
  file += kSuffix;
  return file;
}

bool is_trim_file(const std::filesystem::path& file) {
  return file.filename().string().ends_with(kSuffix);
}

Trim parse_trim(std::string_view text, const std::string& source) {
  const toml::table table = parse_toml(text, source);
  const TomlSection root(table, {}, source);
  root.allow_only({kOffsetKey, kPitchKey});
  const Trim trim{.offset = Lenses(root.number_or(kOffsetKey, 0.0)),
                  .pitch_relative = root.number_or(kPitchKey, 0.0)};
  validate_trim(trim, source + ":1");
  return trim;
}

Trim load_trim(const std::filesystem::path& rig_file) {
  const std::filesystem::path file = trim_file_of(rig_file);
  std::error_code error;
  if (std::filesystem::symlink_status(file, error).type() == std::filesystem::file_type::not_found)
    return {};
  return parse_trim(read_text_file(file, kMaxFileBytes), file.string());
}

void save_trim(const Trim& trim, const std::filesystem::path& rig_file) {
  const std::filesystem::path file = trim_file_of(rig_file);
  validate_trim(trim, file.string());
  if (!trim.empty())
    return write_text_file(
        file, fmt::format("# Trim of {}: what drifted since it was calibrated. Without this file "
                          "the rig is as calibrated.\n{} = {}\n{} = {}\n",
                          rig_file.filename().string(), kOffsetKey, trim.offset.value, kPitchKey,
                          trim.pitch_relative));
  std::error_code error;
  std::filesystem::remove(file, error);
  if (error) throw failed_error("{}: cannot remove: {}", file.string(), error.message());
}

RigIdentity identity_of(const Rig& calibrated, const Trim& trim) {
  std::string calibration = fingerprint(calibrated);
  if (trim.empty()) return {.fingerprint = calibration, .calibration = calibration, .trim = {}};
  return {.fingerprint = fingerprint(trimmed(calibrated, trim)),
          .calibration = std::move(calibration),
          .trim = trim};
}

std::string to_text(const RigIdentity& identity) {
  if (identity.trim.empty()) return identity.fingerprint;
  return fmt::format("{} trims {} {} {}", identity.fingerprint, identity.calibration,
                     identity.trim.offset.value, identity.trim.pitch_relative);
}

RigIdentity parse_identity(std::string_view text) {
  const RigIdentity plain = {
      .fingerprint = std::string(text), .calibration = std::string(text), .trim = {}};
  RigIdentity identity;
  std::istringstream words{std::string(text)};
  words.imbue(std::locale::classic());
  std::string verb;
  words >> identity.fingerprint >> verb >> identity.calibration >> identity.trim.offset.value >>
      identity.trim.pitch_relative;
  if (!words || !words.eof() || verb != "trims" || to_text(identity) != text) return plain;
  return within_limits(identity.trim) ? identity : plain;
}

RigMatch match(const RigIdentity& frames, const RigIdentity& rig) {
  const bool stated = !frames.fingerprint.empty() && !rig.fingerprint.empty();
  if (!stated || frames.fingerprint == rig.fingerprint) return RigMatch::Same;
  return frames.calibration == rig.calibration ? RigMatch::Trimmed : RigMatch::Other;
}

std::string trim_difference(const RigIdentity& frames, const RigIdentity& rig) {
  const Trim change = changed_by(rig.trim, -frames.trim.offset.value, -frames.trim.pitch_relative);
  std::string by;
  if (change.offset.value != 0.0) by = fmt::format("{:+.4g} lens", change.offset.value);
  if (change.pitch_relative != 0.0)
    by += fmt::format("{}{:+.3g} of the pitch", by.empty() ? "" : " and ", change.pitch_relative);
  return fmt::format("woven before the rig was trimmed by {}; played without that trim", by);
}

TrimmedRig load_rig_and_identity(const std::filesystem::path& rig_file) {
  const Trim trim = load_trim(rig_file);
  Rig rig = load_rig(rig_file);
  RigIdentity identity = identity_of(rig, trim);
  if (!trim.empty()) {
    rig = trimmed(std::move(rig), trim);
    validate_rig(rig, trim_file_of(rig_file).string());
  }
  return {.rig = std::move(rig), .identity = std::move(identity)};
}

Rig load_trimmed_rig(const std::filesystem::path& rig_file) {
  return load_rig_and_identity(rig_file).rig;
}

}  // namespace lenticule::optics
