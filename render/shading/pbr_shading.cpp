// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_shading.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::render {
namespace {

constexpr double kPi = std::numbers::pi;
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
