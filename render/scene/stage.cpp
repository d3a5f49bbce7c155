// SPDX-License-Identifier: Apache-2.0
#include "render/scene/stage.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/interval.h"
#include "render/scene/subject.h"

namespace lenticule::render {

Vec3 any_perpendicular(Vec3 v) {
  const Vec3 size{std::abs(v.x), std::abs(v.y), std::abs(v.z)};
  // The axis along which v is smallest is the farthest from parallel to v.
  Vec3 axis{0, 0, 1};
  if (size.y <= size.x && size.y <= size.z)
    axis = {0, 1, 0};
  else if (size.x <= size.y && size.x <= size.z)
    axis = {1, 0, 0};
  return normalized(cross(v, cross(axis, v)));
}

bool up_is_usable(const Camera& camera) {
  constexpr double kParallel = 1e-6;
  const Vec3 forward = normalized(camera.at - camera.from);
  return length(cross(forward, normalized(camera.up))) > kParallel;
}

// ---- stage

namespace {

/// Factor of the distance to the look-at point: content farther away does not reduce the depth
/// scale.
constexpr double kBackdropDistance = 3.0;
/// Fraction of the distance from the panel to the eye that content must not exceed.
constexpr double kNearestToEye = 0.5;
/// The depth is fitted to the subject if that makes the scene deeper by this factor. Then the
/// setting may come before the panel by this multiple of the depth budget.
constexpr double kClearlyDeeper = 1.5, kSettingInFront = 4.0;

/// Orientation holds the panel's axes in world coordinates: right, up, toward the viewer.
struct Orientation {
  Vec3 right{1, 0, 0};
  Vec3 up{0, 1, 0};
  Vec3 toward{0, 0, 1};
  [[nodiscard]] Vec3 turned(Vec3 world) const {
    return {dot(right, world), dot(up, world), dot(toward, world)};
  }
};

struct Framing {
  Orientation orientation;
  Vec3 centre;
  double mm_per_unit = 1.0;
};

void check(bool good, const char* what) {
  if (!good) throw Error(ErrorKind::Usage, std::string("stage: ") + what);
}

void validate(const StageOptions& o) {
  const auto positive = [](double v) { return std::isfinite(v) && v > 0.0; };
  check(!o.centre || is_finite(*o.centre), "the centre must be finite");
  check(!o.mm_per_unit || positive(*o.mm_per_unit), "the scale must be a positive number");
  check(!o.depth_scale || positive(*o.depth_scale), "the depth scale must be a positive number");
  check(positive(o.depth_budget), "the depth budget must be a positive number");
  check(positive(o.fill) && o.fill <= 1.0, "the fill must lie in 0..1");
  check(std::isfinite(o.turn_degrees), "the turn must be finite");
  check(!o.pitch_degrees || std::abs(*o.pitch_degrees) <= 90.0, "the pitch must lie in -90..90");
}

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

Orientation camera_orientation(const Camera& camera) {
  Orientation o;
  o.toward = normalized(camera.from - camera.at);
  const Vec3 up = up_is_usable(camera) ? camera.up : any_perpendicular(o.toward);
  o.right = normalized(cross(up, o.toward));
  o.up = cross(o.toward, o.right);
  return o;
}

/// Returns the axes for a scene rotated by +degrees about `up`: the axes rotate the opposite way.
Orientation turned_about_up(const Orientation& o, double degrees) {
  const double angle = radians(std::remainder(degrees, 360.0));
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {o.right * c + o.toward * s, o.up, o.toward * c - o.right * s};
}

/// Returns the axes for a viewer who sees the scene from `degrees` higher up.
Orientation pitched(const Orientation& o, double degrees) {
  if (degrees == 0.0) return o;
  const double c = std::cos(radians(degrees));
  const double s = std::sin(radians(degrees));
  return {o.right, o.up * c - o.toward * s, o.toward * c + o.up * s};
}

/// Calls visit(position) once for every vertex that is a corner of a triangle.
template <class Visit>
void for_each_corner(const SceneDescription& scene, Visit visit) {
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    std::vector<uint8_t> visited(mesh.positions.size());
    for (const auto& triangle : mesh.triangles)
      for (const uint32_t corner : triangle)
        if (std::exchange(visited[corner], 1) == 0) visit(mesh.positions[corner]);
  });
}

