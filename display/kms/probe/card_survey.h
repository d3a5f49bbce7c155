// SPDX-License-Identifier: Apache-2.0
// CardSurvey lists every card that can be opened and its connectors.
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

/// A card that this process has already open: only its DRM master can probe connectors again.
struct OpenCard {
  int fd = -1;  ///< borrowed
  std::string path{};
};

struct CardSurvey {
  std::vector<DrmDevice> devices;
  std::vector<OutputCandidate> candidates;
  /// The index of each candidate's device; none for candidates of the open card.
  std::vector<std::optional<size_t>> device_of;
  std::optional<Error> problem;  ///< error of a card that could not be opened
};

/// Opens all cards and probes every connector, which may take hundreds of milliseconds each. If
/// `inherited` is one of the cards, its descriptor is used, because it is DRM master already, and
/// `inherited` is reset.
[[nodiscard]] CardSurvey survey_cards(const std::shared_ptr<Session>& session,
                                      std::optional<DrmDevice>& inherited,
                                      const OpenCard& open = {});

/// Returns the error that explains why no output was chosen.
[[nodiscard]] Error refusal(const OutputChoice& choice, const CardSurvey& survey);

}  // namespace lenticule::display
