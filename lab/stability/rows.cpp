// SPDX-License-Identifier: Apache-2.0
#include "lab/stability/rows.h"

#include <fmt/format.h>

#include <atomic>
#include <exception>
#include <mutex>
#include <numbers>
#include <string_view>
#include <thread>

#include "base/error.h"
#include "player/process/interrupt.h"

namespace lenticule::lab {

namespace {

/// Returns 12345678 as "12 345 678".
std::string grouped(uint64_t number) {
  if (number < 1000) return fmt::format("{}", number);
  return fmt::format("{} {:03}", grouped(number / 1000), number % 1000);
}

}  // namespace

bool passes(const StabilityRow& row) {
  return row.tally.samples > 0 && row.tally.failures <= row.failures_allowed &&
         row.tally.worst <= row.of->bound;
}

bool passes(const StabilityReport& report) {
  return !report.rows.empty() &&
         std::ranges::all_of(report.rows, [](const StabilityRow& row) { return passes(row); });
}

nlohmann::json to_json(const StabilityReport& report) {
  nlohmann::json rows = nlohmann::json::array();
  for (const StabilityRow& row : report.rows)
    rows.push_back({{"name", row.of->name},
                    {"stressed", row.of->stressed},
                    {"samples", row.tally.samples},
                    {"samples_are", row.of->samples_are},
                    {"failures", row.tally.failures},
                    {"failures_allowed", row.failures_allowed},
                    {"failures_are", row.of->failures_are},
                    {"worst", row.tally.worst},
                    {"bound", row.of->bound},
                    {"unit", row.of->unit},
                    {"note", row.note},
                    {"passes", passes(row)}});
  return {{"benchmark", "stability"},
          {"size", report.full ? "full" : "quick"},
          {"seconds", report.seconds},
          {"rows", rows},
          {"passes", passes(report)}};
}

std::string to_text(const StabilityReport& report) {
  size_t width = 0;
  for (const StabilityRow& row : report.rows)
    width = std::max(width, std::string_view(row.of->name).size());
  std::string text;
  uint64_t passed = 0;
  for (const StabilityRow& row : report.rows) {
    const StabilityCase& of = *row.of;
    text += fmt::format("{} {:<{}}  {} {}: {} {}", passes(row) ? "pass" : "FAIL", of.name, width,
                        grouped(row.tally.samples), of.samples_are, grouped(row.tally.failures),
                        of.failures_are);
    if (row.failures_allowed > 0) text += " of " + grouped(row.failures_allowed);
    if (of.bound > 0.0)
      text += fmt::format("; error {:.2g} of {:.2g} {}", row.tally.worst, of.bound, of.unit);
    text += fmt::format("\n{:{}}  {}\n", "", width + 5, of.stressed);
    if (!row.note.empty()) text += fmt::format("{:{}}  {}\n", "", width + 5, row.note);
    passed += passes(row) ? 1 : 0;
  }
  return text +
         fmt::format("{} of {} rows pass, {:.0f} s\n", passed, report.rows.size(), report.seconds);
}

// Each part of the table is at the end of the file of its cases.
std::vector<StabilityCase> frame_cases();
std::vector<StabilityCase> hit_cases();
std::vector<StabilityCase> audit_cases();

const std::vector<StabilityCase>& stability_cases() {
  static const std::vector<StabilityCase> table = [] {
    std::vector<StabilityCase> all = frame_cases();
    for (const auto& part : {hit_cases(), audit_cases()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return table;
}

void for_each_part(const StabilitySize& size, uint64_t count,
                   const std::function<void(uint64_t)>& work) {
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const unsigned threads = size.threads > 0 ? static_cast<unsigned>(size.threads) : cores;
  std::atomic<uint64_t> next{0};
  std::mutex mutex;
  std::exception_ptr first_error;
  const auto run = [&] {
    try {
      for (uint64_t k = next++; k < count && !player::interrupted(); k = next++) work(k);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!first_error) first_error = std::current_exception();
      next = count;
    }
  };
  std::vector<std::jthread> others;
  for (unsigned k = 1; k < threads; ++k) others.emplace_back(run);
  run();
  others.clear();
  if (first_error) std::rethrow_exception(first_error);
}

Tally tally_parts(const StabilitySize& size, uint64_t count,
                  const std::function<void(uint64_t, Tally&)>& work) {
  std::mutex mutex;
  Tally sum;
  for_each_part(size, count, [&](uint64_t k) {
    Tally part;
    work(k, part);
    const std::lock_guard lock(mutex);
    sum += part;
  });
  return sum;
}

namespace {

using render::Material;
using render::SceneDescription;
using render::TriangleMesh;

SceneDescription one_triangle() {
  SceneDescription scene;
  scene.source = "one triangle";
  scene.materials = {Material{}};
  scene.meshes.push_back({.name = "triangle",
                          .positions = {{-1, 0, 20}, {1, 0, 20}, {0, 1, 20}},
                          .triangles = {{0, 1, 2}}});
  return scene;
}

}  // namespace

render::Stage plain_stage(Vec3 centre, double mm_per_unit) {
  render::Stage stage;
  stage.world_from_panel = {
      {1.0 / mm_per_unit, 0, 0}, {0, 1.0 / mm_per_unit, 0}, {0, 0, 1.0 / mm_per_unit}, centre};
  stage.panel_from_world = stage.world_from_panel.inverse();
  stage.mm_per_unit = mm_per_unit;
  stage.near_mm = std::numeric_limits<double>::infinity();
  return stage;
}

PlainStage::PlainStage(const optics::Rig&) : scene(one_triangle(), plain_stage(), {}, 1) {}

TriangleMesh ball_mesh(Vec3 centre, double radius, uint32_t rings) {
  TriangleMesh mesh;
  mesh.name = "ball";
  const uint32_t sectors = 2 * rings;
  mesh.positions.push_back(centre + Vec3{0, radius, 0});
  for (uint32_t ring = 1; ring < rings; ++ring)
    for (uint32_t sector = 0; sector < sectors; ++sector) {
      const double polar = std::numbers::pi * ring / rings;
      const double azimuth = 2.0 * std::numbers::pi * sector / sectors;
      mesh.positions.push_back(centre + Vec3{std::sin(polar) * std::cos(azimuth), std::cos(polar),
                                             std::sin(polar) * std::sin(azimuth)} *
                                            radius);
    }
  mesh.positions.push_back(centre - Vec3{0, radius, 0});
  const auto last = static_cast<uint32_t>(mesh.positions.size() - 1);
  const auto corner = [&](uint32_t ring, uint32_t sector) {
    if (ring == 0) return 0U;
    return ring == rings ? last : 1 + (ring - 1) * sectors + sector % sectors;
  };
  for (uint32_t ring = 0; ring < rings; ++ring)
    for (uint32_t sector = 0; sector < sectors; ++sector) {
      const uint32_t a = corner(ring, sector), b = corner(ring, sector + 1);
      const uint32_t c = corner(ring + 1, sector + 1), d = corner(ring + 1, sector);
      if (ring != 0) mesh.triangles.push_back({a, b, c});
      if (ring + 1 != rings) mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

TriangleMesh grid_mesh(Vec3 corner, Vec3 a, Vec3 b, uint32_t side) {
  TriangleMesh mesh;
  mesh.name = "grid";
  for (uint32_t row = 0; row <= side; ++row)
    for (uint32_t column = 0; column <= side; ++column)
      mesh.positions.push_back(corner + a * (static_cast<double>(column) / side) +
                               b * (static_cast<double>(row) / side));
  for (uint32_t row = 0; row < side; ++row)
    for (uint32_t column = 0; column < side; ++column) {
      const uint32_t k = row * (side + 1) + column;
      mesh.triangles.push_back({k, k + 1, k + side + 2});
      mesh.triangles.push_back({k, k + side + 2, k + side + 1});
    }
  return mesh;
}

TriangleMesh box_mesh(Vec3 low, Vec3 high, int material) {
  TriangleMesh mesh;
  mesh.name = "box";
  mesh.material = material;
  for (unsigned k = 0; k < 8; ++k)
    mesh.positions.push_back({(k & 1U) != 0 ? high.x : low.x, (k & 2U) != 0 ? high.y : low.y,
                              (k & 4U) != 0 ? high.z : low.z});
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

optics::Rig small_rig() {
  optics::Rig rig;
  rig.name = "small";
  rig.panel.width_px = 160;
  rig.panel.height_px = 96;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.5);
  rig.sheet.pitch = Subpixels(7.7);
  rig.sheet.slant = 1.0 / 3.0;
  rig.sheet.offset = Lenses(0.137);
  rig.sheet.gap = Millimetres(2.3);
  rig.sheet.refraction_shape = 0.45;
  rig.viewing.distance = Millimetres(400.0);
  return rig;
}

SceneDescription mixed_scene() {
  SceneDescription scene;
  scene.source = "mixed";
  scene.background = {0.11, 0.23, 0.37};
  scene.materials = {Material{.name = "matte", .colour = {0.8, 0.75, 0.6}},
                     Material{.name = "mirror",
                              .colour = {0.9, 0.4, 0.3},
                              .diffuse = 0.4,
                              .specular = 0.5,
                              .shine = 23.0},
                     Material{.name = "glass",
                              .colour = {0.93, 0.97, 0.95},
                              .diffuse = 0.05,
                              .specular = 0.12,
                              .transmittance = 0.8,
                              .refraction_index = 1.5}};
  scene.meshes = {grid_mesh({-5.03, -1.41, 5.07}, {10.11, 0.07, 0.0}, {0.0, 0.05, -10.3}, 4),
                  box_mesh({0.63, -1.33, -0.41}, {1.87, 0.37, 0.89}, 2),
                  ball_mesh({-0.21, 1.13, 0.31}, 0.61, 8)};
  scene.spheres = {{.centre = {-1.31, -0.23, 0.62}, .radius = 1.07, .material = 1},
                   {.centre = {0.17, -1.03, 1.07}, .radius = 0.39, .material = 2}};
  scene.cones = {{.base = {1.91, -1.27, -1.31},
                  .base_radius = 0.73,
                  .apex = {2.13, 1.37, -0.83},
                  .apex_radius = 0.21,
                  .material = 0}};
  render::Light near_light;
  near_light.position = {-7.13, 8.29, 9.41};
  near_light.colour = {0.6, 0.55, 0.5};
  render::Light sun;
  sun.kind = render::Light::Kind::Directional;
  sun.direction = normalized(Vec3{-0.53, -0.71, -0.43});
  sun.colour = {0.3, 0.35, 0.4};
  scene.lights = {near_light, sun};
  return scene;
}

SceneDescription moved(SceneDescription scene, double scale, Vec3 offset) {
  const auto move = [&](Vec3& p) { p = p * scale + offset; };
  for (TriangleMesh& mesh : scene.meshes)
    for (Vec3& p : mesh.positions) move(p);
  for (render::Sphere& sphere : scene.spheres) {
    move(sphere.centre);
    sphere.radius *= scale;
  }
  for (render::Cone& cone : scene.cones) {
    move(cone.base);
    move(cone.apex);
    cone.base_radius *= scale;
    cone.apex_radius *= scale;
  }
  for (render::Light& light : scene.lights) move(light.position);
  return scene;
}

frames::WovenFrame render_small(const SceneDescription& description, const render::Stage& stage,
                                const optics::Rig& rig, int threads) {
  const optics::OpticalModel model(rig);
  const render::Scene scene(description, stage, {}, threads);
  const auto method =
      render::make_method("full", model, {.threads = threads, .cancelled = player::interrupted});
  return next_frame(*method, scene, stage, rig).frame;
}

SmallFrame next_frame(render::Method& method, const render::Scene& scene,
                      const render::Stage& stage, const optics::Rig& rig) {
  SmallFrame out{
      frames::WovenFrame({rig.panel.width_px, rig.panel.height_px, frames::PixelFormat::Rgb8}), {}};
  out.statistics = method.render(scene, stage, out.frame);
  if (out.statistics.invalid_rays != 0)
    throw Error(ErrorKind::Failed, "stability: rays that are not finite",
                "this is a fault of the renderer");
  return out;
}

optics::Rig finer(optics::Rig rig, int times) {
  rig.panel.width_px *= times;
  rig.panel.height_px *= times;
  rig.panel.pixel_width.value /= times;
  rig.panel.pixel_height.value /= times;
  return rig;
}

Material glowing(Vec3 colour) { return {.name = "glowing", .diffuse = 0.0, .emission = colour}; }

SceneDescription dark_scene(Vec3 background) {
  SceneDescription scene;
  scene.source = "dark";
  scene.background = background;
  scene.ambient = Vec3{};
  scene.colour_managed = false;
  return scene;
}
}  // namespace lenticule::lab