/// Returns half the size, along each axis, of a disc that is perpendicular to a unit vector.
Vec3 half_of_disc(Vec3 normal, double radius) {
  const auto reach = [&](double along) {
    return radius * std::sqrt(std::max(0.0, 1 - along * along));
  };
  return {reach(normal.x), reach(normal.y), reach(normal.z)};
}

// ---- extent of the content, for scenes that are fitted as a whole

/// Extent computes how far content reaches from the centre of the panel along the panel's axes, in
/// world units: at one turn, or at every turn about the vertical axis through the centre.
class Extent {
 public:
  /// `upright` are the axes without pitch.
  Extent(const Orientation& upright, Vec3 centre, double pitch_degrees, bool every_turn)
      : upright_(upright),
        centre_(centre),
        cos_(std::cos(radians(pitch_degrees))),
        sin_(std::sin(radians(pitch_degrees))),
        every_turn_(every_turn) {}

  void add(const SceneDescription& scene) {
    for_each_corner(scene, [this](Vec3 corner) { add(corner, {}); });
    for (const Sphere& s : scene.spheres) add(s.centre, {s.radius, s.radius, s.radius});
    for (const Cone& c : scene.cones) {
      add_disc(c.base, c.apex - c.base, c.base_radius);
      add_disc(c.apex, c.apex - c.base, c.apex_radius);
    }
  }

  void add(const Box& box) {
    for (const Vec3& corner : box.corners()) add(corner, {});
  }

  [[nodiscard]] double half_width() const { return half_width_; }
  [[nodiscard]] double half_height() const { return half_height_; }
  /// Returns the range toward the viewer.
  [[nodiscard]] Interval depth() const { return depth_; }

 private:
  /// Adds a box of half the size `half`, along the panel's axes, around a point.
  void add(Vec3 world, Vec3 half) {
    const Vec3 p = upright_.turned(world - centre_);
    if (!every_turn_) {
      extend(std::abs(p.x), cos_ * p.y - sin_ * p.z, sin_ * p.y + cos_ * p.z, half);
      return;
    }
    const double radius = std::hypot(p.x, p.z);
    for (const double z : {-radius, radius})
      extend(radius, cos_ * p.y - sin_ * z, sin_ * p.y + cos_ * z, half);
  }

  void add_disc(Vec3 centre, Vec3 axis, double radius) {
    const Vec3 a = upright_.turned(normalized(axis));
    const Vec3 n{a.x, cos_ * a.y - sin_ * a.z, sin_ * a.y + cos_ * a.z};
    add(centre, every_turn_ ? Vec3{radius, radius, radius} : half_of_disc(n, radius));
  }

  void extend(double x, double y, double z, Vec3 half) {
    half_width_ = std::max(half_width_, x + half.x);
    half_height_ = std::max(half_height_, std::abs(y) + half.y);
    depth_.extend(z - half.z);
    depth_.extend(z + half.z);
  }

  Orientation upright_;
  Vec3 centre_;
  double cos_, sin_;
  bool every_turn_;
  double half_width_ = 0.0;
  double half_height_ = 0.0;
  Interval depth_;
};

/// Returns the largest scale at which the content stays within the fraction `fill` of the panel.
double fitting_scale(const Extent& extent, const Canvas& canvas, double fill) {
  double half_width = extent.half_width();
  double half_height = extent.half_height();
  // A scene without width and height (seen end-on) is scaled by its depth.
  if (half_width == 0.0 && half_height == 0.0)
    half_height = std::max(std::abs(extent.depth().low), std::abs(extent.depth().high));
  return fill / 2.0 * std::min(canvas.width_mm / half_width, canvas.height_mm / half_height);
}

double camera_span(const Camera& camera) {
  const double half_angle = camera.vertical_fov_degrees / 2.0 * std::numbers::pi / 180.0;
  return 2.0 * length(camera.at - camera.from) * std::tan(half_angle);
}

/// Placing holds what decides about the placement of one scene.
struct Placing {
  const SceneDescription& scene;
  const Camera* camera;  ///< null without a camera
  const Canvas& canvas;
  const StageOptions& options;
  double pitch_degrees;

