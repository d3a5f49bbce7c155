// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_brdf.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

namespace lenticule::render {
namespace {

constexpr double kPi = std::numbers::pi;

double fifth_power(double v) {
  const double squared = v * v;
  return squared * squared * v;
}

/// Returns the radical inverse of i in base 2.
double radical_inverse(unsigned i) {
  double value = 0.0;
  for (double digit = 0.5; i != 0; i >>= 1, digit *= 0.5)
    if (i & 1U) value += digit;
  return value;
}

/// Table of a function of the view cosine and the roughness, which is looked up bilinearly. The
/// knots are uniform in the root of the cosine, since the functions are steep at grazing angles.
template <class Value>
class AlbedoTable {
 public:
  template <class Function>
  explicit AlbedoTable(const Function& function) {
    const auto set_row = [&](size_t c) {
      const double root = std::max(1e-2, static_cast<double>(c) / kCosines);
      for (size_t r = 0; r <= kRoughnesses; ++r)
        values_[c][r] = function(root * root, static_cast<double>(r) / kRoughnesses);
    };
    // A thread that waits must not take on work that looks up the table.
    tbb::this_task_arena::isolate([&] { tbb::parallel_for(size_t{0}, kCosines + 1, set_row); });
  }

  [[nodiscard]] Value at(double cosine, double roughness) const {
    const double c = std::sqrt(std::clamp(cosine, 0.0, 1.0)) * kCosines;
    const double r = std::clamp(roughness, 0.0, 1.0) * kRoughnesses;
    const size_t i = std::min(static_cast<size_t>(c), kCosines - 1);
    const size_t k = std::min(static_cast<size_t>(r), kRoughnesses - 1);
    const double u = c - static_cast<double>(i), v = r - static_cast<double>(k);
    return mix(mix(values_[i][k], values_[i][k + 1], v),
               mix(values_[i + 1][k], values_[i + 1][k + 1], v), u);
  }
  [[nodiscard]] const Value& knot(size_t cosine, size_t roughness) const {
    return values_[cosine][roughness];
  }

 private:
  static constexpr size_t kCosines = pbr_kernel::AlbedoTable::kSteps;
  static constexpr size_t kRoughnesses = pbr_kernel::AlbedoTable::kSteps;
  static double mix(double a, double b, double t) { return a + (b - a) * t; }
  static GgxAlbedo mix(GgxAlbedo a, GgxAlbedo b, double t) {
    return {mix(a.scale, b.scale, t), mix(a.bias, b.bias, t)};
  }

  std::array<std::array<Value, kRoughnesses + 1>, kCosines + 1> values_;
};

/// Returns Smith's Lambda for an isotropic surface.
double smith_lambda(double cosine, double alpha) {
  const double squared = cosine * cosine;
  return 0.5 * (std::sqrt(1.0 + alpha * alpha * (1.0 - squared) / squared) - 1.0);
}

/// The numbers of visible_normal() that do not depend on the view.
struct DiscPoint {
  double radius, cosine, sine;
};
constexpr unsigned kSamples = 512;
std::array<DiscPoint, kSamples> disc_points() {
  std::array<DiscPoint, kSamples> points{};
  for (unsigned n = 0; n < kSamples; ++n) {
    const double angle = 2.0 * kPi * radical_inverse(n);
    points[n] = {std::sqrt((n + 0.5) / kSamples), std::cos(angle), std::sin(angle)};
  }
  return points;
}

/// Returns a microfacet normal that is visible from `view`, with the density of visible normals
/// (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018).
LocalVec visible_normal(LocalVec view, double alpha, const DiscPoint& at) {
  const LocalVec stretched = normalized(LocalVec{alpha * view.x, alpha * view.y, view.z});
  const double across = stretched.x * stretched.x + stretched.y * stretched.y;
  const LocalVec t1 = across > 0.0 ? LocalVec{-stretched.y, stretched.x, 0.0} / std::sqrt(across)
                                   : LocalVec{1, 0, 0};
  const LocalVec t2 = cross(stretched, t1);
  const double p1 = at.radius * at.cosine;
  const double s = 0.5 * (1.0 + stretched.z);
  const double p2 = (1.0 - s) * std::sqrt(std::max(0.0, 1.0 - p1 * p1)) + s * at.radius * at.sine;
  const LocalVec normal =
      t1 * p1 + t2 * p2 + stretched * std::sqrt(std::max(0.0, 1.0 - p1 * p1 - p2 * p2));
  return normalized(LocalVec{alpha * normal.x, alpha * normal.y, std::max(0.0, normal.z)});
}

GgxAlbedo integrated_ggx(double cosine, double roughness) {
  const double alpha = roughness * roughness;
  const double mirror = fifth_power(1.0 - cosine);
  if (alpha == 0.0) return {1.0 - mirror, mirror};
  static const std::array<DiscPoint, kSamples> points = disc_points();
  const LocalVec view{std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), 0.0, cosine};
  const double masking = 1.0 + smith_lambda(cosine, alpha);
  GgxAlbedo sum{0.0, 0.0};
  for (const DiscPoint& point : points) {
    const LocalVec half = visible_normal(view, alpha, point);
    const double along = dot(view, half);
    const double light_cosine = 2.0 * along * half.z - view.z;
    if (light_cosine <= 0.0) continue;
    // Height-correlated masking and shadowing over the masking that the samples contain already.
    const double weight = masking / (masking + smith_lambda(light_cosine, alpha));
    const double fresnel = fifth_power(1.0 - std::min(1.0, along));
    sum.scale += weight * (1.0 - fresnel) / kSamples;
    sum.bias += weight * fresnel / kSamples;
  }
  return sum;
}

double integrated_sheen(double cosine, double roughness) {
  constexpr int kHeights = 32, kTurns = 24;
  const double held = std::max(roughness, kSmallestSheenRoughness);
  const LocalVec view{std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), 0.0, cosine};
  double sum = 0.0;
  for (int i = 0; i < kHeights; ++i)
    for (int k = 0; k < kTurns; ++k) {
      const double z = (i + 0.5) / kHeights, turn = kPi * (k + 0.5) / kTurns;
      const double across = std::sqrt(1.0 - z * z);
      const LocalVec light{across * std::cos(turn), across * std::sin(turn), z};
      const LocalVec half = normalized(view + light);
      sum += charlie_distribution(half.z, held * held) * neubelt_visibility(cosine, z) * z;
    }
  return std::min(1.0, sum * 2.0 * kPi / (kHeights * kTurns));
}

}  // namespace

