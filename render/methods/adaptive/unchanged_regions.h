// SPDX-License-Identifier: Apache-2.0
// UnchangedRegions finds the regions of the panel that look the same as in the previous frame, by a
// comparison of the primitives of the two committed scenes (SceneObjects).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "base/interval.h"
#include "render/options/render_options.h"
#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/scene.h"
#include "render/scene/scene_fingerprint.h"
#include "render/scene/texture.h"

namespace lenticule::render {

/// Fingerprints all scene data outside the objects. The nearest object determines where rays start:
/// if it moves, the origins of all rays round differently.
inline Fingerprint rest_of(const Scene& scene) {
  SceneMixer mixer;
  mixer.add(scene.materials, scene.lights);
  const Affine& map = scene.scene_from_panel;
  mixer.add(scene.ambient, scene.backdrop.colour, scene.backdrop.up, scene.backdrop.ahead,
            map.column_x, map.column_y, map.column_z, map.origin);
  mixer.add(scene.backdrop.sky, scene.colour_managed, scene.frame.units_per_world, scene.near_mm);
  mixer.add(uint64_t{scene.meshes.size()}, uint64_t{scene.spheres.size()},
            uint64_t{scene.cones.size()});
  return mixer.value();
}

/// SceneObjects describes a committed scene, object by object. Lifetime: may outlive its scene.
struct SceneObjects {
  struct Object {
    Fingerprint made_of;
    Box box;                       ///< scene frame
    bool depends_on_view = false;  ///< the object is reflective, has highlights or is transparent
  };

  SceneObjects() = default;
  explicit SceneObjects(const Scene& scene)
      : rest(rest_of(scene)), textures(scene.textures), environment(scene.backdrop.environment) {
    objects.reserve(scene.meshes.size() + scene.spheres.size() + scene.cones.size());
    const auto add_all = [&](const auto& shapes, const auto& mix) {
      for (const auto& shape : shapes) {
        const Material& material = scene.materials[static_cast<size_t>(shape.material)];
        SceneMixer mixer;
        mix(shape, mixer);
        objects.push_back(
            {.made_of = mixer.value(),
             .box = box_of(shape),
             .depends_on_view = material.specular > 0.0 || material.transmittance > 0.0});
      }
    };
    add_all(scene.meshes, [&](const MeshShape& mesh, SceneMixer& mixer) {
      mixer.add_mesh(mesh);
      for (const uint32_t number : mesh.wide)
        if (number != MeshShape::kNotWide)
          for (const Vec3& corner : scene.wide_triangles[number].corner) mixer.add(corner);
    });
    add_all(scene.spheres,
            [](const SphereShape& sphere, SceneMixer& mixer) { mixer.add_sphere(sphere); });
    add_all(scene.cones, [](const ConeShape& cone, SceneMixer& mixer) {
      mixer.add(cone.base, cone.axis, cone.height, cone.base_radius, cone.slope, cone.inward,
                cone.material);
    });
  }

  Fingerprint rest;             ///< all other scene data, except texture pixels
  std::vector<Object> objects;  ///< meshes, spheres, cones
  std::vector<std::shared_ptr<const Texture>> textures;
  std::shared_ptr<const Texture> environment;
};

/// Returns true if the scenes are equal except for individual objects (meshes, spheres, cones).
[[nodiscard]] inline bool differ_in_objects_only(const SceneObjects& a, const SceneObjects& b) {
  return a.rest == b.rest && a.objects.size() == b.objects.size() &&
         std::ranges::equal(a.textures, b.textures, same_texture) &&
         same_texture(a.environment, b.environment);
}

/// UnchangedRegions finds the regions of the panel that look the same as in the previous frame: no
/// changed object is visible through the region, casts a shadow there or changes the ambient light
/// there. The regions are bands of rows and columns of some pixels. Thread safety: immutable after
/// construction.
class UnchangedRegions {
 public:
  static constexpr int kBandRows = TilePlan::kRows;
  static constexpr int kColumnPixels = 32;

  /// Finds the unchanged regions for rays that go to `eyes` on the viewing line (mm; tangents for
  /// parallel rays). If the frames differ in more than individual objects, no region is unchanged.
  /// Regions that show view-dependent surfaces always count as changed, since reflections are not
  /// followed.
  UnchangedRegions(const RowPlanes& planes, const Interval& eyes, const Scene& scene,
                   const SoftLight& soft, const SceneObjects& before, const SceneObjects& now)
      : planes_(planes),
        eyes_(eyes),
        panel_from_scene_(scene.scene_from_panel.inverse()),
        bands_((planes.rows() + kBandRows - 1) / kBandRows) {
    const optics::Panel& panel = planes.model().rig().panel;
    const double pixel_mm = panel.pixel_width.value;
    columns_ = (panel.width_px + kColumnPixels - 1) / kColumnPixels + 2;  // lenses extend beyond
    columns_per_mm_ = 1.0 / (kColumnPixels * pixel_mm);
    x_first_ = -0.5 * columns_ * kColumnPixels * pixel_mm;
    for (int band = 0; band < bands_; ++band) {
      Interval& y_mm = band_y_mm_.emplace_back();
      for (const int row : {band * kBandRows - 1, (band + 1) * kBandRows})
        y_mm.extend(planes.plane_at(row + planes.height_in_row(0)).lens_y_mm);
    }
    lost_.assign(static_cast<size_t>(bands_) * static_cast<size_t>(columns_), 0);
    lost_in_band_.assign(static_cast<size_t>(bands_), 0);
    kept_ = lost_.size();
    if (!differ_in_objects_only(before, now))
      mark_all_changed();
    else if (mark_changes(scene, soft, before, now))
      for (const SceneObjects::Object& object : now.objects)
        if (object.depends_on_view) mark_changed(object.box.widened(kMargin));
  }

