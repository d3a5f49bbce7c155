// SPDX-License-Identifier: Apache-2.0
// Writes views as a quilt file with its layout in the file name, which other programs can read.
#pragma once

#include <filesystem>

#include "frames/quilt.h"
#include "frames/weaving/weave_plan.h"

namespace lenticule::frames {

/// Return a grid for the views whose picture is about as wide as high.
[[nodiscard]] QuiltLayout quilt_layout_for(const ViewShape& views);
[[nodiscard]] QuiltLayout quilt_layout_for(const ViewSet& views);

/// Returns the quilt as one picture; unused tiles are black. Throws Error(Usage) if the layout has
/// fewer tiles than there are views.
[[nodiscard]] WovenFrame draw_quilt(const ViewSet& views, const QuiltLayout& layout);
/// Returns the size of the quilt.
[[nodiscard]] FrameGeometry quilt_geometry(const ViewShape& views, const QuiltLayout& layout);
/// Draws into a frame of the quilt's size, for a layout with a tile for each view; unused tiles
/// stay unchanged.
void draw_quilt(const ViewSet& views, const QuiltLayout& layout, WovenFrame& quilt);

/// Returns "city_qs8x6a0.75.png" for "city.png"; a name that already states the layout stays
/// unchanged. Throws Error(Usage) if the name states another layout.
[[nodiscard]] std::filesystem::path quilt_name(const std::filesystem::path& file,
                                               const QuiltLayout& layout);

/// Writes the quilt atomically and returns the name of the file. Throws the errors of
/// write_woven().
std::filesystem::path write_quilt(const ViewSet& views, const std::filesystem::path& file);

}  // namespace lenticule::frames
