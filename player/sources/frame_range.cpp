// SPDX-License-Identifier: Apache-2.0
#include "player/sources/frame_range.h"

#include <fmt/format.h>

#include <charconv>

#include "base/error.h"

namespace lenticule::player {
namespace {

constexpr uint64_t kMostFrames = 100'000'000;

}  // namespace

std::optional<uint64_t> whole_number(std::string_view text) {
  uint64_t value = 0;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || rest != text.data() + text.size() || value > kMostFrames)
    return std::nullopt;
  return value;
}

FrameRange parse_frame_range(std::string_view text) {
  const size_t colon = text.find(':');
  const auto begin = whole_number(text.substr(0, colon));
  const auto end = colon == std::string_view::npos ? begin : whole_number(text.substr(colon + 1));
  if (!begin || !end)
    throw Error(ErrorKind::Usage, fmt::format("--frames '{}': not a range of frames", text),
                "for example --frames 0:24, which ends before frame 24");
  const FrameRange range{*begin, colon == std::string_view::npos ? *begin + 1 : *end};
  if (range.end <= range.begin)
    throw Error(ErrorKind::Usage, fmt::format("--frames '{}': has no frame in it", text));
  return range;
}

}  // namespace lenticule::player
