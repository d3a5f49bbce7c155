// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/lost_digits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/scene/stage.h"

namespace lenticule::render {

void LostDigits::add(const TriangleMesh& mesh) {
  if (mesh.positions.empty()) return;
  Bounds bounds;
  for (const Vec3& p : mesh.positions) bounds.extend(p);
  const auto largest = [](Vec3 v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  };
  const double size = largest(bounds.high - bounds.low);
  const double farthest = std::max(largest(bounds.low), largest(bounds.high));
  const double step = farthest * double{std::numeric_limits<float>::epsilon()};
  constexpr double kVisible = 1e-4;  // about half a pixel of a mesh that fills a 4K panel
  if (!(step > kVisible * size) || size == 0.0) return;
  ++meshes_;
  if (step / size <= coarsest_) return;
  coarsest_ = step / size;
  step_ = step;
}

void LostDigits::write(SceneDescription& scene) const {
  if (meshes_ == 0) return;
  scene.notes.push_back(
      fmt::format("{} meshes lie far from the origin: in the file's single precision their "
                  "coordinates have steps of {:.2g} units, {:.2g} % of a mesh; move them to the "
                  "origin before exporting",
                  meshes_, step_, 100.0 * coarsest_));
}

}  // namespace lenticule::render
