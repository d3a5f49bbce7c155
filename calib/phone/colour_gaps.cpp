// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/colour_gaps.h"

#include <algorithm>
#include <cmath>

#include "calib/fit/observations.h"

namespace lenticule::calib {
namespace {

/// Returns the derivative of PhoneModel::phase_of() by the gap, lenses per mm.
double phase_per_gap(const PhoneModel& model, const Eigen::VectorXd& values, size_t n,
                     const FringeSeen& seen) {
  constexpr double kPart = 1e-3;
  const double* camera = values.data();
  const double* sheet = camera + kCameraCount;
  const double* photo = camera + model.photo_at(n);
  SheetParameters more;
  std::copy_n(sheet, kSheetCount, more.begin());
  more[kGap] *= 1.0 + kPart;
  PlanePoint<double> lens{};
  return (model.phase_of<double>(camera, more.data(), photo, seen, lens) -
          model.phase_of<double>(camera, sheet, photo, seen, lens)) /
         (kPart * sheet[kGap]);
}

}  // namespace

std::array<Estimate, 3> colour_gaps(const PhoneModel& model, const Eigen::VectorXd& values,
                                    double gap_sigma) {
  const std::vector<PhoneObservations>& photos = model.seen();
  const double gap = values[kCameraCount + kGap];
  std::array<Estimate, 3> gaps;
  for (size_t c = 0; c < gaps.size(); ++c) {
    double product = 0.0, square = 0.0, rest = 0.0, count = 0.0;
    const auto for_each = [&](const auto& use) {
      for (size_t n = 0; n < photos.size(); ++n)
        for (const FringeSeen& seen : photos[n].phases)
          use(seen.weight, seen.colour_turns[c], phase_per_gap(model, values, n, seen));
    };
    for_each([&](double weight, double ahead, double slope) {
      product += weight * ahead * slope;
      square += weight * slope * slope;
    });
    const double more = square > 0.0 ? product / square : 0.0;
    for_each([&](double weight, double ahead, double slope) {
      rest += weight * std::pow(ahead - more * slope, 2);
      count += 1.0;
    });
    const double own = square > 0.0 ? std::sqrt(rest / count / square) : 0.0;
    gaps[c] = {gap + more, std::hypot(gap_sigma, own)};
  }
  return gaps;
}

}  // namespace lenticule::calib
