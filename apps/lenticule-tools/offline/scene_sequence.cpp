// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/scene_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>
#include <variant>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "render/loaders/nff.h"

namespace lenticule::tools {

namespace {

/// Copies a picture; without colour management, its code values stay unchanged.
render::Texture texture_of(const scenes::Picture& picture) {
  render::Texture texture{.width = picture.width, .height = picture.height, .name = picture.name};
  texture.rgba.reserve(picture.rgb.size() / 3 * 4);
  for (size_t i = 0; i + 2 < picture.rgb.size(); i += 3)
    texture.rgba.insert(texture.rgba.end(),
                        {picture.rgb[i], picture.rgb[i + 1], picture.rgb[i + 2], 1.0F});
  return texture;
}

render::Material material_of(const scenes::Fill& fill) {
  return {.colour = fill.colour,
          .diffuse = fill.diffuse,
          .specular = fill.specular,
          .shine = fill.shine,
          .transmittance = fill.transmittance,
          .refraction_index = fill.refraction_index};
}

/// ElementAdder adds the elements of a scene to its description.
class ElementAdder {
 public:
  explicit ElementAdder(render::NffScene& scene) : scene_(scene) {}

  void operator()(const scenes::View& view) {
    scene_.view({.name = "view",
                 .from = view.from,
                 .at = view.at,
                 .up = view.up,
                 .vertical_fov_degrees = view.angle_degrees,
                 .hither = view.hither});
  }
  void operator()(const scenes::Background& background) { scene_.background(background.colour); }
  void operator()(const scenes::PointLight& light) { scene_.light(light.position, light.colour); }
  void operator()(const scenes::Fill& fill) { scene_.fill(material_of(fill)); }
  void operator()(const scenes::Sphere& sphere) { scene_.sphere(sphere.centre, sphere.radius); }
  void operator()(const scenes::Cone& cone) {
    scene_.cone(cone.base, cone.base_radius, cone.apex, cone.apex_radius);
  }
  void operator()(const scenes::Polygon& polygon) {
    LENTICULE_CHECK(scene_.polygon(polygon.corners, polygon.normals));
  }

 private:
  render::NffScene& scene_;
};

constexpr std::string_view kBuiltIn = "builtin:";

}  // namespace

render::SceneDescription describe_built_in(const scenes::BuiltInScene& scene,
                                           std::optional<int> size, int frame) {
  scenes::SceneParts parts = scenes::build_scene(scene, size, frame);
  render::NffScene elements(std::string(kBuiltIn) + scene.name);
  for (const scenes::Element& element : parts.elements) std::visit(ElementAdder(elements), element);
  render::SceneDescription description = elements.finish();
  std::map<const scenes::Picture*, size_t> textures;
  for (scenes::PicturedMesh& mesh : parts.pictured) {
    const scenes::Picture& picture = *mesh.picture;
    const auto [place, added] = textures.try_emplace(&picture, description.textures.size());
    if (added)
      description.textures.push_back(std::make_shared<const render::Texture>(texture_of(picture)));
    render::Material& material = description.materials.emplace_back(material_of(mesh.fill));
    material.name = picture.name;
    material.texture = static_cast<int>(place->second);
    description.meshes.push_back({.name = picture.name,
                                  .material = static_cast<int>(description.materials.size() - 1),
                                  .positions = std::move(mesh.positions),
                                  .triangles = std::move(mesh.triangles),
                                  .normals = std::move(mesh.normals),
                                  .uvs = std::move(mesh.uvs)});
  }
  return description;
}

SceneSequence::SceneSequence(const std::string& scene, frames::Rate rate,
                             const render::LoadOptions& options)
    : rate_(rate), load_options_(options) {
  if (scene.starts_with(kBuiltIn)) {
    const std::string rest = scene.substr(kBuiltIn.size());
    const size_t colon = rest.find(':');
    built_in_ = &scenes::find_scene(rest.substr(0, colon));
    if (colon != std::string::npos) {
      const auto size = number_from<uint64_t>(std::string_view(rest).substr(colon + 1));
      if (!size || *size > static_cast<uint64_t>(built_in_->largest_size))
        throw usage_error("{}: not a size from 1 to {}", scene, built_in_->largest_size);
      size_ = static_cast<int>(*size);
    }
    still_ = built_in_->frames == 1;
  } else if (frames::FilePattern::looks_like_pattern(scene)) {
    pattern_.emplace(scene);
    (void)pattern_->existing_or_throw();
  } else {
    file_ = render::load_scene(scene, load_options_);
    still_ = !(file_->duration_seconds > 0.0);
  }
}

void SceneSequence::require(const player::FrameRange& range) const {
  if (!pattern_) return;
  const std::vector<uint64_t> numbers = pattern_->existing();
  for (uint64_t frame = range.begin; frame < range.end; ++frame)
    if (!std::binary_search(numbers.begin(), numbers.end(), frame))
      throw input_error("{}: no such file", pattern_->path(frame).string())
          .remedy(fmt::format("the files there are numbered {} ... {}", numbers.front(),
                              numbers.back()));
}

uint64_t SceneSequence::reference_frame() const {
  return pattern_ ? pattern_->existing().front() : 0;
}

render::SceneDescription SceneSequence::at(uint64_t frame) const {
  if (built_in_) return built_in(frame);
  if (pattern_)
    return render::at_time(render::load_scene(pattern_->path(frame), load_options_), 0.0);
  const double seconds = static_cast<double>(frame) / rate_.hertz();
  return render::at_time(*file_, still_ ? 0.0 : seconds);
}

render::SceneDescription SceneSequence::built_in(uint64_t frame) const {
  const auto period = static_cast<uint64_t>(std::max(1, built_in_->frames));
  const int in_period = static_cast<int>(frame % period);
  render::SceneDescription scene = describe_built_in(*built_in_, size_, in_period);
  render::apply_choices(scene, load_options_.choices);
  return scene;
}

StageSequence::StageSequence(const render::SceneDescription& reference,
                             const render::Canvas& canvas, const render::StageOptions& options,
                             double turned_by_degrees, bool same_content)
    : canvas_(canvas), turned_by_degrees_(turned_by_degrees), options_(options) {
  if (!still()) options_.fit_every_turn = true;
  reference_ = render::make_stage(reference, canvas_, options_);
  options_.depth_scale = reference_.depth_scale;
  const Box bounds = render::scene_bounds(reference);
  ground_ = render::ground_under(bounds);
  if (same_content) bounds_ = bounds;
}

render::Stage StageSequence::at(const render::SceneDescription& scene, double progress) const {
  render::StageOptions options = options_;
  options.turn_degrees += turned_by_degrees_ * progress;
  const bool has_camera = render::placing_camera(scene, options) != nullptr;
  if (!has_camera || still()) options.bounds = bounds_;
  if (!has_camera && !still()) {
    options.centre = reference_.world_from_panel.origin;
    options.mm_per_unit = reference_.mm_per_unit;
  }
  render::Stage stage =
      has_camera || !still() ? render::make_stage(scene, canvas_, options) : reference_;
  // Objects that leave the reference frame's bounds must not be clipped if there is no camera.
  if (!has_camera) stage.near_mm = std::numeric_limits<double>::infinity();
  if (bounds_ && !has_camera && !still()) stage.far_mm = reference_.far_mm;  // at every turn
  stage.ground = ground_;
  return stage;
}
}  // namespace lenticule::tools
