// SPDX-License-Identifier: Apache-2.0
// The interface of the render methods: how a scene becomes a woven frame.
#pragma once

#include <cstdint>

#include "frames/frame.h"
#include "render/options/render_options.h"
#include "render/options/render_statistics.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::render {

class Method {
 public:
  virtual ~Method() = default;
  /// The number of the next frame to be rendered; without being told, methods count.
  virtual void set_frame(uint64_t number) { static_cast<void>(number); }
  /// The first frame that has to be rendered before `number`, one after the other, for it to be as
  /// in a sequence without a break; `number` itself where it needs none.
  [[nodiscard]] virtual uint64_t first_needed(uint64_t number) const { return number; }
  /// Renders one frame; the frame has the rig's panel size. Same input, same bytes, whatever the
  /// number of threads. Not to be called from two threads at once.
  virtual RenderStatistics render(const Scene& scene, const Stage& stage,
                                  frames::WovenFrame& frame) = 0;
  /// White where re-projection left the last frame's subpixels empty; null unless it was asked for,
  /// and for methods that re-project nothing.
  [[nodiscard]] virtual const frames::WovenFrame* missing_subpixels() const { return nullptr; }
};

}  // namespace lenticule::render
