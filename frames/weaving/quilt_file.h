// SPDX-License-Identifier: Apache-2.0
// Views as a quilt file that others read: the layout stands in its name.
#pragma once

#include <filesystem>

#include "frames/quilt.h"

namespace lenticule::frames {

/// A grid for so many views whose picture is about as wide as high.
[[nodiscard]] QuiltLayout quilt_layout_for(const ViewSet& views);

/// The quilt as one picture; unused tiles are black. Throws Error(Usage) where the layout has not
/// as many tiles as there are views.
[[nodiscard]] WovenFrame draw_quilt(const ViewSet& views, const QuiltLayout& layout);

/// "city.png" becomes "city_qs8x6a0.75.png"; a name that says the same already stays. Throws
/// Error(Usage) if it says something else.
[[nodiscard]] std::filesystem::path quilt_name(const std::filesystem::path& file,
                                               const QuiltLayout& layout);

/// Writes it, whole or not at all, and returns the name it got. Errors of write_woven().
std::filesystem::path write_quilt(const ViewSet& views, const std::filesystem::path& file);

}  // namespace lenticule::frames
