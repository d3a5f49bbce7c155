// SPDX-License-Identifier: Apache-2.0
// Checks the error bounds that method adaptive reports for its frames against the ground truth,
// over random scenes.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <random>

#include "frames/compare.h"
#include "lab/stability/rows.h"
#include "player/process/interrupt.h"

namespace lenticule::lab {
namespace {

constexpr std::array kErrors = {0.5, 1.0, 2.0, 8.0};  // codes
constexpr double kRounding = 1e-9;

class RandomScene {
 public:
  explicit RandomScene(uint64_t seed) : random_(seed) {}

  /// Makes a scene near the panel, 6 units wide: matte, mirroring and transparent objects, some far
  /// smaller than the distance of samples, some with a fine pattern; and wires.
  render::SceneDescription make() {
    scene_.source = "random scene";
    scene_.colour_managed = chance(0.5);
    scene_.background = colour();
    scene_.textures = {stripes()};
    for (int n = 0; n < 5; ++n) add_material();
    add_floor();
    const int objects = 3 + static_cast<int>(number(0.0, chance(0.3) ? 120.0 : 12.0));
    for (int n = 0; n < objects; ++n) add_object(objects > 20 ? 0.2 : 1.0);
    for (int n = 0; n < 1 + static_cast<int>(number(0.0, 3.0)); ++n) add_light();
    for (int n = static_cast<int>(number(0.0, 20.0)); n > 0; --n) add_wire();
    return std::move(scene_);
  }
  optics::Rig rig() {
    optics::Rig rig = small_rig();
    rig.sheet.pitch = Subpixels(number(5.0, 12.0));
    rig.sheet.slant = number(-0.5, 0.5);
    rig.sheet.gap = Millimetres(rig.sheet.pitch.value * number(0.28, 0.5));
    return rig;
  }
  double mm_per_unit() { return number(7.0, 14.0); }

 private:
  double number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool chance(double part) { return number(0.0, 1.0) < part; }
  Vec3 colour() { return {number(0.05, 0.95), number(0.05, 0.95), number(0.05, 0.95)}; }
  Vec3 place() { return {number(-3.0, 3.0), number(-1.8, 1.8), number(-1.5, 1.2)}; }
  int material() { return static_cast<int>(number(0.0, 4.999)); }

  std::shared_ptr<const render::Texture> stripes() {
    auto texture = std::make_shared<render::Texture>();
    texture->width = 2 + static_cast<int>(number(0.0, 60.0));
    texture->height = 2 + static_cast<int>(number(0.0, 60.0));
    for (int n = 0; n < texture->width * texture->height; ++n) {
      const auto shade = static_cast<float>(number(0.3, 1.0));
      texture->rgba.insert(texture->rgba.end(), {shade, shade, shade, 1.0F});
    }
    return texture;
  }
  void add_material() {
    render::Material m{.name = "random", .colour = colour()};
    const double kind = number(0.0, 1.0);
    if (kind > 0.5) {
      m.specular = number(0.1, 0.6);
      m.shine = number(3.0, 90.0);
      m.diffuse = 1.0 - m.specular;
    }
    if (kind > 0.8) {
      m.transmittance = number(0.2, 0.8);
      m.diffuse = 0.1;
      m.refraction_index = number(1.1, 1.7);
    }
    scene_.materials.push_back(m);
  }
  void add_floor() {
    render::TriangleMesh floor = grid_mesh({-6.0, number(-2.0, -1.0), 4.0}, {12.0, 0.0, 0.0},
                                           {0.0, number(0.0, 3.0), -9.0}, 3);
    floor.material = 0;
    if (chance(0.5)) {
      scene_.materials[0].texture = 0;
      for (const Vec3& p : floor.positions)
        floor.uvs.push_back(
            {static_cast<float>((p.x + 6.0) / 12.0), static_cast<float>((4.0 - p.z) / 9.0)});
    }
    scene_.meshes.push_back(floor);
  }
  void add_object(double largest) {
    const Vec3 at = place();
    const double size = largest * number(0.05, 0.9);
    switch (static_cast<int>(number(0.0, 3.999))) {
      case 0:
        scene_.spheres.push_back({.centre = at, .radius = size, .material = material()});
        break;
      case 1:
        scene_.cones.push_back(
            {.base = at,
             .base_radius = 0.4 * size,
             .apex = at + Vec3{number(-1, 1), number(0.3, 1), number(-1, 1)} * size,
             .apex_radius = 0.1 * size,
             .material = material()});
        break;
      case 2:
        scene_.meshes.push_back(box_mesh(
            at, at + Vec3{number(0.05, 1), number(0.05, 1), number(0.05, 1)} * size, material()));
        break;
      default:
        scene_.meshes.push_back(ball_mesh(at, size, 4 + static_cast<uint32_t>(number(0.0, 8.0))));
        scene_.meshes.back().material = material();
    }
  }
  /// Samples miss a wire's shadow and its mirror image: few subpixels are off, but by much.
  void add_wire() {
    const double radius = number(0.001, 0.02);
    const double height = chance(0.5) ? 4.0 : 0.0;
    scene_.cones.push_back({.base = place() + Vec3{0.0, height, 0.0},
                            .base_radius = radius,
                            .apex = place() + Vec3{0.0, height, 0.0},
                            .apex_radius = radius,
                            .material = material()});
  }
  void add_light() {
    render::Light light;
    if (chance(0.4)) {
      light.kind = render::Light::Kind::Directional;
      light.direction = normalized(Vec3{number(-1, 1), number(-1, -0.2), number(-1, 0.2)});
    }
    light.position = {number(-8, 8), number(1, 9), number(1, 10)};
    light.colour = colour() * 0.6;
    scene_.lights.push_back(light);
  }

