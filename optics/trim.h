// SPDX-License-Identifier: Apache-2.0
// Trim corrects drift after calibration: a sheet that warms up slides and stretches a little. A
// trim is stored apart from the rig, in a file beside the rig's (kiosk.toml -> kiosk.trim.toml), so
// that the calibration stays unchanged.
//
// A trimmed rig has other numbers and therefore its own fingerprint. Its RigIdentity also holds the
// calibration's fingerprint: frames made before a trim stay playable, and the player can report how
// far they are off.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "optics/rig.h"

namespace lenticule::optics {

struct Trim {
  Lenses offset{0};  ///< added to phi0
  double pitch_relative =
      0.0;  ///< P is multiplied by 1 + pitch_relative; the panel's centre does not move

  [[nodiscard]] bool empty() const { return offset.value == 0.0 && pitch_relative == 0.0; }
  friend bool operator==(const Trim&, const Trim&) = default;
};

/// Limits of a trim. Larger values are not drift: they need a new calibration.
inline constexpr double kMaxTrimOffsetLenses = 1.0;
inline constexpr double kMaxTrimPitch = 0.01;

/// Throws Error(Input) "context: cause" for values beyond these limits or values that are not
/// finite.
void validate_trim(const Trim& trim, const std::string& context);

/// Returns the trim changed by the given amounts. Sums are rounded to 12 decimal places, so that
/// steps back and forth end at the initial value.
[[nodiscard]] Trim changed_by(const Trim& trim, double offset_lenses, double pitch_relative);

/// Returns the rig with the trim applied.
[[nodiscard]] Rig trimmed(Rig rig, const Trim& trim);

/// Returns "kiosk.trim.toml" for "kiosk.toml"; other names get .trim.toml appended.
[[nodiscard]] std::filesystem::path trim_file_of(const std::filesystem::path& rig_file);
/// Returns true for names that trim_file_of() makes; such files are not rigs.
[[nodiscard]] bool is_trim_file(const std::filesystem::path& file);

/// Parses a trim file. Throws Error(Input) that starts with "source:line:".
[[nodiscard]] Trim parse_trim(std::string_view toml, const std::string& source);
/// Returns the trim beside the rig file; an empty trim if there is no such file. Throws
/// Error(Input).
[[nodiscard]] Trim load_trim(const std::filesystem::path& rig_file);
/// Replaces the trim file beside the rig file atomically; an empty trim removes the file. Throws
/// Error(Failed), and the Error(Input) of validate_trim().
void save_trim(const Trim& trim, const std::filesystem::path& rig_file);

/// RigIdentity says which rig frames are made for, or which rig a player shows them with.
struct RigIdentity {
  std::string fingerprint;  ///< fingerprint of the trimmed rig; empty: not stated
  std::string calibration;  ///< fingerprint of the rig without the trim
  Trim trim;
  friend bool operator==(const RigIdentity&, const RigIdentity&) = default;
};
[[nodiscard]] RigIdentity identity_of(const Rig& calibrated, const Trim& trim);

/// Returns the text of an identity, at most 127 bytes: only the fingerprint if there is no trim,
/// else "FINGERPRINT trims CALIBRATION OFFSET PITCH".
[[nodiscard]] std::string to_text(const RigIdentity& identity);
/// Parses the text of an identity. Any other text counts as a fingerprint without a known
/// calibration.
[[nodiscard]] RigIdentity parse_identity(std::string_view text);

enum class RigMatch {
  Same,     ///< the same numbers, or one of the two is not stated
  Trimmed,  ///< the same calibration with another trim
  Other,
};
[[nodiscard]] RigMatch match(const RigIdentity& frames, const RigIdentity& rig);

/// Describes how frames that match Trimmed differ from `rig`, in one sentence without a full stop:
/// "woven before the rig was trimmed by +0.010 lenses: ...".
[[nodiscard]] std::string trim_difference(const RigIdentity& frames, const RigIdentity& rig);

struct TrimmedRig {
  Rig rig;
  RigIdentity identity;
};
/// Loads the rig with the trim beside it, for all code that makes or shows frames. Throws
/// Error(Input) if either file is invalid, or if the two together make no valid rig.
[[nodiscard]] TrimmedRig load_rig_and_identity(const std::filesystem::path& rig_file);
/// Loads the trimmed rig without its identity.
[[nodiscard]] Rig load_trimmed_rig(const std::filesystem::path& rig_file);

}  // namespace lenticule::optics
