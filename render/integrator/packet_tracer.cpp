// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/packet_tracer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/error.h"
#include "base/lanes.h"
#include "frames/srgb.h"
#include "render/accel/ray_stream.h"
#include "render/integrator/light_cache.h"
#include "render/integrator/pbr_tracer.h"
#include "render/rays/primary_packets.h"
#include "render/scene/texture.h"
#include "render/shading/shading.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Thresholds in steps between neighbouring rays: distance by which a suspect ray must end farther
// than the nearer of its neighbours (kDrop), and farther than both (kSpike). Smooth surfaces seen
// at more than four degrees stay below both.
constexpr float kDrop = 16.0F;
constexpr float kSpike = 1.0F;

// Fractions of (largest coordinate + distance), in which single precision has a resolution of
// 2^-24: offset of the four test rays (kHair), and largest distance of the ray from a corner
// (kCorner). Rays that pass through pinholes pass within 2^-22.
constexpr double kHair = 0x1p-19;
constexpr double kCorner = 0x1p-20;
// Multiple of kHair: a hit sooner by more than this is on another surface, not on the slope of the
// same surface.
constexpr double kMuchSooner = 64.0;

// Four lanes: compilers generate poor code for wider vectors.
constexpr size_t kFour = 4;
using Floats = lanes::Vector<float, kFour>;
using Masks = lanes::Vector<int32_t, kFour>;

/// Returns the mask of the lanes that continue past the hits of their neighbours `before` and
/// `after`.
Masks stick_out(Floats t, Floats before, Floats after, float step) {
  const Masks is_before_nearer = before < after;
  const Floats nearer = is_before_nearer ? before : after;
  const Floats farther = is_before_nearer ? after : before;
  return (t > nearer + kDrop * step) | (t > farther + kSpike * step);
}

/// Returns a mask with bit r set if lane r continues past the hits of its neighbours.
uint32_t suspects(const RayPacket& packet, float step) {
  // Inactive lanes count as rays without a hit, as do those before the first and after the last.
  constexpr Floats kNone = {kInfinity, kInfinity, kInfinity, kInfinity};
  constexpr size_t kFours = kPacket / kFour;
  std::array<Floats, kFours + 2> t;
  std::array<Masks, kFours> valid;
  std::memcpy(valid.data(), packet.valid, sizeof valid);
  std::memcpy(&t[1], packet.rays.ray.tfar, sizeof valid);
  t.front() = t.back() = kNone;
  for (size_t k = 0; k < kFours; ++k) t[k + 1] = valid[k] ? t[k + 1] : kNone;
  for (size_t k = 0; k < kFours; ++k) {
    const Floats before = __builtin_shufflevector(t[k], t[k + 1], 3, 4, 5, 6);
    const Floats after = __builtin_shufflevector(t[k + 1], t[k + 2], 1, 2, 3, 4);
    valid[k] &= stick_out(t[k + 1], before, after, step);
  }
  alignas(16) int suspect[kPacket];
  std::memcpy(suspect, valid.data(), sizeof suspect);
  return lane_bits(suspect);
}

struct Line {
  Vec3 origin;
  Vec3 direction;  // unit
};

/// Returns a unit vector perpendicular to `unit`.
Vec3 across(Vec3 unit) {
  const Vec3 aside = std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  return normalized(cross(unit, aside));
}

RTCRayHit trace(const Scene& scene, const Line& line) {
  RTCRayHit found = single_ray(Vec3f(line.origin), Vec3f(line.direction), kInfinity);
  intersect1(scene.embree, found);
  return found;
}

bool passes_corner(const Scene& scene, const RTCHit& hit, const Line& line, double within) {
  const GeometryEntry& geometry = scene.geometries[hit.geomID];
  if (geometry.kind != GeometryEntry::Kind::Mesh) return false;
  const MeshShape& mesh = scene.meshes[geometry.mesh];
  const auto near = [&](uint32_t vertex) {
    const Vec3 from_origin = Vec3(mesh.positions[vertex]) - line.origin;
    return length(cross(from_origin, line.direction)) <= within;
  };
  return std::ranges::any_of(mesh.triangles[hit.primID], near);
}

/// Returns true if a ray ends sooner than `distance`.
bool ends_before(const RTCRayHit& ray, double distance) {
  return ray.hit.geomID != RTC_INVALID_GEOMETRY_ID && double{ray.ray.tfar} < distance;
}

