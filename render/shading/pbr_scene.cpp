// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_scene.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <mutex>
#include <numbers>

#include "render/scene/surroundings.h"
#include "render/scene/texture.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

using Limits = pbr_kernel::Limits<double>;
constexpr double kPi = std::numbers::pi;

double fifth_power(double v) {
  const double squared = v * v;
  return squared * squared * v;
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
  const double held = std::max(roughness, Limits::kSmallestSheenRoughness);
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
  return min(plain, Vec3{1, 1, 1}) * specular;
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

namespace {

/// Makes a table of the kernel; `set` writes a knot.
template <class Table, class Value, class Set>
std::unique_ptr<const Table> narrowed(const AlbedoTable<Value>& from, const Set& set) {
  auto table = std::make_unique<Table>();
  for (size_t c = 0; c <= pbr_kernel::AlbedoTable::kSteps; ++c)
    for (size_t r = 0; r <= pbr_kernel::AlbedoTable::kSteps; ++r)
      set(from.knot(c, r), table->values[c][r]);
  return table;
}

}  // namespace

const pbr_kernel::AlbedoTable& ggx_albedo_table() {
  static const auto table =
      narrowed<pbr_kernel::AlbedoTable>(ggx_table(), [](const GgxAlbedo& from, float(&to)[2]) {
        to[0] = static_cast<float>(from.scale);
        to[1] = static_cast<float>(from.bias);
      });
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

namespace {

const AlbedoTable<double>& sheen_table() {
  static const AlbedoTable<double> table(integrated_sheen);
  return table;
}

}  // namespace

double sheen_albedo(double view_cosine, double roughness) {
  return sheen_table().at(view_cosine, roughness);
}

const pbr_kernel::SheenTable& sheen_albedo_table() {
  static const auto table = narrowed<pbr_kernel::SheenTable>(
      sheen_table(), [](double from, float& to) { to = static_cast<float>(from); });
  return *table;
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
constexpr Vec3 kCoatF0{Limits::kCoatF0, Limits::kCoatF0, Limits::kCoatF0};

Vec3 mixed(Vec3 a, Vec3 b, double part) { return a + (b - a) * part; }

Vec3 quotient(Vec3 a, Vec3 b) {
  const auto each = [](double x, double y) { return y > 0.0 ? x / y : 1.0; };
  return {each(a.x, b.x), each(a.y, b.y), each(a.z, b.z)};
}

Vec3 mirrored(Vec3 view, Vec3 normal) { return normal * (2.0 * dot(view, normal)) - view; }

double seen_cosine(Vec3 normal, Vec3 view) {
  return std::clamp(dot(normal, view), Limits::kSmallestCosine, 1.0);
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
  Vec3 multiple{};  ///< albedo of light that is reflected between microfacets

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
  const double held = std::max(point.roughness, Limits::kSmallestRoughness);
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
      const double rough = std::max(point_.sheen_roughness, Limits::kSmallestSheenRoughness);
      sum += point_.sheen_colour * (kPi * cosine * charlie_distribution(facet.z, rough * rough) *
                                    neubelt_visibility(view_cosine_, cosine));
    }
    sum = sum * below_coat_;
  }
  const double coat_cosine = dot(point_.coat_normal, toward_light);
  if (point_.clearcoat > 0.0 && coat_cosine > 0.0) {
    const double rough = std::max(point_.clearcoat_roughness, Limits::kSmallestRoughness);
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

Vec3 PbrShader::emitted() const { return point_.emission * below_coat_; }

Vec3 PbrShader::transmitted() const {
  return point_.colour * (point_.transmission * below_mirror_ * below_sheen_ * below_coat_);
}

namespace {

Vec3 colour_of(const MipMaps::Value& value) { return {value[0], value[1], value[2]}; }

double clamped01(double v) { return std::clamp(v, 0.0, 1.0); }

Vec3 perpendicular(Vec3 unit) {
  return normalized(cross(unit, std::abs(unit.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
}

/// Returns the side of a footprint on the plane with that normal, as the ray sees it.
Vec3 on_plane(Vec3 side, Vec3 normal, Vec3 direction) {
  double cosine = dot(normal, direction);
  if (std::abs(cosine) < Limits::kGrazing)
    cosine = cosine < 0.0 ? -Limits::kGrazing : Limits::kGrazing;
  return side - direction * (dot(side, normal) / cosine);
}

template <class T, size_t N>
std::array<double, N> blended(const std::vector<std::array<T, N>>& values,
                              const std::array<uint32_t, 3>& corners, Barycentric at) {
  std::array<double, N> out;
  for (size_t k = 0; k < N; ++k)
    out[k] = (1.0 - at.u - at.v) * double{values[corners[0]][k]} +
             at.u * double{values[corners[1]][k]} + at.v * double{values[corners[2]][k]};
  return out;
}

const std::vector<std::array<float, 2>>& uvs_of(const MeshShape& mesh, int set) {
  return set == 1 ? mesh.uvs2 : mesh.uvs;
}

/// Returns the change of texture coordinates along the edges of a triangle.
struct TextureEdges {
  Vec2 edge1, edge2;
};
TextureEdges texture_edges(const std::vector<std::array<float, 2>>& uvs,
                           const std::array<uint32_t, 3>& corners,
                           const std::array<double, 6>& map) {
  const auto edge = [&](uint32_t to) {
    const double u = double{uvs[to][0]} - double{uvs[corners[0]][0]};
    const double v = double{uvs[to][1]} - double{uvs[corners[0]][1]};
    return Vec2{map[0] * u + map[1] * v, map[3] * u + map[4] * v};
  };
  return {edge(corners[1]), edge(corners[2])};
}

}  // namespace

/// Toksvig, "Mipmapping Normal Maps", 2005; the concentration is that of a von Mises-Fisher
/// distribution.
double spread_of_normals(double mean_length) {
  const double r = std::clamp(mean_length, 0.1, 1.0);
  return 2.0 * (1.0 - r * r) / (r * (3.0 - r * r));
}

SurfacePlace place_of(const Scene& scene, const Surface& surface, Vec3 direction,
                      const RayFootprint& footprint) {
  SurfacePlace place;
  place.normal = surface.outer_side ? surface.shading_normal : -surface.shading_normal;
  const Vec3 across = on_plane(footprint.across, surface.geometric_normal, direction);
  const Vec3 along = on_plane(footprint.along, surface.geometric_normal, direction);
  if (surface.mesh == nullptr) {
    place.bend = (dot(across, across) + dot(along, along)) * surface.curvature * surface.curvature;
    return place;
  }
  const MeshShape& mesh = *surface.mesh;
  place.mesh = &mesh;
  place.triangle = surface.triangle;
  place.corners = mesh.triangles[surface.triangle];
  place.at = surface.at;
  const std::array<Vec3, 3> corner = corners_of(scene, mesh, surface.triangle);
  const Vec3 edge1 = corner[1] - corner[0], edge2 = corner[2] - corner[0];
  const Vec3 normal = cross(edge1, edge2);
  const double area = dot(normal, normal);
  if (!(area > 0.0)) return place;
  const auto barycentric = [&](Vec3 side) {
    return Vec2{dot(cross(side, edge2), normal) / area, dot(cross(edge1, side), normal) / area};
  };
  place.across = barycentric(across);
  place.along = barycentric(along);
  if (mesh.normals.empty()) return place;
  const Vec3 first(mesh.normals[place.corners[0]]);
  const Vec3 by_u = Vec3(mesh.normals[place.corners[1]]) - first;
  const Vec3 by_v = Vec3(mesh.normals[place.corners[2]]) - first;
  for (const Vec2 side : {place.across, place.along}) {
    const Vec3 change = by_u * side.x + by_v * side.y;
    place.bend += dot(change, change);
  }
  return place;
}

namespace {

/// Coordinates is a place in a texture.
struct Coordinates {
  Vec2 at;
  TextureFootprint footprint;
};
Coordinates coordinates_of(const std::vector<std::array<float, 2>>& uvs, const SurfacePlace& place,
                           const std::array<double, 6>& map) {
  const auto [u, v] = blended(uvs, place.corners, place.at);
  const TextureEdges edges = texture_edges(uvs, place.corners, map);
  const auto side = [&](Vec2 by) { return edges.edge1 * by.x + edges.edge2 * by.y; };
  return {.at = {map[0] * u + map[1] * v + map[2], map[3] * u + map[4] * v + map[5]},
          .footprint = {.across = side(place.across), .along = side(place.along)}};
}

}  // namespace

bool LaneTextures::find_coordinates(const MaterialInput& input) {
  if (located_ != nullptr && located_->has_coordinates_of(input)) return true;
  const auto& uvs = uvs_of(*mesh_, input.uv_set);
  if (uvs.empty()) return false;
  area_ = {};
  for (uint32_t left = lanes_; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    const auto [at, footprint] = coordinates_of(uvs, places_[r], input.uv_map);
    set_lane(area_, r, at, footprint);
  }
  lookup_.shape = {};
  located_ = &input;
  return true;
}

const texel_kernel::Values* LaneTextures::value(const MaterialInput& input) {
  if (input.maps == nullptr || mesh_ == nullptr) return nullptr;
  for (size_t n = 0; n < count_; ++n)
    if (known_[n]->maps == input.maps && known_[n]->has_coordinates_of(input)) return &values_[n];
  if (!find_coordinates(input)) return nullptr;
  if (lookup_.shape != input.maps->shape()) {
    input.maps->find(area_, lookup_);
    for (size_t r = 0; r < places_.size(); ++r)
      if ((lanes_ >> r & 1) == 0) lookup_.texels.places[r] = 0;
  }
  known_[count_] = &input;
  input.maps->values(lookup_, values_[count_]);
  return &values_[count_++];
}

const texel_kernel::Values* LaneTextures::of_vertices(
    const std::vector<std::array<float, 4>>& values, texel_kernel::Values& out) const {
  if (values.empty()) return nullptr;
  for (uint32_t left = lanes_; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    const std::array<double, 4> mean = blended(values, places_[r].corners, places_[r].at);
    for (size_t c = 0; c < mean.size(); ++c) out.channel[c][r] = static_cast<float>(mean[c]);
  }
  return &out;
}

void LaneTextures::set_axes(const MaterialInput& input, pbr_kernel::AxesInput& out) {
  out.vertex = of_vertices(mesh_->tangents, vertex_tangents_);
  if (out.vertex != nullptr) return;
  const auto& uvs = uvs_of(*mesh_, input.uv_set);
  for (uint32_t left = lanes_; left != 0; left &= left - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(left));
    const TextureEdges edges = texture_edges(uvs, places_[r].corners, input.uv_map);
    out.edge1[0][r] = static_cast<float>(edges.edge1.x);
    out.edge1[1][r] = static_cast<float>(edges.edge1.y);
    out.edge2[0][r] = static_cast<float>(edges.edge2.x);
    out.edge2[1][r] = static_cast<float>(edges.edge2.y);
  }
}

const pbr_kernel::Textures& LaneTextures::all(const PbrMaterial& m, const MaterialInputs& inputs) {
  pbr_kernel::Textures& t = textures_;
  t = {};
  t.lanes = lanes_;
  if (mesh_ == nullptr) return t;
  t.base_colour = value(inputs.base_colour);
  t.vertex_colour = of_vertices(mesh_->colours, vertex_colours_);
  t.metallic_roughness = value(inputs.metallic_roughness);
  t.occlusion = value(inputs.occlusion);
  t.normal = value(inputs.normal);
  if (t.normal != nullptr) set_axes(inputs.normal, t.normal_axes);
  if (m.emission != Vec3{}) t.emission = value(inputs.emission);
  if (m.specular != 0.0) t.specular = value(inputs.specular);
  if (m.specular_colour != Vec3{}) t.specular_colour = value(inputs.specular_colour);
  if (m.sheen_colour != Vec3{}) {
    t.sheen_colour = value(inputs.sheen_colour);
    t.sheen_roughness = value(inputs.sheen_roughness);
  }
  if (m.clearcoat == 0.0) return t;
  t.coat = value(inputs.clearcoat);
  t.coat_roughness = value(inputs.clearcoat_roughness);
  t.coat_normal = value(inputs.clearcoat_normal);
  if (t.coat_normal != nullptr) set_axes(inputs.clearcoat_normal, t.coat_axes);
  return t;
}

std::optional<MipMaps::Value> InputReader::value(const MaterialInput& input) {
  if (lanes_ != nullptr) {
    const texel_kernel::Values* values = lanes_->value(input);
    if (values == nullptr) return std::nullopt;
    MipMaps::Value out;
    for (size_t c = 0; c < out.size(); ++c) out[c] = double{values->channel[c][lane_]};
    return out;
  }
  if (input.maps == nullptr || place_.mesh == nullptr) return std::nullopt;
  const auto& uvs = uvs_of(*place_.mesh, input.uv_set);
  if (uvs.empty()) return std::nullopt;
  const Coordinates found = coordinates_of(uvs, place_, input.uv_map);
  return input.maps->value(found.at, found.footprint);
}

double InputReader::scaled(double factor, const MaterialInput& input, size_t channel) {
  if (factor == 0.0) return factor;
  const auto texel = value(input);
  return texel ? factor * (*texel)[channel] : factor;
}

Vec3 InputReader::tinted(Vec3 factor, const MaterialInput& input) {
  if (factor == Vec3{}) return factor;
  const auto texel = value(input);
  return texel ? factor * colour_of(*texel) : factor;
}

/// Vertex tangents where there are some, otherwise the directions in which the texture's u grows
/// and its v falls (v points down, the bitangent up).
InputReader::TangentFrame InputReader::tangents(const MaterialInput& input) const {
  const Vec3 normal = place_.normal;
  const auto upright = [normal](Vec3 tangent, double sign) -> TangentFrame {
    const Vec3 flat = tangent - normal * dot(tangent, normal);
    const Vec3 unit = length(flat) > 1e-9 ? normalized(flat) : perpendicular(normal);
    return {unit, cross(normal, unit) * sign};
  };
  if (place_.mesh == nullptr) return upright({}, 1.0);
  if (!place_.mesh->tangents.empty()) {
    const auto [x, y, z, sign] = blended(place_.mesh->tangents, place_.corners, place_.at);
    return upright(normalized(Vec3{x, y, z}), sign < 0.0 ? -1.0 : 1.0);
  }
  const auto& uvs = uvs_of(*place_.mesh, input.uv_set);
  if (uvs.empty()) return upright({}, 1.0);
  const std::array<double, 6> same{1, 0, 0, 0, 1, 0};
  const TextureEdges edges =
      texture_edges(uvs, place_.corners, input.maps != nullptr ? input.uv_map : same);
  const double area = edges.edge1.x * edges.edge2.y - edges.edge2.x * edges.edge1.y;
  if (area == 0.0) return upright({}, 1.0);
  const std::array<Vec3, 3> corner = corners_of(scene_, *place_.mesh, place_.triangle);
  const Vec3 edge1 = corner[1] - corner[0], edge2 = corner[2] - corner[0];
  const Vec3 by_u = (edge1 * edges.edge2.y - edge2 * edges.edge1.y) / area;
  const Vec3 by_v = (edge2 * edges.edge1.x - edge1 * edges.edge2.x) / area;
  const TangentFrame frame = upright(normalized(by_u), 1.0);
  return dot(frame.bitangent, by_v) > 0.0 ? TangentFrame{frame.tangent, -frame.bitangent} : frame;
}

Vec3 InputReader::mapped_normal(const MaterialInput& input, double scale) {
  const auto texel = value(input);
  if (!texel) return place_.normal;
  const TangentFrame frame = tangents(input);
  const Vec3 mean = colour_of(*texel);
  const Vec3 scaled{mean.x * scale, mean.y * scale, mean.z};
  const Vec3 turned =
      normalized(frame.tangent * scaled.x + frame.bitangent * scaled.y + place_.normal * scaled.z);
  return turned == Vec3{} ? place_.normal : turned * std::min(1.0, length(mean));
}

MipMaps::Value InputReader::base(const PbrMaterial& material, const MaterialInput& input) {
  MipMaps::Value base{material.base_colour.x, material.base_colour.y, material.base_colour.z,
                      material.alpha};
  const auto multiply = [&](const std::array<double, 4>& by) {
    for (size_t c = 0; c < 4; ++c) base[c] *= by[c];
  };
  if (const auto texel = value(input)) multiply(*texel);
  if (place_.mesh != nullptr && !place_.mesh->colours.empty())
    multiply(blended(place_.mesh->colours, place_.corners, place_.at));
  base[3] = material.alpha_mode == PbrMaterial::AlphaMode::Opaque  ? 1.0
            : material.alpha_mode == PbrMaterial::AlphaMode::Blend ? clamped01(base[3])
            : base[3] < material.alpha_cutoff                      ? 0.0
                                                                   : 1.0;
  return base;
}

/// The occlusion comes next to the roughness, since both are often channels of one texture.
Vec3 InputReader::read_mirror(const PbrMaterial& material, const MaterialInputs& inputs,
                              PbrPoint& out) {
  out.metallic = material.metallic;
  out.roughness = material.roughness;
  if (const auto texel = value(inputs.metallic_roughness)) {
    out.roughness *= (*texel)[1];
    out.metallic *= (*texel)[2];
  }
  out.metallic = clamped01(out.metallic);
  out.roughness = clamped01(out.roughness);
  if (const auto texel = value(inputs.occlusion))
    out.occlusion = clamped01(1.0 + material.occlusion_strength * ((*texel)[0] - 1.0));
  const Vec3 normal = mapped_normal(inputs.normal, material.normal_scale);
  out.emission = tinted(material.emission, inputs.emission);
  out.ior = material.ior;
  out.specular = scaled(material.specular, inputs.specular, 3);
  out.specular_colour = tinted(material.specular_colour, inputs.specular_colour);
  return normal;
}

// ---- tables for the kernel

namespace {

/// Returns true if the material consists of a base and a mirror, with or without sheen
/// and a coat.
bool is_plain(const PbrMaterial& m) {
  return !m.unlit && m.transmission == 0.0 && m.iridescence == 0.0 && m.anisotropy == 0.0;
}

/// Textures also decide where a material is cut out.
bool is_textured(const PbrMaterial& m) {
  return m.alpha_mode != PbrMaterial::AlphaMode::Opaque ||
         std::ranges::any_of(kPbrTextures, [&](auto use) { return (m.*use).texture >= 0; });
}

pbr_kernel::Material table_entry(const PbrMaterial& m) {
  pbr_kernel::Material out{};
  write(m.base_colour, out.colour);
  write(m.emission, out.emission);
  out.metallic = static_cast<float>(std::clamp(m.metallic, 0.0, 1.0));
  out.roughness = static_cast<float>(std::clamp(m.roughness, 0.0, 1.0));
  write(dielectric_f0(m.ior, m.specular, m.specular_colour), out.f0);
  out.f90 = static_cast<float>(m.specular);
  out.coat = static_cast<float>(m.clearcoat);
  out.coat_roughness = static_cast<float>(std::clamp(m.clearcoat_roughness, 0.0, 1.0));
  using enum PbrMaterial::AlphaMode;
  using pbr_kernel::Material;
  out.alpha_mode = m.alpha_mode == Opaque ? Material::kOpaque
                   : m.alpha_mode == Mask ? Material::kMask
                                          : Material::kBlend;
  out.alpha = static_cast<float>(m.alpha);
  out.alpha_cutoff = static_cast<float>(m.alpha_cutoff);
  out.normal_scale = static_cast<float>(m.normal_scale);
  out.occlusion_strength = static_cast<float>(m.occlusion_strength);
  out.plain_f0 = static_cast<float>(dielectric_f0(m.ior, 1.0, kWhite).x);
  out.specular = static_cast<float>(m.specular);
  write(m.specular_colour, out.specular_colour);
  write(m.sheen_colour, out.sheen_colour);
  out.sheen_roughness = static_cast<float>(std::clamp(m.sheen_roughness, 0.0, 1.0));
  out.is_plain = is_plain(m) ? -1 : 0;
  out.is_two_sided = m.double_sided ? -1 : 0;
  out.is_textured = is_textured(m) ? -1 : 0;
  return out;
}

}  // namespace

void PbrScene::set_tables() {
  bool any_sheen = false;
  for (const Material& material : scene_.materials) {
    materials_.push_back(table_entry(*material.pbr));
    any_sheen = any_sheen || largest(material.pbr->sheen_colour) > 0.0;
    any_plain_ = any_plain_ || materials_.back().is_plain != 0;
  }
  for (const MeshShape& mesh : scene_.meshes)
    if (!mesh.colours.empty()) materials_[static_cast<size_t>(mesh.material)].is_textured = -1;
  tables_ = {.shapes = &scene_.shading->tables(),
             .materials = materials_.data(),
             .environment = environment_->tables(),
             .albedo = &ggx_albedo_table(),
             .sheen = any_sheen ? &sheen_albedo_table() : nullptr};
  write(frame_.right, tables_.environment.right);
  write(frame_.up, tables_.environment.up);
  write(frame_.back, tables_.environment.back);

  write(scene_.scene_from_panel.column_x, axes_.across);
  write(scene_.scene_from_panel.column_y, axes_.along);
  const Affine& map = panel_from_scene_;
  write(Vec3{map.column_x.z, map.column_y.z, map.column_z.z}, axes_.depth);
  axes_.depth_origin = static_cast<float>(map.origin.z);
}

pbr_kernel::Beam PbrScene::beam(const BeamSize& size) const {
  pbr_kernel::Beam beam = axes_;
  beam.lens_mm = static_cast<float>(size.lens_mm);
  beam.row_mm = static_cast<float>(size.row_mm);
  beam.subpixels_per_gap = static_cast<float>(size.subpixels_per_gap);
  beam.inverse_distance = static_cast<float>(size.inverse_distance);
  return beam;
}

const pbr_kernel::Kernel& pbr_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kPbrKernel);
}

// ---- scene

namespace {

/// Keeps filtered textures from frame to frame of an animation: at most those of the textures that
/// are in use somewhere.
std::shared_ptr<const MipMaps> mip_maps_of(const std::shared_ptr<const Texture>& texture,
                                           MipMaps::Content content) {
  static std::mutex adding;
  static std::vector<std::shared_ptr<const MipMaps>> known;
  const std::lock_guard lock(adding);
  const auto is_same = [&](const auto& maps) {
    return &maps->texture() == texture.get() && maps->content() == content;
  };
  const auto found = std::ranges::find_if(known, is_same);
  if (found != known.end()) return *found;
  const auto is_orphan = [](const auto& maps) {
    const auto same = std::ranges::count_if(
        known, [&](const auto& other) { return &other->texture() == &maps->texture(); });
    return maps.use_count() == 1 && maps->owners() == same;
  };
  // One at a time, since two of them may have the same texture.
  for (auto old = std::ranges::find_if(known, is_orphan); old != known.end();
       old = std::ranges::find_if(known, is_orphan))
    known.erase(old);
  return known.emplace_back(std::make_shared<const MipMaps>(texture, content));
}

/// Returns the filtered light of a picture. The last one is kept for the next frame.
std::shared_ptr<const EnvironmentLight> light_of(const std::shared_ptr<const Texture>& picture) {
  static std::mutex making;
  static std::shared_ptr<const Texture> last_picture;
  static std::shared_ptr<const EnvironmentLight> last;
  const std::lock_guard lock(making);
  if (last && same_texture(last_picture, picture)) return last;
  const auto maps = std::make_shared<const MipMaps>(picture, MipMaps::Content::Data);
  last = std::make_shared<const EnvironmentLight>([maps](Vec3 direction, double angle) {
    const double across =
        angle / std::max(0.02, std::sqrt(std::max(0.0, 1.0 - direction.y * direction.y)));
    const MipMaps::Value value =
        maps->value({0.5 + std::atan2(direction.x, -direction.z) / (2.0 * kPi),
                     std::acos(std::clamp(direction.y, -1.0, 1.0)) / kPi},
                    {.across = {across / (2.0 * kPi), 0.0}, .along = {0.0, angle / kPi}});
    return Vec3{value[0], value[1], value[2]};
  });
  last_picture = picture;
  return last;
}

/// Returns the roughness of a surface whose microfacets vary by `more` (square of alpha) as well.
double rougher(double roughness, double more) {
  const double alpha = roughness * roughness;
  return std::sqrt(std::sqrt(std::min(1.0, alpha * alpha + more)));
}

bool is_volume(const PbrMaterial& material) {
  return material.transmission > 0.0 && material.thickness > 0.0;
}

}  // namespace

PbrScene::PbrScene(const Scene& scene, bool has_studio)
    : scene_(scene),
      tone_map_(scene.backdrop.tone_map),
      panel_from_scene_(scene.scene_from_panel.inverse()) {
  set_environment(has_studio);
  using enum texel_kernel::Content;
  for (const Material& material : scene.materials) {
    const PbrMaterial& m = *material.pbr;
    any_passes_ =
        any_passes_ || m.alpha_mode != PbrMaterial::AlphaMode::Opaque || m.transmission > 0.0;
    inputs_.push_back({.base_colour = input(m.base_colour_texture, Colour),
                       .metallic_roughness = input(m.metallic_roughness_texture, Data),
                       .normal = input(m.normal_texture, Normals),
                       .occlusion = input(m.occlusion_texture, Data),
                       .emission = input(m.emission_texture, Colour),
                       .specular = input(m.specular_texture, Data),
                       .specular_colour = input(m.specular_colour_texture, Colour),
                       .clearcoat = input(m.clearcoat_texture, Data),
                       .clearcoat_roughness = input(m.clearcoat_roughness_texture, Data),
                       .clearcoat_normal = input(m.clearcoat_normal_texture, Normals),
                       .sheen_colour = input(m.sheen_colour_texture, Colour),
                       .sheen_roughness = input(m.sheen_roughness_texture, Data),
                       .transmission = input(m.transmission_texture, Data),
                       .thickness = input(m.thickness_texture, Data),
                       .iridescence = input(m.iridescence_texture, Data),
                       .iridescence_thickness = input(m.iridescence_thickness_texture, Data),
                       .anisotropy = input(m.anisotropy_texture, Data)});
  }
  for (SceneLight light : scene.lights) {
    light.colour = {1, 1, 1};
    unit_lights_.push_back(light);
  }
  set_tables();
}

void PbrScene::set_environment(bool has_studio) {
  const Backdrop& backdrop = scene_.backdrop;
  frame_ = {
      .right = cross(backdrop.ahead, backdrop.up), .up = backdrop.up, .back = -backdrop.ahead};
  if (backdrop.environment) {
    environment_ = light_of(backdrop.environment);
  } else if (backdrop.sky) {
    static const auto sky = std::make_shared<const EnvironmentLight>(
        [](Vec3 direction, double) { return sky_colour(direction.y); });
    environment_ = sky;
  } else if (has_studio) {
    static const auto studio = std::make_shared<const EnvironmentLight>([](Vec3 direction, double) {
      return Vec3{1, 1, 1} * studio_light(direction);
    });
    environment_ = studio;
  } else {
    environment_ = std::make_shared<const EnvironmentLight>(scene_.ambient);
  }
}

MaterialInput PbrScene::input(const TextureUse& use, MipMaps::Content content) {
  if (use.texture < 0) return {};
  const auto& maps =
      maps_.emplace_back(mip_maps_of(scene_.textures[static_cast<size_t>(use.texture)], content));
  return {.maps = maps.get(), .uv_set = use.uv_set, .uv_map = use.uv_map};
}

Vec3 PbrScene::backdrop(Vec3 origin, Vec3 direction, double roughness) const {
  const Backdrop& backdrop = scene_.backdrop;
  if (backdrop.flat()) return backdrop.colour;
  if (backdrop.ground_shadow)
    return backdrop.colour * backdrop.ground_shadow->light_left(origin, direction);
  if (backdrop.environment && roughness > 0.0)
    return tone_mapped(tone_map_,
                       environment_->mirrored(normalized(frame_.from_scene(direction)), roughness));
  return {backdrop_light(backdrop, direction, 0), backdrop_light(backdrop, direction, 1),
          backdrop_light(backdrop, direction, 2)};
}

Vec3 PbrScene::passed(const Surface& surface) const {
  const PbrMaterial& material = *surface.material->pbr;
  if (material.alpha_mode == PbrMaterial::AlphaMode::Opaque && material.transmission == 0.0)
    return {};
  const MaterialInputs& inputs = inputs_of(surface);
  const SurfacePlace place = place_of(scene_, surface, -surface.geometric_normal, {});
  InputReader reader(scene_, place, nullptr, 0);
  const MipMaps::Value base = reader.base(material, inputs.base_colour);
  const double through = reader.scaled(material.transmission, inputs.transmission, 0);
  // Light is tinted where it enters a volume.
  const bool leaves = is_volume(material) && !surface.outer_side;
  const Vec3 tint = leaves ? Vec3{1, 1, 1} : colour_of(base);
  return Vec3{1, 1, 1} * (1.0 - base[3]) + tint * (through * base[3]);
}

namespace {

/// Sets the values of the layers above and below the mirror. `bend` is the square of alpha by which
/// the shape varies; `side` is -1 on the inner side.
void set_layers(const PbrMaterial& m, const MaterialInputs& inputs, double bend, double side,
                InputReader& reader, PbrSurface& out) {
  PbrPoint& p = out.point;
  p.clearcoat = reader.scaled(m.clearcoat, inputs.clearcoat, 0);
  if (p.clearcoat > 0.0) {
    const Vec3 coat = reader.mapped_normal(inputs.clearcoat_normal, 1.0);
    p.coat_normal = normalized(coat) * side;
    p.clearcoat_roughness =
        rougher(clamped01(reader.scaled(m.clearcoat_roughness, inputs.clearcoat_roughness, 1)),
                bend + spread_of_normals(length(coat)));
  }
  p.sheen_colour = reader.tinted(m.sheen_colour, inputs.sheen_colour);
  p.sheen_roughness = clamped01(reader.scaled(m.sheen_roughness, inputs.sheen_roughness, 3));
  p.transmission = clamped01(reader.scaled(m.transmission, inputs.transmission, 0));
  out.thickness = p.transmission > 0.0 ? reader.scaled(m.thickness, inputs.thickness, 1) : 0.0;
  p.iridescence = clamped01(reader.scaled(m.iridescence, inputs.iridescence, 0));
  if (p.iridescence > 0.0) {
    const auto texel = reader.value(inputs.iridescence_thickness);
    p.iridescence_ior = m.iridescence_ior;
    p.iridescence_nm =
        m.iridescence_thickness_min +
        (m.iridescence_thickness_max - m.iridescence_thickness_min) * (texel ? (*texel)[1] : 1.0);
  }
}

void set_anisotropy(const PbrMaterial& m, const MaterialInputs& inputs, InputReader& reader,
                    PbrPoint& p) {
  if (m.anisotropy == 0.0) {
    p.tangent = perpendicular(p.normal);
    return;
  }
  Vec2 way{std::cos(m.anisotropy_rotation), std::sin(m.anisotropy_rotation)};
  p.anisotropy = m.anisotropy;
  if (const auto texel = reader.value(inputs.anisotropy)) {
    const double x = 2.0 * (*texel)[0] - 1.0, y = 2.0 * (*texel)[1] - 1.0;
    way = {way.x * x - way.y * y, way.y * x + way.x * y};
    p.anisotropy *= (*texel)[2];
  }
  p.anisotropy = clamped01(p.anisotropy);
  const InputReader::TangentFrame frame = reader.tangents(inputs.anisotropy);
  const Vec3 stretched = frame.tangent * way.x + frame.bitangent * way.y;
  const Vec3 flat = stretched - p.normal * dot(stretched, p.normal);
  p.tangent = length(flat) > 1e-9 ? normalized(flat) : perpendicular(p.normal);
}

}  // namespace

PbrSurface PbrScene::surface(const Surface& at, Vec3 direction, const SurfacePlace& place,
                             InputReader& reader) const {
  const PbrMaterial& m = *at.material->pbr;
  const MaterialInputs& inputs = inputs_of(at);
  const double side = at.outer_side ? 1.0 : -1.0;
  PbrSurface out{.material = &m};
  PbrPoint& p = out.point;
  const MipMaps::Value base = reader.base(m, inputs.base_colour);
  p.colour = colour_of(base);
  p.alpha = base[3];
  p.view = -direction;
  p.geometric = at.geometric_normal;
  if (m.unlit || p.alpha == 0.0) return out;
  const Vec3 normal = reader.read_mirror(m, inputs, p);
  const double bend = std::min(place.bend / kPi, Limits::kMostBend);
  p.normal = normalized(normal) * side;
  p.roughness = rougher(p.roughness, bend + spread_of_normals(length(normal)));
  p.coat_normal = place.normal * side;
  set_layers(m, inputs, bend, side, reader, out);
  set_anisotropy(m, inputs, reader, p);
  return out;
}

}  // namespace lenticule::render
