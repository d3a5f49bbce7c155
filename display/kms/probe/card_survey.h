// SPDX-License-Identifier: Apache-2.0
// Every card that can be opened, and what hangs on it.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "display/kms/device/drm_device.h"
#include "display/kms/device/session.h"
#include "display/kms/probe/output_choice.h"

namespace lenticule::display {

/// A card that this process has open already: only its master can ask panels anew.
struct OpenCard {
  int fd = -1;  ///< borrowed
  std::string path{};
};

struct CardSurvey {
  std::vector<DrmDevice> devices;
  std::vector<OutputCandidate> candidates;
  /// Per candidate: its device; the open card's candidates have none.
  std::vector<std::optional<size_t>> device_of;
  std::optional<Error> problem;  ///< of a card that could not be opened
};

/// Asks every panel, which may take hundreds of milliseconds each. `inherited` is used up where it
/// is one of the cards: it is master already.
[[nodiscard]] CardSurvey survey_cards(const std::shared_ptr<Session>& session,
                                      std::optional<DrmDevice>& inherited,
                                      const OpenCard& open = {});

/// Why none was chosen.
[[nodiscard]] Error refusal(const OutputChoice& choice, const CardSurvey& survey);

}  // namespace lenticule::display
