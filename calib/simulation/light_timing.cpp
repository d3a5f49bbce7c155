// SPDX-License-Identifier: Apache-2.0
// Computes integrals over one exposure.
#include "calib/simulation/light_timing.h"

#include <algorithm>
#include <cmath>

namespace lenticule::calib {
namespace {

/// Returns the integral from 0 to t of exp(-t / tau).
double decay_until(double t, double time_constant) {
  if (time_constant <= 0.0) return 0.0;
  return -time_constant * std::expm1(-t / time_constant);
}

/// Returns the integral from 0 to t of the square wave; t in periods.
double lit_until(double t, double duty) {
  const double whole = std::floor(t);
  return whole * duty + std::min(t - whole, duty);
}

}  // namespace

double old_frame_part(double begin, double length, double switched, double time_constant) {
  const double from = std::max(begin, switched) - switched;
  const double to = std::max(begin + length, switched) - switched;
  const double before = std::clamp(switched - begin, 0.0, length);
  return (before + decay_until(to, time_constant) - decay_until(from, time_constant)) / length;
}

double backlight_mean(double begin, double length, double hertz, double duty) {
  if (hertz <= 0.0) return 1.0;
  const double from = begin * hertz / 1000.0;
  const double to = from + length * hertz / 1000.0;
  return (lit_until(to, duty) - lit_until(from, duty)) / ((to - from) * duty);
}

}  // namespace lenticule::calib
