// SPDX-License-Identifier: Apache-2.0
// Tests every pair of a target and a source column, sixteen rows at once. A micro-image has few
// subpixels of one channel, so without gathers this takes a few cycles per subpixel.
#include "render/methods/reuse/reprojection_kernel.h"

#include "render/rays/primary_packets_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using packet_kernel::Field;
using reprojection::Column;
using reprojection::Found;
using reprojection::kChannels;
using reprojection::kLanes;
using reprojection::LensMap;
using reprojection::PanelMap;
using reprojection::Rules;

// The vectors may alias arrays of other types. Functions take them by reference only.
using Floats = float __attribute__((vector_size(4 * kLanes), may_alias));
using Ints = int32_t __attribute__((vector_size(4 * kLanes), may_alias));

constexpr uint32_t kNoGeometry = ~0U;
constexpr float kFarthest = 3e38F;

inline const Floats& floats(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline const Ints& ints(const int32_t* lanes) {
  return *reinterpret_cast<const Ints*>(lanes);
}
inline Floats& floats(float* lanes) {
  return *reinterpret_cast<Floats*>(lanes);
}
inline Ints& ints(int32_t* lanes) {
  return *reinterpret_cast<Ints*>(lanes);
}
inline void choose(const Ints& which, const Floats& value, Floats& out) {
  out = which ? value : out;
}
inline void choose(const Ints& which, const Ints& value, Ints& out) {
  out = which ? value : out;
}
inline void magnitude(const Floats& value, Floats& out) {
  out = value < 0.0F ? -value : value;
}

inline void combine(const float (&row)[3], const float* packet, Field first, Floats& out) {
  out = row[0] * floats(packet + first * kLanes) + row[1] * floats(packet + (first + 1) * kLanes) +
        row[2] * floats(packet + (first + 2) * kLanes);
}

void place(const PanelMap& map, const LensMap& lenses, const float* packet, Column& column) {
  constexpr float kShift = 12582912.0F;  // 1.5 * 2^23: additions round to integers
  Floats x, z, step_x, step_z;
  combine(map.x, packet, packet_kernel::kOriginX, x);
  combine(map.z, packet, packet_kernel::kOriginX, z);
  combine(map.x, packet, packet_kernel::kDirectionX, step_x);
  combine(map.z, packet, packet_kernel::kDirectionX, step_z);
  const Floats tan = step_x / step_z;
  const Floats panel_x = x - z * tan;
  floats(column.tan) = tan;
  floats(column.panel_x) = panel_x;
  const Floats lens = floats(lenses.offset) + floats(lenses.per_mm) * panel_x;
  ints(column.lens) = __builtin_convertvector((lens + kShift) - kShift, Ints);
  ints(column.missing) = Ints{};
  ints(column.chord) = Ints{};
  ints(column.linked) = Ints{};
  ints(column.surface) = Ints{};
  floats(column.x) = Floats{};
  floats(column.down) = Floats{};
  floats(column.code) = Floats{};
  floats(column.z) = Floats{} + __builtin_nanf("");
}

void take_hits(const PanelMap& map, const float* packet, const int32_t* lanes, Column& column) {
  Floats start, step;
  combine(map.z, packet, packet_kernel::kOriginX, start);
  combine(map.z, packet, packet_kernel::kDirectionX, step);
  const Ints met = ints(reinterpret_cast<const int32_t*>(packet) +
                        packet_kernel::kGeometry * kLanes) != static_cast<int32_t>(kNoGeometry);
  const Floats hit = start + step * floats(packet + packet_kernel::kTFar * kLanes);
  const Floats z = met ? hit : Floats{} + reprojection::kSkyZ;
  choose(ints(lanes), z, floats(column.z));
  choose(ints(lanes), floats(column.panel_x) + floats(column.tan) * z, floats(column.x));
}

void join(const Column& left, const Rules& rules, Column& column) {
  const Floats& z = floats(column.z);
  const Floats& left_z = floats(left.z);
  const Ints chord = (ints(column.lens) == ints(left.lens)) & (z == z) & (left_z == left_z);
  const Floats rise = z - left_z;
  Floats steep, wide, apart;
  magnitude(rise, steep);
  magnitude((floats(column.x) - floats(left.x)) - floats(column.tan) * rise, wide);
  magnitude(floats(column.code) - floats(left.code), apart);
  ints(column.chord) = chord;
  ints(column.linked) = chord & (ints(column.surface) == ints(left.surface)) &
                        (steep <= rules.steepest * wide) & (apart <= rules.agreement);
}

/// Extends the view of a lens by one more subpixel.
inline void widen(const Column& source, const Ints& under, Found& found) {
  const Ints there = under & (floats(source.z) == floats(source.z));
  const Floats& tan = floats(source.tan);
  choose(there, floats(source.panel_x), floats(found.lens_x));
  choose(there & (floats(source.z) > floats(found.nearest_z)), floats(source.z),
         floats(found.nearest_z));
  choose(there & (tan < floats(found.low_tan)), tan, floats(found.low_tan));
  choose(there & (tan > floats(found.high_tan)), tan, floats(found.high_tan));
}
inline void see_nothing(Found& found) {
  floats(found.lens_x) = Floats{};
  floats(found.nearest_z) = Floats{} - kFarthest;
  floats(found.low_tan) = Floats{} + kFarthest;
  floats(found.high_tan) = Floats{} - kFarthest;
}
/// Finds the lanes in which `lens` could see the point that `found` holds.
inline void could_see(const Found& lens, const Found& found, Ints& which) {
  const Floats across = floats(found.x) - floats(lens.lens_x);
  const Floats& z = floats(found.z);
  // Behind the panel the order of directions is reversed.
  const Floats front = z < 0.0F ? -z : z;
  const Floats aside = z < 0.0F ? -across : across;
  which = (aside >= floats(lens.low_tan) * front) & (aside <= floats(lens.high_tan) * front);
}

void on_chords(const Column* columns, int first, int end, const int32_t* wanted,
               const Column& target, const Rules& rules, Found& found) {
  const Ints& lens = ints(wanted);
  const Floats panel_x = floats(target.panel_x);
  const Floats tan = floats(target.tan);
  Floats best = Floats{} - kFarthest;
  Floats code{}, last_off{}, last_z{}, last_code{};
  Ints known{}, surface{};
  see_nothing(found);
  for (int c = first; c < end; c += kChannels) {
    const Column& source = columns[c];
    widen(source, ints(source.lens) == lens, found);
    const Floats& z = floats(source.z);
    const Floats off = floats(source.x) - (panel_x + tan * z);
    const Ints crosses =
        ((last_off <= 0.0F) & (off >= 0.0F)) | ((last_off >= 0.0F) & (off <= 0.0F));
    const Floats part = last_off / (last_off - off);
    const Floats at = last_z + part * (z - last_z);
    Ints here = crosses & ints(source.chord) & (ints(source.lens) == lens);
    if (rules.occlusion)
      here &= at > best;
    else
      here &= ints(source.linked);
    choose(here, at, best);
    choose(here, last_code + part * (floats(source.code) - last_code), code);
    choose(here, ints(source.surface), surface);
    choose(here, ints(source.linked), known);
    last_off = off;
    last_z = z;
    last_code = floats(source.code);
  }
  ints(found.known) = known;
  floats(found.z) = best;
  floats(found.x) = panel_x + tan * best;
  floats(found.code) = code;
  ints(found.surface) = surface;
}

void nearest(const Column* columns, int first, int end, const int32_t* wanted, const Column& target,
             const Rules& rules, Found& found) {
  const Ints& lens = ints(wanted);
  const Floats panel_x = floats(target.panel_x);
  const Floats tan = floats(target.tan);
  Floats best_z = Floats{} - kFarthest, before = best_z, best_off = Floats{} + kFarthest;
  Floats code{}, x{}, last_off{}, last_z{};
  Ints known{}, surface{};
  see_nothing(found);
  for (int c = first; c < end; c += kChannels) {
    const Column& source = columns[c];
    const Floats& z = floats(source.z);
    const Floats off = floats(source.x) - (panel_x + tan * z);
    const Ints under = ints(source.lens) == lens;
    widen(source, under, found);
    Floats slot, distance;
    magnitude(z * rules.slot_tan, slot);
    magnitude(off, distance);
    const Floats slots_off = distance / slot;
    Ints here = under & (slots_off <= rules.within);
    here &= rules.occlusion ? z > best_z : slots_off < best_off;
    choose(here, z, best_z);
    choose(here, slots_off, best_off);
    choose(here, floats(source.x), x);
    choose(here, floats(source.code), code);
    choose(here, ints(source.surface), surface);
    known |= here;
    const Ints crosses =
        ((last_off <= 0.0F) & (off >= 0.0F)) | ((last_off >= 0.0F) & (off <= 0.0F));
    const Floats part = last_off / (last_off - off);
    const Floats at = last_z + part * (z - last_z);
    choose(crosses & ints(source.linked) & under & (at > before), at, before);
    last_off = off;
    last_z = z;
  }
  // The distance of a chord's depth from its points' depths is limited by its steepness.
  Floats slot;
  magnitude(best_z * rules.slot_tan, slot);
  if (rules.occlusion) known &= ~(before > best_z + rules.steepest * slot);
  ints(found.known) = known;
  floats(found.z) = best_z;
  floats(found.x) = x;
  floats(found.code) = code;
  ints(found.surface) = surface;
}

void same_place(const Column* columns, int first, int end, const int32_t* wanted,
                const Column& target, const Rules& rules, Found& found) {
  const Ints& lens = ints(wanted);
  Floats best = Floats{} + 0.6F * rules.slot_tan;  // slightly more than half a slot, for rounding
  Floats code{};
  Ints known{};
  for (int c = first; c < end; c += kChannels) {
    const Column& source = columns[c];
    Floats apart;
    magnitude(floats(source.tan) - floats(target.tan), apart);
    const Ints here = (ints(source.lens) == lens) &
                      (ints(source.flag) >= static_cast<int32_t>(reprojection::kProjected)) &
                      (apart < best);
    choose(here, apart, best);
    choose(here, floats(source.code), code);
    known |= here;
  }
  ints(found.known) = known;
  floats(found.code) = code;
  floats(found.z) = Floats{} + __builtin_nanf("");
  floats(found.x) = Floats{};
  ints(found.surface) = Ints{};
  see_nothing(found);
}

void merge(const Found& other, const float* part, const Rules& rules, Found& into) {
  const Ints other_known = ints(other.known);
  const Ints both = ints(into.known) & other_known;
  const Ints only_other = other_known & ~ints(into.known);
  Ints hidden, hidden_other;
  could_see(other, into, hidden);
  could_see(into, other, hidden_other);
  // A lens outside the tile: its view is unknown.
  hidden |= floats(other.low_tan) > floats(other.high_tan);
  hidden_other |= floats(into.low_tan) > floats(into.high_tan);
  Floats between;
  magnitude(floats(other.lens_x) - floats(into.lens_x), between);
  hidden |= floats(other.nearest_z) > floats(into.z) + between;
  hidden_other |= floats(into.nearest_z) > floats(other.z) + between;
  const Ints alone = (ints(into.known) & ~other_known & ~hidden) | (only_other & ~hidden_other);
  Floats apart;
  magnitude(floats(other.code) - floats(into.code), apart);
  const Ints agree = apart <= rules.agreement;
  const Floats mean = floats(into.code) + floats(part) * (floats(other.code) - floats(into.code));
  choose(both, mean, floats(into.code));
  const Ints nearer = (both & (floats(other.z) > floats(into.z))) | only_other;
  choose(nearer, floats(other.z), floats(into.z));
  choose(nearer, floats(other.x), floats(into.x));
  choose(nearer, ints(other.surface), ints(into.surface));
  choose(only_other, floats(other.code), floats(into.code));
  ints(into.known) = (both & agree) | (rules.one_side ? alone : Ints{});
}

void put(const Found& found, const int32_t* lanes, int32_t flag, Column& column) {
  const Ints here = ints(lanes) & ints(found.known) &
                    (ints(column.flag) == static_cast<int32_t>(reprojection::kEmpty));
  choose(here, Ints{} + flag, ints(column.flag));
  choose(here, floats(found.x), floats(column.x));
  choose(here, floats(found.z), floats(column.z));
  choose(here, floats(found.code), floats(column.code));
  choose(here, ints(found.surface), ints(column.surface));
}

}  // namespace

extern const reprojection::Kernel kReprojectionKernel;
const reprojection::Kernel kReprojectionKernel{.place = place,
                                               .take_hits = take_hits,
                                               .join = join,
                                               .on_chords = on_chords,
                                               .nearest = nearest,
                                               .same_place = same_place,
                                               .merge = merge,
                                               .put = put};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
