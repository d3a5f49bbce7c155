// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/light_cache.h"

#include <algorithm>
#include <bit>

#include "render/accel/ray_stream.h"

namespace lenticule::render {
namespace {

/// Transposes a bit mask of lights per lane to a bit mask of lanes per light.
void by_light(std::span<const uint32_t, kPacket> of_lanes,
              std::span<uint32_t, CachedLight::kLights> lanes) {
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

uint32_t mixed(uint32_t path, uint32_t what) {
  uint32_t key = path * 0x9e3779b9U ^ (what + 1) * 0x85ebca6bU;
  key ^= key >> 15;
  key *= 0x2c1b3c6dU;
  return key ^ key >> 13;
}

/// Added to the number of a light that is partly visible.
constexpr uint32_t kPartly = 0x1000;

void record_shares(const KnownShare& shares, float* notes) {
  for (size_t r = 0; r < kPacket; ++r)
    notes[r] = (shares.lanes & kLaneBit[r]) != 0 ? shares.share[r] : LightRecord::kNoShare;
}

}  // namespace

void CachedLight::set_lights(std::span<const uint32_t, kPacket> shining,
                             std::span<const uint32_t, kPacket> not_seen) {
  by_light(shining, lit);
  by_light(not_seen, hidden);
}

void LightCache::begin_recording(const SurfaceGroups& groups, float noticed) {
  groups_ = &groups;
  noticed_ = noticed;
  notes_ = {};
  traced_.clear();
  hits_ = Hits::Write;
}

void LightCache::begin_known(const CachedLight& known, bool again) {
  known_ = &known;
  hits_ = again ? Hits::Read : Hits::Off;
  passed_ = 0;
  std::fill_n(notes_.secondary, kPacket, 0.0F);
}

void LightCache::end(const float* light) {
  for (size_t r = 0; r < kPacket; ++r) {
    notes_.secondary[r] = light[r] - notes_.secondary[r];
    notes_.way[r] += notes_.secondary_way[r];
  }
  groups_ = nullptr;
  known_ = nullptr;
  hits_ = Hits::Off;
}

void LightCache::record_surfaces(Bounce bounce, const RayPacket& packet,
                                 const shading_kernel::Surfaces& surfaces, const float* weight) {
  if (groups_ == nullptr) return;
  uint32_t* way = way_of(bounce);
  for (size_t r = 0; r < kPacket; ++r) {
    if (surfaces.active[r] == 0 || (!bounce.is_first && weight[r] < noticed_)) continue;
    way[r] += mixed(bounce.path, groups_->of(packet.rays.hit.geomID[r], packet.rays.hit.primID[r]));
  }
}

void LightCache::record_surface(Bounce bounce, size_t lane, uint32_t geometry, uint32_t primitive,
                                uint32_t how) {
  if (groups_ == nullptr) return;
  way_of(bounce)[lane] += mixed(mixed(bounce.path, how), groups_->of(geometry, primitive));
}

KnownShare LightCache::known_around(Bounce bounce) {
  KnownShare known;
  if (known_ != nullptr && bounce.is_first) known = known_->around;
  find_share(bounce.path, kAllAround, known);
  return known;
}

void LightCache::keep_around(Bounce bounce, const KnownShare& share, bool serves_all_colours) {
  if (serves_all_colours) store_share(bounce.path, kAllAround, share);
  if (groups_ != nullptr && bounce.is_first) record_shares(share, notes_.around);
}

uint32_t LightCache::take_known(Bounce bounce, size_t light, int* valid) const {
  if (known_ == nullptr || !bounce.is_first || light >= CachedLight::kLights) return 0;
  const uint32_t wanted = lane_bits(valid);
  const uint32_t lit = known_->lit[light] & wanted;
  take_lanes(lit | (known_->hidden[light] & wanted), valid);
  return lit;
}

std::optional<uint32_t> LightCache::find_shadows(Bounce bounce, size_t light, uint32_t lanes) {
  const Traced* known = find(bounce.path, static_cast<uint32_t>(light));
  if (known == nullptr || (lanes & ~known->lanes) != 0) return {};
  return known->free & lanes;
}

void LightCache::store_shadows(Bounce bounce, size_t light, uint32_t lanes, uint32_t unoccluded) {
  if (Traced* entry = store(bounce.path, static_cast<uint32_t>(light), lanes))
    entry->free = unoccluded;
}

void LightCache::record_shadows(Bounce bounce, size_t light, const float* brings, uint32_t wanted,
                                uint32_t reached) {
  if (groups_ == nullptr) return;
  uint32_t* way = way_of(bounce);
  for (uint32_t left = wanted & ~reached; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    if (brings[r] >= noticed_) way[r] += mixed(~bounce.path, static_cast<uint32_t>(light));
  }
  if (!bounce.is_first || light >= CachedLight::kLights) return;
  const uint32_t bit = 1U << light, hidden = wanted & ~reached;
  for (size_t r = 0; r < kPacket; ++r) {
    notes_.lit[r] |= (reached & kLaneBit[r]) != 0 ? bit : 0;
    notes_.hidden[r] |= (hidden & kLaneBit[r]) != 0 ? bit : 0;
  }
}

void LightCache::record_partly(Bounce bounce, size_t light, uint32_t lanes) {
  if (groups_ == nullptr) return;
  for (uint32_t left = lanes; left != 0; left &= left - 1)
    way_of(bounce)[std::countr_zero(left)] +=
        mixed(~bounce.path, static_cast<uint32_t>(light) + kPartly);
}

KnownShare LightCache::known_area_light(Bounce bounce, size_t light, bool integrated,
                                        KnownLanes& lanes) {
  KnownShare shares;
  if (known_ != nullptr && bounce.is_first && light < CachedLight::kLights) {
    lanes.lit |= known_->lit[light];
    lanes.blocked |= known_->hidden[light];
    if (light < LightRecord::kAreaLights) shares = known_->seen[light];
    shares.set(known_->lit[light], 1.0F);
    shares.set(known_->hidden[light], 0.0F);
  }
  if (integrated) find_share(bounce.path, static_cast<uint32_t>(light), shares);
  return shares;
}

/// Notes a penumbra only as "partly lit": the light values themselves distinguish penumbrae.
void LightCache::keep_area_light(Bounce bounce, size_t light, const AreaLightSeen& seen) {
  const auto number = static_cast<uint32_t>(light);
  store_share(bounce.path, number, seen.share);
  if (groups_ == nullptr) return;
  uint32_t* way = way_of(bounce);
  for (uint32_t r = 0; r < kPacket; ++r) {
    const uint32_t bit = 1U << r;
    if ((seen.none & bit) != 0) way[r] += mixed(~bounce.path, number);
    if ((seen.share.lanes & ~(seen.all | seen.none) & bit) != 0)
      way[r] += mixed(~bounce.path, number + kPartly);
    if (!bounce.is_first || light >= CachedLight::kLights) continue;
    notes_.lit[r] |= (seen.all >> r & 1) << light;
    notes_.hidden[r] |= (seen.none >> r & 1) << light;
  }
  if (bounce.is_first && light < LightRecord::kAreaLights)
    record_shares(seen.share, notes_.seen[light]);
}

const float* LightCache::end_first_surfaces(const shading_kernel::Kernel& kernel,
                                            const float* weight, float* light) {
  std::copy_n(light, kPacket, notes_.secondary);  // subtracted by end()
  if (known_ == nullptr) return weight;
  kernel.add_light(known_->secondary_lanes, known_->secondary, light);
  for (size_t r = 0; r < kPacket; ++r)
    weight_left_[r] = (known_->secondary_lanes & kLaneBit[r]) != 0 ? 0.0F : weight[r];
  return weight_left_;
}

bool LightCache::find_hits(uint32_t path, RayPacket& packet) {
  const Traced* known = find(path, kNotToLight);
  if (known == nullptr || (lane_bits(packet.valid) & ~known->lanes) != 0) return false;
  std::copy_n(known->distance, kPacket, packet.rays.ray.tfar);
  std::copy_n(known->geometry, kPacket, packet.rays.hit.geomID);
  std::copy_n(known->primitive, kPacket, packet.rays.hit.primID);
  return true;
}

void LightCache::store_hits(uint32_t path, const RayPacket& packet) {
  Traced* entry = store(path, kNotToLight, lane_bits(packet.valid));
  if (entry == nullptr) return;
  std::copy_n(packet.rays.ray.tfar, kPacket, entry->distance);
  std::copy_n(packet.rays.hit.geomID, kPacket, entry->geometry);
  std::copy_n(packet.rays.hit.primID, kPacket, entry->primitive);
}

LightCache::Traced* LightCache::store(uint32_t path, uint32_t what, uint32_t lanes) {
  if (hits_ != Hits::Write) return nullptr;
  Traced& noted = traced_.emplace_back();
  noted.path = path;
  noted.what = what;
  noted.lanes = lanes;
  return &noted;
}

/// Finds the stored hits of a packet. All colours send the same rays in the same order, except rays
/// with no weight in a colour: then stored packets are skipped, or lanes were not traced.
const LightCache::Traced* LightCache::find(uint32_t path, uint32_t what) {
  if (hits_ != Hits::Read) return nullptr;
  const auto same = [&](const Traced& t) { return t.path == path && t.what == what; };
  const auto found =
      std::find_if(traced_.begin() + static_cast<std::ptrdiff_t>(passed_), traced_.end(), same);
  if (found == traced_.end()) return nullptr;
  passed_ = static_cast<size_t>(found - traced_.begin()) + 1;
  return &*found;
}

void LightCache::store_share(uint32_t path, uint32_t what, const KnownShare& share) {
  if (Traced* entry = store(path, what, share.lanes))
    std::copy_n(share.share.data(), kPacket, entry->share);
}

/// Adds stored shares to the known ones, which keep precedence.
void LightCache::find_share(uint32_t path, uint32_t what, KnownShare& known) {
  if (const Traced* found = find(path, what)) known.set(found->lanes & ~known.lanes, found->share);
}

}  // namespace lenticule::render
