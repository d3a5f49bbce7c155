// SPDX-License-Identifier: Apache-2.0
// The buffers in which the rays of one plane lie while its cuts are swept over them.
#pragma once

#include <cstdint>
#include <vector>

#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep_kernel.h"

namespace lenticule::render {

/// Of one thread; keeps its memory from plane to plane.
class PlaneCells {
 public:
  /// Arranges rays as [place under the lens][lens]; nothing is seen yet. `rays` gets padding, and
  /// must stay until the cells are arranged anew.
  void arrange(const sweep_kernel::Kernel& kernel, double inverse_z, PlaneRays& rays);

  [[nodiscard]] const sweep_kernel::Cells& cells() const { return cells_; }
  [[nodiscard]] const sweep_kernel::Spread& spread() const { return spread_; }
  /// First ray of each lens, then the number of rays.
  [[nodiscard]] const int32_t* first() const { return first_.data(); }
  /// How many elements an array over rays must have for the kernel.
  [[nodiscard]] size_t padded_rays() const { return padded_rays_; }

 private:
  void number_lenses(const PlaneRays& rays);
  void set_buffers();
  void set_steps(double inverse_z, const PlaneRays& rays);
  void set_extremes();

  sweep_kernel::Cells cells_{};
  sweep_kernel::Spread spread_{};
  std::vector<int32_t> first_;
  std::vector<float> floats_;
  std::vector<int32_t> cuts_;
  std::vector<float> ranges_;
  size_t padded_rays_ = 0;
};

}  // namespace lenticule::render
