// SPDX-License-Identifier: Apache-2.0
// Fits runs to the rays: eight places at a time, which is the length of a run.
#include "frames/weaving/plan_kernel.h"

namespace lenticule::frames::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace plan_kernel;
using weave_kernel::kRows;
using weave_kernel::kRun;
using weave_kernel::kSlopeBits;
using weave_kernel::kViewBits;
using weave_kernel::kWeightBits;
using weave_kernel::Quad;
static_assert(kRun == 8 && kPadding >= kRun);

constexpr double kViewUnit = 1 << kViewBits;
constexpr double kColumnUnit = 1 << kWeightBits;
/// Largest distance of a run from the rays, in the run's own units.
constexpr double kViewTolerance = 32.0;
constexpr double kColumnTolerance = 3.0;
/// The movement of a column along a run, before it is shifted down, stays within 16 bits.
constexpr int kFurthestColumn = 32767;

// The places of a run. In a mask, -1 is true.
using Doubles = double __attribute__((vector_size(8 * kRun)));
using Wide = int64_t __attribute__((vector_size(8 * kRun)));
using Words = int32_t __attribute__((vector_size(4 * kRun)));
using Bytes = int8_t __attribute__((vector_size(kRun)));

constexpr Words kAlong = {0, 1, 2, 3, 4, 5, 6, 7};

inline void load(const double* from, Doubles& to) { __builtin_memcpy(&to, from, sizeof to); }
inline Words narrow(const Wide& mask) { return __builtin_convertvector(mask, Words); }
/// Returns one byte per place, 0xff where the mask is true.
inline uint64_t bytes_of(const Words& mask) {
  const Bytes bytes = __builtin_convertvector(mask, Bytes);
  uint64_t all = 0;
  __builtin_memcpy(&all, &bytes, sizeof all);
  return all;
}
/// Returns the bytes of the first `count` places.
inline uint64_t first_bytes(int count) { return ~uint64_t{0} >> (8 * (kRun - count)); }
inline Doubles magnitude(const Doubles& v) { return v < 0.0 ? -v : v; }

void read_places(const Picture& picture, const Places& places, double* view, double* column,
                 uint8_t* black) noexcept {
  const double views = picture.views, width = picture.width, last = width - 1.0;
  const double scale_u = picture.scale_u, scale_v = picture.scale_v;
  for (int n = 0; n < places.count; ++n) {
    view[n] = views * (0.5 - places.place[n]);
    const double u = 0.5 + places.lens_x_mm[n] * scale_u, at = u * width - 0.5;
    const double inside = at < 0.0 ? 0.0 : at;
    column[n] = last < inside ? last : inside;
  }
  __builtin_memset(black, 0, static_cast<size_t>(places.count));
  for (int n = 0; n < places.count && picture.bars_beside; ++n) {
    const double u = 0.5 + places.lens_x_mm[n] * scale_u;
    if (!(u >= 0.0 && u < 1.0)) black[n] = 1;
  }
  for (int n = 0; n < places.count && picture.bars_above; ++n) {
    const double v = 0.5 - places.lens_y_mm[n] * scale_v;
    if (!(v >= 0.0 && v < 1.0)) black[n] = 1;
  }
}