  /// Returns true if the scene is seen from its camera's position.
  [[nodiscard]] bool seen_from_camera() const {
    return camera != nullptr && options.turn_degrees == 0.0 && pitch_degrees == 0.0 &&
           !options.fit_every_turn;
  }
  /// Returns true if the whole content is fitted, and not what a camera sees.
  [[nodiscard]] bool fits_content() const { return camera == nullptr || options.fit_every_turn; }
};

Orientation upright_orientation(const Placing& placing) {
  return turned_about_up(placing.camera ? camera_orientation(*placing.camera) : Orientation{},
                         placing.options.turn_degrees);
}

Extent extent_of(const Placing& placing, Vec3 centre) {
  Extent extent(upright_orientation(placing), centre, placing.pitch_degrees,
                placing.options.fit_every_turn);
  placing.options.bounds ? extent.add(*placing.options.bounds) : extent.add(placing.scene);
  return extent;
}

Framing frame_scene(const Placing& placing, const Box& bounds) {
  const auto& [scene, camera, canvas, options, pitch] = placing;
  Framing framing;
  framing.orientation = pitched(upright_orientation(placing), pitch);
  framing.centre = camera ? camera->at : bounds.low + (bounds.high - bounds.low) / 2.0;
  framing.centre = options.centre.value_or(framing.centre);
  if (options.mm_per_unit)
    framing.mm_per_unit = *options.mm_per_unit;
  else if (camera)
    framing.mm_per_unit = std::min(canvas.width_mm, canvas.height_mm) / camera_span(*camera);
  else
    framing.mm_per_unit = fitting_scale(extent_of(placing, framing.centre), canvas, options.fill);
  if (!std::isfinite(framing.mm_per_unit) || framing.mm_per_unit <= 0.0)
    throw Error(ErrorKind::Input, scene.source + ": the scene has no extent");
  return framing;
}

// ---- depth seen by a camera

/// Half-space of the points with dot(normal, p) + offset >= 0.
struct Plane {
  Vec3 normal;
  double offset = 0.0;
  [[nodiscard]] double side(Vec3 p) const { return dot(normal, p) + offset; }
};

/// SeenDepth computes the depth range of the content inside a camera's view frustum, in camera
/// coordinates (the camera looks along -z).
class SeenDepth {
 public:
  SeenDepth(const Camera& camera, const Canvas& canvas) : from_(camera.from) {
    orientation_ = camera_orientation(camera);
    const double distance = length(camera.at - camera.from);
    const double tangent = camera_span(camera) / 2.0 / distance;
    const double shorter = std::min(canvas.width_mm, canvas.height_mm);
    const double tx = tangent * canvas.width_mm / shorter;
    const double ty = tangent * canvas.height_mm / shorter;
    nearest_ = std::min(camera.hither, distance);
    farthest_ = kBackdropDistance * distance;
    planes_ = {Plane{normalized(Vec3{1, 0, -tx})}, Plane{normalized(Vec3{-1, 0, -tx})},
               Plane{normalized(Vec3{0, 1, -ty})}, Plane{normalized(Vec3{0, -1, -ty})},
               Plane{{0, 0, -1}, -nearest_},       Plane{{0, 0, 1}, farthest_}};
  }

  void add_triangle(Vec3 a, Vec3 b, Vec3 c) {
    polygon_ = {seen(a), seen(b), seen(c)};
    for (const Plane& plane : planes_) {
      clip(plane);
      if (polygon_.empty()) return;
    }
    for (const Vec3 p : polygon_) depth_.extend(-p.z);
  }

  /// Adds a ball of radius `radius` whose content extends `half_depth` in depth to each side of the
  /// centre.
  void add_ball(Vec3 centre, double radius, double half_depth) {
    const Vec3 p = seen(centre);
    for (const Plane& plane : planes_)
      if (plane.side(p) < -radius) return;
    depth_.extend(std::clamp(-p.z - half_depth, nearest_, farthest_));
    depth_.extend(std::clamp(-p.z + half_depth, nearest_, farthest_));
  }

  void add_cone(const Cone& cone) {
    const Vec3 axis = cone.apex - cone.base;
    const double along = normalized(orientation_.turned(axis)).z;
    const double across = std::sqrt(std::max(0.0, 1.0 - along * along));
    const double radius = std::max(cone.base_radius, cone.apex_radius);
    const double half_length = length(axis) / 2.0;
    add_ball(cone.base + axis / 2.0, std::hypot(half_length, radius),
             std::abs(along) * half_length + across * radius);
  }

