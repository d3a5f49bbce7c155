// SPDX-License-Identifier: Apache-2.0
// Rows of whole pictures: phases over a panel 15360 pixels wide in every precision in use,
// refraction, outlines, the independence of origin and unit, and degenerate scenes.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "frames/weave.h"
#include "lab/fixtures.h"
#include "lab/stability/oracles.h"
#include "lab/stability/probes.h"
#include "lab/stability/rows.h"
#include "optics/row_rays.h"
#include "player/process/interrupt.h"
#include "render/loaders/load_scene.h"

namespace lenticule::lab {

// Tests phases over a panel 15360 pixels wide, in every precision in use, against the oracle.

namespace {

constexpr double kViews = 45.0;

/// Returns the kiosk's sheet on a panel larger than any planned one.
optics::Rig large_rig() {
  optics::Rig rig = kiosk_rig();
  rig.panel.width_px = 15360;
  rig.panel.height_px = 8640;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.08);
  rig.sheet.gap = Millimetres(1.15);
  rig.viewing.height = Millimetres(37.0);
  return rig;
}

struct Expected {
  OraclePlace at;
  int view = 0;
};
Expected expected(const optics::Rig& rig, int i, int j, int channel) {
  const OraclePlace at = oracle_place(oracle_phase(rig, i, j, channel, oracle_design_eye(rig)));
  // Views of docs/panel/optics.md: a border belongs to the view on its left, with the tolerance of
  // lenses.
  const Real number = Real(kViews) * (Real(0.5) - at.place) - Real(kViews) / Real(4294967296.0);
  return {at, static_cast<int>(std::ceil(number)) - 1};
}

void compare(const Expected& oracle, int64_t lens, double place, Tally& tally) {
  const int view =
      frames::nearest_view(optics::view_number(place, kViews), static_cast<int>(kViews));
  tally.check(lens == oracle.at.lens && view == oracle.view);
  if (lens == oracle.at.lens)
    tally.error(static_cast<double>(std::fabs(Real(place) - oracle.at.place)));
}

/// Returns the number of rows to test: a few dozen including the first and the last, or all.
uint64_t row_count(const optics::Rig& rig, const StabilitySize& size) {
  return size.samples(24, static_cast<uint64_t>(rig.panel.height_px));
}
int row_number(const optics::Rig& rig, uint64_t count, uint64_t k) {
  return static_cast<int>(k * static_cast<uint64_t>(rig.panel.height_px - 1) / (count - 1));
}

StabilityRow phase_scalar(const StabilitySize& size) {
  const optics::Rig rig = large_rig();
  const optics::OpticalModel model(rig);
  const uint64_t rows = row_count(rig, size);
  return {.tally = tally_parts(size, rows, [&](uint64_t k, Tally& tally) {
            const int j = row_number(rig, rows, k);
            for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
              const optics::SubpixelRay ray = model.ray(s / 3, j, s % 3);
              compare(expected(rig, s / 3, j, s % 3), ray.lens, ray.place, tally);
            }
          })};
}

StabilityRow phase_kernels(const StabilitySize& size) {
  const optics::Rig rig = large_rig();
  const optics::OpticalModel model(rig);
  std::vector<optics::RowRayEvaluator> kernels;
  std::string names;
  for (const Isa isa : {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512}) {
    if (!isa_supported(isa)) continue;
    kernels.emplace_back(model, isa);
    names += (names.empty() ? "" : ", ") + std::string(isa_name(isa));
  }
  const uint64_t rows = row_count(rig, size);
  const Tally all = tally_parts(size, rows, [&](uint64_t k, Tally& tally) {
    const int j = row_number(rig, rows, k);
    static thread_local std::vector<optics::RowRays> rays;
    rays.resize(kernels.size());
    for (size_t n = 0; n < kernels.size(); ++n)
      kernels[n].evaluate(j, 0, rig.panel.width_px, rays[n]);
    for (int s = 0; s < 3 * rig.panel.width_px; ++s) {
      const Expected oracle = expected(rig, s / 3, j, s % 3);
      const auto at = static_cast<size_t>(s);
      for (const optics::RowRays& row : rays) compare(oracle, row.lens[at], row.place[at], tally);
    }
  });
  return {.tally = all, .note = "instruction sets: " + names};
}

