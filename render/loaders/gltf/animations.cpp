// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf/animations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "render/loaders/limits.h"

namespace lenticule::render::gltf {
namespace {

constexpr double kLongestSeconds = 1e7;

enum class Interpolation { Linear, Step, CubicSpline };

Interpolation interpolation_of(const JsonAt& sampler) {
  const std::string name = sampler.text("interpolation", "LINEAR");
  if (name == "LINEAR") return Interpolation::Linear;
  if (name == "STEP") return Interpolation::Step;
  if (name == "CUBICSPLINE") return Interpolation::CubicSpline;
  sampler.at("interpolation").fail("expected LINEAR, STEP or CUBICSPLINE");
}

void assign(Vec3& to, const double* from) {
  to = {from[0], from[1], from[2]};
}
void assign(std::array<double, 4>& to, const double* from) {
  std::copy_n(from, 4, to.begin());
}
void assign(std::vector<double>& to, const double* from) {
  std::copy_n(from, to.size(), to.begin());
}

class AnimationImport {
 public:
  AnimationImport(Document& document, SceneDescription& scene, Notes& notes)
      : document_(document), scene_(scene), notes_(notes) {}

  void add(const JsonAt& channel, const std::vector<JsonAt>& samplers, const Nodes& nodes) {
    const std::vector<JsonAt>& list = document_.list("nodes");
    const JsonAt target = channel.at("target");
    const std::string path = target.at("path").text();
    const auto index = target.find_index("node", list.size(), "nodes");
    const JsonAt& sampler = samplers[channel.at("sampler").index(samplers.size(), "samplers")];
    if (!index) {
      notes_.count("animation channels without a node left out");
      return;
    }
    Node& node = scene_.nodes[static_cast<size_t>(nodes.index(*index))];
    if (path == "weights") {
      if (!node.morph_weights.empty())
        read(sampler, "SCALAR", node.morph_weights, node.morph_weights.size(),
             node.morph_weight_keys);
      return;
    }
    if (list[*index].find("matrix"))
      target.at("node").fail(
          fmt::format("node {} has a matrix; an animated node needs translation, rotation and "
                      "scale instead",
                      *index));
    if (path == "translation")
      read(sampler, "VEC3", node.translation, 1, node.translations);
    else if (path == "rotation")
      read(sampler, "VEC4", node.rotation, 1, node.rotations);
    else if (path == "scale")
      read(sampler, "VEC3", node.scale, 1, node.scales);
    else
      return notes_.count("animation channels of unknown properties left out");
    node.animated = true;
  }

 private:
  std::vector<double> times_of(const JsonAt& sampler) {
    const Accessor input = accessor_of(document_, sampler.at("input"));
    input.require("SCALAR");
    take_keys(input.count(), sampler);
    std::vector<double> times(input.count());
    input.each([&](size_t i, const Element& e) {
      if (!(std::abs(e[0]) <= kLongestSeconds))
        sampler.at("input").fail(fmt::format("key frame {} is not finite or too late", i));
      times[i] = e[0];
    });
    return times;
  }

  void take_keys(size_t count, const JsonAt& sampler) {
    if ((keys_ += count) > kMaxKeys) sampler.fail(fmt::format("more than {} key frames", kMaxKeys));
  }

  /// Reads the keys of one property; `rest` is its value without keys. A value consists of
  /// `elements` elements of the output accessor.
  template <class T>
  void read(const JsonAt& sampler, const char* type, const T& rest, size_t elements,
            Channel<T>& channel) {
    const Interpolation interpolation = interpolation_of(sampler);
    const std::vector<double> times = times_of(sampler);
    // In-tangent, value and out-tangent.
    const size_t values_per_key = interpolation == Interpolation::CubicSpline ? 3 : 1;
    const Accessor output = accessor_of(document_, sampler.at("output"));
    output.require(type, times.size() * values_per_key * elements);
    take_keys(output.count(), sampler);
    const size_t components = output.components();
    std::vector<double> numbers(output.count() * components);
    output.each([&](size_t i, const Element& e) {
      for (size_t k = 0; k < components; ++k) {
        if (!std::isfinite(e[k]))
          sampler.at("output").fail(fmt::format("element {} is not finite", i));
        numbers[i * components + k] = e[k];
      }
    });
    const size_t value_size = elements * components;
    const auto value = [&](size_t number) {
      T value_read = rest;
      assign(value_read, numbers.data() + number * value_size);
      return value_read;
    };
    channel = {};
    channel.steps = interpolation == Interpolation::Step;
    for (size_t i = 0; i < times.size(); ++i) {
      if (!channel.times.empty() && times[i] <= channel.times.back()) {
        notes_.count("key frames out of order dropped");
        continue;
      }
      channel.times.push_back(times[i]);
      scene_.duration_seconds = std::max(scene_.duration_seconds, times[i]);
      if (values_per_key == 1) {
        channel.values.push_back(value(i));
        continue;
      }
      channel.in_tangents.push_back(value(3 * i));
      channel.values.push_back(value(3 * i + 1));
      channel.out_tangents.push_back(value(3 * i + 2));
    }
  }

  Document& document_;
  SceneDescription& scene_;
  Notes& notes_;
  size_t keys_ = 0;
};

}  // namespace

void import_animation(Document& document, const Nodes& nodes, SceneDescription& scene,
                      Notes& notes) {
  const std::vector<JsonAt>& animations = document.list("animations");
  if (animations.empty()) return;
  if (animations.size() > 1)
    scene.notes.push_back(fmt::format("{} animations, the first is played", animations.size()));
  AnimationImport import(document, scene, notes);
  const std::vector<JsonAt> samplers = animations[0].list("samplers");
  for (const JsonAt& channel : animations[0].list("channels")) import.add(channel, samplers, nodes);
  // The nodes of instances come after those of the file.
  for (size_t i = document.list("nodes").size(); i < scene.nodes.size(); ++i)
    scene.nodes[i].morph_weight_keys =
        scene.nodes[static_cast<size_t>(scene.nodes[i].parent)].morph_weight_keys;
}

}  // namespace lenticule::render::gltf
