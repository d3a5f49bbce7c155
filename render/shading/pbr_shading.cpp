// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_shading.h"

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

// ---- pbr shading

namespace {

constexpr Vec3 kWhite{1, 1, 1};
constexpr Vec3 kCoatF0{0.04, 0.04, 0.04};
/// Normal maps may turn a normal away from the viewer.
constexpr double kSmallestCosine = 1e-3;

double largest(Vec3 v) {
  return std::max({v.x, v.y, v.z});
}

Vec3 mixed(Vec3 a, Vec3 b, double part) {
  return a + (b - a) * part;
}

Vec3 quotient(Vec3 a, Vec3 b) {
  const auto each = [](double x, double y) { return y > 0.0 ? x / y : 1.0; };
  return {each(a.x, b.x), each(a.y, b.y), each(a.z, b.z)};
}

Vec3 mirrored(Vec3 view, Vec3 normal) {
  return normal * (2.0 * dot(view, normal)) - view;
}

double seen_cosine(Vec3 normal, Vec3 view) {
  return std::clamp(dot(normal, view), kSmallestCosine, 1.0);
}

/// Returns the occlusion of mirrored light, which comes from a part of the hemisphere (Lagarde and
/// de Rousiers, "Moving Frostbite to Physically Based Rendering", 2014).
double mirror_occlusion(double occlusion, double cosine, double roughness) {
  if (occlusion >= 1.0) return 1.0;
  const double narrow = std::exp2(-16.0 * roughness - 1.0);
  return std::clamp(std::pow(cosine + occlusion, narrow) - 1.0 + occlusion, 0.0, 1.0);
}

Vec3 with_film(Vec3 f0, const PbrPoint& point, double view_cosine) {
  if (point.iridescence == 0.0) return f0;
  const Vec3 film = film_f0(point.iridescence_ior, view_cosine, point.iridescence_nm, f0);
  return mixed(f0, film, point.iridescence);
}

/// Mirror is the GGX lobe of a metal or of a dielectric.
struct Mirror {
  Vec3 f0{}, f90{};
  Vec3 single{};    ///< albedo of light that is reflected once
  Vec3 multiple{};  ///< of light that is reflected between microfacets

  Mirror() = default;
  Mirror(Vec3 at_normal, Vec3 at_grazing, GgxAlbedo albedo)
      : f0(at_normal), f90(at_grazing), single(f0 * albedo.scale + f90 * albedo.bias) {
    const double lost = 1.0 - (albedo.scale + albedo.bias);
    const Vec3 mean = f0 + (f90 - f0) / 21.0;
    multiple = quotient(single * mean, kWhite - mean * lost) * lost;
  }
};

}  // namespace

PbrShader::PbrShader(const PbrPoint& point) : point_(point) {
  view_cosine_ = seen_cosine(point.normal, point.view);
  bitangent_ = cross(point.normal, point.tangent);
  local_view_ = {dot(point.tangent, point.view), dot(bitangent_, point.view), view_cosine_};
  const double held = std::max(point.roughness, kSmallestRoughness);
  alpha_b_ = held * held;
  alpha_t_ = alpha_b_ + (1.0 - alpha_b_) * point.anisotropy * point.anisotropy;

  const GgxAlbedo albedo = ggx_albedo(view_cosine_, point.roughness);
  const auto mirror = [&](Vec3 f0, Vec3 f90) {
    return Mirror(with_film(f0, point, view_cosine_), f90, albedo);
  };
  const Mirror dielectric =
      point.metallic < 1.0 ? mirror(dielectric_f0(point.ior, point.specular, point.specular_colour),
                                    kWhite * point.specular)
                           : Mirror();
  const Mirror metal = point.metallic > 0.0 ? mirror(point.colour, kWhite) : Mirror();
  f0_ = mixed(dielectric.f0, metal.f0, point.metallic);
  f90_ = mixed(dielectric.f90, metal.f90, point.metallic);
  single_ = mixed(dielectric.single, metal.single, point.metallic);
  multiple_ = mixed(dielectric.multiple, metal.multiple, point.metallic);
  stronger_ = quotient(single_ + multiple_, single_);
  below_mirror_ = (1.0 - point.metallic) * (1.0 - largest(dielectric.single + dielectric.multiple));

  sheen_albedo_ =
      largest(point.sheen_colour) > 0.0 ? sheen_albedo(view_cosine_, point.sheen_roughness) : 0.0;
  below_sheen_ = 1.0 - largest(point.sheen_colour) * sheen_albedo_;
  coat_cosine_ = seen_cosine(point.coat_normal, point.view);
  if (point.clearcoat > 0.0) {
    const GgxAlbedo coat = ggx_albedo(coat_cosine_, point.clearcoat_roughness);
    coat_albedo_ = point.clearcoat * (kCoatF0.x * coat.scale + coat.bias);
  }
  below_coat_ = 1.0 - coat_albedo_;
  diffuse_ = point.colour * ((1.0 - point.transmission) * below_mirror_);
}

