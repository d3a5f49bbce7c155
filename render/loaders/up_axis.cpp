// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/up_axis.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.h"
#include "render/loaders/animation.h"

namespace lenticule::render {
namespace {

/// Axes by their names, with the rotation that makes each of them point to +y.
struct AxisTurn {
  std::string_view name;
  UpAxis axis;
  Affine turn;
};

constexpr std::array<AxisTurn, 6> kAxes{{
    {"x", UpAxis::X, {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}, {}}},
    {"y", UpAxis::Y, {}},
    {"z", UpAxis::Z, {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}, {}}},
    {"-x", UpAxis::MinusX, {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}, {}}},
    {"-y", UpAxis::MinusY, {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {}}},
    {"-z", UpAxis::MinusZ, {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}, {}}},
}};

}  // namespace

UpAxis up_axis_named(const std::string& name) {
  const auto* const found = std::ranges::find(kAxes, name, &AxisTurn::name);
  if (found == kAxes.end())
    throw Error(ErrorKind::Usage, "--up '" + name + "': not an axis",
                "axes are x, y, z, -x, -y and -z");
  return found->axis;
}

void turn_upright(SceneDescription& scene, UpAxis up) {
  if (up == UpAxis::Y) return;
  transform_scene(scene, std::ranges::find(kAxes, up, &AxisTurn::axis)->turn);
}

}  // namespace lenticule::render
