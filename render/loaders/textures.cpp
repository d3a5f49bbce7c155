// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/textures.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "render/loaders/limits.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

bool is_there(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::exists(file, error);
}

/// Returns the first entry of a folder, by name, that differs from `name` in the case of letters
/// only.
std::optional<std::filesystem::path> entry_of_any_case(const std::filesystem::path& folder,
                                                       const std::filesystem::path& name) {
  const std::string wanted = lower_case(name.string());
  std::optional<std::filesystem::path> found;
  std::error_code error;
  const std::filesystem::path listed = folder.empty() ? "." : folder;
  for (std::filesystem::directory_iterator entry(listed, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::filesystem::path file = entry->path().filename();
    if (lower_case(file.string()) == wanted && (!found || file < *found)) found = file;
  }
  return found;
}

/// Follows a relative path, one folder after the other.
std::optional<std::filesystem::path> path_of_any_case(const std::filesystem::path& folder,
                                                      const std::filesystem::path& name) {
  std::filesystem::path path = name.is_absolute() ? name.root_path() : folder;
  for (const std::filesystem::path& part : name.relative_path()) {
    if (is_there(path / part)) {
      path /= part;
      continue;
    }
    const auto entry = entry_of_any_case(path, part);
    if (!entry) return std::nullopt;
    path /= *entry;
  }
  return path;
}

}  // namespace

std::string percent_decoded(const std::string& text) {
  const auto digit = [](char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool escape =
        text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0;
    out += escape ? static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2])) : text[i];
    if (escape) i += 2;
  }
  return out;
}

std::filesystem::path named_file(const std::filesystem::path& folder, const std::string& name) {
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const std::filesystem::path plain = folder / slashes;
  if (is_there(plain)) return plain;
  const std::filesystem::path decoded = percent_decoded(slashes);
  if (is_there(folder / decoded)) return folder / decoded;
  if (const auto path = path_of_any_case(folder, slashes)) return *path;
  if (decoded.has_parent_path())
    if (const auto path = path_of_any_case(folder, decoded.filename())) return *path;
  return plain;
}

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
