// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/content_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::frames {
namespace {

constexpr std::array<std::pair<std::string_view, StereoLayout>, 4> kStereoWords{{
    {"sbs", {.beside = true, .half = false}},
    {"tb", {.beside = false, .half = false}},
    {"hsbs", {.beside = true, .half = true}},
    {"htb", {.beside = false, .half = true}},
}};

std::optional<StereoLayout> stereo_word(std::string_view word) {
  for (const auto& [name, layout] : kStereoWords)
    if (word == name) return layout;
  return std::nullopt;
}

/// Returns the words of the name in lower case, without the extension.
std::vector<std::string> words_of(const std::filesystem::path& file) {
  std::vector<std::string> words(1);
  for (const char c : lower_case(file.stem().string())) {
    if (c == '_' || c == '-' || c == '.' || c == ' ')
      words.emplace_back();
    else
      words.back() += c;
  }
  return words;
}

bool means_half(const std::vector<std::string>& words, size_t at) {
  return at < words.size() && (words[at] == "half" || words[at] == "h");
}

}  // namespace

StereoLayout parse_stereo(const std::string& text) {
  if (const auto layout = stereo_word(text)) return *layout;
  throw Error(ErrorKind::Usage, fmt::format("--stereo '{}': unknown", text),
              "use sbs, tb, hsbs (half width), htb (half height) or none");
}

std::optional<StereoLayout> stereo_of_name(const std::filesystem::path& file) {
  const std::vector<std::string> words = words_of(file);
  for (size_t at = 1; at < words.size(); ++at) {
    std::optional<StereoLayout> layout = stereo_word(words[at]);
    if (!layout) continue;
    layout->half = layout->half || means_half(words, at - 1) || means_half(words, at + 1);
    return layout;
  }
  return std::nullopt;
}

StereoTiles tiles_of(const StereoLayout& stereo, const FrameGeometry& picture) {
  StereoTiles tiles;
  tiles.layout =
      stereo.beside ? QuiltLayout{.columns = 2, .rows = 1} : QuiltLayout{.columns = 1, .rows = 2};
  tiles.rightmost_first = !stereo.beside;
  if (stereo.half) tiles.layout.aspect = static_cast<double>(picture.width) / picture.height;
  return tiles;
}

std::optional<DepthPlace> parse_depth_place(std::string_view text) {
  if (text == "right") return DepthPlace::Right;
  if (text == "left") return DepthPlace::Left;
  if (text == "bottom") return DepthPlace::Bottom;
  if (text == "top") return DepthPlace::Top;
  return std::nullopt;
}

bool is_rgbd_name(const std::filesystem::path& file) {
  const std::vector<std::string> words = words_of(file);
  return std::find(words.begin() + 1, words.end(), "rgbd") != words.end();
}

}  // namespace lenticule::frames
