// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/packet_tracer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "frames/srgb.h"
#include "render/accel/embree_packets.h"
#include "render/accel/lane_masks.h"
#include "render/integrator/depth_notes.h"
#include "render/scene/surface_groups.h"
#include "render/scene/texture.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {

RayCounts& RayCounts::operator+=(const RayCounts& other) {
  primary += other.primary;
  secondary += other.secondary;
  shadow += other.shadow;
  ambient += other.ambient;
  ambient_proved += other.ambient_proved;
  invalid += other.invalid;
  holes += other.holes;
  shadow_proved += other.shadow_proved;
  shadow_blocked += other.shadow_blocked;
  secondary_proved += other.secondary_proved;
  secondary_too_weak += other.secondary_too_weak;
  too_little += other.too_little;
  return *this;
}

void RayCounts::report(RenderStatistics& statistics) const {
  statistics.primary_rays = primary;
  statistics.shadow_rays = shadow;
  statistics.secondary_rays = secondary;
  statistics.ambient_rays = ambient;
  statistics.ambient_rays_proved = ambient_proved;
  statistics.invalid_rays = invalid;
  statistics.suspected_holes = holes.suspected;
  statistics.filled_holes = holes.filled;
  statistics.shadow_rays_proved = shadow_proved;
  statistics.shadow_rays_blocked = shadow_blocked;
  statistics.secondary_rays_proved = secondary_proved;
  statistics.secondary_rays_too_weak = secondary_too_weak;
  statistics.rays_of_too_little = too_little;
}

