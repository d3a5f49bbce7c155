// SPDX-License-Identifier: Apache-2.0
#include "player/sources/content_flags.h"

#include <fmt/format.h>

#include <string_view>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::player {
namespace {

/// Parses one end of a range: a number, followed by nothing, "%" or "px". Returns false for other
/// text.
bool read_disparity(std::string_view text, double& value, bool& in_pixels) {
  const auto number = take_number<double>(text);
  if (!number) return false;
  in_pixels = text == "px";
  value = in_pixels ? *number : *number / 100.0;
  return in_pixels || text.empty() || text == "%";
}

}  // namespace

bool ContentFlags::any() const {
  return !grid.empty() || views != 0 || aspect || invert || !stereo.empty() || !depth.empty() ||
         !depth_range.empty() || invert_depth || !from_rig.empty() || reweave;
}

frames::WeaveOptions weave_options(const WeavingFlags& flags) {
  frames::WeaveOptions options{.fit = frames::parse_picture_fit(flags.fit)};
  if (!flags.filter.empty()) options.filter = frames::parse_view_filter(flags.filter);
  return options;
}

std::optional<frames::Crosstalk> crosstalk_of(const std::string& text, const optics::Rig& rig,
                                              int views) {
  if (text.empty()) return std::nullopt;
  if (text == "spot") return frames::crosstalk_of_spot(rig.sheet.spot_sigma.value * views);
  const auto percent = number_from<double>(text);
  if (!percent)
    throw Error(ErrorKind::Usage, fmt::format("--crosstalk '{}': not a percentage", text),
                "for example --crosstalk 12, or --crosstalk spot");
  return frames::crosstalk_of_percent(*percent);
}

void read_grid(const std::string& text, frames::QuiltLayout& layout) {
  const auto grid = numbers_from<int, 2>(text, 'x');
  if (!grid)
    throw Error(ErrorKind::Usage, fmt::format("--grid '{}': not columns x rows", text),
                "for example --grid 8x6, or 1x1 for an ordinary picture");
  layout.columns = (*grid)[0];
  layout.rows = (*grid)[1];
}

void read_depth_range(const std::string& text, frames::DepthOptions& options) {
  const size_t colon = text.find(':');
  bool back_px = false, front_px = false;
  const std::string_view all(text);
  if (colon != std::string::npos && read_disparity(all.substr(0, colon), options.back, back_px) &&
      read_disparity(all.substr(colon + 1), options.front, front_px) && back_px == front_px) {
    options.in_pixels = back_px;
    return;
  }
  throw Error(ErrorKind::Usage, fmt::format("--depth-range '{}': not two disparities", text),
              "for example --depth-range -2:2, in percent of the width, or -20px:20px");
}

}  // namespace lenticule::player
