// SPDX-License-Identifier: Apache-2.0
// What drifts after calibration: a sheet that warms up slides and stretches by a little. A trim is
// kept apart from the rig, in a file beside it (kiosk.toml -> kiosk.trim.toml), so that the
// calibration stays what it was.
//
// A trimmed rig has other numbers and so a fingerprint of its own. Its RigIdentity also carries the
// calibration's: frames made before a trim stay playable, and it can be said how far off they are.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

struct Trim {
  Lenses offset{0};             ///< added to phi0
  double pitch_relative = 0.0;  ///< P is multiplied by 1 + this; the panel's centre stays

  [[nodiscard]] bool empty() const { return offset.value == 0.0 && pitch_relative == 0.0; }
  friend bool operator==(const Trim&, const Trim&) = default;
};

/// More is no drift but another calibration.
inline constexpr double kMaxTrimOffsetLenses = 1.0;
inline constexpr double kMaxTrimPitch = 0.01;

/// Throws Error(Input) "context: cause" for numbers beyond these limits, or none at all.
void validate_trim(const Trim& trim, const std::string& context);

/// A little further; sums are rounded to 12 places, so that steps back and forth end where they
/// began.
[[nodiscard]] Trim changed_by(const Trim& trim, double offset_lenses, double pitch_relative);

/// The rig with the trim in it.
[[nodiscard]] Rig trimmed(Rig rig, const Trim& trim);

/// "kiosk.trim.toml" for "kiosk.toml"; other names get .trim.toml at their end.
[[nodiscard]] std::filesystem::path trim_file_of(const std::filesystem::path& rig_file);
/// True for names that trim_file_of() makes, which are no rigs.
[[nodiscard]] bool is_trim_file(const std::filesystem::path& file);

/// Throws Error(Input) that starts with "source:line:".
[[nodiscard]] Trim parse_trim(std::string_view toml, const std::string& source);
/// The trim beside the rig file; none if there is no such file. Throws Error(Input).
[[nodiscard]] Trim load_trim(const std::filesystem::path& rig_file);
/// Replaces the trim beside the rig file, whole or not at all; an empty trim removes it. Throws
/// Error(Failed), and Error(Input) as validate_trim().
void save_trim(const Trim& trim, const std::filesystem::path& rig_file);

/// RigIdentity says which rig frames are made for, or which rig a player shows them with.
struct RigIdentity {
  std::string fingerprint;  ///< of the rig with the trim in it; empty: not stated
  std::string calibration;  ///< of the rig without it
  Trim trim;
  friend bool operator==(const RigIdentity&, const RigIdentity&) = default;
};
[[nodiscard]] RigIdentity identity_of(const Rig& calibrated, const Trim& trim);

/// The text of an identity, at most 127 bytes: the fingerprint alone without a trim, else
/// "FINGERPRINT trims CALIBRATION OFFSET PITCH".
[[nodiscard]] std::string to_text(const RigIdentity& identity);
/// Reads such a text. Any other text is a fingerprint of which no more is known.
[[nodiscard]] RigIdentity parse_identity(std::string_view text);

enum class RigMatch {
  Same,     ///< the same numbers, or one of the two is not stated
  Trimmed,  ///< the same calibration with another trim
  Other,
};
[[nodiscard]] RigMatch match(const RigIdentity& frames, const RigIdentity& rig);

/// Says how frames that match Trimmed differ from `rig` in one sentence without a full stop: "woven
/// before the rig was trimmed by +0.010 lenses: ...".
[[nodiscard]] std::string trim_difference(const RigIdentity& frames, const RigIdentity& rig);

struct TrimmedRig {
  Rig rig;
  RigIdentity identity;
};
/// Loads the rig with the trim beside it: for everything that makes or shows frames. Throws
/// Error(Input) for either file, or where the two make no valid rig.
[[nodiscard]] TrimmedRig load_rig_and_identity(const std::filesystem::path& rig_file);
/// The same without the identity.
[[nodiscard]] Rig load_trimmed_rig(const std::filesystem::path& rig_file);

}  // namespace lenticule::optics