  /// Returns the range of distances along the viewing direction.
  [[nodiscard]] Interval depth() const { return depth_; }

 private:
  [[nodiscard]] Vec3 seen(Vec3 world) const { return orientation_.turned(world - from_); }

  /// Keeps the part of polygon_ on the positive side of the plane.
  void clip(const Plane& plane) {
    clipped_.clear();
    for (size_t i = 0; i < polygon_.size(); ++i) {
      const Vec3 p = polygon_[i];
      const Vec3 q = polygon_[(i + 1) % polygon_.size()];
      const double sp = plane.side(p);
      const double sq = plane.side(q);
      if (sp >= 0.0) clipped_.push_back(p);
      if ((sp >= 0.0) != (sq >= 0.0)) clipped_.push_back(p + (q - p) * (sp / (sp - sq)));
    }
    std::swap(polygon_, clipped_);
  }

  Orientation orientation_;
  Vec3 from_;
  double nearest_ = 0.0;
  double farthest_ = 0.0;
  std::array<Plane, 6> planes_;
  std::vector<Vec3> polygon_;
  std::vector<Vec3> clipped_;
  Interval depth_;
};

Interval depth_seen_by(const Camera& camera, const SceneDescription& scene, const Canvas& canvas) {
  SeenDepth seen(camera, canvas);
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    for (const auto& [a, b, c] : mesh.triangles)
      seen.add_triangle(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
  });
  for (const Sphere& s : scene.spheres) seen.add_ball(s.centre, s.radius, s.radius);
  for (const Cone& c : scene.cones) seen.add_cone(c);
  return seen.depth();
}

// ---- depth

/// Returns the range of panel z of the content, in mm before depth scaling.
Interval depth_of_content(const Placing& placing, const Box& bounds, const Framing& framing) {
  const double scale = framing.mm_per_unit;
  if (placing.fits_content()) {
    const Interval z = extent_of(placing, framing.centre).depth();
    return {z.low * scale, z.high * scale};
  }
  Interval z;
  for (const Vec3 corner : bounds.corners())
    z.extend(framing.orientation.turned(corner - framing.centre).z * scale);
  return z;
}

/// Returns the range of z of the content that must stay inside the depth budget; empty if none is
/// seen.
Interval depth_to_fit(const Placing& placing, const Interval& all, const Framing& framing) {
  if (!placing.seen_from_camera()) return all;
  const Camera& camera = *placing.camera;
  const Interval seen = depth_seen_by(camera, placing.scene, placing.canvas);
  if (seen.empty()) return seen;
  const double eye = framing.orientation.turned(camera.from - framing.centre).z;
  Interval z;
  z.extend((eye - seen.low) * framing.mm_per_unit);
  z.extend((eye - seen.high) * framing.mm_per_unit);
  return z;
}

/// Returns the scale at which content up to this z comes before the panel within the budget.
double fitting_in_front(double z, double budget_mm, double viewing_distance_mm) {
  const double limit = std::min(budget_mm, kNearestToEye * viewing_distance_mm);
  return z > 0.0 ? std::min(1.0, limit / z) : 1.0;
}

double fitting_depth_scale(const Interval& z, double budget_mm, double viewing_distance_mm) {
  const double in_front = fitting_in_front(z.high, budget_mm, viewing_distance_mm);
  return z.low < 0.0 ? std::min(in_front, budget_mm / -z.low) : in_front;
}

/// Returns the range of z of the subject; empty if nothing stands out from a setting.
Interval depth_of_subject(const Placing& placing, const Box& bounds, const Framing& framing) {
  const auto& [scene, camera, canvas, options, pitch] = placing;
  const auto& [right, up, toward] = framing.orientation;
  constexpr double kFarAway = 100.0;
  PictureView view{.eye = framing.centre + toward * (kFarAway * length(bounds.high - bounds.low)),
                   .centre = framing.centre,
                   .right = right * (canvas.width_mm / 2.0 / framing.mm_per_unit),
                   .up = up * (canvas.height_mm / 2.0 / framing.mm_per_unit)};
  if (options.fit_every_turn) view.turns_about = upright_orientation(placing).up;
  if (placing.seen_from_camera()) {
    view.eye = camera->from;
    view.centre = camera->at;
    view.nearest = camera->hither;
  }
  const auto subject = subject_of(scene, view);
  if (!subject || scene_bounds(*subject).empty()) return {};
  const Placing alone{*subject, camera, canvas, options, pitch};
  return depth_to_fit(alone, depth_of_content(alone, scene_bounds(*subject), framing), framing);
}

