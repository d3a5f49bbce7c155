// SPDX-License-Identifier: Apache-2.0
// Prepares the kernel's input: constants of the rig, subpixel positions block by block, and the
// number of Newton steps that the rig needs.
#include "optics/row_rays.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "optics/row_rays_kernel.h"

namespace lenticule::optics {
namespace {

using row_kernel::Constants;
using row_kernel::EyeTerms;
using row_kernel::kBlock;
using row_kernel::Kernel;
using row_kernel::Points;

constexpr int kBlockPixels = kBlock / 3;
constexpr int kMaxSteps = 40;

const Kernel& kernel_for(Isa isa) { return LENTICULE_SELECT_KERNEL(isa, kRowKernel); }

Constants constants_of(const OpticalModel& model) {
  const Panel& panel = model.rig().panel;
  const LensSheet& sheet = model.rig().sheet;
  const ResidualSpline& residual = model.residual();
  const double gap = sheet.gap.value;
  return {.half_width_px = panel.width_px / 2.0,
          .half_height_px = panel.height_px / 2.0,
          .pixel_width_mm = panel.pixel_width.value,
          .pixel_height_mm = panel.pixel_height.value,
          .gap_mm = gap,
          .kappa = 1.0 - sheet.refraction_shape,
          .lenses_per_px = 3.0 / sheet.pitch.value,
          .slant = sheet.slant,
          .offset_lenses = sheet.offset.value,
          .lens_per_gap = model.pitch_mm() / gap,
          .slope = sheet.slant * panel.pixel_width.value / panel.pixel_height.value,
          .gap_px_x = gap / panel.pixel_width.value,
          .gap_px_y = gap / panel.pixel_height.value,
          .border_tolerance = kBorderTolerance,
          .serve_steps = kMaxSteps,
          .residual = residual.empty() ? nullptr : residual.coefficients(),
          .residual_columns = static_cast<double>(residual.columns()),
          .residual_rows = static_cast<double>(residual.rows()),
          .knots_per_px_x = residual.knots_per_px_x(),
          .knots_per_px_y = residual.knots_per_px_y()};
}

EyeTerms terms_of(const Eye& eye, double gap_mm) {
  if (std::isinf(eye.z_mm)) return {eye.x, eye.y, 0.0, 0.0, kMaxSteps};
  return {eye.x / eye.z_mm, eye.y / eye.z_mm, 1.0 / eye.z_mm, gap_mm / eye.z_mm, kMaxSteps};
}

/// PositionPattern gives the subpixel positions of any block of a row, from a pattern that is one
/// block longer than the layout's period, so that no block needs a modulo.
class PositionPattern {
 public:
  explicit PositionPattern(const Rig& rig) : layout_(rig.panel.layout) {
    const int pixels = layout_.columns() + kBlockPixels;
    for (int row = 0; row < layout_.rows(); ++row) {
      for (int i = 0; i < pixels; ++i) {
        for (int c = 0; c < 3; ++c) {
          x_.push_back(layout_.offset(i, row, c).x_px);
          y_.push_back(layout_.offset(i, row, c).y_px);
        }
      }
    }
    row_length_ = static_cast<size_t>(3 * pixels);
    for (int lane = 0; lane < kBlock; ++lane) {
      pixel_[static_cast<size_t>(lane)] = lane / 3;
      channel_px_[static_cast<size_t>(lane)] =
          rig.sheet.channel_offset[static_cast<size_t>(lane % 3)].value / 3.0;
    }
  }

  void fill(int i_begin, int j, int count, double* x_px, double* y_px) const {
    const size_t start = static_cast<size_t>(j % layout_.rows()) * row_length_ +
                         3 * static_cast<size_t>(i_begin % layout_.columns());
    const double* x = &x_[start];
    const double* y = &y_[start];
    for (int lane = 0; lane < count; ++lane) {
      // (i + offset) comes first, which rounds as in Panel::subpixel_centre_px.
      x_px[lane] = (i_begin + pixel_[static_cast<size_t>(lane)]) + x[lane];
      y_px[lane] = j + y[lane];
    }
  }

  [[nodiscard]] const double* channel_px() const { return channel_px_.data(); }

