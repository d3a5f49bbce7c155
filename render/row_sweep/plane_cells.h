// SPDX-License-Identifier: Apache-2.0
// PlaneCells holds the rays of one plane in the memory layout that the sweep needs.
#pragma once

#include <cstdint>
#include <vector>

#include "render/row_sweep/row_planes.h"
#include "render/row_sweep/row_sweep_kernel.h"

namespace lenticule::render {

/// PlaneCells belongs to one thread and keeps its memory from plane to plane.
class PlaneCells {
 public:
  /// Arranges rays as [place under the lens][lens]; all cells are reset to seeing nothing. Adds
  /// padding to `rays`. Lifetime: `rays` must stay unchanged until the next arrange().
  void arrange(const sweep_kernel::Kernel& kernel, double inverse_z, PlaneRays& rays);

  [[nodiscard]] const sweep_kernel::Cells& cells() const { return cells_; }
  [[nodiscard]] const sweep_kernel::Spread& spread() const { return spread_; }
  /// Returns the first ray of each lens, followed by the number of rays.
  [[nodiscard]] const int32_t* first() const { return first_.data(); }
  /// Returns the number of elements that arrays over rays must have for the kernel.
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
