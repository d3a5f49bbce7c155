// SPDX-License-Identifier: Apache-2.0
#include "render/depth_budget/depth_histogram.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "optics/row_rays.h"
#include "render/accel/denormals.h"
#include "render/depth_budget/prefilter.h"
#include "render/row_sweep/row_sweep.h"

namespace lenticule::render {
namespace {

constexpr double kNothing = std::numeric_limits<double>::infinity();

using Colour = std::array<uint8_t, 3>;

Colour between(const Colour& a, const Colour& b, double part) {
  Colour mixed{};
  for (size_t c = 0; c < 3; ++c)
    mixed[c] = static_cast<uint8_t>(std::lround(a[c] + part * (b[c] - a[c])));
  return mixed;
}

Colour colour_of(double depth) {
  constexpr double kDoublings = 3.0;
  constexpr Colour kWhite{255, 255, 255}, kGrey{96, 96, 96};
  if (std::isinf(depth)) return {};
  const double off = std::abs(depth);
  if (off <= 1.0) return between(kWhite, kGrey, off);
  const double part = std::min(std::log2(off) / kDoublings, 1.0);
  return depth > 0.0 ? between({255, 220, 0}, {200, 0, 0}, part)
                     : between({0, 220, 255}, {0, 0, 200}, part);
}

/// RowMeter measures rows for one thread.
class RowMeter {
 public:
  RowMeter(const RowSweep& sweep, const optics::OpticalModel& model)
      : sweep_(sweep),
        evaluator_(model),
        depth_of_field_(model),
        histogram_(model.rig().sheet.pitch.value) {}

  void measure(int row, const DepthPictures& pictures) {
    sweep_.sweep(row, swept_);
    evaluator_.evaluate(row, 0, evaluator_.model().rig().panel.width_px, rays_);
    for (size_t s = 0; s < rays_.size(); ++s) {
      const double depth = depth_at(s);
      histogram_.add(depth, double{swept_.z_mm[s]});
      if (pictures.map != nullptr && s % 3 == 1)
        std::ranges::copy(colour_of(depth), pictures.map->row(row) + s - 1);
      if (pictures.beyond != nullptr)
        pictures.beyond->row(row)[s] = std::abs(depth) > 1.0 ? 255 : 0;
    }
  }
  [[nodiscard]] const DepthHistogram& histogram() const { return histogram_; }

 private:
  [[nodiscard]] double depth_at(size_t s) const {
    if (swept_.cut[s] == SweptRow::kNothing) return kNothing;
    return double{swept_.z_mm[s]} / depth_of_field_.along_mm(rays_.tan_x[s], rays_.tan_y[s]);
  }

  RowSweep::Worker sweep_;
  optics::RowRayEvaluator evaluator_;
  DepthOfField depth_of_field_;
  DepthHistogram histogram_;
  SweptRow swept_;
  optics::RowRays rays_;
};

}  // namespace

DepthHistogram::DepthHistogram(double views)
    : views_(views), bins_(static_cast<size_t>(2) * kReach * kBinsPerDepth) {}

void DepthHistogram::add(double depth, double z_mm) {
  if (!std::isfinite(depth)) {
    ++nothing_;
    return;
  }
  const double off = std::abs(depth);
  if (off * views_ <= 1.0) ++at_panel_;
  ++(off <= 1.0 ? within_ : depth > 0.0 ? in_front_ : behind_);
  nearest_mm_ = std::max(nearest_mm_, z_mm);
  farthest_mm_ = std::min(farthest_mm_, z_mm);
  const double bin = std::floor((depth + kReach) * kBinsPerDepth);
  const auto last = static_cast<double>(bins_.size() - 1);
  ++bins_[static_cast<size_t>(std::clamp(bin, 0.0, last))];
}

DepthHistogram& DepthHistogram::operator+=(const DepthHistogram& other) {
  nothing_ += other.nothing_;
  at_panel_ += other.at_panel_;
  within_ += other.within_;
  in_front_ += other.in_front_;
  behind_ += other.behind_;
  nearest_mm_ = std::max(nearest_mm_, other.nearest_mm_);
  farthest_mm_ = std::min(farthest_mm_, other.farthest_mm_);
  for (size_t bin = 0; bin < bins_.size(); ++bin) bins_[bin] += other.bins_[bin];
  return *this;
}

uint64_t DepthHistogram::subpixels() const {
  return nothing_ + within_ + in_front_ + behind_;
}

double DepthHistogram::bin_begin(size_t bin) {
  return static_cast<double>(bin) / kBinsPerDepth - kReach;
}

DepthHistogram measure_depth(const optics::OpticalModel& model, const Scene& scene, int threads,
                             const DepthPictures& pictures) {
  const RowPlanes planes(model);
  const RowSweep sweep(planes, scene);
  constexpr int kBand = 16;  // rows in ascending order share work
  tbb::enumerable_thread_specific<RowMeter> meters([&] { return RowMeter(sweep, model); });
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute([&] {
    tbb::parallel_for(0, (planes.rows() + kBand - 1) / kBand, [&](int band) {
      const FlushDenormals flush;
      const int end = std::min((band + 1) * kBand, planes.rows());
      for (int row = band * kBand; row < end; ++row) meters.local().measure(row, pictures);
    });
  });
  DepthHistogram sum(model.rig().sheet.pitch.value);
  for (const RowMeter& meter : meters) sum += meter.histogram();
  return sum;
}

}  // namespace lenticule::render