Vec3 PbrShader::of_light(Vec3 toward_light) const {
  if (!(dot(point_.geometric, toward_light) > 0.0)) return {};
  const Vec3 half = normalized(point_.view + toward_light);
  Vec3 sum;
  const double cosine = dot(point_.normal, toward_light);
  if (cosine > 0.0) {
    const LocalVec light{dot(point_.tangent, toward_light), dot(bitangent_, toward_light), cosine};
    const LocalVec facet{dot(point_.tangent, half), dot(bitangent_, half),
                         dot(point_.normal, half)};
    const double lobe = kPi * cosine * ggx_distribution(facet, alpha_t_, alpha_b_) *
                        smith_visibility(local_view_, light, alpha_t_, alpha_b_);
    const Vec3 fresnel = schlick(f0_, f90_, dot(point_.view, half));
    sum = (diffuse_ * cosine + fresnel * stronger_ * lobe) * below_sheen_;
    if (sheen_albedo_ > 0.0) {
      const double rough = std::max(point_.sheen_roughness, kSmallestSheenRoughness);
      sum += point_.sheen_colour * (kPi * cosine * charlie_distribution(facet.z, rough * rough) *
                                    neubelt_visibility(view_cosine_, cosine));
    }
    sum = sum * below_coat_;
  }
  const double coat_cosine = dot(point_.coat_normal, toward_light);
  if (point_.clearcoat > 0.0 && coat_cosine > 0.0) {
    const double rough = std::max(point_.clearcoat_roughness, kSmallestRoughness);
    const double alpha = rough * rough;
    const auto along = [](double z) {
      return LocalVec{std::sqrt(std::max(0.0, 1.0 - z * z)), 0.0, z};
    };
    const double facets = ggx_distribution(along(dot(point_.coat_normal, half)), alpha, alpha);
    const double visible = smith_visibility(along(coat_cosine_), along(coat_cosine), alpha, alpha);
    sum += schlick(kCoatF0, kWhite, dot(point_.view, half)) *
           (point_.clearcoat * kPi * coat_cosine * facets * visible);
  }
  return sum;
}

Vec3 PbrShader::of_environment(const EnvironmentLight& light, const Frame& frame) const {
  const auto mirrored_light = [&](Vec3 direction, double roughness) {
    return light.mirrored(normalized(frame.from_scene(direction)), roughness);
  };
  Vec3 around = point_.normal;
  if (point_.anisotropy > 0.0) {
    // A lobe that is stretched along the tangent mirrors like one around a normal bent toward the
    // viewer.
    const double rest = 1.0 - point_.anisotropy * (1.0 - point_.roughness);
    const Vec3 bent = normalized(cross(cross(bitangent_, point_.view), bitangent_));
    around = normalized(mixed(bent, point_.normal, rest * rest * rest * rest));
  }
  // Rough lobes lean toward the normal.
  const double squared = point_.roughness * point_.roughness;
  const Vec3 mirror = mixed(mirrored(point_.view, around), point_.normal, squared * squared);
  const Vec3 matt = light.diffuse(frame.from_scene(point_.normal));
  const double mirror_share = mirror_occlusion(point_.occlusion, view_cosine_, point_.roughness);
  Vec3 sum =
      (matt * diffuse_ * point_.occlusion +
       (mirrored_light(mirror, point_.roughness) * single_ + matt * multiple_) * mirror_share) *
      below_sheen_;
  if (sheen_albedo_ > 0.0) sum += point_.sheen_colour * matt * (sheen_albedo_ * point_.occlusion);
  sum = sum * below_coat_;
  if (point_.clearcoat > 0.0)
    sum += mirrored_light(mirrored(point_.view, point_.coat_normal), point_.clearcoat_roughness) *
           (coat_albedo_ *
            mirror_occlusion(point_.occlusion, coat_cosine_, point_.clearcoat_roughness));
  return sum;
}

Vec3 PbrShader::emitted() const {
  return point_.emission * below_coat_;
}

Vec3 PbrShader::transmitted() const {
  return point_.colour * (point_.transmission * below_mirror_ * below_sheen_ * below_coat_);
}

}  // namespace lenticule::render
