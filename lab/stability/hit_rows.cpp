// SPDX-License-Identifier: Apache-2.0
// Rows of single rays: at the borders of lenses and views, on planes and at grazing angles, at
// corners and edges that must have no hole, and at surfaces that must not shadow themselves.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <random>

#include "frames/weave.h"
#include "lab/stability/oracles.h"
#include "lab/stability/probes.h"
#include "lab/stability/rows.h"
#include "optics/row_rays.h"

namespace lenticule::lab {

// Tests rational pitches and slants: whole columns of subpixels lie exactly on the borders of
// lenses and views, and integer arithmetic gives the correct lens and view.

namespace {

constexpr int kWidth = 15360, kHeight = 8640;

/// Pitch = pitch / pitch_by subpixels, slant = slant / slant_by, and the number of views.
struct RationalSheet {
  int pitch, pitch_by;
  int slant, slant_by;
  int views;
};

std::vector<RationalSheet> sheets() {
  std::vector<RationalSheet> all;
  struct Fraction {
    int number, by;
  };
  for (const Fraction p : {Fraction{2, 1}, {3, 1}, {6, 1}, {7, 1}, {15, 2}, {23, 3}, {3000, 1}})
    for (const Fraction m : {Fraction{0, 1}, {1, 3}, {1, 1}, {-1, 1}})
      all.push_back({p.number, p.by, m.number, m.by, p.number > 100 ? 100 : p.number});
  return all;
}

optics::Rig rational_rig(const RationalSheet& sheet) {
  optics::Rig rig;
  rig.panel.width_px = kWidth;
  rig.panel.height_px = kHeight;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.08);
  rig.sheet.pitch = Subpixels(static_cast<double>(sheet.pitch) / sheet.pitch_by);
  rig.sheet.slant = static_cast<double>(sheet.slant) / sheet.slant_by;
  rig.sheet.gap = Millimetres(rig.sheet.pitch.value * 0.08 / 3.0 / 0.5);
  return rig;
}

int64_t floor_divide(int64_t a, int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

struct Owner {
  int64_t lens = 0;
  int view = 0;
  bool on_border = false;
};

/// Owners computes the lens and view of each subpixel of a sheet with integers only.
///
/// phase = 3 [(i + 1/6 + c/3 - W/2) + m (j + 1/2 - H/2)] / P is number / by, two integers; from
/// subpixel to subpixel of a row the number grows by a constant. View and border depend on its
/// remainder and are looked up in a table.
class Owners {
 public:
  explicit Owners(const RationalSheet& sheet)
      : sheet_(sheet), by_(int64_t{2} * sheet.slant_by * sheet.pitch) {
    for (int64_t rest = 0; rest < by_; ++rest) of_rest_.push_back(owner(rest));
  }

  /// Calls see(subpixel, owner) for every subpixel of row j, from left to right.
  template <class See>
  void row(int j, const See& see) const {
    const int64_t first = number(0, j);
    const int64_t step = number(1, j) - first;
    int64_t turn = floor_divide(first, by_);
    int64_t rest = first - turn * by_;
    for (int s = 0; s < 3 * kWidth; ++s) {
      Owner here = of_rest_[static_cast<size_t>(rest)];
      here.lens += turn;
      see(s, here);
      for (rest += step; rest >= by_; rest -= by_) ++turn;
    }
  }

  [[nodiscard]] int64_t lens(int s, int j) const { return owner(number(s, j)).lens; }

 private:
  [[nodiscard]] int64_t number(int s, int j) const {
    // 6 i + 2 c is twice the subpixel's number in its row.
    const int64_t sixths = int64_t{sheet_.slant_by} * (2 * int64_t{s} + 1 - 3 * kWidth) +
                           int64_t{sheet_.slant} * 3 * (2 * int64_t{j} + 1 - kHeight);
    return sixths * sheet_.pitch_by;
  }
  [[nodiscard]] Owner owner(int64_t number) const {
    const int64_t lens = floor_divide(2 * number + by_, 2 * by_);
    // view = ceil(views (1/2 - place)) - 1, place = number / by - lens in [-1/2, 1/2).
    const int64_t place = number - lens * by_;
    const int64_t view_number = sheet_.views * (by_ - 2 * place);
    const int64_t view = -floor_divide(-view_number, 2 * by_) - 1;
    return {lens, static_cast<int>(view),
            2 * place == -by_ || floor_divide(view_number, 2 * by_) * 2 * by_ == view_number};
  }

  RationalSheet sheet_;
  int64_t by_;
  std::vector<Owner> of_rest_;
};

StabilityRow borders(const StabilitySize& size) {
  StabilityRow row;
  std::atomic<uint64_t> on_border{0};
  const int step = static_cast<int>(size.samples(619, 1));
  for (const RationalSheet& sheet : sheets()) {
    const optics::OpticalModel model(rational_rig(sheet));
    const Owners owners(sheet);
    std::vector<optics::RowRayEvaluator> kernels;
    for (const Isa isa : {Isa::Baseline, Isa::Neon, Isa::Avx2, Isa::Avx512})
      if (isa_supported(isa)) kernels.emplace_back(model, isa);
    const auto rows = static_cast<uint64_t>((kHeight + step - 1) / step);
    row.tally += tally_parts(size, rows, [&](uint64_t k, Tally& tally) {
      const int j = static_cast<int>(k) * step;
      // Reused for all rows, because allocating a megabyte for each costs more than filling it.
      static thread_local std::vector<optics::RowRays> rays;
      rays.resize(kernels.size());
      for (size_t n = 0; n < kernels.size(); ++n) kernels[n].evaluate(j, 0, kWidth, rays[n]);
      uint64_t borders = 0;
      owners.row(j, [&](int s, const Owner& ground_truth) {
        borders += ground_truth.on_border ? 1 : 0;
        const auto check = [&](int64_t lens, double place) {
          const double number = optics::view_number(place, sheet.views);
          tally.check(lens == ground_truth.lens && place >= -0.5 && place < 0.5 &&
                      frames::nearest_view(number, sheet.views) == ground_truth.view);
        };
        const auto at = static_cast<size_t>(s);
        for (const optics::RowRays& ray : rays) check(ray.lens[at], ray.place[at]);
        if (s % 16 != 0) return;
        const optics::SubpixelRay ray = model.ray(s / 3, j, s % 3);
        check(ray.lens, ray.place);
      });
      on_border += borders;
    });
  }
  row.note = fmt::format("{} subpixels exactly on a border of a lens or view", on_border.load());
  return row;
}

StabilityRow borders_tiles(const StabilitySize& size) {
  StabilityRow row;
  const uint64_t step = size.samples(4099, 1);
  int by_polynomials = 0;
  for (const RationalSheet& sheet : sheets()) {
    const optics::Rig rig = rational_rig(sheet);
    const optics::OpticalModel model(rig);
    const PlainStage plain(rig);
    const Owners owners(sheet);
    const PrimaryProbe probe(plain.scene, model, best_isa());
    by_polynomials += probe.fast() ? 1 : 0;
    const auto tiles = static_cast<uint64_t>(probe.tiles());
    row.tally += tally_parts(size, (tiles + step - 1) / step, [&](uint64_t k, Tally& tally) {
      static thread_local std::vector<PrimaryProbe::Line> lines;
      probe.lines(static_cast<int>(k * step), lines);
      for (const auto& line : lines) {
        const int64_t lens = owners.lens(line.subpixel, line.row);
        const Real through = oracle_lens_at(rig, line.x_mm, line.y_mm, line.subpixel % 3);
        tally.check(std::fabs(through - static_cast<Real>(lens)) < Real(0.25));
      }
    });
  }
  row.note = fmt::format("{} of {} sheets by polynomials", by_polynomials, sheets().size());
  return row;
}

// Tests coplanar surfaces, grazing rays, eyes on the panel, and objects that cross the panel and
// the eye's plane.

StabilityRow coplanar(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0, 0, 0});
  scene.materials = {glowing({0.4, 0.4, 0.4}), glowing({0.8, 0.8, 0.8})};
  for (const int material : {0, 1, 0}) {
    scene.meshes.push_back(grid_mesh({-90, -90, 3}, {181, 3, 7}, {-2, 179, 5}, 13));
    scene.meshes.back().material = material;
  }
  optics::Rig rig = small_rig();
  rig.panel.width_px *= 2;  // the panel becomes wider and stays within the sheets
  if (size.full) rig = finer(rig, 4);
  Tally tally;
  const frames::WovenFrame first = render_small(scene, plain_stage(), rig, 1);
  for (const uint8_t code : first.bytes()) tally.check(code == 102 || code == 204);
  for (const int threads : {2, 3, 8}) {
    const frames::WovenFrame again = render_small(scene, plain_stage(), rig, threads);
    for (size_t k = 0; k < first.bytes().size(); ++k)
      tally.check(again.bytes()[k] == first.bytes()[k]);
  }
  return {.tally = tally};
}

