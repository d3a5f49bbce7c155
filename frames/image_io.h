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

/// Reads PNG, TIFF, EXR, JPEG, PPM, BMP, TGA or HDR as the exact 8-bit code values of a woven
/// frame: no colour conversion whatever the file says about its colours, alpha dropped, grey
/// repeated, 16 bits rounded to the nearest of the 8-bit values (v / 257). A float file (EXR, HDR)
/// is sRGB-encoded to 8 bits. Throws Error(Input) naming file and reason: missing, truncated,
/// beyond the limits above. Every function here is safe from any thread and starts none.
[[nodiscard]] WovenFrame read_woven(const std::filesystem::path& file);
/// As read_woven into an existing frame (no allocation of the result). A picture of another size
/// throws Error(Input); after a throw the frame's content is unspecified.
void read_woven_into(const std::filesystem::path& file, WovenFrame& frame);
/// Width and height without decoding.
[[nodiscard]] FrameGeometry probe_image(const std::filesystem::path& file);

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
