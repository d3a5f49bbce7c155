// SPDX-License-Identifier: Apache-2.0
// LastFrame keeps the previous frame, to copy it while the scene does not change.
#pragma once

#include <memory>
#include <vector>

#include "frames/frame.h"
#include "render/options/render_statistics.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// LastFrame serves one render method whose rig and options do not change. Thread safety: one
/// thread at a time.
class LastFrame {
 public:
  /// Returns true if the committed scene would be rendered to the kept bytes.
  [[nodiscard]] bool shows(const Scene& scene) const;
  /// Copies the kept frame, whose errors the copy has.
  RenderStatistics copy_to(frames::WovenFrame& frame) const;

  [[nodiscard]] const frames::WovenFrame& frame() const { return frame_; }

  /// Keeps the complete frame to which the scene was rendered, and its errors.
  void keep(const Scene& scene, const frames::WovenFrame& frame, const FrameErrors& errors);

 private:
  bool known_ = false;
  Fingerprint picture_;
  std::vector<std::shared_ptr<const Texture>> textures_;
  std::shared_ptr<const Texture> environment_;
  frames::WovenFrame frame_;
  FrameErrors errors_;
};

}  // namespace lenticule::render
