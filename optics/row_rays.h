// SPDX-License-Identifier: Apache-2.0
// Computes the rays of many subpixels of a pixel row at once with SIMD; the map is the same as in
// OpticalModel::ray.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "optics/model.h"

namespace lenticule::optics {

/// RowRays is a structure of arrays over subpixels; element s - 3 * i_begin is subpixel s = 3 i +
/// channel.
struct RowRays {
  std::vector<double> lens_x_mm;
  std::vector<double> lens_y_mm;
  std::vector<double> tan_x;
  std::vector<double> tan_y;
  std::vector<int32_t> lens;
  std::vector<double> place;

  [[nodiscard]] size_t size() const { return lens_x_mm.size(); }
  void resize(size_t subpixels);
};

/// RowRayEvaluator evaluates rows of one rig. Immutable after construction; evaluate() does not
/// allocate once `out` has its size.
///
/// Thread safety: any thread may call evaluate().
class RowRayEvaluator {
 public:
  /// Throws Error(Usage) for an instruction set that this machine cannot run.
  explicit RowRayEvaluator(const OpticalModel& model, Isa isa = best_isa());

  /// Computes the rays of pixels [i_begin, i_end) of row j, all three channels. Every instruction
  /// set gives the same bits. The phase differs from OpticalModel::ray by less than 1e-9 lens
  /// (tested).
  void evaluate(int j, int i_begin, int i_end, RowRays& out) const;

  [[nodiscard]] const OpticalModel& model() const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

/// RowPhaseEvaluator computes OpticalModel::phase for one eye: Phi_E of every subpixel of a row.
///
/// Thread safety: any thread may call evaluate().
class RowPhaseEvaluator {
 public:
  /// Requires eye.z_mm > 0. Throws Error(Usage) for an instruction set that this machine cannot
  /// run.
  RowPhaseEvaluator(const OpticalModel& model, const Eye& eye, Isa isa = best_isa());

  /// Sets element s - 3 * i_begin of `phase` to Phi_E of subpixel s = 3 i + channel of row j.
  void evaluate(int j, int i_begin, int i_end, std::vector<double>& phase) const;

  /// Computes the phases of arbitrary panel points, in pixels, without a colour's offset. The three
  /// spans must have the same length.
  void evaluate_points(std::span<const double> x_px, std::span<const double> y_px,
                       std::span<double> phase) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace lenticule::optics
