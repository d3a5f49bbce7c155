// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/probes/probe.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "render/accel/denormals.h"
#include "render/accel/ray_stream.h"
#include "render/integrator/hole_guard.h"
#include "render/rays/primary_packets.h"
#include "render/scene/scene.h"
#include "render/shading/shading_tables.h"

namespace lenticule::bench {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

/// The distance between the rows of a typical panel.
constexpr double kStepMm = 0.1;

render::PathRay path_ray(const ProbeRay& ray) {
  return {.origin = ray.origin, .direction = ray.direction, .target = 0};
}

Vec3 lane(const float (&lanes)[3][render::kPacket], size_t k) {
  return {double{lanes[0][k]}, double{lanes[1][k]}, double{lanes[2][k]}};
}

ProbeHit probe_hit(const render::RayPacket& packet,
                   const render::shading_kernel::Surfaces& surfaces, size_t k) {
  if (packet.valid[k] == 0) return {};
  if (surfaces.active[k] == 0) return {.what = ProbeHit::What::Nothing, .distance = kFar};
  return {.what = ProbeHit::What::Surface,
          .distance = double{packet.rays.ray.tfar[k]},
          .point = lane(surfaces.point, k),
          .geometric_normal = lane(surfaces.geometric, k),
          .outer_side = surfaces.outer_side[k] != 0,
          .spawn_point = lane(surfaces.start, k),
          .geometry = packet.rays.hit.geomID[k],
          .primitive = packet.rays.hit.primID[k]};
}

}  // namespace

Probe::Probe(const render::Scene& scene) : scene_(scene) {}

uint64_t Probe::trace(std::span<const ProbeRay> rays, HoleGuard guard,
                      std::span<ProbeHit> hits) const {
  const render::FlushDenormals flush;
  render::FrameCounts counts;
  render::RayPacket packet;
  render::shading_kernel::Surfaces surfaces{};
  std::vector<render::PathRay> lanes;
  for (size_t begin = 0; begin < rays.size(); begin += render::kPacket) {
    lanes.clear();
    for (const ProbeRay& ray : rays.subspan(begin, std::min(render::kPacket, rays.size() - begin)))
      lanes.push_back(path_ray(ray));
    (void)load_packet(lanes, packet);
    intersect16(packet.valid, scene_.embree.get(), packet.rays, render::Coherence::Coherent);
    if (guard == HoleGuard::On) fill_holes(scene_, kStepMm, packet, counts);
    render::shading_kernel_for(best_isa())
        .find_surfaces(scene_.shading->tables(), &packet.rays.ray.org_x[0], packet.valid, surfaces);
    for (size_t k = 0; k < lanes.size(); ++k) hits[begin + k] = probe_hit(packet, surfaces, k);
  }
  return counts.filled_holes;
}

void Probe::leave(std::span<const ProbeHit> hits, std::span<const Vec3> directions,
                  std::span<uint8_t> blocked) const {
  const render::FlushDenormals flush;
  std::vector<render::ShadowRay> rays;
  std::vector<double> light(hits.size(), 0.0);
  for (size_t k = 0; k < hits.size(); ++k) {
    light[k] = hits[k].what == ProbeHit::What::Surface ? 0.0 : 1.0;
    if (hits[k].what != ProbeHit::What::Surface) continue;
    rays.push_back({.origin = hits[k].spawn_point,
                    .direction = directions[k],
                    .distance = kFar,
                    .light = 1.0,
                    .target = static_cast<uint32_t>(k)});
  }
  (void)add_unshadowed(scene_.embree.get(), rays, light);
  for (size_t k = 0; k < hits.size(); ++k) blocked[k] = light[k] == 0.0 ? 1 : 0;
}

std::vector<Vec3> Probe::corners(size_t mesh) const {
  const std::vector<Vec3f>& positions = scene_.meshes.at(mesh).positions;
  std::vector<Vec3> corners;
  for (size_t k = 0; k + 1 < positions.size(); ++k) corners.emplace_back(positions[k]);
  return corners;
}

struct PrimaryProbe::Impl {
  Impl(const render::Scene& committed, const optics::OpticalModel& model, Isa isa)
      : scene(committed), plan(model.rig()), packets(model, plan, isa), footprint(model, {}) {}

  const render::Scene& scene;
  render::TilePlan plan;
  render::PrimaryPackets packets;
  render::Footprint footprint;
};

PrimaryProbe::PrimaryProbe(const render::Scene& scene, const optics::OpticalModel& model, Isa isa)
    : impl_(std::make_unique<Impl>(scene, model, isa)) {}
PrimaryProbe::~PrimaryProbe() = default;

int PrimaryProbe::tiles() const {
  return impl_->plan.count();
}

bool PrimaryProbe::fast() const {
  return impl_->packets.fast();
}

void PrimaryProbe::lines(int tile_index, std::vector<Line>& out) const {
  const render::FlushDenormals flush;
  const render::Tile tile = impl_->plan.tile(tile_index);
  const Affine panel_from_scene = impl_->scene.scene_from_panel.inverse();
  render::PrimaryPackets::Maker maker(impl_->packets);
  std::vector<render::RayPacket> packets(1);
  init_packets(packets);
  maker.start(impl_->scene, tile, impl_->footprint);
  maker.prepare(packets);
  out.clear();
  for (int column = 0; column < tile.columns; ++column) {
    maker.columns(column, packets);
    for (size_t r = 0; r < render::kPacket; ++r) {
      if (packets[0].valid[r] == 0) continue;
      const render::PanelRay line = panel_ray(panel_from_scene, packets[0], r);
      out.push_back({.row = tile.row_begin + static_cast<int>(r),
                     .subpixel = impl_->plan.subpixel(tile, column, static_cast<int>(r)),
                     .x_mm = line.x_mm,
                     .y_mm = line.y_mm,
                     .tan_x = line.tan_x,
                     .tan_y = line.tan_y});
    }
  }
}

}  // namespace lenticule::bench