/// Fits the depth to the budget: sets the depth scale, and subject_mm if it is that of the subject.
/// `all` is the range of z of all content.
void fit_depth(const Placing& placing, const Box& bounds, const Framing& framing,
               const Interval& all, Stage& stage) {
  const double budget = placing.options.depth_budget * placing.canvas.depth_of_field_mm;
  const double distance = placing.canvas.viewing_distance_mm;
  Interval shown = depth_to_fit(placing, all, framing);
  if (shown.empty()) shown = all;
  stage.depth_scale = fitting_depth_scale(shown, budget, distance);
  if (stage.depth_scale == 1.0 || placing.options.whole_depth) return;
  const Interval subject = depth_of_subject(placing, bounds, framing);
  if (subject.empty()) return;
  const double scale = std::min(fitting_depth_scale(subject, budget, distance),
                                fitting_in_front(shown.high, kSettingInFront * budget, distance));
  if (scale < kClearlyDeeper * stage.depth_scale) return;
  stage.depth_scale = scale;
  stage.subject_mm = {subject.low * scale, subject.high * scale};
}

/// Returns the z of the plane where the camera starts to see, in mm before depth scaling. The
/// camera stays where it is if the scene turns in front of it.
double camera_plane(const Camera* camera, const Framing& framing) {
  if (camera == nullptr) return std::numeric_limits<double>::infinity();
  const double hither = std::min(camera->hither, length(camera->at - camera->from));
  return (camera_orientation(*camera).turned(camera->from - framing.centre).z - hither) *
         framing.mm_per_unit;
}

Affine panel_from_world(const Framing& framing, double depth_scale) {
  const auto [right, up, toward] = framing.orientation;
  const double s = framing.mm_per_unit;
  const double d = s * depth_scale;
  Affine map{{right.x * s, up.x * s, toward.x * d},
             {right.y * s, up.y * s, toward.y * d},
             {right.z * s, up.z * s, toward.z * d},
             {}};
  map.origin = -map.vector(framing.centre);
  return map;
}

/// Returns the inverse map, built directly rather than by inversion, so that it is exact for any
/// scale.
Affine world_from_panel(const Framing& framing, double depth_scale) {
  const double s = framing.mm_per_unit;
  return {framing.orientation.right / s, framing.orientation.up / s,
          framing.orientation.toward / (s * depth_scale), framing.centre};
}

void extend_disc(Box& bounds, Vec3 centre, Vec3 axis, double radius) {
  const Vec3 half = half_of_disc(normalized(axis), radius);
  bounds.extend(centre - half);
  bounds.extend(centre + half);
}

}  // namespace

Canvas canvas_of(const optics::OpticalModel& model) {
  const optics::Panel& panel = model.rig().panel;
  return {.width_mm = panel.width_px * panel.pixel_width.value,
          .height_mm = panel.height_px * panel.pixel_height.value,
          .depth_of_field_mm = model.depth_of_field_mm(),
          .viewing_distance_mm = model.rig().viewing.distance.value};
}

Affine world_from_canvas(const Stage& stage) {
  return stage.world_from_panel * stage.canvas_from_panel.inverse();
}

Vec3 world_direction(const Stage& stage, Vec3 canvas_direction) {
  const Affine map = world_from_canvas(stage);
  return normalized(normalized(map.column_x) * canvas_direction.x +
                    normalized(map.column_y) * canvas_direction.y +
                    normalized(map.column_z) * canvas_direction.z);
}

