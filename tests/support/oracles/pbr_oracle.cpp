// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/pbr_oracle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::test {
namespace {

using render::PbrPoint;
constexpr double kPi = std::numbers::pi;

struct Axes {
  Vec3 x, y, z;
};
Axes around(Vec3 z) {
  const Vec3 x = normalized(cross(z, std::abs(z.z) < 0.5 ? Vec3{0, 0, 1} : Vec3{0, 1, 0}));
  return {x, cross(z, x), z};
}

/// Returns Smith's Lambda of a direction in the surface's frame.
double lambda(Vec3 d, double at, double ab) {
  const double tan_squared = (at * at * d.x * d.x + ab * ab * d.y * d.y) / (d.z * d.z);
  return (std::sqrt(1.0 + tan_squared) - 1.0) / 2.0;
}

double distribution(Vec3 h, double at, double ab) {
  const double e = h.x * h.x / (at * at) + h.y * h.y / (ab * ab) + h.z * h.z;
  return 1.0 / (kPi * at * ab * e * e);
}

/// Returns D G2 / (4 (n . l) (n . v)).
double facets(Vec3 v, Vec3 l, double at, double ab) {
  const Vec3 h = normalized(v + l);
  const double shadowing = 1.0 / (1.0 + lambda(v, at, ab) + lambda(l, at, ab));
  return distribution(h, at, ab) * shadowing / (4.0 * v.z * l.z);
}

double fresnel(double f0, double f90, double cosine) {
  return f0 + (f90 - f0) * std::pow(1.0 - cosine, 5.0);
}

Vec3 each(double (*of)(double, double, double), Vec3 a, Vec3 b, double c) {
  return {of(a.x, b.x, c), of(a.y, b.y, c), of(a.z, b.z, c)};
}

double component(Vec3 v, int n) { return n == 0 ? v.x : n == 1 ? v.y : v.z; }

}  // namespace

double oracle_ggx_albedo(double view_cosine, double roughness, double f0, double f90) {
  // Midpoint rule over microfacet normals with the density of GGX, denser still where few are
  // tilted far: they are all that grazing views see.
  constexpr int kSteps = 300;
  const double a = roughness * roughness;
  const Vec3 v{std::sqrt(1.0 - view_cosine * view_cosine), 0.0, view_cosine};
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i)
    for (int k = 0; k < kSteps; ++k) {
      const double rest = 1.0 - (i + 0.5) / kSteps, turn = kPi * (k + 0.5) / kSteps;
      const double left = rest * rest * rest, density = 3.0 * rest * rest;
      const double tan = a * std::sqrt((1.0 - left) / left), z = 1.0 / std::sqrt(1.0 + tan * tan);
      const Vec3 h{z * tan * std::cos(turn), z * tan * std::sin(turn), z};
      const double along = dot(v, h);
      const Vec3 l = h * (2.0 * along) - v;
      if (along <= 0.0 || l.z <= 0.0) continue;
      const double without_density = facets(v, l, a, a) / distribution(h, a, a);
      sum += density * without_density * fresnel(f0, f90, along) * l.z * 4.0 * along / h.z;
    }
  return sum / (kSteps * kSteps);
}

Vec3 hemisphere_integral(Vec3 axis, int steps, const std::function<Vec3(Vec3)>& value) {
  const Axes axes = around(axis);
  Vec3 sum;
  for (int i = 0; i < steps; ++i)
    for (int k = 0; k < 2 * steps; ++k) {
      const double z = (i + 0.5) / steps, turn = kPi * (k + 0.5) / steps;
      const double across = std::sqrt(1.0 - z * z);
      sum += value(axes.x * (across * std::cos(turn)) + axes.y * (across * std::sin(turn)) +
                   axes.z * z);
    }
  return sum * (2.0 * kPi / (2.0 * steps * steps));
}

namespace {

double sheen_lobe(Vec3 v, Vec3 l, double roughness) {
  const double r = std::max(roughness, 0.07), a = r * r;
  const Vec3 h = normalized(v + l);
  const double sine = std::sqrt(std::max(0.0, 1.0 - h.z * h.z));
  const double density = (2.0 + 1.0 / a) * std::pow(sine, 1.0 / a) / (2.0 * kPi);
  return density / (4.0 * (l.z + v.z - l.z * v.z));
}

}  // namespace

double oracle_sheen_albedo(double view_cosine, double roughness) {
  const Vec3 v{std::sqrt(1.0 - view_cosine * view_cosine), 0.0, view_cosine};
  return hemisphere_integral({0, 0, 1}, 200,
                             [&](Vec3 l) {
                               return Vec3{1, 1, 1} * (sheen_lobe(v, l, roughness) * l.z);
                             })
      .x;
}

