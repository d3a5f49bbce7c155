// SPDX-License-Identifier: Apache-2.0
// open_views opens every kind of source that consists of views: quilts, pictures and videos per
// view, stereo, depth, frames woven for other rigs.
#pragma once

#include <memory>

#include "frames/views_input/view_input.h"
#include "player/sources/content_format.h"
#include "player/sources/picture_sources.h"

namespace lenticule::player {

struct ContentRequest {
  SourceSpec source = {};
  PictureRequest how = {};
  int drawing_threads = 1;  ///< threads that make views from depth
};

/// Opens the source. `detected` is that of the source, and not Woven. Throws Error(Usage) and
/// Error(Input) for inputs that are missing, broken, of different sizes or lengths, or too large.
[[nodiscard]] std::unique_ptr<frames::ViewInput> open_views(const ContentRequest& request,
                                                            const ContentFormat& detected);

/// Waits at most a minute for the first set of views. Throws Error(Input) with the input's error,
/// Error(Failed) if none came or the input has no frame.
void await_first(frames::ViewInput& input, const std::string& name);

/// Returns the damage in the whole input. Waits at most a minute for the input's end; the set of
/// views in use must be the last one needed.
[[nodiscard]] frames::FrameDamage await_damage(frames::ViewInput& input);

}  // namespace lenticule::player
