// SPDX-License-Identifier: Apache-2.0
// Derives from file names how foreign pictures are arranged: the arrangement of a stereo pair in
// one picture, and the place of depth beside colour. Examples: film_hsbs.mkv, cat_rgbd.png.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "frames/frame.h"
#include "frames/quilt.h"

namespace lenticule::frames {

/// StereoLayout describes a left and a right eye's picture in one picture, side by side, or top and
/// bottom.
struct StereoLayout {
  bool beside = true;
  /// Each picture is squeezed to half, so that both together have the aspect of one picture.
  bool half = false;
  bool right_first = false;  ///< the right eye's picture is the left or the upper one
  friend bool operator==(const StereoLayout&, const StereoLayout&) = default;
};

/// Parses any of the words that stereo_of_name() knows. Throws Error(Usage) for other texts.
[[nodiscard]] StereoLayout parse_stereo(const std::string& text);

/// Finds the layout in a file's name: one of the words that cameras, players and users write, after
/// the first word, in any case. docs/content/content.md lists them. Words end at "_", "-", ".", " "
/// and where a capital follows a small letter. "half" or "h" as the word before or after selects
/// the half layout. Names of cross-eyed pairs, with the right eye's picture on the left, end in
/// .jps (JPEG) and .pns (PNG).
[[nodiscard]] std::optional<StereoLayout> stereo_of_name(const std::filesystem::path& file);

/// StereoTiles holds two tiles and the order of their cameras.
struct StereoTiles {
  QuiltLayout layout;
  bool rightmost_first = false;  ///< tile 0 is the bottom tile, which is the right eye's
};
[[nodiscard]] StereoTiles tiles_of(const StereoLayout& stereo, const FrameGeometry& picture);

/// DepthPlace is the side of a picture that contains depth; the rest contains the colours.
enum class DepthPlace { Right, Left, Bottom, Top };

/// DepthPart is the size of the depth beside, or above and below, the colours.
enum class DepthPart {
  Whole,    ///< as large as the colours: half of the picture
  Half,     ///< half as wide as the colours beside it, half as high as those above or below it
  Quarter,  ///< half as wide and half as high, at the top or the left of its side
};
struct DepthLayout {
  DepthPlace place = DepthPlace::Right;
  DepthPart part = DepthPart::Whole;
  friend bool operator==(const DepthLayout&, const DepthLayout&) = default;
};

/// Parses "right", "left", "bottom" or "top", alone or with ":half" or ":quarter". Returns nothing
/// for other texts.
[[nodiscard]] std::optional<DepthLayout> parse_depth_layout(std::string_view text);

/// DepthWindows holds the two parts of a picture with depth.
struct DepthWindows {
  struct Window {
    int left = 0, top = 0;
    TileSize size = {};
  };
  Window colour, depth;
};
/// Returns the windows, in whole pixels from the bottom-left corner on. Throws Error(Input) "name:
/// cause" for a picture with too few pixels.
[[nodiscard]] DepthWindows depth_windows(const FrameGeometry& picture, const DepthLayout& layout,
                                         const std::string& name);

/// Returns true if a file's name contains the word "qs", as quilts have it, or a word that begins
/// with "qs" and a digit.
[[nodiscard]] bool mentions_quilt(const std::filesystem::path& file);

/// Returns true if a file's name contains the word "rgbd": depth in the right half.
[[nodiscard]] bool is_rgbd_name(const std::filesystem::path& file);

// Reads the stereo layout of a JPEG with two eyes' pictures (.jps) from the file's own tag.

/// Returns true for a name that ends in .jps.
[[nodiscard]] bool is_jps_name(const std::filesystem::path& file);

/// Parses the stereoscopic descriptor in the first bytes of the file, if there is one. Throws
/// Error(Input) "name: cause" for unsupported layouts, such as interlaced rows.
[[nodiscard]] std::optional<StereoLayout> parse_jps_tag(std::span<const uint8_t> head,
                                                        const std::string& name);

/// Reads the tag of a file. Throws Error(Input) also for a file that cannot be read.
[[nodiscard]] std::optional<StereoLayout> read_jps_tag(const std::filesystem::path& file);

// Reads the JSON file beside a quilt or a picture with depth, as tools for Looking Glass displays
// and their users write it, in the spellings in use.

inline constexpr size_t kMaxSidecarBytes = size_t{1} << 20;

struct QuiltSidecar {
  /// Both are set, or neither.
  std::optional<int> columns, rows;
  std::optional<int> views;
  std::optional<double> aspect;
  double zoom = 1.0;                 ///< as ViewCrop has it
  std::optional<double> duration_s;  ///< for which a still picture stays in a list
  bool inverted = false;             ///< the first view is the rightmost camera's
  std::optional<DepthPlace> depth;
  bool black_is_near = false;
  double depthiness = 1.0;  ///< factor of the default disparities
};

/// Parses the JSON; docs/content/content.md lists the keys. Returns nothing for JSON without any of
/// these keys, which has another purpose. Throws Error(Input) "source: key: cause" for invalid JSON
/// and for invalid values.
[[nodiscard]] std::optional<QuiltSidecar> parse_quilt_sidecar(std::string_view json,
                                                              const std::string& source);

/// Returns "city.png.json" for "city.png" if that file exists, otherwise "city.json".
[[nodiscard]] std::filesystem::path sidecar_of(const std::filesystem::path& picture);

/// Reads the file beside `picture`; returns nothing if there is none. Throws the errors of
/// parse_quilt_sidecar(), also for a file that cannot be read.
[[nodiscard]] std::optional<QuiltSidecar> read_sidecar_of(const std::filesystem::path& picture);

/// Reads the layout of a quilt from the JSON that older Looking Glass programs write into the EXIF
/// comment of a picture: {"LKGColumns": 8, ...}. Returns nothing if there is none, or no such file.
/// Throws the errors of parse_quilt_sidecar().
[[nodiscard]] std::optional<QuiltSidecar> read_quilt_comment(const std::filesystem::path& picture);

}  // namespace lenticule::frames
