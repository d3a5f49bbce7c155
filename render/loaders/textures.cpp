// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/textures.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/error_kinds.h"
#include "render/loaders/formats.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

std::shared_ptr<Texture> texture_of(frames::TextureImage image, const TextureSource& source) {
  auto texture = std::make_shared<Texture>();
  texture->width = image.width;
  texture->height = image.height;
  texture->rgba = std::move(image.rgba);
  texture->codes = std::move(image.codes);
  texture->held = image.held;
  texture->repeat_u = source.wrap_u != TextureWrap::Clamp;
  texture->repeat_v = source.wrap_v != TextureWrap::Clamp;
  texture->mirror_u = source.wrap_u == TextureWrap::Mirror;
  texture->mirror_v = source.wrap_v == TextureWrap::Mirror;
  texture->name = source.name;
  keep_codes(*texture, source.content == frames::TextureContent::Colour);
  return texture;
}

size_t bytes_of(const frames::TextureImage& image) {
  return image.codes.size() + sizeof(float) * image.rgba.size();
}

}  // namespace

void Textures::decode_all(const Textures& list) {
  std::mutex mutex;
  size_t bytes = 0;
  tbb::parallel_for(size_t{0}, list.list_.size(), [&](size_t n) {
    const Wanted& wanted = list.list_[n];
    try {
      frames::TextureImage image = wanted.decode();
      const std::lock_guard lock(mutex);
      bytes += bytes_of(image);
      if (bytes <= kMaxTextureBytes) decoded_.emplace(wanted.source, std::move(image));
    } catch (const Error&) {
      // add() decodes it again and notes the error, in the order of the materials.
    }
  });
}

void Textures::note(std::string text) {
  constexpr size_t kMost = 64;
  if (notes_.size() > kMost || notes_.contains(text)) return;
  if (notes_.size() == kMost) text = "further textures left out or reduced";
  scene_.notes.push_back(text);
  notes_.insert(std::move(text));
}

int Textures::add(const TextureSource& source, const Decode& decode) {
  const auto [known, added] = known_.try_emplace(source, -1);
  if (!added) return known->second;
  if (mode_ == Mode::List) {
    list_.push_back({source, decode});
    return known->second = static_cast<int>(list_.size()) - 1;
  }
  try {
    const auto decoded = decoded_.extract(source);
    frames::TextureImage image = decoded ? std::move(decoded.mapped()) : decode();
    bytes_ += bytes_of(image);
    if (bytes_ > kMaxTextureBytes)
      throw input_error("textures of more than {} MiB in memory", kMaxTextureBytes >> 20);
    if (image.reduced > 1)
      note(fmt::format("texture reduced to {} x {} texels, 1/{} of its width and height: {}",
                       image.width, image.height, image.reduced, source.name));
    known->second = static_cast<int>(scene_.textures.size());
    scene_.textures.push_back(texture_of(std::move(image), source));
  } catch (const Error& error) {
    note(fmt::format("texture left out: {}", error.what()));
  }
  return known->second;
}

frames::TextureImage combined(const frames::FloatImage& a, const frames::FloatImage& b, Mix mix) {
  frames::TextureImage both{std::max(a.width, b.width), std::max(a.height, b.height), {}, {}};
  const auto texels = static_cast<uint64_t>(both.width) * static_cast<uint64_t>(both.height);
  if (texels > frames::kMaxTexturePixels)
    throw input_error("two pictures whose common size is {} x {}", both.width, both.height)
        .remedy("scale them to the same size");
  const auto texel = [&](const frames::FloatImage& image, int x, int y) {
    const auto column = static_cast<int64_t>(x) * image.width / both.width;
    const auto row = static_cast<int64_t>(y) * image.height / both.height;
    return &image.rgba[static_cast<size_t>(row * image.width + column) * 4];
  };
  both.rgba.reserve(texels * 4);
  for (int y = 0; y < both.height; ++y)
    for (int x = 0; x < both.width; ++x) {
      const std::array<float, 4> mixed = mix(texel(a, x, y), texel(b, x, y));
      both.rgba.insert(both.rgba.end(), mixed.begin(), mixed.end());
    }
  return both;
}

std::array<float, 4> mix_metallic_roughness(const float* rough, const float* metal) {
  return {1.0F, rough[0], metal[0], 1.0F};
}

}  // namespace lenticule::render
