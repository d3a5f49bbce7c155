// SPDX-License-Identifier: Apache-2.0
// Picture files to bytes and back; what the bytes mean is the codec's business.
#include "frames/image_io.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/file.h"
#include "frames/image_format.h"
#include "frames/picture_codec.h"

namespace lenticule::frames {
namespace {

constexpr uint64_t kMaxFileBytes = uint64_t{2} << 30;

ImageFormat writable_format(const std::filesystem::path& file) {
  const ImageFormat format = format_of_extension(file.extension().string());
  switch (format) {
    case ImageFormat::Png:
    case ImageFormat::Tiff:
    case ImageFormat::Exr:
      return format;
    case ImageFormat::Pnm:
      if (file.extension() == ".ppm" || file.extension() == ".PPM") return format;
      break;
    default:
      break;
  }
  throw Error(ErrorKind::Usage, fmt::format("{}: no picture format for this name", file.string()),
              "end the name in .png, .tif, .tiff, .exr or .ppm");
}

}  // namespace

WovenFrame read_woven(const std::filesystem::path& file) {
  const std::vector<uint8_t> bytes = read_whole_file(file, kMaxFileBytes);
  WovenFrame frame;
  picture_codec().decode_codes(bytes, file.string(),
                               [&](const FrameGeometry& geometry) -> WovenFrame& {
                                 frame = WovenFrame(geometry);
                                 return frame;
                               });
  return frame;
}

void read_woven_into(const std::filesystem::path& file, WovenFrame& frame) {
  const std::vector<uint8_t> bytes = read_whole_file(file, kMaxFileBytes);
  picture_codec().decode_codes(
      bytes, file.string(), [&](const FrameGeometry& found) -> WovenFrame& {
        if (found != frame.geometry())
          throw Error(ErrorKind::Input,
                      fmt::format("{}: {} x {} pixels where {} x {} are expected", file.string(),
                                  found.width, found.height, frame.width(), frame.height()));
        return frame;
      });
}

FrameGeometry probe_image(const std::filesystem::path& file) {
  return picture_codec().probe(read_whole_file(file, kMaxFileBytes), file.string());
}

FloatImage read_texture(const std::filesystem::path& file) {
  return picture_codec().decode_light(read_whole_file(file, kMaxFileBytes), file.string());
}

FloatImage read_texture(std::span<const uint8_t> encoded, const std::string& name) {
  return picture_codec().decode_light(encoded, name);
}

void check_writable_format(const std::filesystem::path& file) {
  static_cast<void>(writable_format(file));
}

void write_woven(const FrameView& frame, const std::filesystem::path& file) {
  const ImageFormat format = writable_format(file);
  if (frame.geometry.format != PixelFormat::Rgb8 || frame.geometry.width < 1 ||
      frame.geometry.height < 1)
    throw Error(ErrorKind::Failed,
                fmt::format("{}: only frames of 8-bit RGB are written", file.string()));
  LENTICULE_CHECK(frame.bytes.size() == frame.geometry.frame_bytes());
  write_file_atomically(file, picture_codec().encode(frame, format, file.string()));
}

}  // namespace lenticule::frames