  [[nodiscard]] bool any() const { return kept_ > 0; }
  [[nodiscard]] bool whole_band(int band) const {
    return lost_in_band_[static_cast<size_t>(band)] == 0;
  }
  /// Returns true if a ray of the row that leaves the panel at x_mm is in an unchanged region.
  [[nodiscard]] bool at(int row, double x_mm) const {
    const int band = std::clamp(row / kBandRows, 0, bands_ - 1);
    const double column = std::floor((x_mm - x_first_) * columns_per_mm_);
    if (!(column >= 0.0 && column < columns_)) return false;
    return lost_[static_cast<size_t>(band) * static_cast<size_t>(columns_) +
                 static_cast<size_t>(column)] == 0;
  }

 private:
  /// In scene units; larger than the rounding errors of a scene a few hundred units wide.
  static constexpr double kMargin = 0.2;

  struct Patch {
    Interval x_mm, y_mm;
  };
  void mark_all_changed() {
    std::fill(lost_.begin(), lost_.end(), uint8_t{1});
    std::fill(lost_in_band_.begin(), lost_in_band_.end(), columns_);
    kept_ = 0;
  }
  /// Marks the old and new places of all changed objects as changed. Returns true if an object
  /// changed.
  bool mark_changes(const Scene& scene, const SoftLight& soft, const SceneObjects& before,
                    const SceneObjects& now) {
    Box everything;
    for (const SceneObjects* frame : {&before, &now})
      for (const SceneObjects::Object& object : frame->objects) everything.extend(object.box);
    const double around =
        soft.occlusion_samples > 0 ? soft.occlusion_distance_mm * scene.units_per_mm : 0.0;
    bool any_changed = false;
    for (size_t n = 0; n < now.objects.size(); ++n) {
      if (now.objects[n].made_of == before.objects[n].made_of) continue;
      any_changed = true;
      if (soft.environment_samples > 0 || !std::isfinite(around)) mark_all_changed();
      for (const SceneObjects* frame : {&before, &now}) {
        if (!any()) return true;
        const Box& box = frame->objects[n].box;
        mark_changed(box.widened(around + kMargin));
        for (const SceneLight& light : scene.lights)
          mark_shadow_changed(scene, box, light, soft, everything);
      }
    }
    return any_changed;
  }
  void mark_changed(const Box& box) {
    if (!box.empty()) mark_changed(seen_through(box));
  }
  void mark_changed(const Patch& patch) {
    const double first = (patch.x_mm.low - x_first_) * columns_per_mm_;
    const double last = (patch.x_mm.high - x_first_) * columns_per_mm_;
    if (!(first < columns_) || !(last >= 0.0)) return;
    const int begin = first > 0.0 ? static_cast<int>(first) : 0;
    const int end = last < columns_ ? static_cast<int>(last) + 1 : columns_;
    for (int band = 0; band < bands_; ++band) {
      const Interval& y_mm = band_y_mm_[static_cast<size_t>(band)];
      if (y_mm.high < patch.y_mm.low || y_mm.low > patch.y_mm.high) continue;
      for (int column = begin; column < end; ++column) {
        uint8_t& lost = lost_[static_cast<size_t>(band) * static_cast<size_t>(columns_) +
                              static_cast<size_t>(column)];
        if (lost != 0) continue;
        lost = 1;
        ++lost_in_band_[static_cast<size_t>(band)];
        --kept_;
      }
    }
  }
  /// Marks the region behind a box as seen from a light, in pieces, as far as there is content. For
  /// an area light, the region is extended sideways by the penumbra.
  void mark_shadow_changed(const Scene& scene, const Box& box, const SceneLight& light,
                           const SoftLight& soft, const Box& within) {
    constexpr int kPieces = 48;
    const double farthest = length(within.high - within.low);
    const bool is_sun = light.kind == Light::Kind::Directional;
    // The end of the shadow is expressed as a multiple of the distance from the light.
    double nearest = 1.0;
    if (!is_sun)
      nearest = length(max(max(box.low - light.position, Vec3{}), light.position - box.high));
    const double size = soft.shadow_samples == 0 ? 0.0
                        : is_sun ? std::tan(soft.sun_radius_degrees * std::numbers::pi / 180.0)
                                 : soft.light_radius_mm * scene.units_per_mm;
    if (!(nearest > size)) return mark_all_changed();
    const double whole_way = farthest / (nearest - size);
    for (int piece = 0; piece < kPieces; ++piece) {
      Box shadow;
      const double ends[] = {whole_way * piece / kPieces, whole_way * (piece + 1) / kPieces};
      for (const double way : ends)
        for (const Vec3& corner : box.corners())
          shadow.extend(corner + (is_sun ? light.direction : corner - light.position) * way);
      const Box all = within.widened(kMargin);
      shadow = shadow.widened(ends[1] * size + kMargin);
      mark_changed(Box{max(shadow.low, all.low), min(shadow.high, all.high)});
    }
  }
  /// Returns the region of the panel through which a box is visible. Projection from a point keeps
  /// lines straight, so the corners suffice; and the outermost viewing places bound the region for
  /// all places between them.
  [[nodiscard]] Patch seen_through(const Box& box) const {
    const double inverse_z = planes_.inverse_z();
    Patch patch;
    for (const Vec3& corner : box.corners()) {
      const Vec3 p = panel_from_scene_.point(corner);
      if (!extend_by_view({p.x, p.z}, inverse_z, eyes_, patch.x_mm))
        return {kEverywhere, kEverywhere};
      patch.y_mm.extend((p.y - planes_.eye_tan_y() * p.z) / (1.0 - p.z * inverse_z));
    }
    return patch;
  }

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