/// SecondLook retraces one lane of a packet as a single ray.
class SecondLook {
 public:
  /// `reach` is the ray parameter at which the neighbours end.
  SecondLook(const Scene& scene, RayPacket& packet, size_t lane, double reach)
      : scene_(scene), packet_(packet), lane_(lane) {
    const RTCRay16& rays = packet.rays.ray;
    const Vec3 way{double{rays.dir_x[lane]}, double{rays.dir_y[lane]}, double{rays.dir_z[lane]}};
    const Vec3 from{double{rays.org_x[lane]}, double{rays.org_y[lane]}, double{rays.org_z[lane]}};
    stretch_ = length(way);
    line_ = {from, way / stretch_};
    size_ = largest_size(from) + reach * stretch_;
  }

  /// Returns true if the ray had passed through a pinhole; the lane then holds the repaired hit.
  bool fill() {
    const double hair = kHair * size_;
    const double much_sooner = double{packet_.rays.ray.tfar[lane_]} * stretch_ - kMuchSooner * hair;
    const Vec3 side = across(line_.direction) * hair;
    const Vec3 other_side = cross(line_.direction, side);
    const std::array<Vec3, 4> around = {side, -side, other_side, -other_side};
    std::array<RTCRayHit, 4> found;
    for (size_t k = 0; k < around.size(); ++k) {
      found[k] = trace(scene_, {line_.origin + around[k], line_.direction});
      if (!ends_before(found[k], much_sooner)) return false;
      // Traced alone, the ray may hit the surface that it missed in the packet.
      if (k != 0) continue;
      const RTCRayHit alone = trace(scene_, line_);
      if (ends_before(alone, much_sooner)) return take(alone);
    }
    for (const RTCRayHit& beside : found)
      if (passes_corner(scene_, beside.hit, line_, kCorner * size_)) return take(beside);
    return false;
  }

 private:
  bool take(const RTCRayHit& met) {
    packet_.rays.ray.tfar[lane_] = static_cast<float>(double{met.ray.tfar} / stretch_);
    packet_.rays.hit.geomID[lane_] = met.hit.geomID;
    packet_.rays.hit.primID[lane_] = met.hit.primID;
    return true;
  }

  const Scene& scene_;
  RayPacket& packet_;
  size_t lane_;
  Line line_;
  double stretch_ = 1.0;
  double size_ = 0.0;  ///< largest coordinate used to trace the ray up to `reach`
};

/// Returns the ray parameter of the nearer of a lane's neighbours.
double nearer_neighbour(const RayPacket& packet, size_t r) {
  float t = kInfinity;
  if (r > 0 && packet.valid[r - 1] != 0) t = std::min(t, packet.rays.ray.tfar[r - 1]);
  if (r + 1 < kPacket && packet.valid[r + 1] != 0) t = std::min(t, packet.rays.ray.tfar[r + 1]);
  return double{t};
}

}  // namespace

void fill_holes(const Scene& scene, double step_mm, RayPacket& packet, FrameCounts& counts) {
  const auto step = static_cast<float>(step_mm);
  uint32_t looked_at = 0;
  // A repaired lane can reveal a pinhole in the lane beside it.
  for (bool again = true; again;) {
    again = false;
    const uint32_t now = suspects(packet, step) & ~looked_at;
    if (now == 0) return;
    for (size_t r = 0; r < kPacket; ++r) {
      if ((now >> r & 1U) == 0) continue;
      ++counts.suspected_holes;
      if (!SecondLook(scene, packet, r, nearer_neighbour(packet, r)).fill()) continue;
      ++counts.filled_holes;
      again = true;
    }
    looked_at |= now;
  }
}

DepthRecorder::DepthRecorder(const Scene& scene) {
  const Affine panel_from_scene = scene.scene_from_panel.inverse();
  z_of_scene_ = Vec3f(
      Vec3{panel_from_scene.column_x.z, panel_from_scene.column_y.z, panel_from_scene.column_z.z});
  z_at_origin_ = static_cast<float>(panel_from_scene.origin.z);
}

void DepthRecorder::start(const Tile& tile) {
  columns_ = static_cast<size_t>(tile.columns);
  z_mm_.assign(columns_ * TilePlan::kRows, -std::numeric_limits<float>::infinity());
}

