// SPDX-License-Identifier: Apache-2.0
// The shadow is the sum of two layers: a narrow one where the model touches the ground, and a wide
// one of all of it. Each layer takes what hides the sky straight above a point, less the higher it
// is, and blurs that with a kernel that ends at a radius.
#include "render/commit/cast_ground_shadow.h"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "render/shading/pbr_scene.h"
#include "render/shading/shading.h"

namespace lenticule::render {
namespace {

/// Layer is one part of the shadow. Lengths are in sizes of the model.
struct Layer {
  double darkness;  ///< under a large flat model that lies on the ground
  double radius;    ///< radius of the blur kernel
  double height;    ///< from which on nothing casts a shadow
};
constexpr std::array<Layer, 2> kLayers{{{0.45, 0.08, 0.25}, {0.45, 0.25, 1.5}}};
constexpr double kWidest = 0.25, kHighest = 1.5;

/// Distance between rays in sizes of the model, and the largest number of rays along a side.
constexpr double kCell = 0.01;
constexpr double kMostRays = 256.0;
/// A ray ends at the latest after this many surfaces, or when less than this share of it is left.
constexpr int kMostPassed = 64;
constexpr double kLeastShare = 1e-3;
/// Distance in sizes of the model below the ground at which rays start.
constexpr double kBelow = 1e-3;

using Shares = std::array<double, kLayers.size()>;

/// Adds what a surface at a height above the ground, in sizes of the model, hides of a ray.
void add_hidden(double height, double share, Shares& hidden) {
  for (size_t n = 0; n < kLayers.size(); ++n) {
    const double left = 1.0 - std::max(height, 0.0) / kLayers[n].height;
    if (left > 0.0) hidden[n] += share * left * left;
  }
}

/// Returns what hides the ray straight up from a point, by layer.
Shares hidden_above(const Scene& scene, const StandingModel& model, Vec3 origin) {
  Shares hidden{};
  double share = 1.0;
  for (int n = 0; n < kMostPassed && share > kLeastShare; ++n) {
    const double far = model.ground + kHighest * model.size - dot(origin, model.up);
    if (!(far > 0.0)) break;
    const std::optional<Surface> surface = first_surface(scene, origin, model.up, far);
    if (!surface) break;
    const Vec3 passed = scene.pbr->any_passes() ? scene.pbr->passed(*surface) : Vec3{};
    const double on = share * (passed.x + passed.y + passed.z) / 3.0;
    add_hidden((dot(surface->point, model.up) - model.ground) / model.size, share - on, hidden);
    share = on;
    origin = spawn_point(*surface, Side::Far);
  }
  return hidden;
}

/// Returns the grid around the model. Its points stay where they are if the model's bounds change.
GroundGrid grid_around(const StandingModel& model) {
  GroundGrid grid{.up = model.up, .across = model.across, .along = model.along};
  grid.height = model.ground;
  grid.cell =
      std::max(kCell * model.size, std::max(model.x.width(), model.y.width()) / (kMostRays - 2.0));
  const double margin = std::ceil(kWidest * model.size / grid.cell) + 1.0;
  const auto first = [&](const Interval& bounds) {
    return std::floor(bounds.low / grid.cell) - margin;
  };
  const auto count = [&](const Interval& bounds) {
    return static_cast<int>(std::ceil(bounds.high / grid.cell) + margin - first(bounds)) + 1;
  };
  grid.x = first(model.x) * grid.cell;
  grid.y = first(model.y) * grid.cell;
  grid.columns = count(model.x);
  grid.rows = count(model.y);
  return grid;
}

/// Returns the values blurred along one side of the grid, where `step` is the distance between
/// neighbours. Values near the grid's border are zero, so that none are blurred across it.
std::vector<float> blurred(const std::vector<float>& values, int step, double radius_cells) {
  const int reach = std::max(static_cast<int>(std::ceil(radius_cells)) - 1, 0);
  std::vector<double> kernel;
  double sum = 0.0;
  for (int n = -reach; n <= reach; ++n) {
    const double left = 1.0 - (n / radius_cells) * (n / radius_cells);
    sum += kernel.emplace_back(left * left * left);
  }
  std::vector<float> out(values.size());
  const auto count = static_cast<std::ptrdiff_t>(values.size());
  for (int n = -reach; n <= reach; ++n) {
    const std::ptrdiff_t shift = std::ptrdiff_t{n} * step;
    const auto weight = static_cast<float>(kernel[static_cast<size_t>(n + reach)] / sum);
    const std::ptrdiff_t end = std::min(count, count - shift);
    for (std::ptrdiff_t at = std::max<std::ptrdiff_t>(0, -shift); at < end; ++at)
      out[static_cast<size_t>(at)] += weight * values[static_cast<size_t>(at + shift)];
  }
  return out;
}

}  // namespace

std::shared_ptr<const GroundShadow> cast_ground_shadow(const Scene& scene,
                                                       const StandingModel& model) {
  if (!(model.size > 0.0) || !std::isfinite(model.size)) return nullptr;
  const GroundGrid grid = grid_around(model);
  const size_t points = static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows);
  std::array<std::vector<float>, kLayers.size()> hidden;
  for (std::vector<float>& layer : hidden) layer.resize(points);
  const double start = std::min(grid.height, model.z.low) - kBelow * model.size;
  tbb::parallel_for(0, grid.rows, [&](int row) {
    if (const double y = grid.y + row * grid.cell; y < model.y.low || y > model.y.high) return;
    for (int column = 0; column < grid.columns; ++column) {
      if (const double x = grid.x + column * grid.cell; x < model.x.low || x > model.x.high)
        continue;
      const Vec3 from = grid.point(column, row) + grid.up * (start - grid.height);
      const Shares shares = hidden_above(scene, model, from);
      for (size_t n = 0; n < kLayers.size(); ++n)
        hidden[n][static_cast<size_t>(row) * static_cast<size_t>(grid.columns) +
                  static_cast<size_t>(column)] = static_cast<float>(shares[n]);
    }
  });
  std::vector<float> darkness(points);
  for (size_t n = 0; n < kLayers.size(); ++n) {
    const double radius = kLayers[n].radius * model.size / grid.cell;
    const std::vector<float> soft = blurred(blurred(hidden[n], 1, radius), grid.columns, radius);
    for (size_t at = 0; at < points; ++at)
      darkness[at] += static_cast<float>(kLayers[n].darkness) * soft[at];
  }
  return std::make_shared<const GroundShadow>(grid, std::move(darkness));
}

}  // namespace lenticule::render
