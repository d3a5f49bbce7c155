// SPDX-License-Identifier: Apache-2.0
// Anything with views in it, opened: quilts, pictures and films per view, two eyes, depth, frames
// of other rigs.
#pragma once

#include <memory>

#include "frames/views_input/view_input.h"
#include "player/sources/content_meaning.h"
#include "player/sources/picture_sources.h"

namespace lenticule::player {

struct ContentRequest {
  MeaningRequest what;
  PictureRequest how = {};
  int drawing_threads = 1;  ///< for views that are made of depth
};

/// `meaning` is that of request.what, and not Woven. Throws Error(Usage) and Error(Input) for what
/// is missing, broken, of different sizes or lengths, or too much to hold.
[[nodiscard]] std::unique_ptr<frames::ViewInput> open_views(const ContentRequest& request,
                                                            const ContentMeaning& meaning);

/// The first set of views, waited for: for at most a minute. Throws Error(Input) in the input's
/// words, Error(Failed) when none came, and for an input without a frame.
void await_first(frames::ViewInput& input, const std::string& name);

/// What was left out or replaced in all that the input has: waits for its end, for at most a
/// minute, after the set of views that is in use. That must be the last one that is wanted.
[[nodiscard]] frames::FrameDamage await_damage(frames::ViewInput& input);

}  // namespace lenticule::player
