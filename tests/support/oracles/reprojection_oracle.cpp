// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/reprojection_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lenticule::test {
namespace {

struct InPlane {
  double x = 0.0;
  double z = 0.0;
};

InPlane point_of(const optics::SubpixelRay& ray, const SeenPoint& seen) {
  return {ray.lens_x_mm + ray.tan_x * seen.z_mm, seen.z_mm};
}

}  // namespace

FoundPoint oracle_on_chords(const optics::OpticalModel& model, int row, int channel,
                            const std::vector<SeenPoint>& points, int target, long lens,
                            const OracleRules& rules) {
  const optics::SubpixelRay eye_ray = model.ray(target, row, channel);
  FoundPoint best;
  best.z_mm = -std::numeric_limits<double>::infinity();
  double second = best.z_mm;
  optics::SubpixelRay ray_b = model.ray(0, row, channel);
  for (int i = 0; i + 1 < static_cast<int>(points.size()); ++i) {
    const SeenPoint& a = points[static_cast<size_t>(i)];
    const SeenPoint& b = points[static_cast<size_t>(i + 1)];
    const optics::SubpixelRay ray_a = std::exchange(ray_b, model.ray(i + 1, row, channel));
    if (!a.there || !b.there || ray_a.lens != lens || ray_b.lens != lens) continue;
    const InPlane pa = point_of(ray_a, a);
    const InPlane pb = point_of(ray_b, b);
    // Distances of the ends to the right of the target's ray.
    const double off_a = pa.x - (eye_ray.lens_x_mm + eye_ray.tan_x * pa.z);
    const double off_b = pb.x - (eye_ray.lens_x_mm + eye_ray.tan_x * pb.z);
    const double scale = 1e-4 * (1.0 + std::max(std::abs(pa.z), std::abs(pb.z)));
    if (std::min(std::abs(off_a), std::abs(off_b)) < scale) best.margin = 0.0;
    if ((off_a > 0.0) == (off_b > 0.0)) continue;
    const double part = off_a / (off_a - off_b);
    const double z = pa.z + part * (pb.z - pa.z);
    second = std::max(second, std::min(z, best.z_mm));
    if (z <= best.z_mm) continue;
    second = std::max(second, best.z_mm);
    const double rise = pb.z - pa.z;
    const double width = std::abs((pb.x - pa.x) - ray_b.tan_x * rise);
    const bool one_surface = a.surface == b.surface;
    const double slack = rules.steepest * width - std::abs(rise);
    best.known = one_surface && slack >= 0.0 && std::abs(a.code - b.code) <= rules.agreement;
    best.z_mm = z;
    best.code = a.code + part * (b.code - a.code);
    if (one_surface && std::abs(slack) < scale) best.margin = 0.0;
  }
  if (best.z_mm - second < 1e-3 * (1.0 + std::abs(best.z_mm))) best.margin = 0.0;
  return best;
}

}  // namespace lenticule::test
