// SPDX-License-Identifier: Apache-2.0
// Judges how far the camera differs from view to view: a little is normal, because lenses breathe
// when they focus and stabilisers move the lens; more is a zoomed or cropped picture.
#pragma once

#include <string>
#include <vector>

#include "calib/fit/observations.h"

namespace lenticule::calib {

/// Returns true if the difference of any view's camera matters for the phases.
[[nodiscard]] bool differ_notably(const std::vector<OwnCameraValues>& own);

/// Returns true if any view's camera differs by more than breathing and stabiliser explain.
[[nodiscard]] bool contradict(const std::vector<OwnCameraValues>& own);

/// Suspect is a view that may be the only one with another camera, and the difference.
struct Suspect {
  std::string name;
  OwnCameraValues own{};
};

/// Returns a sentence that names the suspects.
[[nodiscard]] std::string sentence_about(const std::vector<Suspect>& suspects);

/// Returns a sentence for each view whose camera differs notably.
[[nodiscard]] std::vector<std::string> notes_of(const std::vector<View>& views,
                                                const std::vector<OwnCameraValues>& own);

}  // namespace lenticule::calib
