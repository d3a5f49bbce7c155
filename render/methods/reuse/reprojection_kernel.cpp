// SPDX-License-Identifier: Apache-2.0
// Tests every pair of a target and a source column, sixteen rows at once. A micro-image has few
// subpixels of one channel, so without gathers this takes a few cycles per subpixel.
#include "render/methods/reuse/reprojection_kernel.h"

#include "base/lanes.h"
#include "render/rays/primary_packets_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lanes;
using packet_kernel::Field;
using reprojection::Column;
using reprojection::Found;
using reprojection::kChannels;
using reprojection::kLanes;
using reprojection::LensMap;
using reprojection::PanelMap;
using reprojection::Rules;

constexpr float kFarthest = 3e38F;

template <class E>
inline void choose(const Masks& which, const Lanes<E>& value, Lanes<E>& out) {
  out = select(which, value, out);
}
inline Floats magnitude(const Floats& value) { return select(value < 0.0F, -value, value); }

inline Floats combine(const float (&row)[4], const float* packet, Field first) {
  return row[0] * floats_at(packet + first * kLanes) +
         row[1] * floats_at(packet + (first + 1) * kLanes) +
         row[2] * floats_at(packet + (first + 2) * kLanes);
}

void place(const PanelMap& map, const LensMap& lenses, const float* packet, Column& column) {
  constexpr float kShift = 12582912.0F;  // 1.5 * 2^23: additions round to integers
  const Floats x = combine(map.x, packet, packet_kernel::kOriginX) + map.x[3];
  const Floats z = combine(map.z, packet, packet_kernel::kOriginX) + map.z[3];
  const Floats tan = combine(map.x, packet, packet_kernel::kDirectionX) /
                     combine(map.z, packet, packet_kernel::kDirectionX);
  const Floats panel_x = x - z * tan;
  floats_at(column.tan) = tan;
  floats_at(column.panel_x) = panel_x;
  const Floats lens = floats_at(lenses.offset) + floats_at(lenses.per_mm) * panel_x;
  masks_at(column.lens) = to_integers((lens + kShift) - kShift);
  masks_at(column.missing) = Masks{};
  masks_at(column.chord) = Masks{};
  masks_at(column.linked) = Masks{};
  masks_at(column.surface) = Masks{};
  floats_at(column.x) = Floats{};
  floats_at(column.down) = Floats{};
  floats_at(column.code) = Floats{};
  floats_at(column.z) = Floats::of(__builtin_nanf(""));
}

void take_hits(const PanelMap& map, const float* packet, const int32_t* lanes, Column& column) {
  constexpr uint32_t kNoGeometry = ~0U;
  const Floats start = combine(map.z, packet, packet_kernel::kOriginX) + map.z[3];
  const Floats step = combine(map.z, packet, packet_kernel::kDirectionX);
  const Masks met = words_at(packet + packet_kernel::kGeometry * kLanes) != kNoGeometry;
  const Floats hit = start + step * floats_at(packet + packet_kernel::kTFar * kLanes);
  const Floats z = select(met, hit, Floats::of(reprojection::kSkyZ));
  choose(masks_at(lanes), z, floats_at(column.z));
  choose(masks_at(lanes), floats_at(column.panel_x) + floats_at(column.tan) * z,
         floats_at(column.x));
}

void join(const Column& left, const Rules& rules, Column& column) {
  const Floats& z = floats_at(column.z);
  const Floats& left_z = floats_at(left.z);
  const Masks chord =
      (masks_at(column.lens) == masks_at(left.lens)) & (z == z) & (left_z == left_z);
  const Floats rise = z - left_z;
  const Floats steep = magnitude(rise);
  const Floats wide =
      magnitude((floats_at(column.x) - floats_at(left.x)) - floats_at(column.tan) * rise);
  const Floats apart = magnitude(floats_at(column.code) - floats_at(left.code));
  masks_at(column.chord) = chord;
  masks_at(column.linked) = chord & (masks_at(column.surface) == masks_at(left.surface)) &
                            (steep <= rules.steepest * wide) & (apart <= rules.agreement);
}

/// Extends the view of a lens by one more subpixel.
inline void widen(const Column& source, const Masks& under, Found& found) {
  const Masks there = under & (floats_at(source.z) == floats_at(source.z));
  const Floats& tan = floats_at(source.tan);
  choose(there, floats_at(source.panel_x), floats_at(found.lens_x));
  choose(there & (floats_at(source.z) > floats_at(found.nearest_z)), floats_at(source.z),
         floats_at(found.nearest_z));
  choose(there & (tan < floats_at(found.low_tan)), tan, floats_at(found.low_tan));
  choose(there & (tan > floats_at(found.high_tan)), tan, floats_at(found.high_tan));
}
inline void see_nothing(Found& found) {
  floats_at(found.lens_x) = Floats{};
  floats_at(found.nearest_z) = Floats::of(-kFarthest);
  floats_at(found.low_tan) = Floats::of(kFarthest);
  floats_at(found.high_tan) = Floats::of(-kFarthest);
}
/// Returns the lanes in which `lens` could see the point that `found` holds.
inline Masks could_see(const Found& lens, const Found& found) {
  const Floats across = floats_at(found.x) - floats_at(lens.lens_x);
  const Floats& z = floats_at(found.z);
  // Behind the panel the order of directions is reversed.
  const Floats front = select(z < 0.0F, -z, z);
  const Floats aside = select(z < 0.0F, -across, across);
  return (aside >= floats_at(lens.low_tan) * front) & (aside <= floats_at(lens.high_tan) * front);
}