double ggx_distribution(LocalVec half, double alpha_t, double alpha_b) {
  const double product = alpha_t * alpha_b;
  const LocalVec scaled{alpha_b * half.x, alpha_t * half.y, product * half.z};
  const double ratio = product / dot(scaled, scaled);
  return product * ratio * ratio / kPi;
}

double smith_visibility(LocalVec view, LocalVec light, double alpha_t, double alpha_b) {
  const double by_view = light.z * length(LocalVec{alpha_t * view.x, alpha_b * view.y, view.z});
  const double by_light = view.z * length(LocalVec{alpha_t * light.x, alpha_b * light.y, light.z});
  return 0.5 / (by_view + by_light);
}

Vec3 dielectric_f0(double ior, double specular, Vec3 specular_colour) {
  const double ratio = (ior - 1.0) / (ior + 1.0);
  const Vec3 plain = specular_colour * (ratio * ratio);
  return Vec3{std::min(plain.x, 1.0), std::min(plain.y, 1.0), std::min(plain.z, 1.0)} * specular;
}

Vec3 schlick(Vec3 f0, Vec3 f90, double cosine) {
  return f0 + (f90 - f0) * fifth_power(1.0 - std::clamp(cosine, 0.0, 1.0));
}

namespace {

const AlbedoTable<GgxAlbedo>& ggx_table() {
  static const AlbedoTable<GgxAlbedo> table(integrated_ggx);
  return table;
}

}  // namespace

GgxAlbedo ggx_albedo(double view_cosine, double roughness) {
  return ggx_table().at(view_cosine, roughness);
}

const pbr_kernel::AlbedoTable& ggx_albedo_table() {
  static const auto table = [] {
    auto values = std::make_unique<pbr_kernel::AlbedoTable>();
    for (size_t c = 0; c <= pbr_kernel::AlbedoTable::kSteps; ++c)
      for (size_t r = 0; r <= pbr_kernel::AlbedoTable::kSteps; ++r) {
        const GgxAlbedo& knot = ggx_table().knot(c, r);
        values->values[c][r][0] = static_cast<float>(knot.scale);
        values->values[c][r][1] = static_cast<float>(knot.bias);
      }
    return values;
  }();
  return *table;
}

double charlie_distribution(double half_cosine, double alpha) {
  const double inverse = 1.0 / alpha;
  const double sine_squared = std::max(0.0, 1.0 - half_cosine * half_cosine);
  return (2.0 + inverse) * std::pow(sine_squared, 0.5 * inverse) / (2.0 * kPi);
}

double neubelt_visibility(double view_cosine, double light_cosine) {
  return 0.25 / (light_cosine + view_cosine - light_cosine * view_cosine);
}

double sheen_albedo(double view_cosine, double roughness) {
  static const AlbedoTable<double> table(integrated_sheen);
  return table.at(view_cosine, roughness);
}

