// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/gap_search.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "calib/linear_algebra.h"

namespace lenticule::calib {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Grid of the sheet's own phase, any smooth function: fine enough for real deformations.
constexpr KnotGrid kSmooth{.columns = 16, .rows = 9};
constexpr size_t kMostPerView = 700;
constexpr double kShapeStep = 0.02;
constexpr double kSmallestGapPart = 0.2;
constexpr double kLargestGapPart = 4.0;
constexpr size_t kMostCandidates = 6;

struct Row {
  size_t view = 0;
  PlanePoint<double> lens{};
  double turns = 0.0;
};

/// SmoothSheet holds all rows, and a projector that removes the part that a smooth sheet can
/// explain.
class SmoothSheet {
 public:
  SmoothSheet(const std::vector<View>& views, const PoseFit& poses, const optics::Panel& panel)
      : views_(views), poses_(poses), panel_(panel) {
    collect();
    basis_ = MatrixXd::Zero(static_cast<Eigen::Index>(rows_.size()), kSmooth.count());
    for (size_t n = 0; n < rows_.size(); ++n) {
      const Vec2 at{panel.x_px(rows_[n].lens.x), panel.y_px(rows_[n].lens.y)};
      for (const KnotWeight& k : knot_weights(kSmooth, at, panel.width_px, panel.height_px))
        basis_(static_cast<Eigen::Index>(n), k.knot) += k.weight;
    }
    MatrixXd normal = basis_.transpose() * basis_;
    normal.diagonal().array() += 1e-6 * normal.diagonal().maxCoeff();
    solver_.compute(normal);
  }

  [[nodiscard]] VectorXd project(const VectorXd& v) const {
    return v - basis_ * solver_.solve(basis_.transpose() * v);
  }

  /// Returns the lens coordinates that the rows show for a gap of zero.
  [[nodiscard]] VectorXd without_gap() const {
    return each([&](const Row& row) {
      return fringe_turns(views_[row.view].fringe, panel_, row.lens) - row.turns;
    });
  }
  /// Returns the contribution of each millimetre of gap.
  [[nodiscard]] VectorXd per_gap(double shape) const {
    return each([&](const Row& row) {
      const PoseValues& pose = poses_.poses[row.view];
      const double rx = pose[kPupil] - row.lens.x, ry = pose[kPupil + 1] - row.lens.y;
      const double part = 1.0 / std::sqrt(pose[kPupil + 2] * pose[kPupil + 2] +
                                          (1.0 - shape) * (rx * rx + ry * ry));
      return -fringe_turns(views_[row.view].fringe, panel_,
                           PlanePoint<double>{part * rx, part * ry});
    });
  }
  [[nodiscard]] VectorXd one_in_view(size_t view) const {
    return each([&](const Row& row) { return row.view == view ? 1.0 : 0.0; });
  }
  [[nodiscard]] size_t count() const { return rows_.size(); }

 private:
  void collect() {
    for (size_t v = 0; v < views_.size(); ++v) {
      const CameraValues camera = camera_of(poses_.camera, poses_.own[v], views_[v]);
      const std::vector<PhaseObservation>& phases = views_[v].phases;
      const size_t stride = std::max<size_t>(1, phases.size() / kMostPerView);
      for (size_t n = 0; n < phases.size(); n += stride)
        rows_.push_back({.view = v,
                         .lens = lens_plane_point(camera.data(), poses_.poses[v].data(),
                                                  phases[n].camera_px.x, phases[n].camera_px.y),
                         .turns = phases[n].turns});
    }
  }
  template <class Value>
  [[nodiscard]] VectorXd each(const Value& value) const {
    VectorXd v(static_cast<Eigen::Index>(rows_.size()));
    for (size_t n = 0; n < rows_.size(); ++n) v[static_cast<Eigen::Index>(n)] = value(rows_[n]);
    return v;
  }

  const std::vector<View>& views_;
  const PoseFit& poses_;
  const optics::Panel& panel_;
  std::vector<Row> rows_;
  MatrixXd basis_;
  Eigen::LDLT<MatrixXd> solver_;
};

class GapSearch {
 public:
  GapSearch(const std::vector<View>& views, const PoseFit& poses, const SheetStart& start,
            const optics::Panel& panel)
      : sheet_(views, poses, panel), start_(start), views_(views.size()) {
    base_ = sheet_.project(sheet_.without_gap());
    for (size_t v = 1; v < views_; ++v) ones_.push_back(sheet_.project(sheet_.one_in_view(v)));
  }