StabilityRow phase_tiles(const StabilitySize& size) {
  optics::Rig rig = large_rig();
  // The cones of views would not fit at less than a panel's width.
  rig.viewing.distance = Millimetres(1500.0);
  const optics::OpticalModel model(rig);
  const PlainStage plain(rig);
  const PrimaryProbe probe(plain.scene, model, best_isa());
  const auto tiles = static_cast<uint64_t>(probe.tiles());
  const uint64_t step = size.samples(599, 1);  // prime, so that all columns and bands are covered
  Tally all = tally_parts(size, (tiles + step - 1) / step, [&](uint64_t k, Tally& tally) {
    static thread_local std::vector<PrimaryProbe::Line> lines;
    probe.lines(static_cast<int>(k * step), lines);
    uint64_t n = 0;
    for (const auto& line : lines) {
      const int i = line.subpixel / 3;
      const int channel = line.subpixel % 3;
      const OraclePlace at =
          oracle_place(oracle_phase(rig, i, line.row, channel, oracle_design_eye(rig)));
      // The ray leaves through the apex line of its lens. (Heights are paraxial: a fraction of a
      // pixel.)
      const Real through = oracle_lens_at(rig, line.x_mm, line.y_mm, channel);
      tally.check(std::fabs(through - static_cast<Real>(at.lens)) < Real(0.25));
      if (n++ % 64 != 0) continue;  // the oracle's eye is slow to find
      const OracleRay oracle = oracle_ray(rig, i, line.row, channel, at.lens);
      tally.error(static_cast<double>(std::fabs(Real(line.tan_x) - oracle.tan_x)));
    }
  });
  if (!probe.fast()) all.samples = 0;  // these rays came from the optical map itself
  return {.tally = all};
}

// Tests total internal reflection and nested transparent objects against Snell's law in long
// double.

render::Material glass(double index) {
  return {.name = "glass",
          .colour = {0.95, 0.9, 0.85},
          .diffuse = 0.0,
          .specular = 0.11,
          .transmittance = 0.84,
          .refraction_index = index};
}

/// Adds stripes of three glowing materials behind everything, which reveal the direction of a
/// refracted ray.
void add_stripes(render::SceneDescription& scene) {
  const int first = static_cast<int>(scene.materials.size());
  scene.materials.push_back(glowing({0.8, 0.3, 0.1}));
  scene.materials.push_back(glowing({0.1, 0.7, 0.4}));
  scene.materials.push_back(glowing({0.3, 0.2, 0.9}));
  for (int k = 0; k < 9; ++k) {
    render::TriangleMesh stripe =
        grid_mesh({-63.1 + 14.0 * k, -41.3, -33.7}, {14.0, 0.0, 1.3}, {0.7, 83.1, -2.1}, 1);
    stripe.material = first + k % 3;
    scene.meshes.push_back(stripe);
  }
}

optics::Rig rig_of(const StabilitySize& size) { return finer(small_rig(), size.full ? 4 : 1); }

/// Returns a box rotated about two axes, so that rays meet its far faces beyond the critical angle.
render::TriangleMesh turned_box() {
  render::TriangleMesh box = box_mesh({-14.1, -11.3, -9.7}, {13.3, 12.1, 10.9}, 0);
  for (Vec3& p : box.positions) {
    p = {0.8 * p.x - 0.6 * p.z, p.y, 0.6 * p.x + 0.8 * p.z};
    p = {p.x - 17.3, 0.96 * p.y - 0.28 * p.z, 0.28 * p.y + 0.96 * p.z};
  }
  return box;
}

StabilityRow total_reflection(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.2, 0.25, 0.3});
  scene.materials = {glass(1.52), glass(2.42)};
  scene.meshes = {turned_box()};
  scene.spheres = {{.centre = {19.7, 1.3, 2.1}, .radius = 14.9, .material = 1}};
  add_stripes(scene);
  return compare_with_oracle(scene, rig_of(size), size);
}