StabilityRow grazing(const StabilitySize& size) {
  constexpr double kReach = 3000.0;
  // A rounded height moves the intersection of a ray with a plane along the ray, by an amount
  // proportional to 1 / slope. Near an edge of the triangle the point cannot move along, and is at
  // most that far off the ray. Below this slope that exceeds the rounding of the point itself.
  constexpr double kGrazing = 1e-4;
  render::SceneDescription scene;
  scene.source = "plane";
  scene.materials = {render::Material{}};
  scene.meshes = {
      grid_mesh({-kReach, -31.1, -kReach}, {2 * kReach, 51.7, 0}, {0, -23.3, 2 * kReach}, 64)};
  const render::Scene committed(scene, plain_stage(), {}, 1);
  const Probe probe(committed);
  const std::vector<Vec3> corners = probe.corners(0);
  const Vec3 normal =
      normalized(cross(corners[65 * 64] - corners.front(), corners[64] - corners.front()));
  const auto shoot = [&](uint64_t part, Tally& tally) {
    std::mt19937_64 random(part);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    std::vector<ProbeRay> rays;
    std::vector<double> slopes;
    for (int k = 0; k < 1024; ++k) {
      // 0.1 mm to a metre away from a point of the plane, at a slope of 0.3 to 0.00003.
      const Vec3 foot = corners.front() +
                        (corners[64] - corners.front()) * (0.5 + 0.2 * unit(random)) +
                        (corners[65 * 64] - corners.front()) * (0.5 + 0.2 * unit(random));
      const double slope = std::pow(10.0, -2.5 + 2.0 * unit(random));
      const double distance = std::pow(10.0, 1.0 + 2.0 * unit(random));
      const Vec3 along = normalized(cross(normal, Vec3{unit(random), unit(random), unit(random)}));
      const Vec3 up = dot(normal, Vec3{0, 1, 0}) > 0 ? normal : -normal;
      const Vec3 way = normalized(along - up * slope);
      rays.push_back({foot - way * distance, way});
      slopes.push_back(slope);
    }
    std::vector<ProbeHit> hits(rays.size());
    (void)probe.trace(rays, HoleGuard::On, hits);
    for (size_t k = 0; k < rays.size(); ++k) {
      tally.check(hits[k].what == ProbeHit::What::Surface);
      if (hits[k].what != ProbeHit::What::Surface) continue;
      // Distance of the point from the ray.
      const Vec3 off = cross(hits[k].point - rays[k].origin, rays[k].direction);
      tally.error(length(off) * std::min(1.0, slopes[k] / kGrazing));
    }
  };
  return {.tally = tally_parts(size, size.samples(200, 20'000), shoot)};
}

StabilityRow eye_on_panel(const StabilitySize& size) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  const auto look = [&](uint64_t part, Tally& tally) {
    std::mt19937_64 random(part);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int k = 0; k < 64; ++k) {
      const int i = static_cast<int>(random() % 160), j = static_cast<int>(random() % 96);
      const optics::Eye eye{40.0 * unit(random), 24.0 * unit(random),
                            std::pow(10.0, -1.5 + 4.5 * unit(random))};
      const Real ground_truth = oracle_phase(rig, i, j, 1, {eye.x, eye.y, eye.z_mm});
      std::vector<double> row;
      optics::RowPhaseEvaluator(model, eye).evaluate(j, i, i + 1, row);
      for (const double phase : {model.phase(i + 0.5, j + 0.5, 1, eye), row[1]}) {
        tally.check(std::isfinite(phase));
        tally.error(static_cast<double>(std::fabs(Real(phase) - ground_truth)));
      }
    }
  };
  return {.tally = tally_parts(size, size.samples(200, 20'000), look)};
}

StabilityRow through_eye(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.05, 0.1, 0.15});
  scene.materials = {glowing({0.9, 0.5, 0.3}), glowing({0.2, 0.6, 0.8}), glowing({0.5, 0.5, 0.1}),
                     glowing({0.4, 0.8, 0.6})};
  // A beam from behind the panel to behind the eye, a wall through panel and eye, a ball half in
  // front of the panel.
  scene.meshes = {box_mesh({7.3, -9.1, -211.0}, {13.9, -3.7, 633.0}, 0),
                  grid_mesh({-31.7, -37.1, -97.0}, {3.1, 0.7, 801.0}, {9.3, 61.9, 0.0}, 3),
                  grid_mesh({-60.0, 11.0, -150.0}, {120.0, 1.1, 0.0}, {0.0, 3.7, 1100.0}, 5)};
  scene.meshes[1].material = 1;
  scene.meshes[2].material = 2;
  scene.spheres = {{.centre = {21.1, 3.3, 0.9}, .radius = 9.7, .material = 3}};
  optics::Rig rig = small_rig();
  if (size.full) rig = finer(rig, 4);
  return compare_with_oracle(scene, rig, size);
}

// Shoots rays at corners and edges of regular closed meshes, from outside and from inside: none may
// pass through.

constexpr double kRadius = 40.0;
constexpr size_t kRaysPerPart = 4096;

/// A closed ball and the origins of the rays at it.
struct Target {
  explicit Target(uint32_t rings) : scene(description(rings), render_stage(), {}, 0), probe(scene) {
    mesh = ball_mesh({}, kRadius, rings);
    corners = probe.corners(0);
  }
  static render::SceneDescription description(uint32_t rings) {
    render::SceneDescription scene;
    scene.source = "ball";
    scene.materials = {render::Material{}};
    scene.meshes = {ball_mesh({}, kRadius, rings)};
    return scene;
  }
  static render::Stage render_stage() { return plain_stage(); }

  render::Scene scene;
  Probe probe;
  render::TriangleMesh mesh;
  std::vector<Vec3> corners;
};

/// Targets of the rays from a random place inside the ball: consecutive corners, points of edges,
/// or any points.
enum class Aim { Corners, Edges, Anywhere };

Vec3 random_inside(std::mt19937_64& random, double radius) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vec3 p;
  do p = {unit(random), unit(random), unit(random)};
  while (dot(p, p) > 1.0 || dot(p, p) < 1e-6);
  return p * radius;
}

std::vector<ProbeRay> rays_from_inside(const Target& target, Aim aim, uint64_t part) {
  std::mt19937_64 random(part * 7919 + static_cast<uint64_t>(aim));
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const Vec3 from = part % 16 == 0 ? Vec3{} : random_inside(random, 0.9 * kRadius);
  const size_t first = random() % target.mesh.triangles.size();
  std::vector<ProbeRay> rays;
  for (size_t k = 0; k < kRaysPerPart; ++k) {
    const auto& triangle = target.mesh.triangles[(first + k) % target.mesh.triangles.size()];
    const Vec3 a = target.corners[triangle[0]];
    const Vec3 b = target.corners[triangle[1]];
    const double part_of_way = share(random);
    Vec3 at = a;
    if (aim == Aim::Edges) at = a * (1.0 - part_of_way) + b * part_of_way;
    if (aim == Aim::Anywhere) at = random_inside(random, kRadius) * 3.0;
    rays.push_back({from, normalized(at - from)});
  }
  return rays;
}

template <Aim kAim>
StabilityRow count_holes(const StabilitySize& size) {
  const std::array<Target, 3> targets{Target(16), Target(60), Target(250)};
  const uint64_t parts = size.samples(1'500'000, 100'000'000) / kRaysPerPart + 1;
  std::atomic<uint64_t> filled{0};
  const Tally all = tally_parts(size, parts, [&](uint64_t part, Tally& tally) {
    const Target& target = targets[part % targets.size()];
    const std::vector<ProbeRay> rays = rays_from_inside(target, kAim, part);
    std::vector<ProbeHit> hits(rays.size());
    filled += target.probe.trace(rays, HoleGuard::On, hits);
    // A ray from inside that hits no surface has passed through a hole.
    for (const ProbeHit& hit : hits) tally.check(hit.what == ProbeHit::What::Surface);
  });
  return {.tally = all,
          .note = fmt::format("{} rays passed through cracks and were caught", filled.load())};
}

// Tests single convex objects: no surface can lie between the lit side and the light.

constexpr size_t kRaysPerShadowPart = 2048;
constexpr double kSize = 50.0;  // size of the object, mm on the panel

enum class Kind { Triangle, Sphere, Cone, Cylinder };

render::SceneDescription object(Kind kind, Vec3 at) {
  render::SceneDescription scene;
  scene.source = "convex object";
  scene.materials = {render::Material{}};
  const auto along = [&](Vec3 p) { return at + p * kSize; };
  if (kind == Kind::Triangle) {
    // A tetrahedron stays convex, however its corners are rounded.
    scene.meshes.push_back({.name = "tetrahedron",
                            .positions = {along({-0.71, -0.53, 0.62}), along({0.83, -0.47, 0.31}),
                                          along({0.07, 0.91, 0.13}), along({0.11, -0.29, -0.87})},
                            .triangles = {{0, 1, 2}, {1, 3, 2}, {3, 0, 2}, {0, 3, 1}}});
  } else if (kind == Kind::Sphere) {
    scene.spheres.push_back({.centre = at, .radius = 0.7 * kSize});
  } else {
    scene.cones.push_back({.base = along({-0.3, -0.7, 0.1}),
                           .base_radius = 0.5 * kSize,
                           .apex = along({0.2, 0.8, -0.1}),
                           .apex_radius = (kind == Kind::Cylinder ? 0.5 : 0.1) * kSize});
  }
  return scene;
}

Vec3 random_direction(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vec3 v;
  do v = {unit(random), unit(random), unit(random)};
  while (dot(v, v) > 1.0 || dot(v, v) < 1e-4);
  return normalized(v);
}

/// Returns a direction away from the surface, in half of the cases a hundredth of a degree above
/// it.
Vec3 away(Vec3 normal, std::mt19937_64& random) {
  const Vec3 v = random_direction(random);
  if (random() % 2 == 0) return dot(v, normal) > 0.0 ? v : -v;
  return normalized(normalized(cross(normal, v)) + normal * 1.7e-4);
}

/// Shoots rays at the object at `from_centre`, and from every hit on its outer side a ray toward a
/// light.
Tally count(const Probe& probe, Vec3 from_centre, uint64_t part) {
  std::mt19937_64 random(part + 1);
  std::vector<ProbeRay> rays;
  for (size_t k = 0; k < kRaysPerShadowPart; ++k) {
    const Vec3 from = from_centre + random_direction(random) * (3.0 * kSize);
    const Vec3 at = from_centre + random_direction(random) * (0.4 * kSize);
    rays.push_back({from, normalized(at - from)});
  }
  std::vector<ProbeHit> hits(rays.size());
  (void)probe.trace(rays, HoleGuard::On, hits);
  std::vector<Vec3> directions;
  for (ProbeHit& hit : hits) {
    if (!hit.outer_side) hit.what = ProbeHit::What::Nothing;  // the inside of an open cone
    directions.push_back(away(hit.geometric_normal, random));
  }
  std::vector<uint8_t> blocked(hits.size());
  probe.leave(hits, directions, blocked);
  Tally tally;
  for (size_t k = 0; k < hits.size(); ++k)
    if (hits[k].what == ProbeHit::What::Surface) tally.check(blocked[k] == 0);
  return tally;
}

/// Places the object anywhere in the world with the placement centred on it, or off the placement's
/// centre.
enum class Place { InTheWorld, OffTheStage };

Tally count_at(const StabilitySize& size, Kind kind, Place place, double offset, uint64_t rays) {
  const Vec3 at{offset, -0.7 * offset, 0.4 * offset};
  const bool moved = place == Place::InTheWorld;
  const render::Scene scene(object(kind, at), plain_stage(moved ? at : Vec3{}), {}, 1);
  const Probe probe(scene);
  return tally_parts(size, rays / kRaysPerShadowPart + 1, [&](uint64_t part, Tally& tally) {
    tally = count(probe, scene.scene_from_panel.point(moved ? Vec3{} : at), part);
  });
}

template <Kind kKind>
StabilityRow shadows(const StabilitySize& size) {
  StabilityRow row;
  const uint64_t rays = size.samples(400'000, 250'000'000) / 8;
  for (const double offset : {0.0, 1e3, 1e5, 1e6, 1e7})
    row.tally += count_at(size, kKind, Place::InTheWorld, offset, rays);
  for (const double offset : {1e3, 1e4, 1e5})
    row.tally += count_at(size, kKind, Place::OffTheStage, offset, rays);
  return row;
}

StabilityRow shadows_far(const StabilitySize& size) {
  StabilityRow row;
  const uint64_t rays = size.samples(400'000, 40'000'000) / 8;
  for (const double offset : {1e6, 1e7})
    for (const Kind kind : {Kind::Triangle, Kind::Sphere, Kind::Cone, Kind::Cylinder}) {
      const Tally tally = count_at(size, kind, Place::OffTheStage, offset, rays);
      row.note +=
          fmt::format("{}{} of {}", row.note.empty() ? "" : ", ", tally.failures, tally.samples);
      row.tally += tally;
    }
  return row;
}

}  // namespace

std::vector<StabilityCase> hit_cases() {
  const char* rays = "rays";
  const char* shadowed = "false shadows";
  return {
      {"borders", "pitches 2, 3, 6, 7, 15/2, 23/3, 3000 with slants 0, 1/3, 1, -1 on 15360x8640",
       "phases", "wrong lenses or views", borders},
      {"borders-tiles", "the same through the polynomials of tiles", rays, "through the wrong lens",
       borders_tiles},
      {"corners", "rays exactly at corners of closed meshes, from inside", rays, "holes",
       count_holes<Aim::Corners>},
      {"edges", "rays exactly at edges of closed meshes, from inside", rays, "holes",
       count_holes<Aim::Edges>},
      {"inside", "rays anywhere from inside closed meshes: none escapes", rays, "holes",
       count_holes<Aim::Anywhere>},
      {"shadow-triangle",
       "tetrahedron 50 mm, 0 to 10^7 units off in the world, to 10^5 mm off the stage", rays,
       shadowed, shadows<Kind::Triangle>},
      {"shadow-sphere", "the same with a sphere", rays, shadowed, shadows<Kind::Sphere>},
      {"shadow-cone", "the same with the outside of a cone", rays, shadowed, shadows<Kind::Cone>},
      {"shadow-cylinder", "the same with the outside of a cylinder", rays, shadowed,
       shadows<Kind::Cylinder>},
      {"shadow-far", "all four 10^6 and 10^7 mm off the middle of the stage", rays, shadowed,
       shadows_far},
      {"coplanar", "three sheets in one plane: one of them, and the same for 1, 2, 3, 8 threads",
       "subpixels", "holes or changes", coplanar},
      {"grazing",
       "rays at slopes of 0.3 to 0.00003 over a plane of 6 m: hit, with the hit point on the ray",
       rays, "misses", grazing, 0.01, "mm"},
      {"eye-on-glass",
       "eyes from a metre down to a millionth of a millimetre in front of the panel", "phases",
       "not finite", eye_on_panel, 1e-9, "lens"},
      {"through-eye", "a beam, walls and a ball through the panel plane and the plane of the eyes",
       "subpixels", "off by more than one code", through_eye},
  };
}
}  // namespace lenticule::lab
