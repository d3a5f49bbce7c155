// SPDX-License-Identifier: Apache-2.0
// PrimitiveTree is a bounding volume hierarchy of a scene's primitives for conservative tests of
// ray bundles. Embree's builder makes it, since Embree does not expose the hierarchy of a committed
// scene.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "render/accel/embree.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// PrimitiveTree holds boxes in the scene frame. Boxes of spheres, cones and wide triangles are a
/// margin larger than their shapes; boxes of other triangles just contain the corners. Thread
/// safety: immutable, usable from any thread.
class PrimitiveTree {
 public:
  /// Embree's geometry and primitive numbers.
  struct Leaf {
    uint32_t geometry = 0;
    uint32_t primitive = 0;
  };

  /// Builds the tree. Throws Error(Failed) with Embree's message.
  explicit PrimitiveTree(const Scene& scene);
  ~PrimitiveTree();
  PrimitiveTree(const PrimitiveTree&) = delete;
  PrimitiveTree& operator=(const PrimitiveTree&) = delete;

  /// Visits the primitives whose box and all boxes around it satisfy `wanted(low, high)`, until
  /// `found(leaf)` is true for one. Returns true if one is found, false if none is, and `unsure` if
  /// the stack of pending boxes overflows.
  template <class Wanted, class Found>
  [[nodiscard]] bool search(bool unsure, const Wanted& wanted, const Found& found) const;

 private:
  static constexpr unsigned kMostDepth = 64;
  /// An inner node, or a leaf if it has no children.
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
