// SPDX-License-Identifier: Apache-2.0
#include "player/sources/frame_range.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::player {
namespace {

constexpr uint64_t kMostFrames = 100'000'000;

std::optional<uint64_t> frame_number(std::string_view text) {
  const auto number = number_from<uint64_t>(text);
  return number.value_or(kMostFrames + 1) > kMostFrames ? std::nullopt : number;
}

}  // namespace

FrameRange parse_frame_range(std::string_view text) {
  const size_t colon = text.find(':');
  const auto begin = frame_number(text.substr(0, colon));
  const auto end = colon == std::string_view::npos ? begin : frame_number(text.substr(colon + 1));
  if (!begin || !end)
    throw Error(ErrorKind::Usage, fmt::format("--frames '{}': not a range of frames", text),
                "for example --frames 0:24, which ends before frame 24");
  const FrameRange range{*begin, colon == std::string_view::npos ? *begin + 1 : *end};
  if (range.end <= range.begin)
    throw Error(ErrorKind::Usage, fmt::format("--frames '{}': contains no frame", text),
                "for example --frames 0:24, which ends before frame 24");
  return range;
}

}  // namespace lenticule::player
