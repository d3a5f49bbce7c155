// SPDX-License-Identifier: Apache-2.0
// MipMaps filters a texture over the footprint of a ray.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/scene/scene_description.h"
#include "render/textures/texel_kernel.h"

namespace lenticule::render {

/// The sides of a parallelogram in texture coordinates.
struct TextureFootprint {
  Vec2 across{};
  Vec2 along{};
};

inline void set_lane(texel_kernel::Area& area, size_t lane, Vec2 at,
                     const TextureFootprint& footprint) {
  area.middle[0][lane] = at.x;
  area.middle[1][lane] = at.y;
  area.across[0][lane] = static_cast<float>(footprint.across.x);
  area.across[1][lane] = static_cast<float>(footprint.across.y);
  area.along[0][lane] = static_cast<float>(footprint.along.x);
  area.along[1][lane] = static_cast<float>(footprint.along.y);
}

/// TextureShape is what the place of a look-up depends on.
struct TextureShape {
  int width = 0;
  int height = 0;
  bool repeat_u = false, mirror_u = false, repeat_v = false, mirror_v = false;

  friend bool operator==(const TextureShape&, const TextureShape&) = default;
};

/// TextureLookup holds the texels of a look-up, for all textures of one shape: those of a material
/// mostly have one.
struct TextureLookup {
  TextureShape shape;  ///< shape of the textures; has no width if nothing was looked up
  texel_kernel::Lookup texels;
};

/// MipMaps holds a texture and copies of it in halves, quarters and so on. The levels of an 8-bit
/// texture have 8 bits. Thread safety: immutable.
class MipMaps {
 public:
  using Content = texel_kernel::Content;

  MipMaps(std::shared_ptr<const Texture> texture, Content content);

  using Value = std::array<double, 4>;
  /// Returns the mean over the footprint around (u, v): several trilinear lookups along its longer
  /// axis. Repeats or extends the texture as Texture states. For normal maps the first three
  /// channels are the mean vector, which is the shorter the more the vectors differ. Coordinates
  /// that are not finite, or from 1e15 on, count as 0.
  [[nodiscard]] Value value(Vec2 at, const TextureFootprint& footprint) const;
  /// Do the same for sixteen look-ups, in two steps. The second one must be given a look-up of the
  /// shape of the texture.
  void find(const texel_kernel::Area& area, TextureLookup& lookup) const;
  void values(const TextureLookup& lookup, texel_kernel::Values& out) const;

  [[nodiscard]] const Texture& texture() const { return *texture_; }
  [[nodiscard]] const TextureShape& shape() const { return shape_; }
  [[nodiscard]] Content content() const { return content_; }
  /// Returns the number of owners of the texture.
  [[nodiscard]] long owners() const { return texture_.use_count(); }

 private:
  /// Level holds one of the copies: `codes` or `values`, four channels per texel.
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<uint8_t> codes{};
    std::vector<float> values{};
  };
  /// Returns a texel in the form that can be averaged.
  [[nodiscard]] Value texel(const texel_kernel::Level& from, int x, int y) const;
  [[nodiscard]] Level halved(const texel_kernel::Level& from) const;
  void store(const Value& value, size_t index, Level& to) const;

  std::shared_ptr<const Texture> texture_;
  TextureShape shape_;
  Content content_;
  const texel_kernel::Kernel& kernel_;
  const double* colour_of_code_;  ///< numbers of the 256 codes, for RGB
  std::vector<Level> levels_;
  std::vector<texel_kernel::Level> views_;  ///< the texture and its levels
  texel_kernel::TextureLevels texels_{};
};

}  // namespace lenticule::render