  std::vector<GapCandidate> run() {
    for (double shape = 0.0; shape <= 1.0 + 1e-9; shape += kShapeStep) try_shape(shape);
    weigh();
    return std::move(found_);
  }

 private:
  /// Steps through gaps and records the whole numbers nearest to the views' remaining offsets.
  void try_shape(double shape) {
    const VectorXd per_gap = sheet_.project(sheet_.per_gap(shape));
    const double gap0 = start_.values[kGap];
    const double step = 0.02 * gap0;
    std::vector<int> before;
    for (double gap = kSmallestGapPart * gap0; gap < kLargestGapPart * gap0; gap += step) {
      const std::vector<int> wholes = lacking(base_ + gap * per_gap);
      if (wholes != before) try_wholes(wholes, per_gap, shape);
      before = wholes;
    }
  }

  /// Returns the views' offsets by least squares, rounded.
  [[nodiscard]] std::vector<int> lacking(const VectorXd& rest) const {
    const auto count = static_cast<Eigen::Index>(ones_.size());
    MatrixXd normal(count, count);
    VectorXd right(count);
    for (Eigen::Index a = 0; a < count; ++a) {
      for (Eigen::Index b = 0; b < count; ++b)
        normal(a, b) = ones_[static_cast<size_t>(a)].dot(ones_[static_cast<size_t>(b)]);
      right[a] = -ones_[static_cast<size_t>(a)].dot(rest);
    }
    const VectorXd offsets = solve_symmetric(normal, right);
    std::vector<int> wholes{0};
    for (Eigen::Index a = 0; a < count; ++a)
      wholes.push_back(static_cast<int>(std::lround(offsets[a])));
    return wholes;
  }

  void try_wholes(const std::vector<int>& wholes, const VectorXd& per_gap, double shape) {
    VectorXd rest = base_;
    for (size_t v = 1; v < views_; ++v) rest += wholes[v] * ones_[v - 1];
    const double gap = -rest.dot(per_gap) / per_gap.squaredNorm();
    if (!(gap > kSmallestGapPart * start_.values[kGap] &&
          gap < kLargestGapPart * start_.values[kGap]))
      return;
    rest += gap * per_gap;
    keep({.whole_lenses = wholes,
          .gap_mm = gap,
          .shape = shape,
          .rms_lenses = std::sqrt(rest.squaredNorm() / static_cast<double>(sheet_.count()))});
  }

  /// Keeps one entry per combination: its best shape.
  void keep(const GapCandidate& candidate) {
    for (GapCandidate& known : found_) {
      if (known.whole_lenses != candidate.whole_lenses) continue;
      if (candidate.rms_lenses < known.rms_lenses) known = candidate;
      return;
    }
    found_.push_back(candidate);
  }

  void weigh() {
    double least = 1e9;
    for (const GapCandidate& c : found_) least = std::min(least, c.rms_lenses);
    least = std::max(least, 1e-4);
    for (GapCandidate& c : found_) {
      const double misfit = c.rms_lenses / least;
      const double gap = std::log(c.gap_mm / start_.values[kGap]) / start_.gap_tolerance;
      const double shape = (c.shape - start_.values[kShape]) / start_.shape_tolerance;
      c.chi_squared =
          misfit * misfit * static_cast<double>(sheet_.count()) + gap * gap + shape * shape;
    }
    std::ranges::sort(found_, {}, &GapCandidate::chi_squared);
    if (found_.size() > kMostCandidates) found_.resize(kMostCandidates);
  }

  SmoothSheet sheet_;
  SheetStart start_;
  size_t views_;
  VectorXd base_;
  std::vector<VectorXd> ones_;
  std::vector<GapCandidate> found_;
};

}  // namespace

std::vector<GapCandidate> search_gaps(const std::vector<View>& views, const PoseFit& poses,
                                      const SheetStart& start, const optics::Panel& panel) {
  if (views.size() < 2) return {};
  return GapSearch(views, poses, start, panel).run();
}

}  // namespace lenticule::calib
