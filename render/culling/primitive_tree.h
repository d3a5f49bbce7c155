// SPDX-License-Identifier: Apache-2.0
// A tree of boxes around a scene's primitives, for proofs that bundles of rays meet nothing.
// Embree builds it, but does not show its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "render/accel/rounding_margin.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Immutable, safe from any thread. Boxes are in the scene frame; those of spheres and cones are a
/// margin wider than their shapes, and those of wide triangles; those of others hold their corners.
class PrimitiveTree {
 public:
  /// Embree's numbers.
  struct Leaf {
    uint32_t geometry = 0;
    uint32_t primitive = 0;
  };

  /// Throws Error(Failed) with what Embree said.
  explicit PrimitiveTree(const Scene& scene);
  ~PrimitiveTree();
  PrimitiveTree(const PrimitiveTree&) = delete;
  PrimitiveTree& operator=(const PrimitiveTree&) = delete;

  /// Visits primitives whose boxes, and all those around them, are `wanted(low, high)`, until one
  /// is `found(leaf)`. False if none is. `unsure` is returned if there are too many boxes to be
  /// remembered.
  template <class Wanted, class Found>
  [[nodiscard]] bool search(bool unsure, const Wanted& wanted, const Found& found) const;

 private:
  static constexpr unsigned kMostDepth = 64;
  /// An inner node, or a leaf where it has no children.
  struct Node {
    std::array<const Node*, 2> child{};
    std::array<Vec3f, 2> low{}, high{};
    Leaf leaf;
  };
  struct Builder;
  struct Release {
    void operator()(RTCBVH tree) const noexcept { rtcReleaseBVH(tree); }
  };

  std::unique_ptr<std::remove_pointer_t<RTCBVH>, Release> bvh_;
  const Node* root_ = nullptr;
};

template <class Wanted, class Found>
bool PrimitiveTree::search(bool unsure, const Wanted& wanted, const Found& found) const {
  if (!root_) return false;
  std::array<const Node*, 2 * size_t{kMostDepth}> waiting;
  size_t count = 0;
  waiting[count++] = root_;
  while (count > 0) {
    const Node& node = *waiting[--count];
    if (!node.child[0]) {
      if (found(node.leaf)) return true;
      continue;
    }
    for (size_t i = 0; i < 2; ++i) {
      if (!wanted(node.low[i], node.high[i])) continue;
      if (count == waiting.size()) return unsure;
      waiting[count++] = node.child[i];
    }
  }
  return false;
}

}  // namespace lenticule::render