void DepthRecorder::note(int column, const RayPacket& packet) {
  const RTCRay16& ray = packet.rays.ray;
  for (size_t r = 0; r < kPacket; ++r) {
    if (packet.valid[r] == 0 || packet.rays.hit.geomID[r] == RTC_INVALID_GEOMETRY_ID) continue;
    const float t = ray.tfar[r];
    z_mm_[r * columns_ + static_cast<size_t>(column)] =
        z_at_origin_ + z_of_scene_.x * (ray.org_x[r] + t * ray.dir_x[r]) +
        z_of_scene_.y * (ray.org_y[r] + t * ray.dir_y[r]) +
        z_of_scene_.z * (ray.org_z[r] + t * ray.dir_z[r]);
  }
}

CellCulling::CellCulling(const RenderOptions& options)
    : kernel_(shading_kernel_for(options.isa)),
      enabled_(options.use_shaft_culling),
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

void CellCulling::look_at(const Scene& scene, const SoftShader& soft, const RayPacket& packet,
                          const shading_kernel::Surfaces& surfaces, Cells& cells) {
  cells.point_lights = cells.area_lights = cells.around = cells.mirrored = false;
  if (!enabled_ || scene.shaft_cache == nullptr) return;
  if ((soft.samples_area_lights() || soft.looks_around()) && soft_cache_ == nullptr)
    soft_cache_ = &scene.shaft_cache->with_sizes(soft.sizes(scene));
  cells.point_lights = point_payoff_.worth_asking();
  cells.area_lights = soft.samples_area_lights() && area_light_payoff_.worth_asking();
  cells.around = soft.looks_around() && around_payoff_.worth_asking();
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

namespace {

using sampling::Turn;
using shading_kernel::NewRays;
using shading_kernel::Surfaces;

static_assert(shading_kernel::kLanes == kPacket);

/// Packets per batch: few enough for rays and hits to stay in the first-level cache.
constexpr int kFewPackets = 8;
static_assert(TilePlan::kColumns % kFewPackets == 0);

/// Computes the surface of one lane in double precision (render/shading/shading.h): near the
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

uint8_t code_of_light(float light) { return frames::code_from_linear(double{light}); }

}  // namespace

struct PacketTracer::Generation {
  uint32_t path = sampling::kFirstPath;
  Surfaces surfaces;
  CellCulling::Cells cells;
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
    : isa_(options.isa),
      kernel_(shading_kernel_for(options.isa)),
      soft_(options.soft, options.isa),
      culling_(options),
      is_soft_(options.soft.any()),
      // The light from a sampled environment has no upper bound, so weak rays cannot be skipped.
      skip_weak_(options.skip_weak_rays && options.samples == 1 &&
                 options.soft.environment_samples == 0),
      primary_(kFewPackets),
      generations_(static_cast<size_t>(options.max_depth) + 1),
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

FrameCounts PacketTracer::counts() const {
  FrameCounts all = counts_;
  return all += soft_.counts();
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
      trace_packet(scene, plan, of_column, weights.data(), packet);
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
  trace_packet(scene, plan, colours_of(scene, channel), kWhole.data(), packet);
  std::copy_n(lanes_.light, kPacket, light.data());
}

void PacketTracer::shade_lanes(const Scene& scene, const TilePlan& plan,
                               std::span<const int32_t, kPacket> channel, const RayPacket& packet,
                               std::span<float, kPacket> light) {
  clock_.turn_to(Work::Shade);
  set_colours(colours_of(scene, channel));
  if (scene.pbr != nullptr)
    shade_pbr(scene, plan, packet, kWhole.data());
  else
    shade(scene, packet, kWhole.data(), 0);
  std::copy_n(lanes_.light, kPacket, light.data());
}

void PacketTracer::trace_packet(const Scene& scene, const TilePlan& plan, const Colours& colours,
                                const float* weight, RayPacket& packet) {
  clock_.turn_to(Work::TracePrimary);
  intersect16(packet.valid, scene.embree, packet.rays, Coherence::Coherent);
  fill_holes(scene, plan.row_mm(), packet, counts_);
  clock_.turn_to(Work::Shade);
  counts_.primary_rays += count_lanes(packet.valid);
  set_colours(colours);
  if (scene.pbr != nullptr) return shade_pbr(scene, plan, packet, weight);
  shade(scene, packet, weight, 0);
}

void PacketTracer::shade_pbr(const Scene& scene, const TilePlan& plan, const RayPacket& packet,
                             const float* weight) {
  if (!pbr_) pbr_ = std::make_unique<PbrTracer>(static_cast<int>(generations_.size()) - 1, isa_);
  uint32_t met = 0;
  for (size_t r = 0; r < kPacket; ++r)
    if (packet.rays.hit.geomID[r] != RTC_INVALID_GEOMETRY_ID) met |= kLaneBit[r];
  const uint32_t valid = lane_bits(packet.valid);
  add_backdrop(scene, packet, weight, valid & ~met);
  std::array<float, kPacket> light{};
  pbr_->shade(scene, plan.beam(), std::span<const int32_t, kPacket>(lanes_.channel), packet, light,
              cache_, counts_, clock_);
  for (size_t r = 0; r < kPacket; ++r)
    if ((valid & met & kLaneBit[r]) != 0) lanes_.light[r] += weight[r] * light[r];
  if (cache_ != nullptr) cache_->end_only_surfaces(lanes_.light);
}

std::array<float, kPacket> PacketTracer::pbr_light(const RayPacket& packet, int channel) const {
  std::array<float, kPacket> light;
  std::copy_n(lanes_.light, kPacket, light.begin());
  for (size_t r = 0; r < kPacket; ++r)
    if (packet.valid[r] != 0 && packet.rays.hit.geomID[r] != RTC_INVALID_GEOMETRY_ID)
      light[r] = static_cast<float>(component(pbr_->light_of(r), channel));
  return light;
}

void PacketTracer::set_colours(const Colours& colours) {
  std::copy_n(colours.channel.data(), kPacket, lanes_.channel);
  std::copy_n(colours.backdrop.data(), kPacket, lanes_.backdrop);
  std::fill_n(lanes_.light, kPacket, 0.0F);
  std::fill_n(lanes_.tolerance_left, kPacket, tolerated_);
}

namespace {

LightCache::Bounce bounce_of(uint32_t path, size_t depth) {
  return {.path = path, .is_first = depth == 0};
}

}  // namespace

void PacketTracer::shade(const Scene& scene, const RayPacket& packet, const float* weight,
                         size_t depth) {
  Generation& generation = generations_[depth];
  Surfaces& surfaces = generation.surfaces;
  std::copy_n(lanes_.channel, kPacket, surfaces.channel);
  const bool met = kernel_.find_surfaces(scene.shading->tables(), &packet.rays.ray.org_x[0],
                                         packet.valid, surfaces);
  add_backdrop(scene, packet, weight, lane_bits(packet.valid) & ~lane_bits(surfaces.active));
  if (!met) return;
  if (cache_ != nullptr)
    cache_->record_surfaces(bounce_of(generation.path, depth), packet, surfaces, weight);
  if (surfaces.any_textured) apply_textures(scene, packet, surfaces);
  culling_.look_at(scene, soft_, packet, surfaces, generation.cells);
  add_own_light(scene, weight, depth);
  add_lights(scene, weight, depth);
  if (cache_ != nullptr && depth == 0)
    weight = cache_->end_first_surfaces(kernel_, weight, lanes_.light);
  if (depth + 1 == generations_.size()) return;
  if (surfaces.any_transmits)
    follow_glass(scene, packet, weight, depth);
  else if (surfaces.any_specular)
    follow_mirror(scene, weight, depth);
}

void PacketTracer::add_own_light(const Scene& scene, const float* weight, size_t depth) {
  const Generation& generation = generations_[depth];
  if (!soft_.samples_ambient())
    return kernel_.add_own_light(scene.shading->tables(), generation.surfaces, weight,
                                 lanes_.light);
  const uint32_t open = culling_.open_around(generation.cells);
  const LightCache::Bounce bounce = bounce_of(generation.path, depth);
  const KnownShare known = cache_ != nullptr ? cache_->known_around(bounce) : KnownShare{};
  alignas(64) std::array<float, kPacket> ambient;
  soft_.find_ambient(soft_packet(scene, depth), open, known, weight, lanes_.backdrop,
                     ambient.data(), clock_);
  if (cache_ != nullptr) cache_->keep_around(bounce, soft_.share(), soft_.shares(scene));
  kernel_.add_own_light_under(ambient.data(), generation.surfaces, weight, lanes_.light);
}

SoftPacket PacketTracer::soft_packet(const Scene& scene, size_t depth) const {
  const Generation& generation = generations_[depth];
  const bool accurate =
      cache_ != nullptr && cache_->wants_accuracy(bounce_of(generation.path, depth));
  return {.scene = scene,
          .surfaces = generation.surfaces,
          .seeds = std::span<const uint32_t, kPacket>(lanes_.seed),
          .path = generation.path,
          .noticed = accurate ? 0.0F : tolerated_};
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
    ++counts_.secondary_rays_too_weak;
  }
}

void PacketTracer::leave_out_little(const NewRays& rays, int* valid) {
  if (!(tolerated_ > 0.0F)) return;
  const uint32_t left_out =
      kernel_.leave_out(tolerated_, rays.weight, valid, lanes_.tolerance_left, lanes_.light);
  counts_.rays_of_too_little += static_cast<uint64_t>(std::popcount(left_out));
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
  std::array<float, kPacket> light;
  light_beyond_packet(scene.backdrop, packet, lanes, lanes_.channel, light);
  for (uint32_t left = lanes; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    lanes_.light[r] += weight[r] * light[r];
  }
}

void PacketTracer::add_lights(const Scene& scene, const float* weight, size_t depth) {
  const Generation& generation = generations_[depth];
  const LightCache::Bounce bounce = bounce_of(generation.path, depth);
  NewRays rays;
  rays.packet = &lanes_.shadow.org_x[0];
  rays.valid = lanes_.shadow_valid;
  const std::vector<shading_kernel::Light>& lights = scene.shading->lights();
  for (size_t light = 0; light < lights.size(); ++light) {
    if (soft_.samples(scene, lights[light])) {
      add_soft_light(scene, light, weight, depth);
      continue;
    }
    const bool any = kernel_.shadow_rays(lights[light], generation.surfaces, weight, rays);
    counts_.invalid_rays += static_cast<uint64_t>(rays.refused);
    if (!any) continue;
    const Coherence coherence = coherence_of(rays.valid, lanes_.shadow);
    uint32_t lit = cache_ != nullptr ? cache_->take_known(bounce, light, rays.valid) : 0;
    leave_out_little(rays, rays.valid);
    const uint32_t unknown = lane_bits(rays.valid);
    const uint32_t wanted = lit | unknown;
    counts_.shadow_rays += static_cast<uint64_t>(std::popcount(wanted));
    const KnownLanes culled = culling_.point_light(scene, generation.cells, light, unknown);
    take_lanes(culled.lit | culled.blocked, rays.valid);
    counts_.shadow_rays_culled += static_cast<uint64_t>(std::popcount(culled.lit));
    counts_.shadow_rays_blocked += static_cast<uint64_t>(std::popcount(culled.blocked));
    lit |= culled.lit;
    const uint32_t reached = lit | trace_shadows(scene, light, coherence, depth);
    kernel_.add_light(reached, rays.weight, lanes_.light);
    if (cache_ != nullptr) cache_->record_shadows(bounce, light, rays.weight, wanted, reached);
  }
}

/// Tests the light's centre against the surface; the light's rim may lie on the other side.
void PacketTracer::add_soft_light(const Scene& scene, size_t light, const float* weight,
                                  size_t depth) {
  const Generation& generation = generations_[depth];
  const LightCache::Bounce bounce = bounce_of(generation.path, depth);
  KnownLanes known;
  NewRays to_middle;
  to_middle.packet = &lanes_.shadow.org_x[0];
  to_middle.valid = lanes_.shadow_valid;
  if (generation.cells.area_lights &&
      kernel_.shadow_rays(scene.shading->lights()[light], generation.surfaces, weight, to_middle))
    known = culling_.area_light(generation.cells, light, lane_bits(to_middle.valid));
  const KnownShare shares =
      cache_ != nullptr
          ? cache_->known_area_light(bounce, light, soft_.integrates_area_lights(), known)
          : KnownShare{};
  const AreaLightSeen seen = soft_.add_area_light(soft_packet(scene, depth), light, known, shares,
                                                  weight, lanes_.light, clock_);
  if (cache_ != nullptr) cache_->keep_area_light(bounce, light, seen);
}

uint32_t PacketTracer::trace_shadows(const Scene& scene, size_t light, Coherence coherence,
                                     size_t depth) {
  const int* valid = lanes_.shadow_valid;
  const uint32_t lanes = lane_bits(valid);
  if (lanes == 0) return 0;
  const LightCache::Bounce bounce = bounce_of(generations_[depth].path, depth);
  if (cache_ != nullptr)
    if (const auto unoccluded = cache_->find_shadows(bounce, light, lanes)) return *unoccluded;
  clock_.turn_to(Work::TraceShadows);
  occluded16(valid, scene.embree, lanes_.shadow, coherence);
  clock_.turn_to(Work::Shade);
  const uint32_t unoccluded = lanes & ~sign_bits(lanes_.shadow.tfar);
  if (cache_ != nullptr) cache_->store_shadows(bounce, light, lanes, unoccluded);
  return unoccluded;
}

void PacketTracer::follow_mirror(const Scene& scene, const float* weight, size_t depth) {
  Generation& generation = generations_[depth];
  int* const valid = generation.mirrored.valid;
  NewRays& rays = generation.mirrored_rays;
  if (!mirror(generation, weight)) return;
  const Coherence coherence = coherence_of(valid, generation.mirrored.rays.ray);
  if (skip_weak_ && glass_above_ == 0 && scene.shading->light_only_adds())
    leave_out_weak(scene, rays, depth);
  // Done before the culling queries, which are made only while they pay off.
  leave_out_little(rays, valid);
  const uint32_t open = culling_.open_mirrored(scene, generation.cells, rays, lane_bits(valid));
  take_lanes(open, valid);
  counts_.secondary_rays_culled += static_cast<uint64_t>(std::popcount(open));
  counts_.secondary_rays += static_cast<uint64_t>(std::popcount(open));
  add_backdrop(scene, generation.mirrored, rays.weight, open);
  follow(scene, rays, generation.mirrored, coherence, depth, Turn::Mirrored);
}

bool PacketTracer::mirror(Generation& generation, const float* weight) {
  NewRays& rays = generation.mirrored_rays;
  rays.packet = &generation.mirrored.rays.ray.org_x[0];
  rays.valid = generation.mirrored.valid;
  const bool any = kernel_.mirrored_rays(generation.surfaces, weight, rays);
  counts_.invalid_rays += static_cast<uint64_t>(rays.refused);
  return any;
}

/// Traces secondary rays of packets with transparent lanes. For lanes that met a transparent
/// surface, mirrored and refracted rays are made here, since total reflection moves light from the
/// refracted to the mirrored ray; other lanes keep the mirrored rays of ordinary packets.
void PacketTracer::follow_glass(const Scene& scene, const RayPacket& packet, const float* weight,
                                size_t depth) {
  Generation& generation = generations_[depth];
  (void)mirror(generation, weight);
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
      ++counts_.invalid_rays;
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

void PacketTracer::follow(const Scene& scene, NewRays& rays, RayPacket& packet, Coherence coherence,
                          size_t depth, Turn turn) {
  const uint64_t traced = count_lanes(packet.valid);
  if (traced == 0) return;
  counts_.secondary_rays += traced;
  std::fill_n(packet.rays.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
  generations_[depth + 1].path = sampling::longer_path(generations_[depth].path, turn);
  trace_secondary(scene, packet, coherence, depth);
  shade(scene, packet, rays.weight, depth + 1);
}

void PacketTracer::trace_secondary(const Scene& scene, RayPacket& packet, Coherence coherence,
                                   size_t depth) {
  const uint32_t path = generations_[depth + 1].path;
  if (cache_ != nullptr && cache_->find_hits(path, packet)) return;
  // Neighbouring rays diverge after two reflections at curved surfaces, and packet traversal is
  // slower.
  clock_.turn_to(Work::TraceSecondary);
  intersect16(packet.valid, scene.embree, packet.rays,
              depth == 0 ? coherence : Coherence::Incoherent);
  clock_.turn_to(Work::Shade);
  if (cache_ != nullptr) cache_->store_hits(path, packet);
}

}  // namespace lenticule::render
