// SPDX-License-Identifier: Apache-2.0
// Sample points of sixteen lanes at once, and their maps to a disc and to a hemisphere. For kernels
// that are compiled once per instruction set; see render/shading/packet_kernel_lanes.h.
#pragma once

#include "render/shading/packet_kernel_lanes.h"
#include "render/shading/sample_data.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

inline Words reversed_bits(const Words& v) {
  Words x = v >> 16 | v << 16;
  x = ((x >> 8) & 0x00ff00ffU) | ((x & 0x00ff00ffU) << 8);
  x = ((x >> 4) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4);
  x = ((x >> 2) & 0x33333333U) | ((x & 0x33333333U) << 2);
  return ((x >> 1) & 0x55555555U) | ((x & 0x55555555U) << 1);
}

/// Applies Owen scrambling to a number whose bits are in reverse order, by a hash in which each bit
/// affects only higher bits (Laine and Karras, with Vegdahl's constants). Returns values in [0, 1).
inline Floats scrambled(uint32_t reversed, const Words& seed) {
  Words x = Words::of(reversed);
  x = x ^ x * 0x3d20adeaU;
  x = x + seed;
  x = x * (seed >> 16 | 1U);
  x = x ^ x * 0x05526c56U;
  x = x ^ x * 0x53a22864U;
  // Keeps as many bits as single precision holds.
  return to_floats(masks_of(reversed_bits(x) >> 8)) * (1.0F / (1 << 24));
}

struct Floats2 {
  Floats x, y;
};

/// Returns cosine and sine by their series; up to pi / 4 the first omitted terms are below 1e-9.
inline Floats2 cos_sin(const Floats& angle) {
  const Floats q = angle * angle;
  const Floats cosine =
      1.0F + q * (-1.0F / 2 +
                  q * (1.0F / 24 + q * (-1.0F / 720 + q * (1.0F / 40320 - q * (1.0F / 3628800)))));
  const Floats sine =
      angle *
      (1.0F + q * (-1.0F / 6 + q * (1.0F / 120 + q * (-1.0F / 5040 + q * (1.0F / 362880)))));
  return {cosine, sine};
}

/// Maps a sample to the unit disc: concentric squares become circles (Shirley and Chiu), and areas
/// keep their ratio.
inline Floats2 on_disc(const sampling::Sample& sample) {
  const Floats a = 2.0F * scrambled(sample.x, words_in(sample.set->scramble[0])) - 1.0F;
  const Floats b = 2.0F * scrambled(sample.y, words_in(sample.set->scramble[1])) - 1.0F;
  const Masks wide = absolute(a) > absolute(b);
  const Floats radius = select(wide, a, b);
  const Floats ratio = select(radius != 0.0F, select(wide, b, a) / radius, Floats{});
  constexpr float kQuarterPi = 0.785398163F;
  const Floats2 turn = cos_sin(kQuarterPi * ratio);
  return {radius * select(wide, turn.x, turn.y), radius * select(wide, turn.y, turn.x)};
}

struct Basis {
  Floats3 x, y;
};
/// Returns two unit vectors perpendicular to `z` and to each other (Duff and others). The formula's
/// branch is at an unusual height, so that common surfaces do not lie on the branch.
inline Basis across(const Floats3& z) {
  const Floats sign = select(z.z < -0.31F, Floats::of(-1.0F), Floats::of(1.0F));
  const Floats a = -1.0F / (sign + z.z);
  const Floats b = z.x * z.y * a;
  return {{1.0F + sign * z.x * z.x * a, sign * b, -(sign * z.x)}, {b, sign + z.y * z.y * a, -z.y}};
}

/// Returns a direction around the unit vector `normal`, with a density proportional to its cosine.
inline Floats3 cosine_direction(const Floats3& normal, const sampling::Sample& sample) {
  const Floats2 at = on_disc(sample);
  const Floats height = root(max(1.0F - (at.x * at.x + at.y * at.y), Floats{}));
  const Basis basis = across(normal);
  return basis.x * at.x + basis.y * at.y + normal * height;
}

/// Disc is a disc that faces the lanes.
struct Disc {
  Floats3 way;  ///< vector to the centre
  float radius;
  Basis basis;

  Disc(const Floats3& to_middle, float of_radius)
      : way(to_middle), radius(of_radius), basis(across(unit(to_middle))) {}
  /// Returns the vector to a point of the unit disc.
  Floats3 way_to(const Floats2& at) const {
    return way + (basis.x * at.x + basis.y * at.y) * Floats::of(radius);
  }
};

/// Radon's seven points of the unit disc, which integrate polynomials of degree 5 exactly. All have
/// the same weight except the first.
inline constexpr int kDiscPoints = 7;
inline constexpr float kDiscPoint[kDiscPoints][2] = {{0.0F, 0.0F},
                                                     {0.81649658F, 0.0F},
                                                     {0.40824829F, 0.70710678F},
                                                     {-0.40824829F, 0.70710678F},
                                                     {-0.81649658F, 0.0F},
                                                     {-0.40824829F, -0.70710678F},
                                                     {0.40824829F, -0.70710678F}};
inline constexpr float kDiscWeight[kDiscPoints] = {0.25F,  0.125F, 0.125F, 0.125F,
                                                   0.125F, 0.125F, 0.125F};

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