Vec3 oracle_of_light(const PbrPoint& p, Vec3 toward_light) {
  if (dot(p.geometric, toward_light) <= 0.0) return {};
  const Vec3 bitangent = cross(p.normal, p.tangent);
  const auto local = [&](Vec3 d) {
    return Vec3{dot(p.tangent, d), dot(bitangent, d), dot(p.normal, d)};
  };
  const Vec3 v = local(p.view), l = local(toward_light);
  const double half_view = dot(normalized(p.view + toward_light), p.view);
  const double ratio = (p.ior - 1.0) / (p.ior + 1.0);

  double coat_albedo = 0.0, coat_light = 0.0;
  if (p.clearcoat > 0.0) {
    const Axes axes = around(p.coat_normal);
    const auto on_coat = [&](Vec3 d) {
      return Vec3{dot(axes.x, d), dot(axes.y, d), dot(axes.z, d)};
    };
    const Vec3 cv = on_coat(p.view), cl = on_coat(toward_light);
    const double a = p.clearcoat_roughness * p.clearcoat_roughness;
    coat_albedo = p.clearcoat * oracle_ggx_albedo(cv.z, p.clearcoat_roughness, 0.04, 1.0);
    if (cl.z > 0.0)
      coat_light = p.clearcoat * kPi * cl.z * facets(cv, cl, a, a) * fresnel(0.04, 1.0, half_view);
  }
  const double most_sheen = std::max({p.sheen_colour.x, p.sheen_colour.y, p.sheen_colour.z});
  const double sheen_albedo =
      most_sheen > 0.0 ? std::min(1.0, oracle_sheen_albedo(v.z, p.sheen_roughness)) : 0.0;

  // The mirror lobe of a dielectric and of a metal, per channel.
  const double white = oracle_ggx_albedo(v.z, p.roughness, 1.0, 1.0);
  const auto total_of = [&](double single, double f0, double f90) {
    const double mean = f0 + (f90 - f0) / 21.0;
    return single + single * mean / (1.0 - mean * (1.0 - white)) * (1.0 - white);
  };
  const auto mix = [&](double dielectric, double metal) {
    return dielectric * (1.0 - p.metallic) + metal * p.metallic;
  };
  const double f90 = mix(p.specular, 1.0);
  double f0[3], albedo[3], single[3], most_albedo = 0.0;
  for (int c = 0; c < 3; ++c) {
    const double dielectric =
        std::min(1.0, ratio * ratio * component(p.specular_colour, c)) * p.specular;
    const double metal = component(p.colour, c);
    const double once = oracle_ggx_albedo(v.z, p.roughness, dielectric, p.specular);
    const double once_metal = oracle_ggx_albedo(v.z, p.roughness, metal, 1.0);
    f0[c] = mix(dielectric, metal);
    single[c] = mix(once, once_metal);
    most_albedo = std::max(most_albedo, total_of(once, dielectric, p.specular));
    albedo[c] = mix(total_of(once, dielectric, p.specular), total_of(once_metal, metal, 1.0));
  }
  const double ab = p.roughness * p.roughness;
  const double at = ab + (1.0 - ab) * p.anisotropy * p.anisotropy;
  const auto channel = [&](int c) {
    double base = 0.0;
    if (l.z > 0.0) {
      const double matt = component(p.colour, c) * (1.0 - p.metallic) * (1.0 - p.transmission) *
                          (1.0 - most_albedo);
      const double stronger = single[c] > 0.0 ? albedo[c] / single[c] : 1.0;
      base = (matt + kPi * facets(v, l, at, ab) * fresnel(f0[c], f90, half_view) * stronger) * l.z *
             (1.0 - most_sheen * sheen_albedo);
      if (most_sheen > 0.0)
        base += component(p.sheen_colour, c) * kPi * sheen_lobe(v, l, p.sheen_roughness) * l.z;
    }
    return base * (1.0 - coat_albedo) + coat_light;
  };
  return {channel(0), channel(1), channel(2)};
}

Vec3 oracle_pbr_neutral(Vec3 light) {
  const double x = std::min({light.x, light.y, light.z});
  const double offset = x < 0.08 ? x - 6.25 * x * x : 0.04;
  const Vec3 c = light - Vec3{offset, offset, offset};
  const double peak = std::max({c.x, c.y, c.z});
  if (peak < 0.76) return c;
  const double new_peak = 1.0 - 0.24 * 0.24 / (peak + 0.24 - 0.76);
  const double g = 1.0 - 1.0 / (0.15 * (peak - new_peak) + 1.0);
  return each([](double a, double b, double part) { return a * (1.0 - part) + b * part; },
              c * (new_peak / peak), Vec3{new_peak, new_peak, new_peak}, g);
}

}  // namespace lenticule::test
