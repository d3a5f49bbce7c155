// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/textures.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "render/loaders/limits.h"
#include "render/scene/texture_codes.h"

namespace lenticule::render {
namespace {

std::shared_ptr<Texture> texture_of(frames::TextureImage image, const TextureSource& source) {
  auto texture = std::make_shared<Texture>();
  texture->width = image.width;
  texture->height = image.height;
  texture->rgba = std::move(image.rgba);
  texture->codes = std::move(image.codes);
  texture->repeat_u = source.wrap_u != TextureWrap::Clamp;
  texture->repeat_v = source.wrap_v != TextureWrap::Clamp;
  texture->mirror_u = source.wrap_u == TextureWrap::Mirror;
  texture->mirror_v = source.wrap_v == TextureWrap::Mirror;
  texture->name = source.name;
  keep_codes(*texture, source.content == frames::TextureContent::Colour);
  return texture;
}

}  // namespace

int Textures::add(const TextureSource& source, const Decode& decode) {
  const auto [known, added] = known_.try_emplace(source, -1);
  if (!added) return known->second;
  try {
    frames::TextureImage image = decode();
    bytes_ += image.codes.size() + sizeof(float) * image.rgba.size();
    if (bytes_ > kMaxTextureBytes)
      throw Error(ErrorKind::Input,
                  fmt::format("textures of more than {} MiB in memory", kMaxTextureBytes >> 20));
    known->second = static_cast<int>(scene_.textures.size());
    scene_.textures.push_back(texture_of(std::move(image), source));
  } catch (const Error& error) {
    const std::string note = fmt::format("texture left out: {}", error.what());
    if (std::ranges::find(scene_.notes, note) == scene_.notes.end()) scene_.notes.push_back(note);
  }
  return known->second;
}

}  // namespace lenticule::render
