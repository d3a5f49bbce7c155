// SPDX-License-Identifier: Apache-2.0
// Still pictures in and out. The only door to OpenImageIO: nothing of it shows in this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

/// What every picture from outside is held to before anything is allocated for it.
inline constexpr int kMaxImageSide = 32768;
inline constexpr uint64_t kMaxImagePixels = uint64_t{1} << 28;    ///< 16384 x 16384
inline constexpr uint64_t kMaxTexturePixels = uint64_t{1} << 26;  ///< 8192 x 8192: 1 GiB decoded

/// Linear-light picture, four channels (alpha not multiplied in), rows from the top.
struct FloatImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgba;
};

/// How the picture is to be turned to be seen upright, as EXIF numbers it.
enum class Orientation : uint8_t {
  Upright = 1,
  Mirrored,
  HalfTurn,
  UpsideDown,  ///< first row at the bottom
  Transposed,
  QuarterTurn,  ///< clockwise, to be seen upright
  Transversed,
  ThreeQuarterTurn,
};

/// What a picture's header says.
struct PictureInfo {
  FrameGeometry geometry;  ///< as stored
  Orientation orientation = Orientation::Upright;
  double pixel_aspect = 1.0;  ///< a pixel's width over its height
  friend bool operator==(const PictureInfo&, const PictureInfo&) = default;
};

/// Whether the tags of a picture may change its pixels. Woven frames are never turned: a picture
/// with another orientation than Upright, or with pixels that are not square, is refused.
enum class PictureUse { Woven, Views };

/// Reads PNG, TIFF, EXR, JPEG, PPM, BMP, TGA or HDR as the exact 8-bit code values of a woven
/// frame: no colour conversion whatever the file says about its colours, alpha dropped, grey
/// repeated, 16 bits rounded to the nearest of the 8-bit values (v / 257). A float file (EXR, HDR)
/// is sRGB-encoded to 8 bits. Throws Error(Input) naming file and reason: missing, truncated,
/// beyond the limits above. Every function here is safe from any thread and starts none.
/// Views are turned as their orientation says.
[[nodiscard]] WovenFrame read_woven(const std::filesystem::path& file,
                                    PictureUse use = PictureUse::Woven);
/// As read_woven into a frame of the geometry `expected`, which is allocated unless it has that
/// geometry already. A picture of another size throws Error(Input) before anything is allocated;
/// after a throw the frame's content is unspecified.
void read_woven_into(const std::filesystem::path& file, const FrameGeometry& expected,
                     WovenFrame& frame, PictureUse use = PictureUse::Woven);
void read_woven_into(const std::filesystem::path& file, WovenFrame& frame);
/// What the header says, without decoding. Throws as read_woven() does.
[[nodiscard]] PictureInfo probe_picture(const std::filesystem::path& file,
                                        PictureUse use = PictureUse::Woven);
/// Width and height that read_woven() would give, whatever the picture's other tags say.
[[nodiscard]] FrameGeometry probe_image(const std::filesystem::path& file);

/// The size of a picture once it is turned upright.
[[nodiscard]] FrameGeometry turned_geometry(const FrameGeometry& stored, Orientation orientation);
/// The shape of a pixel after that.
[[nodiscard]] double upright_pixel_aspect(const PictureInfo& info);
/// Turns packed RGB pixels upright. `upright` has as many bytes as `stored` and does not overlap
/// it.
void turn_upright(std::span<const uint8_t> stored, const FrameGeometry& geometry,
                  Orientation orientation, std::span<uint8_t> upright);

/// Writes under a temporary name beside `file` and renames; the format follows the extension
/// (.png, .tif, .tiff, .exr, .ppm). 8-bit files hold the exact code values; EXR holds linear light
/// in half precision, from which read_woven gets every code value back. Throws Error(Failed) naming
/// file and cause (no such folder, no permission, disk full) and leaves no partial file;
/// Error(Usage) for another extension.
void write_woven(const FrameView& frame, const std::filesystem::path& file);
/// Throws the Error(Usage) of write_woven early, before long work.
void check_writable_format(const std::filesystem::path& file);

/// A texture: decoded to linear light (sRGB assumed for integer files, linear for float files).
[[nodiscard]] FloatImage read_texture(const std::filesystem::path& file);
/// The same from bytes in memory, as glTF embeds them; `name` is for messages.
[[nodiscard]] FloatImage read_texture(std::span<const uint8_t> encoded, const std::string& name);

/// "dir/%05d.png" with exactly one %d or %0Nd, in the file's name and not in a folder's. Throws
/// Error(Usage) otherwise.
class FilePattern {
 public:
  explicit FilePattern(std::string pattern);
  [[nodiscard]] std::filesystem::path path(uint64_t number) const;
  /// True if the text holds a % at all, so that plain names can be told apart.
  [[nodiscard]] static bool looks_like_pattern(std::string_view text);
  [[nodiscard]] const std::string& text() const { return pattern_; }
  /// The numbers of the files that exist, ascending.
  [[nodiscard]] std::vector<uint64_t> existing() const;

 private:
  std::string pattern_;
  std::string prefix_;
  std::string suffix_;
  int digits_ = 0;
};

}  // namespace lenticule::frames
