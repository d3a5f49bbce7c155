// SPDX-License-Identifier: Apache-2.0
#include "frames/image_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error_kinds.h"
#include "base/text.h"
#include "frames/image_io.h"

namespace lenticule::frames {
namespace {

using Bytes = std::span<const uint8_t>;

bool starts_with(Bytes bytes, std::string_view mark) {
  return bytes.size() >= mark.size() &&
         std::equal(mark.begin(), mark.end(), bytes.begin(),
                    [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
}

bool is_pnm(Bytes bytes) {
  return bytes.size() >= 3 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
         (bytes[2] == ' ' || bytes[2] == '\n' || bytes[2] == '\r' || bytes[2] == '\t');
}

/// Returns true for a RIFF file (mark, length, kind) of the kind WEBP.
bool is_webp(Bytes bytes) {
  constexpr size_t kKindAt = 8;
  return bytes.size() >= kKindAt && starts_with(bytes, "RIFF") &&
         starts_with(bytes.subspan(kKindAt), "WEBP");
}

/// Returns true for HEIF and AVIF, and false for films, which begin with other brands.
bool is_heif(Bytes bytes) {
  constexpr size_t kMarkAt = 4, kBrandAt = 8;
  if (bytes.size() < kBrandAt || !starts_with(bytes.subspan(kMarkAt), "ftyp")) return false;
  return std::ranges::any_of(
      std::array{"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "mif2", "msf1", "avif",
                 "avis"},
      [&](const char* brand) { return starts_with(bytes.subspan(kBrandAt), brand); });
}

/// Follows the blocks of a GIF: returns true if its end comes after one picture.
bool is_still_gif(Bytes bytes) {
  constexpr size_t kHeader = 13, kDescriptor = 10;
  if (bytes.size() < kHeader || !starts_with(bytes, "GIF8")) return false;
  const auto table_bytes = [](uint8_t flags) {
    return flags & 0x80 ? size_t{6} << (flags & 7) : 0;
  };
  int pictures = 0;
  size_t at = kHeader + table_bytes(bytes[10]);
  for (; at + kDescriptor < bytes.size() && (bytes[at] == ',' || bytes[at] == '!'); ++at) {
    const bool is_picture = bytes[at] == ',';
    pictures += is_picture ? 1 : 0;
    at += is_picture ? kDescriptor + table_bytes(bytes[at + 9]) + 1 : 2;
    while (at < bytes.size() && bytes[at] != 0) at += size_t{bytes[at]} + 1;
  }
  return pictures == 1 && at < bytes.size() && bytes[at] == ';';
}

uint32_t little_endian_32(Bytes bytes) {
  return bytes[0] | uint32_t{bytes[1]} << 8 | uint32_t{bytes[2]} << 16 | uint32_t{bytes[3]} << 24;
}

bool webp_reaches_end(Bytes bytes) {
  return little_endian_32(bytes.subspan(4)) <= bytes.size() - 8;
}

uint32_t big_endian_32(Bytes bytes) {
  return uint32_t{bytes[0]} << 24 | uint32_t{bytes[1]} << 16 | uint32_t{bytes[2]} << 8 | bytes[3];
}

/// Follows the chunks (length, type, data, check sum) to the end of IEND.
bool png_reaches_end(Bytes bytes) {
  constexpr size_t kSignature = 8;
  constexpr size_t kChunkOverhead = 12;
  size_t at = kSignature;
  while (at <= bytes.size() && bytes.size() - at >= kChunkOverhead) {
    const size_t length = big_endian_32(bytes.subspan(at));
    if (length > bytes.size() - at - kChunkOverhead) return false;
    if (starts_with(bytes.subspan(at + 4), "IEND")) return true;
    at += kChunkOverhead + length;
  }
  return false;
}

/// Follows the marker segments; coded data extends to the next marker that is neither a stuffed
/// zero nor a restart.
bool jpeg_reaches_end(Bytes bytes) {
  constexpr uint8_t kStartOfScan = 0xDA, kEndOfImage = 0xD9, kStartOfImage = 0xD8, kTemporary = 1;
  const auto is_restart = [](uint8_t marker) { return marker >= 0xD0 && marker <= 0xD7; };
  bool coded = false;
  size_t at = 0;
  while (at + 1 < bytes.size()) {
    const uint8_t marker = bytes[at + 1];
    if (bytes[at] != 0xFF || marker == 0xFF || (coded && (marker == 0 || is_restart(marker)))) {
      ++at;  // coded data, or fill before a marker
      continue;
    }
    if (marker == kEndOfImage) return true;
    at += 2;
    coded = false;
    if (marker == kStartOfImage || marker == kTemporary || is_restart(marker)) continue;
    if (at + 1 >= bytes.size()) return false;
    at += std::max<size_t>(2, size_t{bytes[at]} << 8 | bytes[at + 1]);
    coded = marker == kStartOfScan;
  }
  return false;
}

/// Follows the attributes (name, type, length, value) to the empty name that ends the header.
bool exr_header_fits(Bytes bytes) {
  constexpr size_t kMagicAndVersion = 8;
  size_t at = kMagicAndVersion;
  const auto skip_text = [&] {
    while (at < bytes.size() && bytes[at] != 0) ++at;
    ++at;
  };
  while (at < bytes.size() && bytes[at] != 0) {
    skip_text();
    skip_text();
    if (at + 4 > bytes.size()) return false;
    const size_t length = little_endian_32(bytes.subspan(at));
    at += 4;
    if (length > bytes.size() - at) return false;
    at += length;
  }
  return at < bytes.size();
}

struct Name {
  std::string_view extension;
  ImageFormat format;
};
constexpr std::array<Name, 14> kNames = {{{".png", ImageFormat::Png},
                                          {".jpg", ImageFormat::Jpeg},
                                          {".jpeg", ImageFormat::Jpeg},
                                          {".tif", ImageFormat::Tiff},
                                          {".tiff", ImageFormat::Tiff},
                                          {".exr", ImageFormat::Exr},
                                          {".ppm", ImageFormat::Pnm},
                                          {".pgm", ImageFormat::Pnm},
                                          {".pbm", ImageFormat::Pnm},
                                          {".pnm", ImageFormat::Pnm},
                                          {".bmp", ImageFormat::Bmp},
                                          {".tga", ImageFormat::Targa},
                                          {".hdr", ImageFormat::Hdr},
                                          {".pic", ImageFormat::Hdr}}};

}  // namespace

ImageFormat format_of_extension(std::string_view extension) {
  const std::string lower = lower_case(std::string(extension));
  for (const Name& name : kNames)
    if (lower == name.extension) return name.format;
  return ImageFormat::Unknown;
}

ImageFormat detect_format(std::span<const uint8_t> bytes, std::string_view name) {
  using namespace std::string_view_literals;
  if (starts_with(bytes, "\x89PNG\r\n\x1a\n"sv)) return ImageFormat::Png;
  if (starts_with(bytes, "\xFF\xD8\xFF"sv)) return ImageFormat::Jpeg;
  if (starts_with(bytes, "II*\0"sv) || starts_with(bytes, "MM\0*"sv) ||
      starts_with(bytes, "II+\0"sv) || starts_with(bytes, "MM\0+"sv))
    return ImageFormat::Tiff;
  if (starts_with(bytes, "\x76\x2F\x31\x01"sv)) return ImageFormat::Exr;
  if (starts_with(bytes, "#?"sv)) return ImageFormat::Hdr;
  if (starts_with(bytes, "BM"sv)) return ImageFormat::Bmp;
  if (is_pnm(bytes)) return ImageFormat::Pnm;
  if (is_webp(bytes)) return ImageFormat::WebP;
  if (is_heif(bytes)) return ImageFormat::Heif;
  if (is_still_gif(bytes)) return ImageFormat::Gif;
  const size_t dot = name.rfind('.');
  const bool targa =
      dot != std::string_view::npos && format_of_extension(name.substr(dot)) == ImageFormat::Targa;
  return targa ? ImageFormat::Targa : ImageFormat::Unknown;
}

const char* plugin_name(ImageFormat format) {
  // In the order of ImageFormat.
  constexpr const char* kPlugins[] = {"",    "png",   "jpeg", "tiff", "openexr", "pnm",
                                      "bmp", "targa", "hdr",  "webp", "heif",    "gif"};
  return kPlugins[static_cast<size_t>(format)];
}

bool reaches_end_mark(ImageFormat format, std::span<const uint8_t> bytes) {
  if (format == ImageFormat::Png) return png_reaches_end(bytes);
  if (format == ImageFormat::Jpeg) return jpeg_reaches_end(bytes);
  if (format == ImageFormat::WebP) return webp_reaches_end(bytes);
  return true;
}

bool header_fits(ImageFormat format, std::span<const uint8_t> bytes) {
  return format != ImageFormat::Exr || exr_header_fits(bytes);
}

void check_picture_size(const std::string& name, uint64_t width, uint64_t height,
                        uint64_t max_pixels) {
  const auto fail = [&](const std::string& cause) { throw input_error("{}: {}", name, cause); };
  if (width < 1 || height < 1) fail("not a two-dimensional picture with pixels");
  if (width > kMaxImageSide || height > kMaxImageSide)
    fail(fmt::format("{} x {} pixels, the limit is {} per side", width, height, kMaxImageSide));
  if (width * height > max_pixels)
    fail(fmt::format("{} x {} pixels, the limit is {} million", width, height, max_pixels >> 20));
}

double plausible_pixel_aspect(double aspect) {
  constexpr double kMost = 16.0;
  return aspect > 1.0 / kMost && aspect < kMost ? aspect : 1.0;
}

}  // namespace lenticule::frames
