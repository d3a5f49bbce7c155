// SPDX-License-Identifier: Apache-2.0
// Converts a frame woven for one rig to another rig: decodes the frame into views and weaves them
// again.
#pragma once

#include <filesystem>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/weaving/weave_plan.h"
#include "optics/model.h"

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

/// Returns the number of whole subpixels under a lens, which is the number of views in the frame.
/// At least 2.
[[nodiscard]] int views_in_woven(const optics::Rig& rig);

/// Decodes a woven frame: view k of `views` is the picture that an eye in the middle of that part
/// of the rig's lobe sees, one pixel per lens, with the panel's aspect. View k of one rig's lobe
/// becomes view k of the other's, as with quilts. Throws Error(Input) if the frame does not have
/// the panel's size.
[[nodiscard]] ViewSet views_of_woven(const FrameView& woven, const optics::OpticalModel& model,
                                     int views);

}  // namespace lenticule::frames