void on_chords(const Column* columns, int first, int end, const int32_t* wanted,
               const Column& target, const Rules& /*rules*/, Found& found) {
  const Masks& lens = masks_at(wanted);
  const Floats panel_x = floats_at(target.panel_x);
  const Floats tan = floats_at(target.tan);
  Floats best = Floats::of(-kFarthest);
  Floats code{}, last_off{}, last_z{}, last_code{};
  Masks known{}, surface{};
  see_nothing(found);
  for (int c = first; c < end; c += kChannels) {
    const Column& source = columns[c];
    widen(source, masks_at(source.lens) == lens, found);
    const Floats& z = floats_at(source.z);
    const Floats off = floats_at(source.x) - (panel_x + tan * z);
    const Masks crosses =
        ((last_off <= 0.0F) & (off >= 0.0F)) | ((last_off >= 0.0F) & (off <= 0.0F));
    const Floats part = last_off / (last_off - off);
    const Floats at = last_z + part * (z - last_z);
    const Masks here =
        crosses & masks_at(source.chord) & (masks_at(source.lens) == lens) & (at > best);
    choose(here, at, best);
    choose(here, last_code + part * (floats_at(source.code) - last_code), code);
    choose(here, masks_at(source.surface), surface);
    choose(here, masks_at(source.linked), known);
    last_off = off;
    last_z = z;
    last_code = floats_at(source.code);
  }
  masks_at(found.known) = known;
  floats_at(found.z) = best;
  floats_at(found.x) = panel_x + tan * best;
  floats_at(found.code) = code;
  masks_at(found.surface) = surface;
}

void same_place(const Column* columns, int first, int end, const int32_t* wanted,
                const Column& target, const Rules& rules, Found& found) {
  const Masks& lens = masks_at(wanted);
  Floats best = Floats::of(0.6F * rules.slot_tan);  // slightly more than half a slot, for rounding
  Floats code{};
  Masks known{};
  for (int c = first; c < end; c += kChannels) {
    const Column& source = columns[c];
    const Floats apart = magnitude(floats_at(source.tan) - floats_at(target.tan));
    const Masks here = (masks_at(source.lens) == lens) &
                       (masks_at(source.flag) >= static_cast<int32_t>(reprojection::kProjected)) &
                       (apart < best);
    choose(here, apart, best);
    choose(here, floats_at(source.code), code);
    known = known | here;
  }
  masks_at(found.known) = known;
  floats_at(found.code) = code;
  floats_at(found.z) = Floats::of(__builtin_nanf(""));
  floats_at(found.x) = Floats{};
  masks_at(found.surface) = Masks{};
  see_nothing(found);
}

void merge(const Found& other, const float* part, const Rules& rules, Found& into) {
  const Masks other_known = masks_at(other.known);
  const Masks both = masks_at(into.known) & other_known;
  const Masks only_other = other_known & ~masks_at(into.known);
  const Floats between = magnitude(floats_at(other.lens_x) - floats_at(into.lens_x));
  // A lens outside the tile: its view is unknown.
  const Masks hidden = could_see(other, into) |
                       (floats_at(other.low_tan) > floats_at(other.high_tan)) |
                       (floats_at(other.nearest_z) > floats_at(into.z) + between);
  const Masks hidden_other = could_see(into, other) |
                             (floats_at(into.low_tan) > floats_at(into.high_tan)) |
                             (floats_at(into.nearest_z) > floats_at(other.z) + between);
  const Masks alone =
      (masks_at(into.known) & ~other_known & ~hidden) | (only_other & ~hidden_other);
  const Masks agree = magnitude(floats_at(other.code) - floats_at(into.code)) <= rules.agreement;
  const Floats mean =
      floats_at(into.code) + floats_at(part) * (floats_at(other.code) - floats_at(into.code));
  choose(both, mean, floats_at(into.code));
  const Masks nearer = (both & (floats_at(other.z) > floats_at(into.z))) | only_other;
  choose(nearer, floats_at(other.z), floats_at(into.z));
  choose(nearer, floats_at(other.x), floats_at(into.x));
  choose(nearer, masks_at(other.surface), masks_at(into.surface));
  choose(only_other, floats_at(other.code), floats_at(into.code));
  masks_at(into.known) = (both & agree) | (rules.one_side ? alone : Masks{});
}

void put(const Found& found, const int32_t* lanes, int32_t flag, Column& column) {
  const Masks here = masks_at(lanes) & masks_at(found.known) &
                     (masks_at(column.flag) == static_cast<int32_t>(reprojection::kEmpty));
  choose(here, Masks::of(flag), masks_at(column.flag));
  choose(here, floats_at(found.x), floats_at(column.x));
  choose(here, floats_at(found.z), floats_at(column.z));
  choose(here, floats_at(found.code), floats_at(column.code));
  choose(here, masks_at(found.surface), masks_at(column.surface));
}

}  // namespace

extern const reprojection::Kernel kReprojectionKernel;
const reprojection::Kernel kReprojectionKernel{.place = place,
                                               .take_hits = take_hits,
                                               .join = join,
                                               .on_chords = on_chords,
                                               .same_place = same_place,
                                               .merge = merge,
                                               .put = put};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
