// SPDX-License-Identifier: Apache-2.0
// ExactnessReport states whether the panel receives the buffer's values unchanged, as plain data
// for logs, stats and `doctor`.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace lenticule::display {

enum class Verdict {
  Yes,  ///< verified: every step that could change a subpixel was checked and leaves it unchanged
  No,   ///< some step changes subpixels
  Unknown,  ///< no error was found, and some step could not be checked
};
/// Returns "yes", "no" or "cannot tell".
[[nodiscard]] inline const char* verdict_name(Verdict verdict) {
  constexpr const char* kNames[] = {"yes", "no", "cannot tell"};
  return kNames[static_cast<size_t>(verdict)];
}

enum class AuditOutcome {
  Neutral,   ///< had the neutral value already
  Forced,    ///< was changed to the neutral value
  Planned,   ///< would be changed when frames are displayed
  Refused,   ///< the driver rejects the neutral value
  ReadOnly,  ///< not neutral and not writable
  Foreign,   ///< the driver has no value that is known to be neutral
};
[[nodiscard]] inline const char* outcome_name(AuditOutcome outcome) {
  constexpr const char* kNames[] = {"neutral", "forced",    "would be forced",
                                    "refused", "read only", "no neutral value known"};
  return kNames[static_cast<size_t>(outcome)];
}

struct AuditRow {
  std::string object;    ///< "connector", "crtc", "plane" or "link"
  std::string property;  ///< the kernel's name
  std::string found;     ///< the property's value before this process changed it
  std::string wanted;
  std::string now;
  AuditOutcome outcome = AuditOutcome::Neutral;
  bool alters_pixels = false;  ///< a value that is not neutral changes pixels
  std::string effect;
  std::string remedy;
};

struct ExactnessReport {
  Verdict verdict = Verdict::Unknown;
  std::vector<std::string> verified{};  ///< steps that were checked and leave subpixels unchanged
  std::vector<std::string> reasons{};   ///< steps that change them
  std::vector<std::string> unseen{};    ///< steps that could not be checked
  std::vector<std::string> remarks{};   ///< facts that do not change pixels, such as timing
  std::vector<std::string> remedies{};  ///< actions for the user
  std::vector<AuditRow> rows{};

  /// Returns "EXACT no (connector 'underscan' is on: the picture is scaled)".
  [[nodiscard]] std::string summary() const {
    const std::vector<std::string>& why = reasons.empty() ? unseen : reasons;
    std::string text = fmt::format("EXACT {}", verdict_name(verdict));
    for (size_t i = 0; i < why.size(); ++i) text += (i == 0 ? " (" : "; ") + why[i];
    return why.empty() ? text : text + ")";
  }
  /// Sets the verdict from the lists.
  void conclude() {
    verdict = !reasons.empty() ? Verdict::No : !unseen.empty() ? Verdict::Unknown : Verdict::Yes;
  }
};

}  // namespace lenticule::display
