// SPDX-License-Identifier: Apache-2.0
// Predicts the phases of a view from the other views, to check the fit where it was not fitted.
#pragma once

#include <optional>

#include "calib/fit/fit_search.h"

namespace lenticule::calib {

/// Smallest number of views for which one of them can be predicted: the others determine the gap.
inline constexpr size_t kLeastForPrediction = 3;

/// Returns the largest error of the phases of view `out`, in lenses, if sheet and map come from the
/// other views and the camera's position from the view's own panel points; the error is a mean over
/// kEvaluatedCells. Empty if the other views do not suffice. Needs kLeastForPrediction views;
/// `found` has a gap and a fit.
[[nodiscard]] std::optional<double> error_from_other_views(const FitProblem& problem,
                                                           const FoundFit& found, size_t out);

}  // namespace lenticule::calib
