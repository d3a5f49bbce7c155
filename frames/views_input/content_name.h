// SPDX-License-Identifier: Apache-2.0
// What is known about other people's pictures without looking into them: how two eyes' pictures
// share one, and where depth lies beside colour. Names tell it: film_hsbs.mkv, cat_rgbd.png.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "frames/frame.h"
#include "frames/quilt.h"

namespace lenticule::frames {

/// A left and a right eye's picture in one. Beside each other the left eye's is on the left; one
/// above the other the left eye's is above.
struct StereoLayout {
  bool beside = true;
  /// Each is squeezed to half, so that both together have the aspect of one.
  bool half = false;
  friend bool operator==(const StereoLayout&, const StereoLayout&) = default;
};

/// "sbs", "tb", "hsbs", "htb"; throws Error(Usage) otherwise.
[[nodiscard]] StereoLayout parse_stereo(const std::string& text);

/// One of these four words in a file's name, between "_", "-", "." or the name's ends, in any
/// case. "half" or "h" as the word before or after means the half one.
[[nodiscard]] std::optional<StereoLayout> stereo_of_name(const std::filesystem::path& file);

/// Two tiles and what they say about the order of cameras.
struct StereoTiles {
  QuiltLayout layout;
  bool rightmost_first = false;  ///< tile 0 is the bottom one: the right eye's
};
[[nodiscard]] StereoTiles tiles_of(const StereoLayout& stereo, const FrameGeometry& picture);

/// The half of a picture that holds depth; the other one holds the colours.
enum class DepthPlace { Right, Left, Bottom, Top };

/// "right", "left", "bottom", "top"; empty for anything else.
[[nodiscard]] std::optional<DepthPlace> parse_depth_place(std::string_view text);

/// True for the word "rgbd" in a file's name: depth in the right half.
[[nodiscard]] bool is_rgbd_name(const std::filesystem::path& file);

}  // namespace lenticule::frames