Stage stage_of_panel(const Stage& canvas, const Affine& canvas_from_panel,
                     const std::string& panel) {
  Stage stage = canvas;
  const bool parallel = canvas_from_panel.column_z == Vec3{0, 0, 1};
  if (!parallel && canvas.cuts_in_front)
    throw Error(ErrorKind::Input,
                panel + ": the panel is turned, and the scene has content behind its camera",
                "--fit ignores the camera; or remove that content from the scene");
  stage.canvas_from_panel = canvas_from_panel;
  stage.world_from_panel = canvas.world_from_panel * canvas_from_panel;
  stage.panel_from_world = canvas_from_panel.inverse() * canvas.panel_from_world;
  stage.near_mm = parallel ? canvas.near_mm - canvas_from_panel.origin.z
                           : std::numeric_limits<double>::infinity();
  stage.far_mm -= canvas_from_panel.origin.z;
  return stage;
}

Box scene_bounds(const SceneDescription& scene) {
  if (!scene.nodes.empty()) return scene_bounds(at_time(scene, 0.0));
  Box bounds;
  for_each_corner(scene, [&](Vec3 corner) { bounds.extend(corner); });
  for (const Sphere& s : scene.spheres) {
    const Vec3 half{s.radius, s.radius, s.radius};
    bounds.extend(Box{s.centre - half, s.centre + half});
  }
  for (const Cone& c : scene.cones) {
    extend_disc(bounds, c.base, c.apex - c.base, c.base_radius);
    extend_disc(bounds, c.apex, c.apex - c.base, c.apex_radius);
  }
  return bounds;
}

Ground ground_under(const Box& bounds) {
  const Vec3 size = bounds.high - bounds.low;
  const double longer = std::max(size.x, size.z);
  return {.y = bounds.low.y,
          .size = std::clamp(std::cbrt(size.x * size.y * size.z), 0.25 * longer, 2.0 * longer)};
}

Stage make_stage(const SceneDescription& scene, const Canvas& canvas, const StageOptions& options) {
  validate(options);
  if (!scene.nodes.empty()) return make_stage(at_time(scene, 0.0), canvas, options);
  const Box bounds = options.bounds ? *options.bounds : scene_bounds(scene);
  if (bounds.empty()) refuse_empty(scene);
  const Camera* camera = placing_camera(scene, options);
  const Placing placing{.scene = scene,
                        .camera = camera,
                        .canvas = canvas,
                        .options = options,
                        .pitch_degrees = options.pitch_degrees.value_or(
                            camera != nullptr ? 0.0 : kPitchWithoutCamera)};
  const Framing framing = frame_scene(placing, bounds);
  const Interval all = depth_of_content(placing, bounds, framing);

  Stage stage;
  stage.mm_per_unit = framing.mm_per_unit;
  stage.depth_of_field_mm = canvas.depth_of_field_mm;
  if (options.depth_scale)
    stage.depth_scale = *options.depth_scale;
  else
    fit_depth(placing, bounds, framing, all, stage);
  const double cut = camera_plane(camera, framing);
  stage.near_mm = std::min(all.high, cut) * stage.depth_scale;
  stage.cuts_in_front = cut < all.high;
  stage.far_mm = all.low * stage.depth_scale;
  stage.panel_from_world = panel_from_world(framing, stage.depth_scale);
  stage.world_from_panel = world_from_panel(framing, stage.depth_scale);
  if (!(stage.panel_from_world.determinant() > 0.0) || !is_finite(stage.panel_from_world.origin))
    throw Error(ErrorKind::Input, scene.source + ": the scene's scale is out of range");
  return stage;
}

// ---- nothing seen

namespace {

/// RayVolume contains all rays of a panel: at depth z they lie within half_width + tan_x |z| and
/// half_height + tan_y |z| of its centre.
class RayVolume {
 public:
  RayVolume(const optics::OpticalModel& model, double near_mm) : near_mm_(near_mm) {
    const optics::Rig& rig = model.rig();
    // The shift between pixel and lens is a fraction of the gap, far less than this.
    constexpr double kWider = 1.05;
    half_width_ = kWider * rig.panel.width_px * rig.panel.pixel_width.value / 2.0;
    half_height_ = kWider * rig.panel.height_px * rig.panel.pixel_height.value / 2.0;
    // Tangents in the sheet are at most those of a lens half a lobe off the eye. In the air they
    // are larger: up to 1.5 times up to 40 degrees. Steeper rays are not bounded.
    const double eye = 1.0 / rig.viewing.distance.value;  // 0 for parallel zones
    const double in_sheet = (half_width_ + std::abs(rig.viewing.centre.value)) * eye +
                            model.pitch_mm() / (2.0 * rig.sheet.gap.value);
    tan_x_ = in_sheet < kSteepInSheet ? kInAir * in_sheet : HUGE_VAL;
    tan_y_ = kInAir * (half_height_ + std::abs(rig.viewing.height.value)) * eye;
    eye_ = {rig.viewing.centre.value * eye, rig.viewing.height.value * eye, 1.0};
    per_distance_ = eye;
  }

