// SPDX-License-Identifier: Apache-2.0
// Generates an mpv user shader that weaves a quilt video for one rig on a graphics card: the whole
// panel, the nearest view, the picture point straight under the subpixel. This is a preview for
// other players; unlike the weaver of frames/weave.h it is not exact (no refraction, no lens
// points, mixing in code values).
#pragma once

#include <string>

#include "frames/quilt.h"
#include "optics/rig.h"

namespace lenticule::tools {

/// Returns the shader's text. Its constants have the form `const float NAME = value;`. The
/// subpixel's view is
///    floor(VIEWS (1/2 - (phase - floor(phase + 1/2)))) with
///    phase = (x - WIDTH / 2) LENSES_PER_PIXEL + (y - HEIGHT / 2) LENSES_PER_ROW + OFFSET
/// for the subpixel's centre (x, y) in pixels, y down. A finite viewing distance is folded into
/// pitch and offset, paraxially. Throws Error(Input) for a residual map or a cell table,
/// Error(Usage) for an invalid layout.
[[nodiscard]] std::string mpv_shader(const optics::Rig& rig, const frames::QuiltLayout& layout);

}  // namespace lenticule::tools
