// SPDX-License-Identifier: Apache-2.0
// Imports key frames from assimp.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "base/error.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/limits.h"

namespace lenticule::render {
namespace {

constexpr double kTicksPerSecondUnlessStated = 25.0;
constexpr double kLongestSeconds = 1e7;

Vec3 value_of(const aiVectorKey& key) {
  return vec3(key.mValue);
}
std::array<double, 4> value_of(const aiQuatKey& key) {
  return {key.mValue.x, key.mValue.y, key.mValue.z, key.mValue.w};
}

bool finite(Vec3 v) {
  return is_finite(v);
}
bool finite(const std::array<double, 4>& q) {
  return std::all_of(q.begin(), q.end(), [](double v) { return std::isfinite(v); });
}

class AnimationImport {
 public:
  AnimationImport(const aiAnimation& from, SceneDescription& scene) : scene_(scene) {
    if (std::isfinite(from.mTicksPerSecond) && from.mTicksPerSecond > 0.0)
      ticks_per_second_ = from.mTicksPerSecond;
  }

  void add(const aiNodeAnim& from, Node& node) {
    read(std::span(from.mPositionKeys, from.mNumPositionKeys), node, node.translations);
    read(std::span(from.mRotationKeys, from.mNumRotationKeys), node, node.rotations);
    read(std::span(from.mScalingKeys, from.mNumScalingKeys), node, node.scales);
    node.animated = !node.translations.times.empty() || !node.rotations.times.empty() ||
                    !node.scales.times.empty();
  }

  void finish() {
    if (dropped_keys_ > 0)
      scene_.notes.push_back(fmt::format("{} key frames out of order dropped", dropped_keys_));
  }

 private:
  template <class Key, class T>
  void read(std::span<Key> keys, const Node& node, Channel<T>& channel) {
    if ((keys_ += keys.size()) > kMaxKeys)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: more than {} key frames", scene_.source, kMaxKeys));
    for (const Key& key : keys) {
      const double seconds = key.mTime / ticks_per_second_;
      const T value = value_of(key);
      if (!(std::abs(seconds) <= kLongestSeconds) || !finite(value))
        throw Error(ErrorKind::Input,
                    fmt::format("{}: node '{}' has a key frame that is not finite", scene_.source,
                                node.name));
      if (!channel.times.empty() && seconds <= channel.times.back()) {
        ++dropped_keys_;
        continue;
      }
      channel.times.push_back(seconds);
      channel.values.push_back(value);
      scene_.duration_seconds = std::max(scene_.duration_seconds, seconds);
    }
  }

  SceneDescription& scene_;
  double ticks_per_second_ = kTicksPerSecondUnlessStated;
  size_t keys_ = 0;
  size_t dropped_keys_ = 0;
};

}  // namespace

void import_animation(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  if (from.mNumAnimations == 0) return;
  if (from.mNumAnimations > 1)
    scene.notes.push_back(
        fmt::format("{} animations; only the first is used", from.mNumAnimations));
  const aiAnimation& animation = *from.mAnimations[0];
  AnimationImport import(animation, scene);
  for (const aiNodeAnim* channel : std::span(animation.mChannels, animation.mNumChannels)) {
    const auto node = nodes.find(channel->mNodeName.C_Str());
    if (node != nodes.end()) import.add(*channel, scene.nodes[static_cast<size_t>(node->second)]);
  }
  import.finish();
}

}  // namespace lenticule::render
