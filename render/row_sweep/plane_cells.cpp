// SPDX-License-Identifier: Apache-2.0
#include "render/row_sweep/plane_cells.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

namespace lenticule::render {
namespace {

constexpr size_t kLanes = sweep_kernel::kLanes;

constexpr size_t rounded_up(size_t count) {
  return (count + kLanes - 1) / kLanes * kLanes;
}

/// Returns the first element at a vector boundary; the buffer has space for the shift.
template <class T>
T* at_vector(T* elements) {
  constexpr size_t kBytes = kLanes * sizeof(T);
  void* at = elements;
  size_t room = 2 * kBytes;
  return static_cast<T*>(std::align(kBytes, kBytes, at, room));
}

/// Returns the row stride; ranges may start at the last lens and extend over kLanes.
size_t stride_for(size_t lenses) {
  const size_t stride = rounded_up(lenses + kLanes);
  // Rows a power of two apart would map to the same cache sets.
  return stride % 128 == 0 ? stride + kLanes : stride;
}

}  // namespace

void PlaneCells::arrange(const sweep_kernel::Kernel& kernel, double inverse_z, PlaneRays& rays) {
  number_lenses(rays);
  set_buffers();
  padded_rays_ = rays.end + static_cast<size_t>(cells_.places) + 2 * kLanes;
  if (rays.x_mm.size() < padded_rays_) rays.x_mm.resize(padded_rays_);
  if (rays.tan_x.size() < padded_rays_) rays.tan_x.resize(padded_rays_);
  set_steps(inverse_z, rays);
  kernel.to_cells(rays.x_mm.data(), rays.tan_x.data(), first_.data(), cells_, spread_);
  set_extremes();
}

void PlaneCells::number_lenses(const PlaneRays& rays) {
  const auto count = static_cast<int32_t>(rays.end);
  const int32_t* lens = rays.lens.data();
  first_.clear();
  int32_t places = 0;
  for (auto n = static_cast<int32_t>(rays.first), guess = 1; n < count;) {
    first_.push_back(n);
    // The numbers of places of two lenses differ by at most one, so the last lens predicts the
    // next.
    int32_t end = std::min(n + guess, count);
    while (end < count && lens[end] == lens[n]) ++end;
    while (lens[end - 1] != lens[n]) --end;
    guess = end - n;
    places = std::max(places, guess);
    n = end;
  }
  // If lenses are very unequal, each ray counts as its own lens.
  const size_t made = rays.end - rays.first;
  if (static_cast<size_t>(places) * stride_for(first_.size()) > 16 * made + 4096) {
    first_.resize(made);
    std::iota(first_.begin(), first_.end(), static_cast<int32_t>(rays.first));
    places = 1;
  }
  cells_.lenses = static_cast<int>(first_.size());
  cells_.places = places;
  cells_.stride = static_cast<int>(stride_for(first_.size()));
  first_.resize(static_cast<size_t>(cells_.stride) + kLanes, count);
}

void PlaneCells::set_buffers() {
  const size_t places = rounded_up(static_cast<size_t>(cells_.places));
  const size_t size = places * static_cast<size_t>(cells_.stride);
  if (floats_.size() < 4 * size + kLanes) floats_.resize(4 * size + kLanes);
  if (cuts_.size() < size + kLanes) cuts_.resize(size + kLanes);
  cells_.x = at_vector(floats_.data());
  cells_.tan = cells_.x + size;
  cells_.z = cells_.tan + size;
  cells_.along = cells_.z + size;
  cells_.cut = at_vector(cuts_.data());
  ranges_.assign(4 * places, 0.0F);
  spread_.x_low = ranges_.data();
  spread_.x_high = spread_.x_low + places;
  spread_.tan_low = spread_.x_high + places;
  spread_.tan_high = spread_.tan_low + places;
}

/// Sets the steps along a row. All rays under a lens meet in one point, and all rays meet the
/// viewing line: along a row, tan changes by -1/Z times the change of x, apart from the place under
/// the lens.
void PlaneCells::set_steps(double inverse_z, const PlaneRays& rays) {
  const auto lenses = static_cast<size_t>(cells_.lenses);
  double step = 1.0;
  if (lenses > 1) {
    const double left = rays.x_mm[rays.first];
    const double right = rays.x_mm[static_cast<size_t>(first_[lenses - 1])];
    step = (right - left) / (cells_.lenses - 1);
  }
  spread_.x_step = static_cast<float>(step);
  spread_.tan_step = static_cast<float>(-step * inverse_z);
}

void PlaneCells::set_extremes() {
  spread_.x_far = spread_.tan_far = 0.0F;
  for (int n = 0; n < cells_.places; ++n) {
    spread_.x_far =
        std::max({spread_.x_far, std::abs(spread_.x_low[n]), std::abs(spread_.x_high[n])});
    spread_.tan_far =
        std::max({spread_.tan_far, std::abs(spread_.tan_low[n]), std::abs(spread_.tan_high[n])});
  }
  const auto lenses = static_cast<float>(cells_.lenses);
  spread_.x_far += std::abs(spread_.x_step) * lenses;
  spread_.tan_far += std::abs(spread_.tan_step) * lenses;
}

}  // namespace lenticule::render