  /// Returns false if no ray passes through the box (panel coordinates).
  [[nodiscard]] bool meets(const Box& box) const {
    const auto& [low, high] = box;
    if (low.z > near_mm_) return false;
    const double depth = std::max(std::abs(low.z), std::abs(std::min(high.z, near_mm_)));
    const double half_width = half_width_ + tan_x_ * depth;
    const double half_height = half_height_ + tan_y_ * depth;
    return low.x <= half_width && high.x >= -half_width && low.y <= half_height &&
           high.y >= -half_height;
  }

  /// Returns false if a surface at a point clearly faces away from the viewer. At less than six
  /// degrees, an eye in another place may see the front.
  [[nodiscard]] bool faces(Vec3 point, Vec3 normal) const {
    return dot(normal, normalized(eye_ - point * per_distance_)) > -0.1;
  }

 private:
  static constexpr double kSteepInSheet = 0.6;
  static constexpr double kInAir = 1.5;

  double near_mm_;
  double half_width_, half_height_;
  double tan_x_, tan_y_;
  double per_distance_;  ///< 0 for an infinite viewing distance
  Vec3 eye_;             ///< the viewer's place times per_distance_
};

}  // namespace

void refuse_empty(const SceneDescription& scene) {
  const std::string reasons =
      scene.notes.empty() ? "it has no surface" : fmt::format("{}", fmt::join(scene.notes, "; "));
  throw Error(ErrorKind::Input,
              fmt::format("{}: nothing to see in this scene: {}", scene.source, reasons),
              "surfaces are shown: triangles, polygons, spheres and cones that have an area");
}

InView content_in_view(const SceneDescription& scene, const Stage& stage,
                       const optics::OpticalModel& model) {
  const RayVolume rays(model, stage.near_mm);
  const Affine& map = stage.panel_from_world;
  const auto ball = [&](Box& box, Vec3 centre, double radius) {
    const double r = radius * stage.mm_per_unit;
    const Vec3 half{r, r, r * stage.depth_scale};
    box.extend(Box{map.point(centre) - half, map.point(centre) + half});
  };
  for (const Sphere& sphere : scene.spheres) {
    Box box;
    ball(box, sphere.centre, sphere.radius);
    if (rays.meets(box)) return InView::Content;
  }
  for (const Cone& cone : scene.cones) {
    Box box;
    ball(box, cone.base, cone.base_radius);
    ball(box, cone.apex, cone.apex_radius);
    if (rays.meets(box)) return InView::Content;
  }
  InView found = InView::Nothing;
  for_each_mesh(scene, [&](const TriangleMesh& mesh) {
    if (found == InView::Content) return;
    const auto material = static_cast<size_t>(mesh.material);
    const bool single_sided = material < scene.materials.size() && scene.materials[material].pbr &&
                              !scene.materials[material].pbr->double_sided;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3 corner[] = {map.point(mesh.positions[a]), map.point(mesh.positions[b]),
                             map.point(mesh.positions[c])};
      Box box;
      for (const Vec3 p : corner) box.extend(p);
      if (!rays.meets(box)) continue;
      const Vec3 normal = normalized(cross(corner[1] - corner[0], corner[2] - corner[0]));
      found = InView::BackFaces;
      if (single_sided && !rays.faces(corner[0], normal)) continue;
      found = InView::Content;
      return;
    }
  });
  return found;
}

void show_both_sides(SceneDescription& scene) {
  for (Material& material : scene.materials)
    if (material.pbr) {
      auto pbr = std::make_shared<PbrMaterial>(*material.pbr);
      pbr->double_sided = true;
      material.pbr = std::move(pbr);
    }
}

}  // namespace lenticule::render
