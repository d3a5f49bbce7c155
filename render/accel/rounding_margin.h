// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lenticule::render {

/// The relative error that is assumed for positions, directions and Embree's arithmetic: many
/// roundings of single precision.
inline constexpr float kRoundingMargin = 1.0F / (1 << 18);

}  // namespace lenticule::render