StabilityRow nested_glass(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.2, 0.25, 0.3});
  scene.materials = {glass(1.5), glass(2.0)};
  // A glass ball that contains a bubble, which contains a ball of denser glass; and beside it the
  // same with an air gap so thin that the surfaces nearly touch.
  scene.spheres = {{.centre = {-19.3, 0.7, 1.1}, .radius = 17.3, .material = 0},
                   {.centre = {-18.1, 1.9, 2.3}, .radius = 11.9, .inward = true, .material = 0},
                   {.centre = {-17.3, 2.3, 3.1}, .radius = 7.1, .material = 1},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 16.7, .material = 0},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 12.001, .inward = true, .material = 0},
                   {.centre = {19.1, -0.9, 1.7}, .radius = 12.0, .material = 1}};
  add_stripes(scene);
  return compare_with_oracle(scene, rig_of(size), size);
}

// Tests outlines of every slope, each exactly through the ray of a subpixel: method adaptive
// against full.

constexpr double kPaneMm = 12.0;   // distance in front of the panel
constexpr double kWallMm = -21.0;  // behind the panel
constexpr double kFarOff = 110.0;  // distance from the middle to beyond the visible area
constexpr double kError = 2.0;     // codes, the tolerated error of method adaptive

/// Surfaces are identified by ranges of codes, which light does not change.
enum class Seen { Wall, Pane, Nothing, Neither };
Seen seen(uint8_t code) {
  if (code <= 90) return Seen::Wall;
  if (code >= 140 && code <= 220) return Seen::Pane;
  return code >= 250 ? Seen::Nothing : Seen::Neither;
}

/// A line in the pane's plane.
struct Outline {
  Vec3 point;
  Vec3 along;   ///< unit
  Vec3 inward;  ///< unit, toward the pane
  [[nodiscard]] double distance(Vec3 p) const { return std::abs(dot(p - point, inward)); }
};

/// Returns the intersection of a subpixel's ray with the pane's plane.
Vec3 at_pane(const optics::SubpixelRay& ray) {
  return {ray.lens_x_mm + kPaneMm * ray.tan_x, ray.lens_y_mm + kPaneMm * ray.tan_y, kPaneMm};
}

Outline outline_at(const optics::OpticalModel& model, double degrees) {
  const double angle = degrees * std::numbers::pi / 180.0;
  // All components but one of a level line must be exactly zero.
  const auto clean = [](double v) { return std::abs(v) < 1e-15 ? 0.0 : v; };
  const double c = clean(std::cos(angle)), s = clean(std::sin(angle));
  const optics::Panel& panel = model.rig().panel;
  return {.point = at_pane(model.ray(panel.width_px / 2, panel.height_px / 2, 1)),
          .along = {c, s, 0.0},
          .inward = {-s, c, 0.0}};
}

/// Returns half a plane in front of a wall, with a light whose shadow has an edge of the same
/// slope.
render::SceneDescription scene_of(const Outline& outline) {
  render::SceneDescription scene = dark_scene({1.0, 1.0, 1.0});
  scene.source = "slopes";
  scene.materials = {
      render::Material{.name = "wall", .diffuse = 0.2, .emission = Vec3{0.1, 0.12, 0.14}},
      render::Material{.name = "pane", .diffuse = 0.2, .emission = Vec3{0.57, 0.59, 0.61}}};
  scene.meshes = {
      grid_mesh({-kFarOff, -kFarOff, kWallMm}, {2 * kFarOff, 0, 0}, {0, 2 * kFarOff, 0}, 1),
      grid_mesh(outline.point - outline.along * kFarOff, outline.along * (2 * kFarOff),
                outline.inward * kFarOff, 1)};
  scene.meshes[1].material = 1;
  render::Light light;
  light.position = {-57.0, 83.0, 310.0};
  scene.lights = {light};
  return scene;
}

/// Returns all angles in steps, and angles slightly beside those that are special to a panel.
std::vector<double> slopes(const optics::Rig& rig, double per_degree) {
  std::vector<double> degrees;
  for (int n = 0; n < 180.0 * per_degree; ++n) degrees.push_back(n / per_degree);
  const optics::Panel& panel = rig.panel;
  const double lean =
      std::atan(rig.sheet.slant * panel.pixel_width.value / panel.pixel_height.value) * 180.0 /
      std::numbers::pi;
  for (const double special : {0.0, 45.0, 90.0, 135.0, 90.0 + lean, 90.0 - lean})
    for (const double beside : {0.0, 1e-6, -1e-6}) degrees.push_back(special + beside);
  return degrees;
}

/// Counts subpixels whose error exceeds the tolerated one, and the number that the method reports
/// as its bound.
struct Beyond {
  std::atomic<uint64_t> subpixels{0};
  std::atomic<uint64_t> allowed{0};
  std::atomic<uint64_t> on_outline{0};
};

