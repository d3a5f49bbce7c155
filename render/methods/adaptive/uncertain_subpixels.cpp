// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/uncertain_subpixels.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "render/rays/panel_rays.h"
#include "render/scene/surface_groups.h"

namespace lenticule::render {
namespace {

/// Number of sheared columns whose subpixels are traced together, row by row.
constexpr size_t kTogether = 16;

/// Kinds of subpixels. Packets hold one kind if possible: a lane with secondary rays costs almost
/// as much as sixteen, and transparent surfaces are traced lane by lane.
constexpr size_t kWays = 3;
constexpr size_t kKinds = kWays * (ResolvedLight::kNoSamples + 1);
size_t kind_of(const UncertainSubpixels::Subpixel& s) {
  const size_t sampled = kWays * s.resolved.wanted;
  if (s.resolved.secondary_known) return sampled;
  return sampled + (SurfaceGroups::lets_light_through(s.group) ? 2 : 1);
}

}  // namespace

UncertainSubpixels::UncertainSubpixels(const RowPlanes& planes, const TilePlan& plan)
    : planes_(planes), plan_(plan), packet_(1) {
  init_packets(packet_);
  // Takes address space only, until a band needs it.
  for (std::vector<Subpixel>* list : {&subpixels_, &ordered_})
    list->reserve(static_cast<size_t>(plan.row_subpixels()) * TilePlan::kRows);
}

/// Orders subpixels by kind, then by group of sheared columns, then downwards, so that neighbouring
/// rays are close together.
void UncertainSubpixels::order() {
  const int lean = plan_.shift(TilePlan::kRows - 1);  // positive or negative
  const int first = std::min(lean, 0);
  const size_t across = static_cast<size_t>(plan_.row_subpixels() + std::abs(lean)) / kTogether + 1;
  const auto column = [&](const Subpixel& s) {
    return static_cast<size_t>(s.at + plan_.shift(s.row) - first) / kTogether + kind_of(s) * across;
  };
  const size_t columns = kKinds * across;
  first_of_column_.assign(columns + 1, 0);
  for (const Subpixel& s : subpixels_) ++first_of_column_[column(s) + 1];
  for (size_t n = 1; n <= columns; ++n) first_of_column_[n] += first_of_column_[n - 1];
  ordered_.resize(subpixels_.size());
  for (const Subpixel& s : subpixels_) ordered_[first_of_column_[column(s)]++] = s;
  subpixels_.swap(ordered_);
}

void UncertainSubpixels::find_planes(int first_row) {
  for (int row = 0; row < TilePlan::kRows; ++row)
    plane_of_row_[static_cast<size_t>(row)] =
        planes_.plane_at(first_row + row + planes_.height_in_row(0));
}

void UncertainSubpixels::load(const Scene& scene, double start_mm, size_t first) {
  for (size_t r = 0; r < kPacket; ++r) {
    // Idle lanes repeat the last ray.
    const Subpixel& s = subpixels_[std::min(first + r, subpixels_.size() - 1)];
    packet_[0].valid[r] = first + r < subpixels_.size() ? -1 : 0;
    channel_[r] = s.at % 3;
    const RowPlane& plane = plane_of_row_[s.row];
    set_panel_ray(scene, start_mm,
                  {.x_mm = double{s.x_mm},
                   .y_mm = plane.lens_y_mm,
                   .tan_x = double{s.tan_x},
                   .tan_y = plane.tan_y},
                  packet_[0], r);
  }
}

namespace {

const WideTriangle* wide_triangle_of(const Scene& scene, const UncertainSubpixels::Subpixel& s) {
  if (scene.wide_triangles.empty()) return nullptr;
  const GeometryEntry& entry = scene.geometries[s.geometry];
  if (entry.kind != GeometryEntry::Kind::Mesh) return nullptr;
  return scene.wide_triangle(scene.meshes[entry.mesh], s.primitive);
}

/// Computes the hit distance in double precision, since single precision is too coarse for cuts as
/// long as those of wide triangles.
void set_distance(const WideTriangle& triangle, RayPacket& packet, size_t r) {
  RTCRay16& ray = packet.rays.ray;
  const Vec3 origin{double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}};
  const Vec3 way{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
  const Roots roots = meet(triangle, origin, way);
  if (roots.count > 0 && roots.t[0] > 0.0) ray.tfar[r] = static_cast<float>(roots.t[0]);
}

}  // namespace

/// Sets the same seeds as method full.
void UncertainSubpixels::find_seeds(int first_row, size_t first) {
  for (size_t r = 0; r < kPacket; ++r) {
    const Subpixel& s = subpixels_[std::min(first + r, subpixels_.size() - 1)];
    seeds_[r] = sampling::subpixel_seed(first_row + s.row, s.at, 0);
  }
}

void UncertainSubpixels::load_surfaces(const Scene& scene, double start_mm, size_t first) {
  std::array<uint32_t, kPacket> lit, hidden;
  known_.secondary_lanes = known_.around.lanes = 0;
  for (KnownShare& seen : known_.seen) seen.lanes = 0;
  for (size_t r = 0; r < kPacket; ++r) {
    const Subpixel& s = subpixels_[std::min(first + r, subpixels_.size() - 1)];
    packet_[0].rays.ray.tfar[r] = static_cast<float>(start_mm) - s.z_mm;  // millimetres of z
    packet_[0].rays.hit.geomID[r] = s.geometry;
    packet_[0].rays.hit.primID[r] = s.primitive;
    if (const WideTriangle* wide = wide_triangle_of(scene, s)) set_distance(*wide, packet_[0], r);
    lit[r] = s.resolved.lit;
    hidden[r] = s.resolved.hidden;
    if (s.resolved.secondary_known) known_.secondary_lanes |= 1U << r;
    known_.secondary[r] = s.resolved.secondary;
    if (s.resolved.around_known) known_.around.lanes |= 1U << r;
    known_.around.share[r] = s.resolved.around;
    for (uint32_t left = s.resolved.area_lights_known; left != 0; left &= left - 1) {
      const auto area_light = static_cast<size_t>(std::countr_zero(left));
      known_.seen[area_light].lanes |= 1U << r;
      constexpr float kPart = 1.0F / ResolvedAreaLights::kWholeAreaLight;
      const ResolvedAreaLights& area_lights = area_lights_[s.resolved.area_lights];
      known_.seen[area_light].share[r] = kPart * static_cast<float>(area_lights.seen[area_light]);
      known_.seen[area_light].apart[r] = kPart * static_cast<float>(area_lights.apart[area_light]);
    }
  }
  known_.set_lights(lit, hidden);
}

void UncertainSubpixels::shade(const Scene& scene, double start_mm, int first_row,
                               NotingTracer& tracer) {
  order();
  find_planes(first_row);
  for (size_t first = 0; first < subpixels_.size(); first += kPacket) {
    load(scene, start_mm, first);
    if (tracer.needs_seeds()) {
      find_seeds(first_row, first);
      tracer.set_seeds(seeds_);
    }
    load_surfaces(scene, start_mm, first);
    tracer.trace_known(scene, plan_, channel_, known_, packet_[0], light_);
    const size_t count = std::min(kPacket, subpixels_.size() - first);
    for (size_t r = 0; r < count; ++r) subpixels_[first + r].light = light_[r];
  }
}

}  // namespace lenticule::render
