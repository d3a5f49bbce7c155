// SPDX-License-Identifier: Apache-2.0
// Views as a quilt file that others read: the layout stands in its name.
#pragma once

#include <filesystem>

#include "frames/quilt.h"
#include "frames/weaving/weave_plan.h"

namespace lenticule::frames {

/// A grid for so many views whose picture is about as wide as high.
[[nodiscard]] QuiltLayout quilt_layout_for(const ViewShape& views);
[[nodiscard]] QuiltLayout quilt_layout_for(const ViewSet& views);

/// The quilt as one picture; unused tiles are black. Throws Error(Usage) where the layout has not
/// as many tiles as there are views.
[[nodiscard]] WovenFrame draw_quilt(const ViewSet& views, const QuiltLayout& layout);
/// Its size.
[[nodiscard]] FrameGeometry quilt_geometry(const ViewShape& views, const QuiltLayout& layout);
/// Into a frame of that size, for a layout with a tile for each view; unused tiles stay as they
/// are.
void draw_quilt(const ViewSet& views, const QuiltLayout& layout, WovenFrame& quilt);

/// "city.png" becomes "city_qs8x6a0.75.png"; a name that says the same already stays. Throws
/// Error(Usage) if it says something else.
[[nodiscard]] std::filesystem::path quilt_name(const std::filesystem::path& file,
                                               const QuiltLayout& layout);

/// Writes it, whole or not at all, and returns the name it got. Errors of write_woven().
std::filesystem::path write_quilt(const ViewSet& views, const std::filesystem::path& file);

}  // namespace lenticule::frames