struct Pictures {
  SmallFrame full, adaptive;
};

Pictures pictures_of(const optics::OpticalModel& model, const Outline& outline) {
  const render::Stage stage = plain_stage();
  const render::Scene scene(scene_of(outline), stage, {}, 1);
  const render::RenderOptions options{
      .threads = 1, .tolerated_error = kError, .cancelled = player::interrupted};
  const auto make = [&](const char* name) {
    return next_frame(*render::make_method(name, model, options), scene, stage, model.rig());
  };
  return {make("full"), make("adaptive")};
}

Tally compare(const optics::OpticalModel& model, const Outline& outline, const Pictures& pictures,
              Beyond& beyond) {
  Tally tally;
  uint64_t off = 0;
  const optics::Panel& panel = model.rig().panel;
  for (int j = 0; j < panel.height_px; ++j)
    for (int s = 0; s < 3 * panel.width_px; ++s) {
      const uint8_t made = pictures.adaptive.frame.row(j)[s],
                    ground_truth = pictures.full.frame.row(j)[s];
      const Seen what = seen(made);
      tally.check(what == Seen::Wall || what == Seen::Pane);
      if (what == seen(ground_truth)) {
        if (std::abs(int{made} - int{ground_truth}) > kError) ++off;
        continue;
      }
      ++beyond.on_outline;
      tally.error(outline.distance(at_pane(model.ray(s / 3, j, s % 3))));
    }
  beyond.subpixels += off;
  const auto subpixels = static_cast<double>(pictures.full.frame.bytes().size());
  beyond.allowed += static_cast<uint64_t>(pictures.adaptive.statistics.beyond_bound * subpixels);
  return tally;
}

StabilityRow outline_slopes(const StabilitySize& size) {
  const optics::OpticalModel model(finer(small_rig(), size.full ? 2 : 1));
  const std::vector<double> degrees = slopes(model.rig(), size.full ? 10.0 : 0.5);
  Beyond beyond;
  Tally all = tally_parts(size, degrees.size(), [&](uint64_t k, Tally& tally) {
    const Outline outline = outline_at(model, degrees[k]);
    const Pictures pictures = pictures_of(model, outline);
    if (!player::interrupted()) tally = compare(model, outline, pictures, beyond);
  });
  if (beyond.subpixels > beyond.allowed) ++all.failures;
  return {.tally = all,
          .note = fmt::format("{} outlines, {} subpixels on them; {} off by more than {} codes, at "
                              "most {} according to the frames",
                              degrees.size(), beyond.on_outline.load(), beyond.subpixels.load(),
                              kError, beyond.allowed.load())};
}

// Tests that the picture depends neither on the position of the world's origin nor on the unit.

constexpr double kMmPerUnit = 12.0;

optics::Rig invariance_rig(const StabilitySize& size) {
  return finer(small_rig(), size.full ? 8 : 1);
}

frames::WovenFrame picture(const StabilitySize& size, double scale, Vec3 offset) {
  return render_small(moved(mixed_scene(), scale, offset), plain_stage(offset, kMmPerUnit / scale),
                      invariance_rig(size), size.threads);
}

/// Counts codes that differ by more than one, and records the largest difference.
Tally difference(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  Tally tally;
  for (size_t k = 0; k < a.bytes().size(); ++k) {
    const int off = std::abs(int{a.bytes()[k]} - int{b.bytes()[k]});
    tally.check(off <= 1);
  }
  return tally;
}

/// Compares the picture at home with those at each scale or offset. A small number of failures is
/// allowed: rounded world coordinates may move the outline of an object across a subpixel's ray.
StabilityRow compare_places(const StabilitySize& size, const std::vector<double>& places,
                            const std::function<frames::WovenFrame(double)>& picture_at) {
  const frames::WovenFrame at_home = picture(size, 1.0, {});
  StabilityRow row{.note = "in turn:"};
  for (const double place : places) {
    const Tally tally = difference(at_home, picture_at(place));
    row.note += fmt::format(" {}", tally.failures);
    row.tally += tally;
  }
  row.failures_allowed = row.tally.samples / 20000;
  return row;
}