/// Rounds |v| < 2^31 to the nearest integer, halves away from zero, as std::lround does.
inline int rounded(double v) {
  const int whole = static_cast<int>(v);
  const double rest = v - whole;
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

inline bool is_short(double v) { return v <= 32767.0 && v >= -32767.0; }

/// Returns the view whose span contains the number, as frames::nearest_view does.
inline int nearest_view(const Terms& terms, double number) {
  const double inside = number - terms.off_border;
  int view = static_cast<int>(inside);
  if (static_cast<double>(view) >= inside) --view;
  const int last = terms.views - 1;
  return view < 0 ? 0 : view > last ? last : view;
}

/// Returns a view number in kernel units.
inline int32_t view_of(const Terms& terms, double number) {
  if (terms.numbers == Numbers::NearestView)
    return rounded((number - terms.off_border) * kViewUnit) - 1;
  return rounded((number - 0.5) * kViewUnit);
}

/// Marks the places whose view is not the one of the rays.
inline Words wrong_views(const Terms& terms, const Words& view, const Doubles& number) {
  if (terms.numbers == Numbers::Any)
    return narrow(magnitude(__builtin_convertvector(view, Doubles) - (number - 0.5) * kViewUnit) >
                  kViewTolerance);
  const Words least = Words{}, most = Words{} + terms.view_most;
  const Words above = view < least ? least : view;
  const Words held = above > most ? most : above;
  if (terms.numbers == Numbers::Clamped) {
    const Doubles none = {}, last = none + (terms.views - 1.0);
    const Doubles centre = number - 0.5, inside = centre < none ? none : centre;
    const Doubles wanted = last < inside ? last : inside;
    return narrow(magnitude(__builtin_convertvector(held, Doubles) - wanted * kViewUnit) >
                  kViewTolerance);
  }
  // View k spans (k, k + 1]; the first and the last view span all that is beyond them.
  const Words index = held >> kViewBits, last_view = Words{} + (terms.views - 1);
  const Doubles left = __builtin_convertvector(index, Doubles), inside = number - terms.off_border;
  const Words right_of = narrow(inside > left) | (index == 0);
  const Words left_of = narrow(inside <= left + 1.0) | (index == last_view);
  return ~(right_of & left_of);
}

/// Steps holds the integer values that the runs of a record share.
struct Steps {
  int view, bend;
};

/// Returns the column step such that the run ends where its own parabola does, despite a slightly
/// different bend.
inline int column_step_of(const Run& run, int bend) {
  return rounded(run.column_step + (run.column_bend - bend) * (run.count - 1));
}

inline bool fits(const Terms& terms, const Line& line, const Run& run, const Steps& steps) {
  if (!is_short(steps.view - terms.view_step) || !is_short(steps.bend)) return false;
  const int column_step = column_step_of(run, steps.bend);
  if (!is_short(column_step)) return false;
  Doubles number, column;
  load(line.view + run.at, number);
  load(line.column + run.at, column);
  Words wrong = wrong_views(terms, run.view + kAlong * steps.view, number);
  const Words step = column_step + kAlong * steps.bend, moved = kAlong * step;
  wrong |= (step > kFurthestColumn) | (step < -kFurthestColumn);
  wrong |= (moved > kFurthestColumn) | (moved < -kFurthestColumn);
  const Words share = run.share + (moved >> kSlopeBits);
  wrong |= (share < 0) | (share >= (1 << kWeightBits));
  const Doubles at = run.column * kColumnUnit + __builtin_convertvector(share, Doubles);
  wrong |= narrow(magnitude(at - column * kColumnUnit) > kColumnTolerance);
  return (bytes_of(wrong) & first_bytes(run.count)) == 0;
}

/// Fits the parabola through a run's first, middle and last column.
inline void bend_column(const Line& line, Run& run) {
  const double* const column = line.column + run.at;
  const auto moved = [&](int n) {
    return (column[n] - column[0]) * kColumnUnit * (1 << kSlopeBits);
  };
  const int last = run.count - 1, middle = last / 2;
  const double mean = moved(last) / last;
  if (middle > 0) run.column_bend = (mean - moved(middle) / middle) / (last - middle);
  run.column_step = mean - run.column_bend * last;
}

inline Run run_of(const Terms& terms, const Line& line, int at, int count) {
  const int column = rounded(line.column[at] * kColumnUnit);
  Run run{.at = at,
          .count = count,
          .lens = line.lens[at],
          .view = view_of(terms, line.view[at]),
          .column = column >> kWeightBits,
          .share = column & ((1 << kWeightBits) - 1),
          .view_step = static_cast<double>(terms.view_step),
          .column_step = 0.0,
          .column_bend = 0.0};
  if (count > 1) {
    run.view_step = (line.view[at + count - 1] - line.view[at]) * kViewUnit / (count - 1);
    bend_column(line, run);
  }
  return run;
}

/// Returns the number of places from `at` on, at most kRun, that are under one lens and not black.
inline int places_under_lens(const Line& line, int at) {
  Words lens;
  Bytes black;
  __builtin_memcpy(&lens, line.lens + at, sizeof lens);
  __builtin_memcpy(&black, line.black + at, sizeof black);
  uint64_t in_bar = 0;
  __builtin_memcpy(&in_bar, &black, sizeof in_bar);
  const uint64_t other = bytes_of(lens != line.lens[at]) | in_bar;
  const int alike = other == 0 ? kRun : __builtin_ctzll(other) / 8;
  const int left = line.places - at;
  return alike < left ? alike : left;
}

/// Returns the longest run from `at` on. One place always fits; only a view that rounding put over
/// a border is moved.
inline Run longest_run(const Terms& terms, const Line& line, int at) {
  for (int count = places_under_lens(line, at); count > 1; --count) {
    const Run run = run_of(terms, line, at, count);
    if (!is_short(run.view_step - terms.view_step) || !is_short(run.column_step) ||
        !is_short(run.column_bend))
      continue;
    if (fits(terms, line, run, {rounded(run.view_step), rounded(run.column_bend)})) return run;
  }
  Run run = run_of(terms, line, at, 1);
  Doubles number;
  load(line.view + at, number);
  if ((bytes_of(wrong_views(terms, Words{} + run.view, number)) & first_bytes(1)) != 0)
    run.view = nearest_view(terms, line.view[at]) << kViewBits;
  return run;
}

int find_runs(const Terms& terms, const Line& line, Run* runs) noexcept {
  int found = 0;
  for (int at = 0; at < line.places;) {
    if (line.black[at] != 0) {
      ++at;
      continue;
    }
    runs[found] = longest_run(terms, line, at);
    at += runs[found++].count;
  }
  return found;
}

/// Rows holds the runs that become one record; null for a row without a run.
struct Rows {
  const Run* run[kRows];
};

Steps shared_steps(const Terms& terms, const Rows& rows) {
  double view = 0.0, bend = 0.0;
  int several = 0;
  for (const Run* run : rows.run) {
    if (run == nullptr || run->count < 2) continue;
    view += run->view_step;
    bend += run->column_bend;
    ++several;
  }
  if (several == 0) return {.view = terms.view_step, .bend = 0};
  return {rounded(view / several), rounded(bend / several)};
}

/// Makes one record of the rows' runs if they can share their steps.
bool join(const Terms& terms, const Line (&lines)[kRows], const Rows& rows, int places,
          Quad& quad) {
  const Steps steps = shared_steps(terms, rows);
  int column = 0;
  for (const Run* run : rows.run)
    if (run != nullptr) column = run->column;
  quad = {};
  quad.view_step = static_cast<int16_t>(steps.view - terms.view_step);
  quad.column_bend = static_cast<int16_t>(steps.bend);
  unsigned counts = 0, colours = 0;
  for (int r = 0; r < kRows; ++r) {
    quad.at[r] = static_cast<uint16_t>(places);
    quad.column[r] = static_cast<uint16_t>(column);
    if (const Run* const run = rows.run[r]; run != nullptr) {
      if (!fits(terms, lines[r], *run, steps)) return false;
      quad.view[r] = run->view;
      quad.share[r] = static_cast<uint16_t>(run->share);
      quad.column[r] = static_cast<uint16_t>(run->column);
      quad.at[r] = static_cast<uint16_t>(run->at);
      quad.column_step[r] = static_cast<int16_t>(column_step_of(*run, steps.bend));
      counts |= static_cast<unsigned>(run->count) << (4 * r);
    }
    colours |= quad.at[r] % 3U << (2 * r);
  }
  quad.counts = static_cast<uint16_t>(counts);
  quad.colours = static_cast<uint16_t>(colours);
  return true;
}

int join_runs(const Terms& terms, const Line (&lines)[kRows], const Run* const (&runs)[kRows],
              const int (&counts)[kRows], int places, Quad* quads) noexcept {
  int next[kRows] = {}, made = 0;
  while (true) {
    bool any = false;
    int32_t lens = 0;
    for (int r = 0; r < kRows; ++r) {
      if (next[r] == counts[r]) continue;
      const int32_t here = runs[r][next[r]].lens;
      lens = any && lens < here ? lens : here;
      any = true;
    }
    if (!any) return made;
    Rows rows{};
    for (int r = 0; r < kRows; ++r)
      if (next[r] < counts[r] && runs[r][next[r]].lens == lens) rows.run[r] = &runs[r][next[r]++];
    if (join(terms, lines, rows, places, quads[made])) {
      ++made;
      continue;
    }
    for (int r = 0; r < kRows; ++r) {
      Rows alone{};
      alone.run[r] = rows.run[r];
      if (rows.run[r] != nullptr && !join(terms, lines, alone, places, quads[made++])) return -1;
    }
  }
}

}  // namespace

extern const Kernel kPlanKernel;
const Kernel kPlanKernel{
    .read_places = read_places, .find_runs = find_runs, .join_runs = join_runs};

}  // namespace lenticule::frames::LENTICULE_ISA_NAMESPACE
