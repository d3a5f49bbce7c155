// SPDX-License-Identifier: Apache-2.0
// Reads and writes still pictures. This is the sole wrapper of OpenImageIO, which does not appear
// in this header.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

/// Limits of pictures from outside, checked before memory is allocated for them.
inline constexpr int kMaxImageSide = 32768;
inline constexpr uint64_t kMaxImagePixels = uint64_t{1} << 28;  ///< 16384 x 16384
/// 8192 x 8192: 1 GiB decoded. A larger texture is reduced while it is decoded.
inline constexpr uint64_t kMaxTexturePixels = uint64_t{1} << 26;

/// FloatImage is a linear-light picture with four channels (straight alpha), rows from the top.
struct FloatImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgba;
};

/// TextureImage is a texture as its file stores it, with four channels, rows from the top: `codes`
/// where that has 8 bits (colours sRGB-encoded), floats as in FloatImage otherwise. The other
/// vector is empty.
struct TextureImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgba;
  std::vector<uint8_t> codes;
  int held = -1;    ///< number of the texels in another process, if both vectors are empty
  int reduced = 1;  ///< pixels of the file along each side of a texel, whose mean it is
};

/// TexelPlace says where the texels of a texture may be.
enum class TexelPlace : uint32_t {
  Here,
  Anywhere,  ///< also in another process, which passes them on
};

/// Orientation is the EXIF orientation: the transform that makes the stored picture upright.
enum class Orientation : uint8_t {
  Upright = 1,
  Mirrored,
  HalfTurn,
  UpsideDown,  ///< first row at the bottom
  Transposed,
  QuarterTurn,  ///< rotate clockwise to make it upright
  Transversed,
  ThreeQuarterTurn,
};

/// PictureInfo holds the properties in a picture's header.
struct PictureInfo {
  FrameGeometry geometry;  ///< stored size, before rotation
  Orientation orientation = Orientation::Upright;
  double pixel_aspect = 1.0;  ///< a pixel's width divided by its height
  size_t pixel_bytes = 3;     ///< size of a decoded pixel: see PictureValues
  bool two_eyes = false;      ///< a file for two eyes: the left half is the left eye's picture
  friend bool operator==(const PictureInfo&, const PictureInfo&) = default;
};

/// PictureUse decides whether the tags of a picture may change its pixels. Woven frames are never
/// rotated: a woven picture with an orientation other than Upright, or with pixels that are not
/// square, is refused.
enum class PictureUse { Woven, Views };

/// Reads PNG, TIFF, EXR, JPEG, PPM, BMP, TGA or HDR as the exact 8-bit code values of a woven
/// frame: no colour conversion even if the file has a colour profile, alpha dropped, grey repeated,
/// 16 bits rounded to the nearest of the 8-bit values (v / 257). A float file (EXR, HDR) is
/// sRGB-encoded to 8 bits. Pictures of views are rotated according to their orientation. Throws
/// Error(Input) that names the file and the reason: missing, truncated, beyond the limits above.
///
/// Thread safety: any thread may call every function here; none of them starts threads.
[[nodiscard]] WovenFrame read_woven(const std::filesystem::path& file,
                                    PictureUse use = PictureUse::Woven);
/// Reads like read_woven() into a frame of the geometry `expected`; `frame` is allocated unless it
/// already has that geometry. Throws Error(Input) for a picture of another size before memory is
/// allocated; after a throw the frame's content is unspecified.
void read_woven_into(const std::filesystem::path& file, const FrameGeometry& expected,
                     WovenFrame& frame, PictureUse use = PictureUse::Woven);
void read_woven_into(const std::filesystem::path& file, WovenFrame& frame);
/// Reads the header without decoding the pixels. Throws the errors of read_woven().
[[nodiscard]] PictureInfo probe_picture(const std::filesystem::path& file,
                                        PictureUse use = PictureUse::Woven);
/// Returns the width and height that read_woven() would give, even if other tags of the picture
/// would make read_woven() refuse it.
[[nodiscard]] FrameGeometry probe_image(const std::filesystem::path& file);

/// Returns the size of a picture once it is upright.
[[nodiscard]] FrameGeometry oriented_geometry(const FrameGeometry& stored, Orientation orientation);
/// Returns the pixel aspect of a picture once it is upright.
[[nodiscard]] double upright_pixel_aspect(const PictureInfo& info);
/// Rotates packed RGB pixels upright. `upright` has as many bytes as `stored` and does not overlap
/// it.
void turn_upright(std::span<const uint8_t> stored, const FrameGeometry& geometry,
                  Orientation orientation, std::span<uint8_t> upright);

/// Writes to a temporary name beside `file` and renames; the format follows the extension (.png,
/// .tif, .tiff, .exr, .ppm). 8-bit files hold the exact code values; EXR holds linear light in half
/// precision, from which read_woven() restores every code value. Throws Error(Failed) that names
/// the file and the cause (no such folder, no permission, disk full) and leaves no partial file;
/// throws Error(Usage) for another extension.
void write_woven(const FrameView& frame, const std::filesystem::path& file);
/// Throws the Error(Usage) of write_woven() early, before long work.
void check_writable_format(const std::filesystem::path& file);

/// TextureContent decides how the integers of a texture are decoded: colours from sRGB to linear
/// light, other data (normals, roughness) to fractions of the largest value.
enum class TextureContent { Colour, Data };

/// Reads a texture. Float files hold linear light or data as they are. Each side of one of more
/// than kMaxTexturePixels is divided by a power of two.
[[nodiscard]] TextureImage read_texture(const std::filesystem::path& file,
                                        TextureContent content = TextureContent::Colour,
                                        TexelPlace place = TexelPlace::Here);
/// Reads a texture from bytes in memory, as glTF embeds them; `name` is for messages.
[[nodiscard]] TextureImage read_texture(std::span<const uint8_t> encoded, const std::string& name,
                                        TextureContent content = TextureContent::Colour,
                                        TexelPlace place = TexelPlace::Here);
/// Returns the texture's values: linear light of colours, fractions of data, alpha as it is.
[[nodiscard]] FloatImage floats_of(TextureImage image,
                                   TextureContent content = TextureContent::Colour);

/// FilePattern is a pattern such as "dir/%05d.png" with exactly one %d or %0Nd, in the file's name
/// and not in a folder's. Throws Error(Usage) otherwise.
class FilePattern {
 public:
  explicit FilePattern(std::string pattern);
  [[nodiscard]] std::filesystem::path path(uint64_t number) const;
  /// Returns true if the text contains a %; plain file names do not.
  [[nodiscard]] static bool looks_like_pattern(std::string_view text);
  [[nodiscard]] const std::string& text() const { return pattern_; }
  /// Returns the numbers of the files that exist, ascending.
  [[nodiscard]] std::vector<uint64_t> existing() const;
  /// Returns the same numbers. Throws Error(Input) if no file exists; its remedy names the pattern
  /// of files that have another number of digits.
  [[nodiscard]] std::vector<uint64_t> existing_or_throw() const;

 private:
  struct Named {
    uint64_t number;
    size_t digits;
  };
  /// Returns the files whose names have any number of digits at the pattern's place.
  [[nodiscard]] std::vector<Named> similar() const;

  std::string pattern_;
  std::string prefix_;
  std::string suffix_;
  int digits_ = 0;
};

}  // namespace lenticule::frames
