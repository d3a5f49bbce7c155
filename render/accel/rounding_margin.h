// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lenticule::render {

/// Assumed relative error of positions, directions and Embree's arithmetic, which covers many
/// single-precision roundings.
inline constexpr float kRoundingMargin = 1.0F / (1 << 18);

}  // namespace lenticule::render
