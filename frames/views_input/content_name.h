// SPDX-License-Identifier: Apache-2.0
// Derives from file names how foreign pictures are arranged: the arrangement of a stereo pair in
// one picture, and the place of depth beside colour. Examples: film_hsbs.mkv, cat_rgbd.png.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "frames/frame.h"
#include "frames/quilt.h"

namespace lenticule::frames {

/// StereoLayout describes a left and a right eye's picture in one picture. Side by side, the left
/// eye's picture is on the left; top and bottom, the left eye's picture is on top.
struct StereoLayout {
  bool beside = true;
  /// Each picture is squeezed to half, so that both together have the aspect of one picture.
  bool half = false;
  friend bool operator==(const StereoLayout&, const StereoLayout&) = default;
};

/// Parses "sbs", "tb", "hsbs", "htb". Throws Error(Usage) for other texts.
[[nodiscard]] StereoLayout parse_stereo(const std::string& text);

/// Finds one of these four words in a file's name, between "_", "-", "." or the name's ends, in any
/// case. "half" or "h" as the word before or after selects the half layout.
[[nodiscard]] std::optional<StereoLayout> stereo_of_name(const std::filesystem::path& file);

/// StereoTiles holds two tiles and the order of their cameras.
struct StereoTiles {
  QuiltLayout layout;
  bool rightmost_first = false;  ///< tile 0 is the bottom tile, which is the right eye's
};
[[nodiscard]] StereoTiles tiles_of(const StereoLayout& stereo, const FrameGeometry& picture);

/// DepthPlace is the half of a picture that contains depth; the other half contains the colours.
enum class DepthPlace { Right, Left, Bottom, Top };

/// Parses "right", "left", "bottom", "top". Returns nothing for other texts.
[[nodiscard]] std::optional<DepthPlace> parse_depth_place(std::string_view text);

/// Returns true if a file's name contains the word "rgbd": depth in the right half.
[[nodiscard]] bool is_rgbd_name(const std::filesystem::path& file);

}  // namespace lenticule::frames
