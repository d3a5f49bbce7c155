// SPDX-License-Identifier: Apache-2.0
// Judges whether the hand turned while a photograph was read. As the rows are read one after the
// other, a rotation looks like a shift of the camera's axis and a step to the side: few photographs
// leave open which it was.
#pragma once

#include <vector>

#include "calib/phone/phone_fit.h"
#include "optics/rig.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// Returns the fit of the photograph during which the hand moved most evidently, if that changes
/// the phases that the eyes see; nullptr if no hand moved. `start` gives panel and layout.
///
/// Lifetime: the result belongs to the fit.
[[nodiscard]] const TurnedFit* moved_hand(const PhoneFit& fit, const optics::Rig& start,
                                          const std::vector<Vec3>& eyes);

/// Returns the fit with a hand that moved of which the result is least sure: its probability times
/// the change of a phase is largest, and too large to accept; else nullptr. `mean` is that of
/// averaged_over_turns(). More than kFewPhotos photographs leave no such doubt.
///
/// Lifetime: the result belongs to `fit`.
[[nodiscard]] const TurnedFit* possibly_moved_hand(const PhoneFit& fit, const PhoneFit& mean,
                                                   const optics::Rig& start,
                                                   const std::vector<Vec3>& eyes);

/// Returns the mean of the fit and of those with a hand that moved, by their probabilities. Their
/// differences add to the covariance. `photos` is that of the fit. More than kFewPhotos photographs
/// determine rotations; their fit is returned unchanged.
[[nodiscard]] PhoneFit averaged_over_turns(const PhoneFit& fit);

}  // namespace lenticule::calib