 private:
  SubpixelLayout layout_;
  size_t row_length_ = 0;
  std::vector<double> x_, y_;
  std::array<double, kBlock> pixel_{};
  std::array<double, kBlock> channel_px_{};
};

/// TrialPoints are the panel points where the search is hardest or unusual: a grid that includes
/// the corners.
struct TrialPoints {
  explicit TrialPoints(const OpticalModel& model) {
    const Panel& panel = model.rig().panel;
    const LensSheet& sheet = model.rig().sheet;
    constexpr int kAcross = 16, kDown = 12;
    static_assert(kAcross * kDown <= kBlock);
    for (int n = 0; n < kAcross * kDown; ++n) {
      const auto s = static_cast<size_t>(n);
      x_px[s] = panel.width_px * (n % kAcross) / (kAcross - 1.0);
      y_px[s] = panel.height_px * (n / kAcross) / (kDown - 1.0);
      // A small shift along the row spreads the points over all positions under their lenses.
      x_px[s] += sheet.pitch.value / 3.0 * (n % 7) / 7.0;
    }
  }
  [[nodiscard]] Points points() const {
    return {kBlock, x_px.data(), y_px.data(), channel_px.data()};
  }
  std::array<double, kBlock> x_px{}, y_px{}, channel_px{};
};

double largest_difference(const std::array<double, kBlock>& a,
                          const std::array<double, kBlock>& b) {
  double largest = 0.0;
  for (size_t n = 0; n < a.size(); ++n) largest = std::max(largest, std::abs(a[n] - b[n]));
  return largest;
}

/// Returns the smallest number of steps whose values (given by `evaluate(steps)`) differ by less
/// than the tolerance from the values after kMaxSteps, at every trial point.
int steps_needed(const auto& evaluate, double tolerance) {
  const auto converged = evaluate(kMaxSteps);
  for (int steps = 1; steps < kMaxSteps; ++steps) {
    if (largest_difference(evaluate(steps), converged) <= tolerance) return steps;
  }
  return kMaxSteps;
}

int sight_steps_needed(const Constants& constants, EyeTerms eye, const TrialPoints& trial) {
  const double rounding = 1e-15 * (constants.half_width_px * constants.lenses_per_px + 1.0);
  return steps_needed(
      [&](int steps) {
        std::array<double, kBlock> phase{};
        eye.sight_steps = steps;
        isa_baseline::kRowKernel.phases(constants, eye, trial.points(), phase.data());
        return phase;
      },
      std::max(1e-12, 4.0 * rounding));
}

int serve_steps_needed(Constants constants, const EyeTerms& eye, const TrialPoints& trial) {
  const double rounding = 1e-15 * (constants.half_width_px * constants.lenses_per_px + 1.0);
  const int steps = steps_needed(
      [&](int n) {
        std::array<double, kBlock> lens_x{}, lens_y{}, tan_x{}, tan_y{}, place{};
        std::array<int32_t, kBlock> lens{};
        constants.serve_steps = n;
        isa_baseline::kRowKernel.rays(
            constants, eye, trial.points(),
            {lens_x.data(), lens_y.data(), tan_x.data(), tan_y.data(), lens.data(), place.data()});
        return tan_x;
      },
      std::max(1e-13, 4.0 * rounding * constants.lens_per_gap));
  // A residual map may be steeper between the trial points, so it gets one step more.
  return constants.residual != nullptr ? steps + 1 : steps;
}

/// Calls block(first_lane, points) for each block of the row.
void for_each_block(const PositionPattern& pattern, int j, int i_begin, int i_end,
                    const auto& block) {
  alignas(64) std::array<double, kBlock> x_px;
  alignas(64) std::array<double, kBlock> y_px;
  for (int i = i_begin; i < i_end; i += kBlockPixels) {
    const int count = 3 * std::min(kBlockPixels, i_end - i);
    pattern.fill(i, j, count, x_px.data(), y_px.data());
    block(static_cast<size_t>(3 * (i - i_begin)),
          Points{count, x_px.data(), y_px.data(), pattern.channel_px()});
  }
}

void check_range(const Panel& panel, int j, int i_begin, int i_end) {
  LENTICULE_CHECK(j >= 0 && j < panel.height_px);
  LENTICULE_CHECK(i_begin >= 0 && i_begin <= i_end && i_end <= panel.width_px);
}

}  // namespace

void RowRays::resize(size_t subpixels) {
  lens_x_mm.resize(subpixels);
  lens_y_mm.resize(subpixels);
  tan_x.resize(subpixels);
  tan_y.resize(subpixels);
  lens.resize(subpixels);
  place.resize(subpixels);
}

struct RowRayEvaluator::Impl {
  Impl(const OpticalModel& m, Isa isa)
      : model(m),
        kernel(kernel_for(isa)),
        pattern(m.rig()),
        constants(constants_of(model)),
        eye(terms_of(m.design_eye(), m.rig().sheet.gap.value)) {
    const TrialPoints trial(model);
    eye.sight_steps = sight_steps_needed(constants, eye, trial);
    constants.serve_steps = serve_steps_needed(constants, eye, trial);
  }