StabilityRow offsets(const StabilitySize& size) {
  return compare_places(size, {1e3, 1e4, 1e5, 1e6, 1e7}, [&](double offset) {
    return picture(size, 1.0, Vec3{offset, -0.7 * offset, 0.4 * offset});
  });
}

StabilityRow scales(const StabilitySize& size) {
  return compare_places(size, {1e-6, 1e-3, 7.0, 1e3, 1e6},
                        [&](double scale) { return picture(size, scale, {}); });
}

// Tests degenerate geometry: values that are not finite are refused with a clear error, and
// primitives without area change nothing. A run that ends by a signal here has failed too.

using render::SceneDescription;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Returns true if the attempt throws an Error with a subject and a cause.
bool refuses(const std::function<void()>& attempt) {
  try {
    attempt();
  } catch (const Error& error) {
    return error.kind() == ErrorKind::Input &&
           std::string(error.what()).find(": ") != std::string::npos;
  }
  return false;
}

SceneDescription ball_scene() {
  SceneDescription scene = dark_scene({0.1, 0.2, 0.3});
  scene.materials = {glowing({0.7, 0.5, 0.4}), glowing({0.2, 0.9, 0.6})};
  scene.meshes = {ball_mesh({1.1, 0.3, 0.7}, 17.3, 12)};
  return scene;
}

void refuse_scenes(NamedFailures& failures) {
  const auto expect = [&](const std::string& name,
                          const std::function<void(SceneDescription&)>& spoil) {
    SceneDescription scene = ball_scene();
    spoil(scene);
    failures.check(name,
                   refuses([&] { (void)render_small(scene, plain_stage(), small_rig(), 1); }));
  };
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    const auto expect_bad = [&](const char* name, const auto& spoil) {
      expect(fmt::format("{} {}", name, bad), spoil);
    };
    expect_bad("vertex", [&](auto& s) { s.meshes[0].positions[7].y = bad; });
    expect_bad("unused vertex", [&](auto& s) { s.meshes[0].positions.push_back({bad, 0, 0}); });
    expect_bad("normal", [&](auto& s) {
      s.meshes[0].normals.assign(s.meshes[0].positions.size(), {0, 1, 0});
      s.meshes[0].normals[3].z = bad;
    });
    expect_bad("sphere's centre", [&](auto& s) { s.spheres = {{.centre = {bad, 0, 0}}}; });
    expect_bad("sphere's radius", [&](auto& s) { s.spheres = {{.radius = bad}}; });
    expect_bad("cone's base", [&](auto& s) {
      s.cones = {{.base = {0, bad, 0}, .apex = {1, 2, 3}}};
    });
    expect_bad("cone's radius", [&](auto& s) {
      s.cones = {{.base_radius = bad, .apex = {1, 2, 3}}};
    });
    expect_bad("colour", [&](auto& s) { s.materials[0].colour.x = bad; });
    expect_bad("index of refraction", [&](auto& s) { s.materials[0].refraction_index = bad; });
    expect_bad("ambient light", [&](auto& s) { s.ambient = Vec3{0, bad, 0}; });
    expect_bad("lamp", [&](auto& s) {
      render::Light light;
      light.position = {0, 0, bad};
      s.lights = {light};
    });
  }
  expect("vertex at 1e30", [](auto& s) { s.meshes[0].positions[7].y = 1e30; });
  expect("missing vertex", [](auto& s) { s.meshes[0].triangles[5][1] = 1U << 30U; });
  expect("missing material", [](auto& s) { s.meshes[0].material = 7; });
  expect("negative radius", [](auto& s) { s.spheres = {{.radius = -1.0}}; });
  expect("cone without height", [](auto& s) {
    s.cones = {{.base = {1, 1, 1}, .apex = {1, 1, 1}}};
  });
}

/// Adds triangles without area, slivers thinner than any number on the panel, and duplicates of
/// them.
void add_nothing(SceneDescription& scene) {
  render::TriangleMesh nothing;
  nothing.name = "nothing";
  nothing.material = 1;
  nothing.positions = {{-30, -20, 30},         {30, 20, 30},       {0, 0, 30},
                       {-30, -20 + 1e-30, 30}, {3e-39, 1e-40, 25}, {0, 2e-40, 25}};
  for (int again = 0; again < 50; ++again)
    nothing.triangles.insert(nothing.triangles.end(),
                             {{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 2}, {0, 1, 3}, {2, 4, 5}});
  scene.meshes.push_back(nothing);
  const auto triangles = scene.meshes[0].triangles;
  for (int again = 0; again < 3; ++again)
    scene.meshes[0].triangles.insert(scene.meshes[0].triangles.end(), triangles.begin(),
                                     triangles.end());
}

