// SPDX-License-Identifier: Apache-2.0
#include "render/culling/last_frame.h"

#include <algorithm>
#include <chrono>

#include "render/scene/texture.h"

namespace lenticule::render {

bool LastFrame::shows(const Scene& scene) const {
  return known_ && picture_ == scene.picture &&
         std::ranges::equal(textures_, scene.textures, same_texture) &&
         same_texture(environment_, scene.backdrop.environment);
}

void LastFrame::keep(const Scene& scene, const frames::WovenFrame& frame,
                     const FrameErrors& errors) {
  frame_ = frame;
  errors_ = errors;
  picture_ = scene.picture;
  textures_ = scene.textures;
  environment_ = scene.backdrop.environment;
  known_ = true;
}

RenderStatistics LastFrame::copy_to(frames::WovenFrame& frame) const {
  const auto start = std::chrono::steady_clock::now();
  frame = frame_;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  RenderStatistics statistics;
  static_cast<FrameErrors&>(statistics) = errors_;
  statistics.subpixels = statistics.copied_subpixels = frame.bytes().size();
  statistics.seconds = elapsed.count();
  return statistics;
}

}  // namespace lenticule::render
