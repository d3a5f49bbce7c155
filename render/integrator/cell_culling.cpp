// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/cell_culling.h"

#include <algorithm>
#include <bit>

#include "render/accel/lane_masks.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {

CellCulling::CellCulling(const RenderOptions& options, const SoftShader& soft)
    : kernel_(shading_kernel_for(options.isa)),
      enabled_(options.use_shaft_culling),
      samples_area_lights_(soft.samples_area_lights()),
      looks_around_(soft.looks_around()),
      sizes_(soft.sizes()),
      light_answers_(size_t{1} << kAnswersLog2),
      open_answers_(size_t{1} << kAnswersLog2),
      area_light_payoff_(static_cast<uint32_t>(options.soft.shadow_samples)),
      around_payoff_(static_cast<uint32_t>(options.soft.occlusion_samples)) {}

bool CellCulling::Payoff::worth_asking() {
  if (pause_ == 0) return true;
  --pause_;
  return false;
}

void CellCulling::Payoff::asked(bool packet_saved) {
  constexpr uint32_t kTrial = 128;
  constexpr uint32_t kLongestPause = 64 * kTrial;
  if (packet_saved) ++saved_;
  if (++asked_ < kTrial) return;
  // The pause grows, since a tile may differ from its neighbours, and a scene from other scenes.
  const bool pays = 2 * per_answer_ * saved_ >= kTrial;
  next_pause_ = pays ? kTrial : std::min(2 * next_pause_, kLongestPause);
  pause_ = pays ? 0 : next_pause_;
  asked_ = saved_ = 0;
}

void CellCulling::look_at(const Scene& scene, const RayPacket& packet,
                          const shading_kernel::Surfaces& surfaces, Cells& cells) {
  cells.point_lights = cells.area_lights = cells.around = cells.mirrored = false;
  if (!enabled_ || scene.shaft_cache == nullptr) return;
  if ((samples_area_lights_ || looks_around_) && soft_cache_ == nullptr)
    soft_cache_ = &scene.shaft_cache->with_sizes(sizes_);
  cells.point_lights = point_payoff_.worth_asking();
  cells.area_lights = samples_area_lights_ && area_light_payoff_.worth_asking();
  cells.around = looks_around_ && around_payoff_.worth_asking();
  cells.mirrored = surfaces.any_specular != 0 && mirrored_payoff_.worth_asking();
  if (!cells.point_lights && !cells.area_lights && !cells.around && !cells.mirrored) return;
  cells.packet = &packet;
  cells.surfaces = &surfaces;
  kernel_.group_cells(&packet.rays.ray.org_x[0], surfaces, cells.groups);
  for (int g = 0; g < cells.groups.count; ++g) {
    const auto r = static_cast<size_t>(cells.groups.first[g]);
    cells.numbers[g] = scene.shaft_cache->number(packet.rays.hit.geomID[r],
                                                 packet.rays.hit.primID[r], cells.groups.place[g]);
  }
}

KnownLanes CellCulling::point_light(const Scene& scene, const Cells& cells, size_t light,
                                    uint32_t wanted) {
  if (!cells.point_lights) return {};
  const KnownLanes known = known_lanes(*scene.shaft_cache, cells, light, wanted);
  point_payoff_.asked((known.lit | known.blocked) == wanted);
  return known;
}

KnownLanes CellCulling::area_light(const Cells& cells, size_t light, uint32_t wanted) {
  if (!cells.area_lights) return {};
  const KnownLanes known = known_lanes(*soft_cache_, cells, light, wanted);
  area_light_payoff_.asked((known.lit | known.blocked) == wanted);
  return known;
}

uint32_t CellCulling::open_around(const Cells& cells) {
  if (!cells.around) return 0;
  uint32_t lanes = 0;
  for (int g = 0; g < cells.groups.count; ++g)
    if (open(*soft_cache_, cells, g, ShaftCache::kAround)) lanes |= cells.groups.lanes[g];
  around_payoff_.asked(lanes == lane_bits(cells.surfaces->active));
  return lanes;
}

uint32_t CellCulling::open_mirrored(const Scene& scene, const Cells& cells,
                                    const shading_kernel::NewRays& rays, uint32_t wanted) {
  if (!cells.mirrored) return 0;
  uint32_t lanes = 0;
  for (int g = 0; g < cells.groups.count; ++g) {
    uint64_t last = ShaftCache::kTargets;
    bool last_open = false;
    for (uint32_t left = cells.groups.lanes[g] & wanted; left != 0; left &= left - 1) {
      const int r = std::countr_zero(left);
      const uint64_t target = ShaftCache::direction_target(rays.bin_u[r], rays.bin_v[r]);
      if (target != last) last_open = open(*scene.shaft_cache, cells, g, target);
      last = target;
      if (last_open) lanes |= 1U << r;
    }
  }
  mirrored_payoff_.asked(lanes == wanted);
  return lanes;
}

KnownLanes CellCulling::known_lanes(ShaftCache& shaft_cache, const Cells& cells, size_t light,
                                    uint32_t wanted) {
  const shading_kernel::CellGroups& groups = cells.groups;
  KnownLanes known;
  for (int g = 0; g < groups.count; ++g) {
    if ((groups.lanes[g] & wanted) == 0) continue;
    const ShaftResult result = light_result(shaft_cache, cells, g, light);
    known.lit |= result == ShaftResult::Empty ? groups.lanes[g] : 0;
    known.blocked |= result == ShaftResult::Blocked ? groups.lanes[g] : 0;
  }
  return {.lit = known.lit & wanted, .blocked = known.blocked & wanted};
}

ShaftResult CellCulling::light_result(ShaftCache& shaft_cache, const Cells& cells, int group,
                                      size_t light) {
  const uint64_t number = cells.numbers[group];
  const auto ask = [&] {
    const auto lane = static_cast<size_t>(cells.groups.first[group]);
    return shaft_cache.result(cell_of(cells.packet->rays, *cells.surfaces, lane), number,
                              ShaftCache::light_target(light));
  };
  if (light >= kLightsPerCell) return ask();
  LightAnswers& known = light_answers_[ShaftCache::mixed(number, kAnswersLog2)];
  if (known.cell != number) known = {number, 0};
  const size_t shift = 2 * light;
  if (const uint32_t result = known.lights >> shift & 3; result != 0)
    return static_cast<ShaftResult>(result);
  const ShaftResult result = ask();
  known.lights |= static_cast<uint32_t>(result) << shift;
  return result;
}

/// Returns true if certainly no geometry lies in a bin of directions from the cell, or around the
/// cell.
bool CellCulling::open(ShaftCache& shaft_cache, const Cells& cells, int group, uint64_t target) {
  const uint64_t question = cells.numbers[group] * ShaftCache::kTargets + target;
  OpenAnswer& answer = open_answers_[ShaftCache::mixed(question, kAnswersLog2)];
  if (answer.question == question) return answer.empty;
  const auto lane = static_cast<size_t>(cells.groups.first[group]);
  const SurfaceCell cell = cell_of(cells.packet->rays, *cells.surfaces, lane);
  answer = {question, shaft_cache.result(cell, cells.numbers[group], target) == ShaftResult::Empty};
  return answer.empty;
}

}  // namespace lenticule::render
