// SPDX-License-Identifier: Apache-2.0
// The frame before, for as long as nothing changes.
#pragma once

#include <memory>
#include <vector>

#include "frames/frame.h"
#include "render/options/render_statistics.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Of one method, whose rig and options never change. Not to be used from two threads at once.
class LastFrame {
 public:
  /// Whether the scene, put where it is, would be rendered to the bytes that are kept.
  [[nodiscard]] bool shows(const Scene& scene) const;
  /// Copies those bytes.
  RenderStatistics copy_to(frames::WovenFrame& frame) const;

  [[nodiscard]] const frames::WovenFrame& frame() const { return frame_; }

  /// The whole frame that the scene was rendered to.
  void keep(const Scene& scene, const frames::WovenFrame& frame);

 private:
  bool known_ = false;
  Fingerprint picture_;
  std::vector<std::shared_ptr<const Texture>> textures_;
  std::shared_ptr<const Texture> environment_;
  frames::WovenFrame frame_;
};

}  // namespace lenticule::render