namespace {

Vec3 each_pair(Vec3 a, Vec3 b, double (*of)(double, double)) {
  return {of(a.x, b.x), of(a.y, b.y), of(a.z, b.z)};
}

double f0_between(double to, double from) {
  const double ratio = (to - from) / (to + from);
  return ratio * ratio;
}

/// Returns the response of the eye, in linear sRGB, to light of the given difference of paths.
Vec3 sensitivity(double path_nm, Vec3 shift) {
  constexpr Vec3 kValue{5.4856e-13, 4.4201e-13, 5.2481e-13};
  constexpr Vec3 kPosition{1.6810e+06, 1.7953e+06, 2.2084e+06};
  constexpr Vec3 kVariance{4.3278e+09, 9.3046e+09, 6.6121e+09};
  constexpr double kPeak = 1.0685e-7;
  const double phase = 2.0 * kPi * path_nm * 1e-9;
  const auto lobe = [phase](double value, double position, double variance, double by) {
    return value * std::sqrt(2.0 * kPi * variance) * std::cos(position * phase + by) *
           std::exp(-phase * phase * variance);
  };
  Vec3 xyz{lobe(kValue.x, kPosition.x, kVariance.x, shift.x),
           lobe(kValue.y, kPosition.y, kVariance.y, shift.y),
           lobe(kValue.z, kPosition.z, kVariance.z, shift.z)};
  xyz.x += lobe(9.7470e-14, 2.2399e+06, 4.5282e+09, shift.x);
  constexpr Affine kLinearFromXyz{{3.2404542, -0.9692660, 0.0556434},
                                  {-1.5371385, 1.8760108, -0.2040259},
                                  {-0.4985314, 0.0415560, 1.0572252},
                                  {}};
  return kLinearFromXyz.vector(xyz / kPeak);
}

/// Returns the light that a film and its base reflect.
Vec3 film_reflectance(double film_ior, double view_cosine, double thickness_nm, Vec3 base_f0) {
  constexpr Vec3 kOne{1, 1, 1};
  // A film much thinner than light has no effect.
  const double part = std::clamp(thickness_nm / 0.03, 0.0, 1.0);
  const double ior = 1.0 + (film_ior - 1.0) * part * part * (3.0 - 2.0 * part);
  const double inner_squared = 1.0 - (1.0 - view_cosine * view_cosine) / (ior * ior);
  if (inner_squared < 0.0) return kOne;
  const double inner_cosine = std::sqrt(inner_squared);
  const double first = schlick(kOne * f0_between(ior, 1.0), kOne, view_cosine).x;
  const double passed = 1.0 - first;
  const double back_shift = ior < 1.0 ? 0.0 : kPi;
  const auto base_ior = [](double f0, double) {
    const double root = std::sqrt(std::clamp(f0, 0.0, 0.9999));
    return (1.0 + root) / (1.0 - root);
  };
  const Vec3 under = each_pair(base_f0, {}, base_ior);
  const Vec3 second = schlick(each_pair(under, kOne * ior, f0_between), kOne, inner_cosine);
  const Vec3 shift =
      each_pair(under, kOne * ior, [](double a, double b) { return a < b ? kPi : 0.0; }) +
      kOne * back_shift;
  const double path_nm = 2.0 * ior * thickness_nm * inner_cosine;
  const Vec3 both = each_pair(second, kOne * first,
                              [](double a, double b) { return std::clamp(a * b, 1e-5, 0.9999); });
  const Vec3 root = each_pair(both, {}, [](double a, double) { return std::sqrt(a); });
  const Vec3 series =
      each_pair(second * (passed * passed), both, [](double a, double b) { return a / (1.0 - b); });
  Vec3 light = series + kOne * first;
  Vec3 term = series - kOne * passed;
  for (int m = 1; m <= 2; ++m) {
    term = term * root;
    light += term * (sensitivity(m * path_nm, shift * static_cast<double>(m)) * 2.0);
  }
  return each_pair(light, {}, [](double a, double) { return std::max(a, 0.0); });
}

}  // namespace

Vec3 film_f0(double film_ior, double view_cosine, double thickness_nm, Vec3 base_f0) {
  const Vec3 seen = film_reflectance(film_ior, view_cosine, thickness_nm, base_f0);
  // Solves Schlick's approximation with f90 = 1 for f0.
  const double grazing = std::min(0.9999, fifth_power(1.0 - std::clamp(view_cosine, 0.0, 1.0)));
  return each_pair(seen, {grazing, grazing, grazing},
                   [](double f, double g) { return std::clamp((f - g) / (1.0 - g), 0.0, 1.0); });
}

}  // namespace lenticule::render