  OpticalModel model;
  const Kernel& kernel;
  PositionPattern pattern;
  Constants constants;
  EyeTerms eye;
};

RowRayEvaluator::RowRayEvaluator(const OpticalModel& model, Isa isa)
    : impl_(std::make_shared<const Impl>(model, isa)) {}

const OpticalModel& RowRayEvaluator::model() const { return impl_->model; }

void RowRayEvaluator::evaluate(int j, int i_begin, int i_end, RowRays& out) const {
  check_range(impl_->model.rig().panel, j, i_begin, i_end);
  out.resize(static_cast<size_t>(3 * (i_end - i_begin)));
  for_each_block(impl_->pattern, j, i_begin, i_end, [&](size_t at, const Points& points) {
    impl_->kernel.rays(impl_->constants, impl_->eye, points,
                       {out.lens_x_mm.data() + at, out.lens_y_mm.data() + at, out.tan_x.data() + at,
                        out.tan_y.data() + at, out.lens.data() + at, out.place.data() + at});
  });
}

struct RowPhaseEvaluator::Impl {
  Impl(const OpticalModel& m, const Eye& where, Isa isa)
      : model(m),
        kernel(kernel_for(isa)),
        pattern(m.rig()),
        constants(constants_of(model)),
        eye(terms_of(where, m.rig().sheet.gap.value)),
        place(where),
        close(where.z_mm < kClose * m.rig().sheet.gap.value) {
    eye.sight_steps = sight_steps_needed(constants, eye, TrialPoints(model));
  }

  /// Solves one point at a time, for eyes where a fixed number of Newton steps is not enough.
  [[nodiscard]] double phase_without_offset(double x_px, double y_px) const {
    const Panel& panel = model.rig().panel;
    const Vec2 lens = model.lens_point_mm({panel.x_mm(x_px), panel.y_mm(y_px)}, place);
    const double offset_px = model.rig().sheet.channel_offset[1].value / 3.0;
    return model.lens_coordinate(panel.x_px(lens.x) - offset_px, panel.y_px(lens.y), 1);
  }

  OpticalModel model;  // keeps the residual coefficients alive
  const Kernel& kernel;
  PositionPattern pattern;
  Constants constants;
  EyeTerms eye;
  Eye place;
  bool close;  ///< the eye is so near to the panel that only the model itself is accurate

  static constexpr double kClose = 2.0;  ///< gaps
};

RowPhaseEvaluator::RowPhaseEvaluator(const OpticalModel& model, const Eye& eye, Isa isa)
    : impl_(std::make_shared<const Impl>(model, eye, isa)) {}

void RowPhaseEvaluator::evaluate(int j, int i_begin, int i_end, std::vector<double>& phase) const {
  check_range(impl_->model.rig().panel, j, i_begin, i_end);
  phase.resize(static_cast<size_t>(3 * (i_end - i_begin)));
  if (impl_->close) {
    const Panel& panel = impl_->model.rig().panel;
    for (int s = 3 * i_begin; s < 3 * i_end; ++s) {
      const Vec2 at = panel.subpixel_centre_px(s / 3, j, s % 3);
      phase[static_cast<size_t>(s - 3 * i_begin)] =
          impl_->model.phase(at.x, at.y, s % 3, impl_->place);
    }
    return;
  }
  for_each_block(impl_->pattern, j, i_begin, i_end, [&](size_t at, const Points& points) {
    impl_->kernel.phases(impl_->constants, impl_->eye, points, phase.data() + at);
  });
}

void RowPhaseEvaluator::evaluate_points(std::span<const double> x_px, std::span<const double> y_px,
                                        std::span<double> phase) const {
  LENTICULE_CHECK(x_px.size() == phase.size() && y_px.size() == phase.size());
  if (impl_->close) {
    for (size_t k = 0; k < phase.size(); ++k)
      phase[k] = impl_->phase_without_offset(x_px[k], y_px[k]);
    return;
  }
  static constexpr std::array<double, kBlock> kNoOffset{};
  for (size_t at = 0; at < phase.size(); at += kBlock) {
    const auto count = static_cast<int>(std::min(phase.size() - at, size_t{kBlock}));
    impl_->kernel.phases(impl_->constants, impl_->eye,
                         {count, x_px.data() + at, y_px.data() + at, kNoOffset.data()},
                         phase.data() + at);
  }
}

}  // namespace lenticule::optics