  std::mt19937_64 random_;
  render::SceneDescription scene_;
};

/// Sums over frames.
struct Audits {
  uint64_t frames = 0;
  uint64_t broken = 0;        ///< frames with a bound below the true share or root mean square
  uint64_t beyond_aim = 0;    ///< frames with a root mean square above the 2 E at which audits aim
  uint64_t sampled_less = 0;  ///< frames of which the samples have less than half of the error
  uint64_t retraced = 0;      ///< frames with bands that were traced again
  double true_share = 0.0;
  double bound = 0.0;
  // Sampled subpixels in which the audit found an error above the limit, and the expected number of
  // them.
  double found = 0.0;
  double expected = 0.0;
  double variance = 0.0;
};

void audit(uint64_t seed, std::mutex& mutex, Audits& sum) {
  RandomScene source(seed);
  const optics::Rig rig = source.rig();
  const optics::OpticalModel model(rig);
  const render::Stage stage = plain_stage({}, source.mm_per_unit());
  const render::Scene scene(source.make(), stage, {}, 1);
  const double error = kErrors[seed % kErrors.size()];
  const render::RenderOptions options{
      .threads = 1, .tolerated_error = error, .cancelled = player::interrupted};
  const auto make = [&](const char* name) {
    return next_frame(*render::make_method(name, model, options), scene, stage, rig);
  };
  const SmallFrame full = make("full"), adaptive = make("adaptive");
  if (player::interrupted()) return;
  const frames::Difference off =
      frames::compare_pictures(full.frame.view(), adaptive.frame.view()).total;
  const render::RenderStatistics& said = adaptive.statistics;
  const int limit = static_cast<int>(error);  // larger whole numbers exceed the error
  const double share = off.share_over(limit);
  // Sampled subpixels are delivered as traced, so the bound is checked on the other subpixels.
  const auto sampled = static_cast<double>(said.audited_subpixels);
  const double of_rest = static_cast<double>(off.count_over(limit)) /
                         (static_cast<double>(off.samples()) - 2.0 * sampled);
  const std::lock_guard lock(mutex);
  ++sum.frames;
  sum.broken += share > said.beyond_bound || off.rmse() > said.rmse_bound + kRounding ? 1 : 0;
  sum.beyond_aim += off.rmse() > 2.0 * error ? 1 : 0;
  sum.sampled_less += off.rmse() > 2.0 * said.audited_rmse ? 1 : 0;
  sum.retraced += said.retraced_subpixels > 0 ? 1 : 0;
  sum.true_share += share;
  sum.bound += said.beyond_bound;
  sum.found += static_cast<double>(said.audited_beyond);
  sum.expected += of_rest * sampled;
  sum.variance += of_rest * (1.0 - of_rest) * sampled;
}

StabilityRow audits(const StabilitySize& size) {
  std::mutex mutex;
  Audits sum;
  for_each_part(size, size.samples(100, 4'000), [&](uint64_t seed) { audit(seed, mutex, sum); });
  const auto frames = static_cast<double>(sum.frames);
  return {
      .tally = {.samples = sum.frames,
                .failures = sum.broken,
                .worst = std::abs(sum.found - sum.expected) / std::sqrt(sum.variance)},
      .failures_allowed = sum.frames / 100,
      .note = fmt::format("over E: {:.2f} % on average, bounds {:.2f} %; {} found of {:.0f} "
                          "expected; {} frames retraced; RMSE of {} frames above 2 E, of {} "
                          "more than twice that of the samples",
                          100.0 * sum.true_share / frames, 100.0 * sum.bound / frames, sum.found,
                          sum.expected, sum.retraced, sum.beyond_aim, sum.sampled_less)};
}

}  // namespace

std::vector<StabilityCase> audit_cases() {
  return {{"audit", "random scenes: what method adaptive reports about its frames, against full",
           "frames", "bounds that do not hold", audits, 4.0, "deviations of the number found"}};
}

}  // namespace lenticule::lab
