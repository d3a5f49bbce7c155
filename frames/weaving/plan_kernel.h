// SPDX-License-Identifier: Apache-2.0
// The inner loops of weave_plan.cpp, compiled once per instruction set: they find the runs of a row
// and join the runs of four rows to records. Plain data only; all variants give the same bits.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::plan_kernel {

/// Numbers selects the view numbers that a run must reproduce.
enum class Numbers : uint8_t {
  NearestView,  ///< the integer part is the nearest view, exactly
  Clamped,      ///< within the tolerance, between the outermost views' centres
  Any,          ///< within the tolerance
};

/// Terms holds the values that are constant for a whole plan.
struct Terms {
  Numbers numbers;
  int views;
  int32_t view_step;  ///< nominal
  int32_t view_most;
  double off_border;  ///< view numbers up to this far beyond a border are on the border
};

/// Picture maps lens points to the picture, as frames::PicturePlace does.
struct Picture {
  double scale_u, scale_v;
  bool bars_beside, bars_above;
  int views, width;
};

/// Places holds the rays of the places of a row, arrays of `count`.
struct Places {
  const double* lens_x_mm;
  const double* lens_y_mm;
  const double* place;
  int count;
};

/// Line holds the places of one row of a set, as the rays give them. Every array has kPadding more
/// elements than places, whose values do not matter.
struct Line {
  const double* view;    ///< numbers, in (0, views]
  const double* column;  ///< picture pixels from the first one's centre, within the picture
  const int32_t* lens;
  const uint8_t* black;  ///< 1 in a black bar
  int places;
};
inline constexpr int kPadding = 8;

/// Run is a run before it shares its steps with other rows. Steps are per place, in the units of
/// weave_kernel.
struct Run {
  int at, count;
  int32_t lens;
  int32_t view;
  int column, share;
  double view_step, column_step, column_bend;
};

struct Kernel {
  /// Writes the three arrays of a line.
  void (*read_places)(const Picture& picture, const Places& places, double* view, double* column,
                      uint8_t* black) noexcept;
  /// Writes the runs of a line, at most one per place, and returns their number.
  int (*find_runs)(const Terms& terms, const Line& line, Run* runs) noexcept;
  /// Joins the runs of four rows by lens, from the left to the right. Writes at most as many
  /// records as there are runs, and returns their number; -1 if a run is not a record even alone,
  /// which would be a bug.
  int (*join_runs)(const Terms& terms, const Line (&lines)[weave_kernel::kRows],
                   const Run* const (&runs)[weave_kernel::kRows],
                   const int (&counts)[weave_kernel::kRows], int places,
                   weave_kernel::Quad* quads) noexcept;
};

}  // namespace lenticule::frames::plan_kernel

namespace lenticule::frames {
LENTICULE_DECLARE_KERNEL(plan_kernel::Kernel, kPlanKernel)
}
