// SPDX-License-Identifier: Apache-2.0
// UnchangedRegions finds the regions of the panel that look the same as in the previous frame, by a
// comparison of the primitives of the two committed scenes (SceneObjects).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/interval.h"
#include "render/options/render_options.h"
#include "render/row_sweep/row_planes.h"
#include "render/scene/scene.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// SceneObjects describes a committed scene, object by object. Lifetime: may outlive its scene.
struct SceneObjects {
  struct Object {
    Fingerprint made_of;
    Box box;                       ///< scene frame, millimetres on the panel
    bool depends_on_view = false;  ///< the object is reflective, has highlights or is transparent
  };

  SceneObjects() = default;
  explicit SceneObjects(const Scene& scene);

  bool known = false;
  Fingerprint rest;             ///< all other scene data, except texture pixels
  std::vector<Object> objects;  ///< meshes, spheres, cones
  std::vector<std::shared_ptr<const Texture>> textures;
  std::shared_ptr<const Texture> environment;
};

/// Returns true if the scenes are equal except for individual objects (meshes, spheres, cones).
[[nodiscard]] bool differ_in_objects_only(const SceneObjects& a, const SceneObjects& b);

/// UnchangedRegions finds the regions of the panel that look the same as in the previous frame: no
/// changed object is visible through the region, casts a shadow there or changes the ambient light
/// there. The regions are bands of rows and columns of some pixels. Thread safety: immutable after
/// construction.
class UnchangedRegions {
 public:
  static constexpr int kBandRows = 16;
  static constexpr int kColumnPixels = 32;

  /// Finds the unchanged regions for rays that go to `eyes` on the viewing line (mm; tangents for
  /// parallel rays). If the frames differ in more than individual objects, no region is unchanged.
  /// Regions that show view-dependent surfaces always count as changed, since reflections are not
  /// followed.
  UnchangedRegions(const RowPlanes& planes, const Interval& eyes, const Scene& scene,
                   const SoftLight& soft, const SceneObjects& before, const SceneObjects& now);

  [[nodiscard]] bool any() const { return kept_ > 0; }
  [[nodiscard]] bool whole_band(int band) const {
    return lost_in_band_[static_cast<size_t>(band)] == 0;
  }
  /// Returns true if a ray of the row that leaves the panel at x_mm is in an unchanged region.
  [[nodiscard]] bool at(int row, double x_mm) const;

 private:
  struct Patch {
    Interval x_mm, y_mm;
  };
  void mark_all_changed();
  bool mark_changes(const Scene& scene, const SoftLight& soft, const SceneObjects& before,
                    const SceneObjects& now);
  void mark_changed(const Box& box);
  void mark_changed(const Patch& patch);
  void mark_shadow_changed(const Box& box, const SceneLight& light, const SoftLight& soft,
                           const Box& within);
  [[nodiscard]] Patch seen_through(const Box& box) const;

  const RowPlanes& planes_;
  Interval eyes_;
  Affine panel_from_scene_;
  int bands_, columns_;
  double x_first_, columns_per_mm_;
  std::vector<Interval> band_y_mm_;
  std::vector<uint8_t> lost_;  ///< [band][column]; 1 = changed
  std::vector<int> lost_in_band_;
  size_t kept_ = 0;
};

}  // namespace lenticule::render
