// SPDX-License-Identifier: Apache-2.0
#include "render/depth_budget/prefilter.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Wraps a value to [-1/2, 1/2).
double wrapped(double value) {
  return value - std::floor(value + 0.5);
}

int largest_odd(int count) {
  return count - (count + 1) % 2;
}

/// Steps from one place to the next: down, and across the lens.
struct Steps {
  double down = 0.0;
  double across = 0.0;
};

/// Returns the steps. For the numbers of rays that beam_rays() returns, rank-1 lattices: of all
/// lattices, those whose mean over sine waves in front of and behind sheets of several slants is
/// closest to the mean over the whole beam. For other numbers, powers of the root of r^3 = r + 1,
/// whose multiples fill a square evenly.
Steps steps_for(int rays) {
  struct Lattice {
    int rays, down, across;
  };
  constexpr Lattice kLattices[] = {{5, 2, 3}, {9, 2, 5}, {17, 4, 2}, {33, 14, 4}, {65, 18, 61}};
  for (const Lattice& lattice : kLattices)
    if (lattice.rays == rays)
      return {static_cast<double>(lattice.down) / rays, static_cast<double>(lattice.across) / rays};
  constexpr double kRoot = 1.3247179572447460;
  return {1.0 / kRoot, 1.0 / (kRoot * kRoot)};
}

}  // namespace

Prefilter prefilter_named(const std::string& name) {
  if (name == "off") return Prefilter::Off;
  if (name == "depth") return Prefilter::Depth;
  if (name == "beam") return Prefilter::Beam;
  if (name == "exhaustive") return Prefilter::Exhaustive;
  throw Error(ErrorKind::Usage, fmt::format("prefilter '{}': unknown", name),
              "use off, depth, beam or exhaustive");
}

std::vector<SubpixelPlace> beam_samples(int count) {
  const int rays = largest_odd(count);
  const Steps steps = steps_for(rays);
  std::vector<SubpixelPlace> places = {{}};
  for (int k = 1; k <= rays / 2; ++k)
    for (const double side : {1.0, -1.0})
      places.push_back({.x = side * k / rays,
                        .y = side * wrapped(k * steps.down),
                        .lens = side * wrapped(k * steps.across)});
  return places;
}

int beam_rays(double depth, int most) {
  const double wanted = 2.0 * (1.0 + depth);
  int rays = 5;
  while (rays < most && rays < wanted) rays = 2 * rays - 1;
  return rays <= most ? rays : largest_odd(most);
}

}  // namespace lenticule::render
