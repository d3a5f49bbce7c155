// SPDX-License-Identifier: Apache-2.0
// Textures adds the textures of a scene file to the scene, each once.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "frames/image_io.h"
#include "render/loaders/scene_files.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

enum class TextureWrap { Repeat, Mirror, Clamp };

/// TextureSource says which picture is wanted, and for what.
struct TextureSource {
  std::string name;  ///< identifies the picture within the scene
  TextureWrap wrap_u = TextureWrap::Repeat;
  TextureWrap wrap_v = TextureWrap::Repeat;
  frames::TextureContent content = frames::TextureContent::Colour;
  friend auto operator<=>(const TextureSource&, const TextureSource&) = default;
};

class Textures {
 public:
  using Decode = std::function<frames::TextureImage()>;

  /// List only takes down what add() is asked for, for decode_all().
  enum class Mode { Load, List };

  /// Lifetime: must not outlive the scene.
  explicit Textures(SceneDescription& scene, Mode mode = Mode::Load) : scene_(scene), mode_(mode) {}

  /// Decodes the textures of a list on all cores, so that add() finds them decoded. Leaves those to
  /// add() that are damaged or beyond the limit of memory. Calls the list's functions on any
  /// thread.
  void decode_all(const Textures& list);

  /// Returns the index of the texture. Calls `decode` for one that the scene has not yet; if that
  /// throws an Error, the scene gets a note and the result is -1, since a missing picture should
  /// not prevent displaying the scene.
  int add(const TextureSource& source, const Decode& decode);

 private:
  struct Wanted {
    TextureSource source;
    Decode decode;
  };

  /// Adds a note, once, and not too many: a file may name thousands of pictures that do not exist.
  void note(std::string text);

  SceneDescription& scene_;
  Mode mode_;
  std::vector<Wanted> list_;
  std::map<TextureSource, frames::TextureImage> decoded_;
  std::map<TextureSource, int> known_;
  std::set<std::string> notes_;
  size_t bytes_ = 0;
};

/// Returns the texel that two texels become.
using Mix = std::array<float, 4> (*)(const float* a, const float* b);

/// Combines two pictures texel by texel; the result has the larger width and height, and the
/// nearest texels. Throws Error(Input) for a result beyond the limit of a texture.
[[nodiscard]] frames::TextureImage combined(const frames::FloatImage& a,
                                            const frames::FloatImage& b, Mix mix);
/// Makes one texture of two grey pictures: roughness in green, metalness in blue.
[[nodiscard]] std::array<float, 4> mix_metallic_roughness(const float* rough, const float* metal);

/// A picture of one white texel, for a part that the file does not have.
[[nodiscard]] inline frames::FloatImage white_picture() { return {1, 1, {1, 1, 1, 1}}; }

}  // namespace lenticule::render
