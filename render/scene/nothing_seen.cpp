// SPDX-License-Identifier: Apache-2.0
#include "render/scene/nothing_seen.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/interval.h"

namespace lenticule::render {
namespace {

/// RayVolume contains all rays of a panel: at depth z they lie within half_width + tan_x |z| and
/// half_height + tan_y |z| of its centre.
class RayVolume {
 public:
  RayVolume(const optics::OpticalModel& model, double near_mm) : near_mm_(near_mm) {
    const optics::Rig& rig = model.rig();
    // The shift between pixel and lens is a fraction of the gap, far less than this.
    constexpr double kWider = 1.05;
    half_width_ = kWider * rig.panel.width_px * rig.panel.pixel_width.value / 2.0;
    half_height_ = kWider * rig.panel.height_px * rig.panel.pixel_height.value / 2.0;
    // Tangents in the sheet are at most those of a lens half a lobe off the eye. In the air they
    // are larger: up to 1.5 times up to 40 degrees. Steeper rays are not bounded.
    const double eye = 1.0 / rig.viewing.distance.value;  // 0 for parallel zones
    const double in_sheet = (half_width_ + std::abs(rig.viewing.centre.value)) * eye +
                            model.pitch_mm() / (2.0 * rig.sheet.gap.value);
    tan_x_ = in_sheet < kSteepInSheet ? kInAir * in_sheet : HUGE_VAL;
    tan_y_ = kInAir * (half_height_ + std::abs(rig.viewing.height.value)) * eye;
  }

  /// Returns false if no ray passes through the box (panel coordinates).
  [[nodiscard]] bool meets(const Interval& x, const Interval& y, const Interval& z) const {
    if (z.low > near_mm_) return false;
    const double depth = std::max(std::abs(z.low), std::abs(std::min(z.high, near_mm_)));
    return overlaps(x, half_width_ + tan_x_ * depth) && overlaps(y, half_height_ + tan_y_ * depth);
  }

 private:
  static constexpr double kSteepInSheet = 0.6;
  static constexpr double kInAir = 1.5;

  static bool overlaps(const Interval& content, double reach) {
    return content.low <= reach && content.high >= -reach;
  }

  double near_mm_;
  double half_width_, half_height_;
  double tan_x_, tan_y_;
};

/// PanelBox is a box in panel coordinates.
struct PanelBox {
  Interval x, y, z;

  void extend(Vec3 p, Vec3 half = {}) {
    x.extend(Interval{p.x - half.x, p.x + half.x});
    y.extend(Interval{p.y - half.y, p.y + half.y});
    z.extend(Interval{p.z - half.z, p.z + half.z});
  }
};

}  // namespace

void refuse_empty(const SceneDescription& scene) {
  const std::string reasons =
      scene.notes.empty() ? "it has no surface" : fmt::format("{}", fmt::join(scene.notes, "; "));
  throw Error(ErrorKind::Input,
              fmt::format("{}: nothing to see in this scene: {}", scene.source, reasons),
              "surfaces are shown: triangles, polygons, spheres and cones that have an area");
}

bool content_meets_rays(const SceneDescription& scene, const Stage& stage,
                        const optics::OpticalModel& model) {
  const RayVolume rays(model, stage.near_mm);
  const Affine& map = stage.panel_from_world;
  const auto meets = [&](const PanelBox& box) { return rays.meets(box.x, box.y, box.z); };
  const auto ball = [&](PanelBox& box, Vec3 centre, double radius) {
    const double r = radius * stage.mm_per_unit;
    box.extend(map.point(centre), {r, r, r * stage.depth_scale});
  };
  for (const TriangleMesh& mesh : scene.meshes)
    for (const auto& triangle : mesh.triangles) {
      PanelBox box;
      for (const uint32_t corner : triangle) box.extend(map.point(mesh.positions[corner]));
      if (meets(box)) return true;
    }
  for (const Sphere& sphere : scene.spheres) {
    PanelBox box;
    ball(box, sphere.centre, sphere.radius);
    if (meets(box)) return true;
  }
  for (const Cone& cone : scene.cones) {
    PanelBox box;
    ball(box, cone.base, cone.base_radius);
    ball(box, cone.apex, cone.apex_radius);
    if (meets(box)) return true;
  }
  return false;
}

}  // namespace lenticule::render
