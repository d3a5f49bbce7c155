// SPDX-License-Identifier: Apache-2.0
// Whether what is in the buffer is what the panel shows: plain data, for logs, stats and `doctor`.
#pragma once

#include <string>
#include <vector>

namespace lenticule::display {

enum class Verdict {
  Yes,      ///< proved: everything that could change a subpixel was looked at and does not
  No,       ///< something changes subpixels
  Unknown,  ///< nothing is known to be wrong, but something could not be seen
};
/// "yes", "no" or "cannot tell"
[[nodiscard]] const char* verdict_name(Verdict verdict);

enum class AuditOutcome {
  Neutral,   ///< was neutral already
  Forced,    ///< was not, is now
  Planned,   ///< was not; would be forced when frames are shown
  Refused,   ///< the driver does not take the neutral value
  ReadOnly,  ///< is not neutral and cannot be written
  Foreign,   ///< the driver has no value that is known to be neutral
};
[[nodiscard]] const char* outcome_name(AuditOutcome outcome);

struct AuditRow {
  std::string object;    ///< "connector", "crtc", "plane" or "link"
  std::string property;  ///< as the kernel calls it
  std::string found;     ///< before we came
  std::string wanted;
  std::string now;
  AuditOutcome outcome = AuditOutcome::Neutral;
  bool alters_pixels = false;  ///< when it is not neutral
  std::string effect;
  std::string remedy;
};

struct ExactnessReport {
  Verdict verdict = Verdict::Unknown;
  std::vector<std::string> proved{};    ///< what was looked at and leaves subpixels as they are
  std::vector<std::string> reasons{};   ///< what changes them
  std::vector<std::string> unseen{};    ///< what could not be seen
  std::vector<std::string> remarks{};   ///< what changes the timing, not the pixels
  std::vector<std::string> remedies{};  ///< what a person can do about it
  std::vector<AuditRow> rows{};

  /// "EXACT no (connector 'underscan' is on: the picture is scaled)"
  [[nodiscard]] std::string summary() const;
  /// Draws the verdict from the lists.
  void conclude();
};

}  // namespace lenticule::display