namespace {

using sampling::Turn;
using shading_kernel::NewRays;
using shading_kernel::Surfaces;

static_assert(shading_kernel::kLanes == kPacket);

/// Packets per batch: few enough for rays and hits to stay in the first-level cache.
constexpr int kFewPackets = 8;
static_assert(TilePlan::kColumns % kFewPackets == 0);

/// Computes the surface of one lane in double precision (render/shading/surface.h): near the
/// critical angle, refraction amplifies the rounding errors of single precision.
Surface exact_surface(const Scene& scene, const RayPacket& packet, int channel, size_t r,
                      Vec3& direction) {
  const RTCRay16& ray = packet.rays.ray;
  const Vec3 way{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
  direction = normalized(way);
  return surface_at(scene,
                    {.origin = {double{ray.org_x[r]}, double{ray.org_y[r]}, double{ray.org_z[r]}},
                     .direction = direction,
                     .channel = channel},
                    {.geometry = packet.rays.hit.geomID[r],
                     .primitive = packet.rays.hit.primID[r],
                     .distance = static_cast<float>(double{ray.tfar[r]} * length(way))});
}

void apply_textures(const Scene& scene, const RayPacket& packet, Surfaces& s) {
  for (size_t r = 0; r < kPacket; ++r) {
    if (s.active[r] == 0) continue;
    const GeometryEntry& entry = scene.geometries[packet.rays.hit.geomID[r]];
    const int texture = scene.materials[static_cast<size_t>(s.material[r])].texture;
    if (texture < 0 || entry.kind != GeometryEntry::Kind::Mesh) continue;
    s.colour[r] *= static_cast<float>(
        texture_of_mesh(*scene.textures[static_cast<size_t>(texture)], scene.meshes[entry.mesh],
                        packet.rays.hit.primID[r], {double{s.u[r]}, double{s.v[r]}}, s.channel[r]));
  }
}

struct alignas(64) Weights : std::array<float, kPacket> {};
constexpr Weights all_of(float weight) {
  Weights weights{};
  for (float& w : weights) w = weight;
  return weights;
}
constexpr Weights kWhole = all_of(1.0F);

uint8_t code_of_light(float light) {
  return frames::code_from_linear(double{light});
}

}  // namespace

struct PacketTracer::Generation {
  uint32_t path = sampling::kFirstPath;
  Surfaces surfaces;
  Cells cells;
  RayPacket mirrored;
  RayPacket refracted;
  NewRays mirrored_rays;
  NewRays refracted_rays;
};

struct PacketTracer::Colours {
  std::array<int32_t, kPacket> channel;
  std::array<float, kPacket> backdrop;
};

PacketTracer::Colours PacketTracer::colours_of(const Scene& scene, const TilePlan& plan,
                                               const Tile& tile, int column) {
  Colours colours;
  for (size_t row = 0; row < kPacket; ++row) {
    // Subpixels to the left of the panel have negative numbers.
    const int channel = (plan.subpixel(tile, column, static_cast<int>(row)) % 3 + 3) % 3;
    colours.channel[row] = channel;
    colours.backdrop[row] = static_cast<float>(component(scene.backdrop.colour, channel));
  }
  return colours;
}

PacketTracer::PacketTracer(const RenderOptions& options)
    : kernel_(shading_kernel_for(options.isa)),
      soft_(options.soft, options.isa),
      is_soft_(options.soft.any()),
      primary_(kFewPackets),
      generations_(static_cast<size_t>(options.max_depth) + 1),
      use_proofs_(options.use_shaft_proofs),
      // The light from a sampled environment has no upper bound, so weak rays cannot be skipped.
      skip_weak_(options.skip_weak_rays && options.samples == 1 &&
                 options.soft.environment_samples == 0),
      cells_(size_t{1} << kAnswersLog2),
      answers_(size_t{1} << kAnswersLog2),
      lamp_payoff_(static_cast<uint32_t>(options.soft.shadow_samples)),
      around_payoff_(static_cast<uint32_t>(options.soft.occlusion_samples)),
      clock_(options.measure_work) {
  init_packets(primary_);
  for (Generation& generation : generations_) {
    init_packets({&generation.mirrored, 1});
    init_packets({&generation.refracted, 1});
  }
  const RTCRay16& harmless = primary_.front().rays.ray;
  lanes_.shadow = harmless;
}

PacketTracer::~PacketTracer() = default;
PacketTracer::PacketTracer(PacketTracer&&) noexcept = default;

RayCounts PacketTracer::counts() const {
  RayCounts all = counts_;
  const SoftShader::Counts& soft = soft_.counts();
  all.shadow += soft.shadow;
  all.shadow_proved += soft.shadow_proved;
  all.shadow_blocked += soft.shadow_blocked;
  all.ambient += soft.ambient;
  all.ambient_proved += soft.ambient_proved;
  all.invalid += soft.invalid;
  return all;
}

bool PacketTracer::Payoff::worth_asking() {
  if (pause_ == 0) return true;
  --pause_;
  return false;
}

void PacketTracer::Payoff::asked(bool packet_saved) {
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

void PacketTracer::trace(const Scene& scene, const TilePlan& plan, const Tile& tile,
                         ColumnRange columns, FootprintSample sample, PrimaryPackets::Maker& maker,
                         std::span<float> light) {
  alignas(64) std::array<float, kPacket> weights;
  weights.fill(static_cast<float>(sample.weight));
  maker.prepare(primary_);
  // The colours of a column's lanes repeat every three columns.
  std::array<Colours, 3> colours;
  for (int k = 0; k < 3; ++k) colours[static_cast<size_t>(k)] = colours_of(scene, plan, tile, k);
  for (int column = columns.begin; column < columns.end; column += kFewPackets) {
    clock_.turn_to(Work::MakeRays);
    maker.columns(column, primary_);
    for (int k = 0; k < kFewPackets; ++k) {
      RayPacket& packet = primary_[static_cast<size_t>(k)];
      const Colours& of_column = colours[static_cast<size_t>((column + k) % 3)];
      if (is_soft_) seed_column(plan, tile, column + k, sample.number);
      trace_packet(scene, plan.row_mm(), of_column, weights.data(), packet);
      if (sample.depths != nullptr) sample.depths->note(column + k, packet);
      float* out = light.data() + column + k;
      for (size_t row = 0; row < kPacket; ++row)
        out[row * static_cast<size_t>(tile.columns)] += lanes_.light[row];
    }
  }
}

void PacketTracer::seed_column(const TilePlan& plan, const Tile& tile, int column, int sample) {
  for (size_t r = 0; r < kPacket; ++r) {
    const int row = static_cast<int>(r);
    lanes_.seed[r] =
        sampling::subpixel_seed(tile.row_begin + row, plan.subpixel(tile, column, row), sample);
  }
}

void PacketTracer::set_seeds(std::span<const uint32_t, kPacket> seeds) {
  std::copy_n(seeds.data(), kPacket, lanes_.seed);
}

PacketTracer::Colours PacketTracer::colours_of(const Scene& scene,
                                               std::span<const int32_t, kPacket> channel) {
  Colours colours;
  for (size_t r = 0; r < kPacket; ++r) {
    colours.channel[r] = channel[r];
    colours.backdrop[r] = static_cast<float>(component(scene.backdrop.colour, channel[r]));
  }
  return colours;
}

void PacketTracer::trace_lanes(const Scene& scene, const TilePlan& plan,
                               std::span<const int32_t, kPacket> channel, RayPacket& packet,
                               std::span<float, kPacket> light) {
  trace_packet(scene, plan.row_mm(), colours_of(scene, channel), kWhole.data(), packet);
  std::copy_n(lanes_.light, kPacket, light.data());
}

void PacketTracer::trace_noting(const Scene& scene, const TilePlan& plan,
                                std::span<const int32_t, kPacket> channel,
                                const SurfaceGroups& groups, float noticed, RayPacket& packet,
                                std::span<float, kPacket> light) {
  groups_ = &groups;
  noticed_ = noticed;
  notes_ = {};
  traced_.clear();
  memory_ = Memory::Writes;
  trace_lanes(scene, plan, channel, packet, light);
  note_secondary();
  memory_ = Memory::Off;
  groups_ = nullptr;
}

namespace {

/// Transposes a bit mask of lights per lane to a bit mask of lanes per light.
void by_light(std::span<const uint32_t, kPacket> of_lanes,
              std::span<uint32_t, PacketTracer::Known::kLights> lanes) {
  uint32_t any = 0;
  for (const uint32_t of_lane : of_lanes) any |= of_lane;
  std::fill(lanes.begin(), lanes.end(), 0U);
  for (uint32_t left = any; left != 0; left &= left - 1) {
    const uint32_t light = left & (0U - left);
    int has[kPacket];
    for (size_t r = 0; r < kPacket; ++r) has[r] = (of_lanes[r] & light) != 0 ? -1 : 0;
    lanes[static_cast<size_t>(std::countr_zero(light))] = lane_bits(has);
  }
}

}  // namespace

void PacketTracer::Known::set_lights(std::span<const uint32_t, kPacket> shining,
                                     std::span<const uint32_t, kPacket> not_seen) {
  by_light(shining, lit);
  by_light(not_seen, hidden);
}

void PacketTracer::trace_known(const Scene& scene, std::span<const int32_t, kPacket> channel,
                               const Known& known, RayPacket& packet,
                               std::span<float, kPacket> light, bool again) {
  known_ = &known;
  memory_ = again ? Memory::Reads : Memory::Off;
  recalled_ = 0;
  clock_.turn_to(Work::Shade);
  set_colours(colours_of(scene, channel));
  std::fill_n(notes_.secondary, kPacket, 0.0F);
  shade(scene, packet, kWhole.data(), 0);
  known_ = nullptr;
  memory_ = Memory::Off;
  note_secondary();
  std::copy_n(lanes_.light, kPacket, light.data());
}

void PacketTracer::trace_packet(const Scene& scene, double row_mm, const Colours& colours,
                                const float* weight, RayPacket& packet) {
  clock_.turn_to(Work::TracePrimary);
  intersect16(packet.valid, scene.embree.get(), packet.rays, Coherence::Coherent);
  fill_holes(scene, row_mm, packet, counts_.holes);
  clock_.turn_to(Work::Shade);
  counts_.primary += count_lanes(packet.valid);
  set_colours(colours);
  shade(scene, packet, weight, 0);
}

void PacketTracer::set_colours(const Colours& colours) {
  std::copy_n(colours.channel.data(), kPacket, lanes_.channel);
  std::copy_n(colours.backdrop.data(), kPacket, lanes_.backdrop);
  std::fill_n(lanes_.light, kPacket, 0.0F);
  std::fill_n(lanes_.leeway, kPacket, tolerated_);
}

void PacketTracer::shade(const Scene& scene, const RayPacket& packet, const float* weight,
                         size_t depth) {
  Generation& generation = generations_[depth];
  Surfaces& surfaces = generation.surfaces;
  std::copy_n(lanes_.channel, kPacket, surfaces.channel);
  const bool met = kernel_.find_surfaces(scene.shading->tables(), &packet.rays.ray.org_x[0],
                                         packet.valid, surfaces);
  add_backdrop(scene, packet, weight, lane_bits(packet.valid) & ~lane_bits(surfaces.active));
  if (!met) return;
  if (groups_ != nullptr) note_surfaces(packet, surfaces, weight, depth);
  if (surfaces.any_textured) apply_textures(scene, packet, surfaces);
  const Asking ask = worth_asking(scene, surfaces);
  if (ask.any()) find_cells(scene, packet, surfaces, generation.cells);
  const Asker asker{packet, generation};
  add_own_light(scene, asker, weight, ask.around, depth);
  add_lights(scene, asker, weight, ask, depth);
  if (depth == 0) {
    if (groups_ != nullptr || known_ != nullptr)
      std::copy_n(lanes_.light, kPacket, notes_.secondary);  // subtracted at the end
    if (known_ != nullptr) weight = add_known_secondary(weight);
  }
  if (depth + 1 == generations_.size()) return;
  if (!surfaces.any_specular && !surfaces.any_transmits) return;
  NewRays& rays = generation.mirrored_rays;
  rays.packet = &generation.mirrored.rays.ray.org_x[0];
  rays.valid = generation.mirrored.valid;
  const bool any = kernel_.mirrored_rays(surfaces, weight, rays);
  counts_.invalid += static_cast<uint64_t>(rays.refused);
  if (surfaces.any_transmits) return follow_glass(scene, packet, generation, weight, depth);
  if (!any) return;
  const Coherence coherence = coherence_of(generation.mirrored.valid, generation.mirrored.rays.ray);
  if (skip_weak_ && glass_above_ == 0 && scene.shading->light_only_adds())
    leave_out_weak(scene, rays, depth);
  // Done before the culling queries, which are made only while they pay off.
  leave_out_little(rays, generation.mirrored.valid);
  if (ask.mirrored) {
    const uint32_t open = take_open(scene, asker, rays, generation.mirrored.valid);
    mirrored_payoff_.asked(!any_lane(generation.mirrored.valid));
    counts_.secondary += static_cast<uint64_t>(std::popcount(open));
    add_backdrop(scene, generation.mirrored, rays.weight, open);
  }
  follow(scene, rays, generation.mirrored, coherence, depth, Turn::Mirrored);
}

PacketTracer::Asking PacketTracer::worth_asking(const Scene& scene, const Surfaces& met) {
  if (!use_proofs_ || scene.proofs == nullptr) return {};
  if (is_soft_ && soft_proofs_ == nullptr) soft_proofs_ = &scene.proofs->with_sizes(soft_.sizes());
  return {.points = shadow_payoff_.worth_asking(),
          .lamps = soft_.samples_lamps() && lamp_payoff_.worth_asking(),
          .around = soft_.looks_around() && around_payoff_.worth_asking(),
          .mirrored = met.any_specular != 0 && mirrored_payoff_.worth_asking()};
}

void PacketTracer::add_own_light(const Scene& scene, const Asker& asker, const float* weight,
                                 bool ask, size_t depth) {
  const Surfaces& surfaces = asker.generation.surfaces;
  if (!soft_.samples_ambient())
    return kernel_.add_own_light(scene.shading->tables(), surfaces, weight, lanes_.light);
  uint32_t open_lanes = 0;
  if (ask) {
    const shading_kernel::CellGroups& groups = asker.generation.cells.groups;
    for (int g = 0; g < groups.count; ++g)
      if (open(*soft_proofs_, asker, g, ShaftProofs::kAround)) open_lanes |= groups.lanes[g];
    around_payoff_.asked(open_lanes == lane_bits(surfaces.active));
  }
  const bool is_first = depth == 0;
  KnownShare known;
  if (known_ != nullptr && is_first) known = known_->around;
  const uint32_t path = generations_[depth].path;
  recall_share(path, kAllAround, known);
  alignas(64) std::array<float, kPacket> ambient;
  soft_.find_ambient(soft_packet(scene, asker.generation), open_lanes, known, weight,
                     lanes_.backdrop, ambient.data(), clock_);
  if (soft_.shares(scene)) remember_share(path, kAllAround, soft_.share());
  if (groups_ != nullptr && is_first) note_shares(soft_.share(), notes_.around);
  kernel_.add_own_light_under(ambient.data(), surfaces, weight, lanes_.light);
}

SoftPacket PacketTracer::soft_packet(const Scene& scene, const Generation& generation) const {
  return {
      .scene = scene,
      .surfaces = generation.surfaces,
      .seeds = std::span<const uint32_t, kPacket>(lanes_.seed),
      .path = generation.path,
      // Noted surfaces serve many subpixels, which would then share the same noise, so no light is
      // ignored there.
      .noticed = groups_ != nullptr && &generation == &generations_.front() ? 0.0F : tolerated_};
}

/// Called when lanes_.light holds all light of a subpixel except that of the mirrored rays, so that
/// the missing light lies between zero and the brightest light that the scene can send.
void PacketTracer::leave_out_weak(const Scene& scene, NewRays& rays, size_t depth) {
  const int generations = static_cast<int>(generations_.size() - depth) - 2;
  const float most = scene.shading->most_light(generations);
  const auto code = scene.colour_managed ? code_of_light : frames::code_from_encoded;
  constexpr float kNotWorthAsking = 1.0F / 16;
  for (size_t r = 0; r < kPacket; ++r) {
    const float now = lanes_.light[r];
    const float later = now + rays.weight[r] * most;
    const bool perhaps = rays.valid[r] != 0 && (now >= 1.0F || later - now < kNotWorthAsking);
    if (!perhaps || code(now) != code(later)) continue;
    rays.valid[r] = 0;
    ++counts_.secondary_too_weak;
  }
}

void PacketTracer::leave_out_little(const NewRays& rays, int* valid) {
  if (!(tolerated_ > 0.0F)) return;
  const uint32_t left_out =
      kernel_.leave_out(tolerated_, rays.weight, valid, lanes_.leeway, lanes_.light);
  counts_.too_little += static_cast<uint64_t>(std::popcount(left_out));
}

/// Adds the backdrop's light for the rays of `lanes`, which met nothing.
void PacketTracer::add_backdrop(const Scene& scene, const RayPacket& packet, const float* weight,
                                uint32_t lanes) {
  if (lanes == 0) return;
  if (scene.backdrop.flat()) {
    for (size_t r = 0; r < kPacket; ++r)
      lanes_.light[r] += (lanes & kLaneBit[r]) != 0 ? weight[r] * lanes_.backdrop[r] : 0.0F;
    return;
  }
  for (uint32_t left = lanes; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    const RTCRay16& ray = packet.rays.ray;
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    lanes_.light[r] += weight[r] * static_cast<float>(backdrop_light(
                                       scene.backdrop, normalized(direction), lanes_.channel[r]));
  }
}

void PacketTracer::add_lights(const Scene& scene, const Asker& asker, const float* weight,
                              Asking ask, size_t depth) {
  NewRays rays;
  rays.packet = &lanes_.shadow.org_x[0];
  rays.valid = lanes_.shadow_valid;
  const std::vector<shading_kernel::Light>& lights = scene.shading->lights();
  for (size_t light = 0; light < lights.size(); ++light) {
    if (soft_.samples(lights[light])) {
      add_soft_light(scene, asker, light, weight, ask.lamps, depth);
      continue;
    }
    const bool any = kernel_.shadow_rays(lights[light], asker.generation.surfaces, weight, rays);
    counts_.invalid += static_cast<uint64_t>(rays.refused);
    if (!any) continue;
    const Coherence coherence = coherence_of(rays.valid, lanes_.shadow);
    uint32_t lit = known_ != nullptr && depth == 0 ? take_known(light, rays.valid) : 0;
    leave_out_little(rays, rays.valid);
    const uint32_t wanted = lit | lane_bits(rays.valid);
    counts_.shadow += static_cast<uint64_t>(std::popcount(wanted));
    if (ask.points) lit |= take_lit(scene, asker, light, rays.valid);
    const bool some_left = any_lane(rays.valid);
    if (ask.points) shadow_payoff_.asked(!some_left);
    const uint32_t reached = lit | (some_left ? trace_shadows(scene, light, coherence, depth) : 0);
    kernel_.add_light(reached, rays.weight, lanes_.light);
    if (groups_ != nullptr) note_shadows(rays.weight, wanted, reached, light, depth);
  }
}

/// Tests the lamp's centre against the surface; the lamp's rim may lie on the other side.
void PacketTracer::add_soft_light(const Scene& scene, const Asker& asker, size_t light,
                                  const float* weight, bool ask, size_t depth) {
  KnownLanes known;
  NewRays to_middle;
  to_middle.packet = &lanes_.shadow.org_x[0];
  to_middle.valid = lanes_.shadow_valid;
  if (ask && kernel_.shadow_rays(scene.shading->lights()[light], asker.generation.surfaces, weight,
                                 to_middle)) {
    const uint32_t wanted = lane_bits(to_middle.valid);
    known = known_lanes(scene, asker, light, wanted);
    lamp_payoff_.asked((known.lit | known.blocked) == wanted);
  }
  KnownShare shares;
  if (known_ != nullptr && depth == 0 && light < Known::kLights) {
    known.lit |= known_->lit[light];
    known.blocked |= known_->hidden[light];
    if (light < kLamps) shares = known_->seen[light];
    shares.set(known_->lit[light], 1.0F);
    shares.set(known_->hidden[light], 0.0F);
  }
  const uint32_t path = generations_[depth].path;
  const auto what = static_cast<uint32_t>(light);
  if (soft_.integrates_lamps()) recall_share(path, what, shares);
  const LampSeen seen = soft_.add_lamp(soft_packet(scene, asker.generation), light, known, shares,
                                       weight, lanes_.light, clock_);
  remember_share(path, what, seen.share);
  if (groups_ != nullptr) note_lamp(seen, light, depth);
}

namespace {

uint32_t mixed(uint32_t path, uint32_t what) {
  uint32_t key = path * 0x9e3779b9U ^ (what + 1) * 0x85ebca6bU;
  key ^= key >> 15;
  key *= 0x2c1b3c6dU;
  return key ^ key >> 13;
}

}  // namespace

void PacketTracer::note_surfaces(const RayPacket& packet, const Surfaces& surfaces,
                                 const float* weight, size_t depth) {
  uint32_t* way = depth == 0 ? notes_.way : notes_.secondary_way;
  const uint32_t path = generations_[depth].path;
  for (size_t r = 0; r < kPacket; ++r) {
    if (surfaces.active[r] == 0 || (depth > 0 && weight[r] < noticed_)) continue;
    way[r] += mixed(path, groups_->of(packet.rays.hit.geomID[r], packet.rays.hit.primID[r]));
  }
}

/// Notes shadows only for lights in front of a surface that contribute noticeably; other shadows
/// are invisible.
void PacketTracer::note_shadows(const float* brings, uint32_t wanted, uint32_t reached,
                                size_t light, size_t depth) {
  uint32_t* way = depth == 0 ? notes_.way : notes_.secondary_way;
  const uint32_t path = generations_[depth].path;
  for (uint32_t left = wanted & ~reached; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    if (brings[r] >= noticed_) way[r] += mixed(~path, static_cast<uint32_t>(light));
  }
  if (depth > 0 || light >= Known::kLights) return;
  for (uint32_t r = 0; r < kPacket; ++r) {
    notes_.lit[r] |= (reached >> r & 1) << light;
    notes_.hidden[r] |= ((wanted & ~reached) >> r & 1) << light;
  }
}

/// Notes a penumbra only as "partly lit": the light values themselves distinguish penumbrae.
void PacketTracer::note_lamp(const LampSeen& seen, size_t light, size_t depth) {
  uint32_t* way = depth == 0 ? notes_.way : notes_.secondary_way;
  const uint32_t path = generations_[depth].path;
  constexpr uint32_t kPartly = 0x1000;
  const auto number = static_cast<uint32_t>(light);
  for (uint32_t r = 0; r < kPacket; ++r) {
    const uint32_t bit = 1U << r;
    if ((seen.none & bit) != 0) way[r] += mixed(~path, number);
    if ((seen.share.lanes & ~(seen.all | seen.none) & bit) != 0)
      way[r] += mixed(~path, number + kPartly);
    if (depth > 0 || light >= Known::kLights) continue;
    notes_.lit[r] |= (seen.all >> r & 1) << light;
    notes_.hidden[r] |= (seen.none >> r & 1) << light;
  }
  if (depth == 0 && light < kLamps) note_shares(seen.share, notes_.seen[light]);
}

void PacketTracer::note_shares(const KnownShare& shares, float* notes) {
  for (size_t r = 0; r < kPacket; ++r)
    notes[r] = (shares.lanes & kLaneBit[r]) != 0 ? shares.share[r] : kNoShare;
}

void PacketTracer::note_secondary() {
  for (size_t r = 0; r < kPacket; ++r) {
    notes_.secondary[r] = lanes_.light[r] - notes_.secondary[r];
    notes_.way[r] += notes_.secondary_way[r];
  }
}

uint32_t PacketTracer::take_known(size_t light, int* valid) const {
  if (light >= Known::kLights) return 0;
  const uint32_t wanted = lane_bits(valid);
  const uint32_t lit = known_->lit[light] & wanted;
  take_lanes(lit | (known_->hidden[light] & wanted), valid);
  return lit;
}

const float* PacketTracer::add_known_secondary(const float* weight) {
  kernel_.add_light(known_->secondary_lanes, known_->secondary, lanes_.light);
  for (size_t r = 0; r < kPacket; ++r)
    weight_left_[r] = (known_->secondary_lanes & kLaneBit[r]) != 0 ? 0.0F : weight[r];
  return weight_left_;
}

void PacketTracer::find_cells(const Scene& scene, const RayPacket& packet, const Surfaces& s,
                              Cells& cells) {
  kernel_.group_cells(&packet.rays.ray.org_x[0], s, cells.groups);
  for (int g = 0; g < cells.groups.count; ++g) {
    const auto r = static_cast<size_t>(cells.groups.first[g]);
    cells.numbers[g] = scene.proofs->number(packet.rays.hit.geomID[r], packet.rays.hit.primID[r],
                                            cells.groups.place[g]);
  }
}

ShaftProof PacketTracer::light_proof(const Scene& scene, const Asker& asker, int group,
                                     size_t light) {
  const Cells& cells = asker.generation.cells;
  const uint64_t number = cells.numbers[group];
  const auto ask = [&] {
    const auto lane = static_cast<size_t>(cells.groups.first[group]);
    ShaftProofs& proofs =
        soft_.samples(scene.shading->lights()[light]) ? *soft_proofs_ : *scene.proofs;
    return proofs.proof(cell_of(asker.packet.rays, asker.generation.surfaces, lane), number,
                        ShaftProofs::light_target(light));
  };
  if (light >= kLightsPerCell) return ask();
  CellAnswers& known = cells_[ShaftProofs::mixed(number, kAnswersLog2)];
  if (known.number != number) known = {number, 0};
  const size_t shift = 2 * light;
  if (const uint32_t proof = known.lights >> shift & 3; proof != 0)
    return static_cast<ShaftProof>(proof);
  const ShaftProof proof = ask();
  known.lights |= static_cast<uint32_t>(proof) << shift;
  return proof;
}

/// Returns true if certainly no geometry lies in a bin of directions from the cell, or around the
/// cell.
bool PacketTracer::open(ShaftProofs& proofs, const Asker& asker, int group, uint64_t target) {
  const Cells& cells = asker.generation.cells;
  const uint64_t question = cells.numbers[group] * ShaftProofs::kTargets + target;
  Answer& answer = answers_[ShaftProofs::mixed(question, kAnswersLog2)];
  if (answer.question == question) return answer.empty;
  const auto lane = static_cast<size_t>(cells.groups.first[group]);
  const SurfaceCell cell = cell_of(asker.packet.rays, asker.generation.surfaces, lane);
  answer = {question, proofs.proof(cell, cells.numbers[group], target) == ShaftProof::Empty};
  return answer.empty;
}

KnownLanes PacketTracer::known_lanes(const Scene& scene, const Asker& asker, size_t light,
                                     uint32_t wanted) {
  const shading_kernel::CellGroups& groups = asker.generation.cells.groups;
  KnownLanes known;
  for (int g = 0; g < groups.count; ++g) {
    if ((groups.lanes[g] & wanted) == 0) continue;
    const ShaftProof proof = light_proof(scene, asker, g, light);
    known.lit |= proof == ShaftProof::Empty ? groups.lanes[g] : 0;
    known.blocked |= proof == ShaftProof::Blocked ? groups.lanes[g] : 0;
  }
  return {.lit = known.lit & wanted, .blocked = known.blocked & wanted};
}

uint32_t PacketTracer::take_lit(const Scene& scene, const Asker& asker, size_t light, int* valid) {
  const KnownLanes known = known_lanes(scene, asker, light, lane_bits(valid));
  take_lanes(known.lit | known.blocked, valid);
  counts_.shadow_proved += static_cast<uint64_t>(std::popcount(known.lit));
  counts_.shadow_blocked += static_cast<uint64_t>(std::popcount(known.blocked));
  return known.lit;
}

uint32_t PacketTracer::take_open(const Scene& scene, const Asker& asker, const NewRays& rays,
                                 int* valid) {
  const shading_kernel::CellGroups& groups = asker.generation.cells.groups;
  const uint32_t wanted = lane_bits(valid);
  uint32_t empty = 0;
  for (int g = 0; g < groups.count; ++g) {
    uint64_t last = ShaftProofs::kTargets;
    bool last_empty = false;
    for (uint32_t left = groups.lanes[g] & wanted; left != 0; left &= left - 1) {
      const int r = std::countr_zero(left);
      const uint64_t target = ShaftProofs::direction_target(rays.bin_u[r], rays.bin_v[r]);
      if (target != last) last_empty = open(*scene.proofs, asker, g, target);
      last = target;
      if (last_empty) empty |= 1U << r;
    }
  }
  take_lanes(empty, valid);
  counts_.secondary_proved += static_cast<uint64_t>(std::popcount(empty));
  return empty;
}

/// Traces secondary rays of packets with transparent lanes. For lanes that met a transparent
/// surface, mirrored and refracted rays are made here, since total reflection moves light from the
/// refracted to the mirrored ray; other lanes keep the mirrored rays of ordinary packets.
void PacketTracer::follow_glass(const Scene& scene, const RayPacket& packet, Generation& generation,
                                const float* weight, size_t depth) {
  const Surfaces& s = generation.surfaces;
  NewRays& mirrored = generation.mirrored_rays;
  NewRays& refracted = generation.refracted_rays;
  const auto set = [&](RayPacket& rays, NewRays& brings, size_t r, Vec3 origin, Vec3 direction,
                       double part) {
    rays.valid[r] = 0;
    brings.weight[r] = weight[r] * static_cast<float>(part);
    set_lane(rays, r, {}, Vec3f(Vec3{0, 0, 1}));
    if (brings.weight[r] == 0.0F) return;
    if (!fit_for_embree(origin, direction)) {
      ++counts_.invalid;
      return;
    }
    rays.valid[r] = -1;
    set_lane(rays, r, Vec3f(origin), Vec3f(direction));
  };
  for (size_t r = 0; r < kPacket; ++r) {
    if (s.active[r] == 0 ||
        !(scene.materials[static_cast<size_t>(s.material[r])].transmittance > 0.0)) {
      set(generation.refracted, refracted, r, {}, {}, 0.0);
      continue;
    }
    Vec3 direction;
    const Surface surface = exact_surface(scene, packet, s.channel[r], r, direction);
    const Continuation on = continuation(surface, direction);
    set(generation.mirrored, mirrored, r, spawn_point(surface, Side::Viewer), on.mirror_direction,
        on.mirror_weight);
    set(generation.refracted, refracted, r, spawn_point(surface, Side::Far), on.transmit_direction,
        on.transmit_weight);
  }
  ++glass_above_;
  leave_out_little(mirrored, generation.mirrored.valid);
  follow(scene, mirrored, generation.mirrored, Coherence::Coherent, depth, Turn::Mirrored);
  --glass_above_;
  leave_out_little(refracted, generation.refracted.valid);
  follow(scene, refracted, generation.refracted, Coherence::Coherent, depth, Turn::Refracted);
}

PacketTracer::Traced* PacketTracer::remember(uint32_t path, uint32_t what, uint32_t lanes) {
  if (memory_ != Memory::Writes) return nullptr;
  Traced& noted = traced_.emplace_back();
  noted.path = path;
  noted.what = what;
  noted.lanes = lanes;
  return &noted;
}

/// Finds the stored hits of a packet. All colours send the same rays in the same order, except rays
/// with no weight in a colour: then stored packets are skipped, or lanes were not traced.
const PacketTracer::Traced* PacketTracer::recall(uint32_t path, uint32_t what) {
  if (memory_ != Memory::Reads) return nullptr;
  const auto same = [&](const Traced& t) { return t.path == path && t.what == what; };
  const auto found =
      std::find_if(traced_.begin() + static_cast<std::ptrdiff_t>(recalled_), traced_.end(), same);
  if (found == traced_.end()) return nullptr;
  recalled_ = static_cast<size_t>(found - traced_.begin()) + 1;
  return &*found;
}

void PacketTracer::remember_share(uint32_t path, uint32_t what, const KnownShare& share) {
  if (Traced* note = remember(path, what, share.lanes))
    std::copy_n(share.share.data(), kPacket, note->share);
}

/// Adds stored shares to the known ones, which keep precedence.
void PacketTracer::recall_share(uint32_t path, uint32_t what, KnownShare& known) {
  if (const Traced* found = recall(path, what))
    known.set(found->lanes & ~known.lanes, found->share);
}

uint32_t PacketTracer::trace_shadows(const Scene& scene, size_t light, Coherence coherence,
                                     size_t depth) {
  const uint32_t path = generations_[depth].path;
  const auto what = static_cast<uint32_t>(light);
  const int* valid = lanes_.shadow_valid;
  const uint32_t lanes = lane_bits(valid);
  if (const Traced* known = recall(path, what); known != nullptr && (lanes & ~known->lanes) == 0)
    return known->free & lanes;
  Traced* note = remember(path, what, lanes);
  clock_.turn_to(Work::TraceShadows);
  occluded16(valid, scene.embree.get(), lanes_.shadow, coherence);
  clock_.turn_to(Work::Shade);
  uint32_t free = 0;
  for (uint32_t r = 0; r < kPacket; ++r)
    if (valid[r] != 0 && lanes_.shadow.tfar[r] >= 0.0F) free |= 1U << r;
  if (note != nullptr) note->free = free;
  return free;
}

void PacketTracer::trace_secondary(const Scene& scene, RayPacket& packet, Coherence coherence,
                                   size_t depth) {
  const uint32_t path = generations_[depth + 1].path;
  RTCRayHit16& rays = packet.rays;
  const uint32_t lanes = lane_bits(packet.valid);
  if (const Traced* known = recall(path, kNotToLight);
      known != nullptr && (lanes & ~known->lanes) == 0) {
    std::copy_n(known->distance, kPacket, rays.ray.tfar);
    std::copy_n(known->geometry, kPacket, rays.hit.geomID);
    std::copy_n(known->primitive, kPacket, rays.hit.primID);
    return;
  }
  Traced* note = remember(path, kNotToLight, lanes);
  // Neighbouring rays diverge after two reflections at curved surfaces, and packet traversal is
  // slower.
  clock_.turn_to(Work::TraceSecondary);
  intersect16(packet.valid, scene.embree.get(), rays,
              depth == 0 ? coherence : Coherence::Incoherent);
  clock_.turn_to(Work::Shade);
  if (note == nullptr) return;
  std::copy_n(rays.ray.tfar, kPacket, note->distance);
  std::copy_n(rays.hit.geomID, kPacket, note->geometry);
  std::copy_n(rays.hit.primID, kPacket, note->primitive);
}

void PacketTracer::follow(const Scene& scene, NewRays& rays, RayPacket& packet, Coherence coherence,
                          size_t depth, Turn turn) {
  const uint64_t traced = count_lanes(packet.valid);
  if (traced == 0) return;
  counts_.secondary += traced;
  std::fill_n(packet.rays.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
  generations_[depth + 1].path = sampling::longer_path(generations_[depth].path, turn);
  trace_secondary(scene, packet, coherence, depth);
  shade(scene, packet, rays.weight, depth + 1);
}

}  // namespace lenticule::render
