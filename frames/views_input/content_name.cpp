// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/content_name.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
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

namespace {

/// Tags precede the coded picture; a camera's preview may precede the tags.
constexpr size_t kHeadBytes = size_t{1} << 20;
constexpr uint64_t kMostBytes = uint64_t{2} << 30;
constexpr std::string_view kMark = "_JPSJPS_";

/// Returns the payload of the APP3 segment that begins with the mark; empty if there is none.
std::span<const uint8_t> descriptor_of(std::span<const uint8_t> head) {
  constexpr uint8_t kApp3 = 0xE3, kStartOfScan = 0xDA;
  for (size_t at = 2; at + 4 <= head.size() && head[at] == 0xFF;) {
    const uint8_t marker = head[at + 1];
    const size_t length = size_t{head[at + 2]} << 8 | head[at + 3];
    if (marker == kStartOfScan || length < 2 || at + 2 + length > head.size()) return {};
    const std::span<const uint8_t> payload = head.subspan(at + 4, length - 2);
    const bool marked = payload.size() >= kMark.size() &&
                        std::equal(kMark.begin(), kMark.end(), payload.begin(),
                                   [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
    if (marker == kApp3 && marked) return payload.subspan(kMark.size());
    at += 2 + length;
  }
  return {};
}

}  // namespace

bool is_jps_name(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".jps" || extension == ".JPS";
}

JpsTag parse_jps_tag(std::span<const uint8_t> head, const std::string& name) {
  // Two bytes of length, then separation, flags, layout and type.
  constexpr size_t kDescriptorBytes = 6;
  constexpr uint8_t kHalfHeight = 1, kHalfWidth = 2, kLeftFirst = 4;
  constexpr uint8_t kStereoscopic = 1, kBeside = 2, kAbove = 3;
  const std::span<const uint8_t> descriptor = descriptor_of(head);
  if (descriptor.size() < kDescriptorBytes) return {};
  const uint8_t flags = descriptor[3], layout = descriptor[4], type = descriptor[5];
  if (type != kStereoscopic)
    throw Error(ErrorKind::Input, fmt::format("{}: its tag says that it is not stereoscopic", name),
                "use --stereo none to show it unchanged");
  if (layout != kBeside && layout != kAbove)
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: its tag says {}; only side by side and top and bottom are supported", name,
                    layout == 1 ? "interlaced rows" : "an unknown layout"),
        "convert it to side by side");
  const bool beside = layout == kBeside;
  const bool half = (flags & (beside ? kHalfWidth : kHalfHeight)) != 0;
  return {.stereo = {.beside = beside, .half = half}, .right_first = (flags & kLeftFirst) == 0};
}

JpsTag read_jps_tag(const std::filesystem::path& file) {
  const OpenedFile opened = open_regular_file(file, kMostBytes);
  std::vector<uint8_t> head(std::min<uint64_t>(opened.bytes, kHeadBytes));
  const ssize_t n = ::pread(opened.descriptor.get(), head.data(), head.size(), 0);
  head.resize(static_cast<size_t>(std::max<ssize_t>(n, 0)));
  return parse_jps_tag(head, file.string());
}

}  // namespace lenticule::frames
