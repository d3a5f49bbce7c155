// SPDX-License-Identifier: Apache-2.0
// Chooses the distances from which a frame is predicted best. They are measured on the frame
// itself, so that the lens sheet need not be known, and views or quilts compress as well.
#pragma once

#include <cstdint>

#include "frames/frame.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::frames {

/// Every kPredictorInterval-th frame of a film chooses the predictors of the frames up to the next
/// choice: content changes slowly, and choosing takes about as long as compressing a frame.
inline constexpr uint64_t kPredictorInterval = 32;

/// Returns at most kMaxPredictors distances (predictors), the most useful first. Examines a fixed
/// sample of the blocks: the same frame gives the same predictors on every machine. `band_rows` is
/// the container's value.
[[nodiscard]] PredictorTable choose_predictors(const FrameView& frame, int band_rows);

}  // namespace lenticule::frames
