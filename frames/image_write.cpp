// SPDX-License-Identifier: Apache-2.0
// Encoding woven frames with OpenImageIO, in memory: the bytes go to the disk in one place that
// sees every failure of it.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <mutex>

#include "frames/atomic_file.h"
#include "frames/image_format.h"
#include "frames/image_io.h"
#include "frames/oiio_setup.h"
#include "frames/srgb.h"
#include "optics/error.h"

namespace lenticule::frames {
namespace {

/// The frames of a sequence are written more often than they are stored. The neighbours to the left
/// belong to other views; the row above is the same picture shifted by the slant. On a 4K frame
/// this is the fastest combination and the smallest file of the fast ones (docs/frames.md).
constexpr int kPngCompressionLevel = 1;
constexpr int kPngFilterUp = 32;

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

OIIO::ImageSpec output_spec(const FrameGeometry& geometry, ImageFormat format) {
  OIIO::ImageSpec spec(geometry.width, geometry.height, 3,
                       format == ImageFormat::Exr ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::UINT8);
  spec.attribute("png:compressionLevel", kPngCompressionLevel);
  spec.attribute("png:filter", kPngFilterUp);
  spec.attribute("oiio:dither", 0);
  if (format == ImageFormat::Tiff) spec.attribute("compression", "lzw");
  if (format == ImageFormat::Exr) spec.attribute("compression", "zip");
  // Same pixels, same bytes: these formats would note the time of day.
  if (format == ImageFormat::Tiff || format == ImageFormat::Exr)
    spec.attribute("DateTime", "1970:01:01 00:00:00");
  return spec;
}

std::vector<float> light_of(std::span<const uint8_t> codes) {
  const auto& table = linear_of_codes();
  std::vector<float> light(codes.size());
  std::transform(codes.begin(), codes.end(), light.begin(),
                 [&](uint8_t code) { return static_cast<float>(table[code]); });
  return light;
}

bool write_pixels(OIIO::ImageOutput& output, const FrameView& frame, ImageFormat format) {
  if (format != ImageFormat::Exr)
    return output.write_image(OIIO::TypeDesc::UINT8, frame.bytes.data());
  return output.write_image(OIIO::TypeDesc::FLOAT, light_of(frame.bytes).data());
}

std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format, const std::string& name) {
  set_up_oiio();
  std::vector<uint8_t> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  const auto fail = [&](const std::string& cause) {
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot encode: {}", name, cause));
  };
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(plugin_name(format));
  if (!output) fail(fmt::format("this OpenImageIO writes no {}", plugin_name(format)));
  output->threads(1);
  output->set_ioproxy(&memory);
  const bool done = output->open(name, output_spec(frame.geometry, format)) &&
                    write_pixels(*output, frame, format) && output->close();
  if (!done) fail(output->geterror());
  return bytes;
}

}  // namespace

void set_up_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
    OIIO::attribute("limits:imagesize_MB", 8192);
    OIIO::attribute("limits:channels", 64);
  });
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
  write_file_atomically(file, encode(frame, format, file.string()));
}

}  // namespace lenticule::frames
