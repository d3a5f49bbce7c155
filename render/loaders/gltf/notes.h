// SPDX-License-Identifier: Apache-2.0
// Notes counts what a loader leaves out, and reports each kind of thing in one line.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "render/scene/scene_description.h"

namespace lenticule::render::gltf {

class Notes {
 public:
  /// `items` follows the number in the note: "primitives of points or lines left out".
  void count(const std::string& items, size_t number = 1) {
    if (number == 0) return;
    const auto known = std::ranges::find(counts_, items, &Count::first);
    if (known != counts_.end())
      known->second += number;
    else
      counts_.emplace_back(items, number);
  }

  void write(SceneDescription& scene) const {
    for (const auto& [items, number] : counts_)
      scene.notes.push_back(fmt::format("{} {}", number, items));
  }

 private:
  using Count = std::pair<std::string, size_t>;
  std::vector<Count> counts_;
};

}  // namespace lenticule::render::gltf
