// SPDX-License-Identifier: Apache-2.0
#include "render/depth_budget/depth_of_field.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {

DepthOfField::DepthOfField(const optics::OpticalModel& model)
    : straight_mm_(model.depth_of_field_mm()), kappa_(1.0 - model.rig().sheet.refraction_shape) {}

double DepthOfField::along_mm(double tan_x, double tan_y) const {
  const double down = 1.0 + kappa_ * std::min(tan_y * tan_y, 1.0);
  const double all = down + kappa_ * std::min(tan_x * tan_x, 1.0);
  return straight_mm_ * down / (all * std::sqrt(all));
}

/// The depth of field first grows with t_y and then falls, or only falls, so the minimum is at
/// an end.
double DepthOfField::least_mm() const {
  return std::min(along_mm(1.0, 0.0), along_mm(1.0, 1.0));
}

}  // namespace lenticule::render