void compare_with_clean(NamedFailures& failures) {
  SceneDescription scene = ball_scene();
  const frames::WovenFrame clean = render_small(scene, plain_stage(), small_rig(), 1);
  add_nothing(scene);
  const frames::WovenFrame littered = render_small(scene, plain_stage(), small_rig(), 1);
  failures.check("picture with degenerate triangles",
                 std::ranges::equal(clean.bytes(), littered.bytes()));
  scene = ball_scene();
  scene.meshes[0].normals.assign(scene.meshes[0].positions.size(), Vec3{});
  const frames::WovenFrame without = render_small(scene, plain_stage(), small_rig(), 1);
  failures.check("picture with normals of length zero",
                 std::ranges::equal(clean.bytes(), without.bytes()));
}

/// Tests that broken files cause an error with the file's name, or a note about a repair.
void load_files(NamedFailures& failures) {
  const ScratchFolder folder;
  const auto load = [&](const char* name, const char* text) {
    const std::string file = folder.file(name);
    std::ofstream(file) << text;
    return render::load_scene(file);
  };
  const auto refused = [&](const char* name, const char* text) {
    failures.check(name, refuses([&] { (void)load(name, text); }));
  };
  refused("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  refused("inf.obj", "v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  refused("nan.nff", "f 1 1 1 1 0 0 0 1\np 3\nnan 0 0\n1 0 0\n0 1 0\n");
  refused("huge.nff", "f 1 1 1 1 0 0 0 1\ns 0 0 0 1e999\n");
  const auto noted = [&](const char* name, const char* text) {
    bool good = false;
    try {
      good = !load(name, text).notes.empty();
    } catch (const Error& error) {
      good = error.kind() == ErrorKind::Input;
    }
    failures.check(name, good);
  };
  noted("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
  noted("flat.nff", "f 1 1 1 1 0 0 0 1\np 3\n0 0 0\n1 0 0\n0 1 0\np 3\n0 0 0\n1 0 0\n2 0 0\n");
  noted("normal.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn nan 0 0\nf 1//1 2//2 3//1\n");
}

StabilityRow degenerate(const StabilitySize&) {
  NamedFailures failures;
  refuse_scenes(failures);
  compare_with_clean(failures);
  load_files(failures);
  return {.tally = failures.tally, .note = failures.names()};
}

}  // namespace

std::vector<StabilityCase> frame_cases() {
  const char* subpixels = "subpixels";
  const char* wrong = "wrong lenses or views";
  const char* off = "off by more than one code";
  return {
      {"phase-scalar", "scalar double, 15360x8640, 45 views, seen from 700 mm", subpixels, wrong,
       phase_scalar, 1e-9, "lens"},
      {"phase-kernels", "vector kernels, the same panel", subpixels, wrong, phase_kernels, 1e-9,
       "lens"},
      {"phase-tiles",
       "polynomials of tiles, as the renderer uses them, the same panel from 1500 mm", subpixels,
       "wrong lenses", phase_tiles, 4e-7, "of a direction"},
      {"offsets", "a scene 6 units wide moved by 10^3 to 10^7 units", subpixels, off, offsets},
      {"scales", "the same scene in units of 10^-6 to 10^6", subpixels, off, scales},
      {"degenerate", "NaN, infinity, 1e30, missing corners; slivers, duplicates, no area; files",
       "cases", "neither refused nor harmless", degenerate},
      {"total-reflection",
       "a rotated box of glass and a ball of diamond: total internal reflection", subpixels, off,
       total_reflection},
      {"nested-glass", "glass in bubbles in glass, one a thousandth of a millimetre thin",
       subpixels, off, nested_glass},
      // The row sweep's tolerance for points on an outline, docs/render/methods.md: 4e-7 of
      // coordinates.
      {"outline-slopes", "outlines at every slope through a subpixel's ray, adaptive against full",
       subpixels, "show no surface", outline_slopes, 4e-7 * std::hypot(kFarOff, kFarOff),
       "mm off the outline"},
  };
}
}  // namespace lenticule::lab
