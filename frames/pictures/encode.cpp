// SPDX-License-Identifier: Apache-2.0
// Encodes woven frames with OpenImageIO, in memory: a single place writes the bytes to the disk and
// detects every failure.
#include "frames/pictures/encode.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <mutex>

#include "base/error.h"
#include "frames/pictures/oiio_setup.h"
#include "frames/srgb.h"

namespace lenticule::frames::pictures {
namespace {

OIIO::ImageSpec output_spec(const FrameGeometry& geometry, ImageFormat format) {
  OIIO::ImageSpec spec(geometry.width, geometry.height, 3,
                       format == ImageFormat::Exr ? OIIO::TypeDesc::HALF : OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:dither", 0);
  if (format == ImageFormat::Tiff) spec.attribute("compression", "lzw");
  if (format == ImageFormat::Exr) spec.attribute("compression", "zip");
  // The same pixels must give the same bytes, but these formats would record the time of day.
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

}  // namespace

std::vector<uint8_t> encode(const FrameView& frame, ImageFormat format, const std::string& name) {
  set_up_oiio();
  std::vector<uint8_t> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  const auto fail = [&](const std::string& cause) {
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot encode: {}", name, cause));
  };
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(plugin_name(format));
  if (!output) fail(fmt::format("this OpenImageIO cannot write {}", plugin_name(format)));
  output->threads(1);
  output->set_ioproxy(&memory);
  const bool done = output->open(name, output_spec(frame.geometry, format)) &&
                    write_pixels(*output, frame, format) && output->close();
  if (!done) fail(output->geterror());
  return bytes;
}

void set_up_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
    OIIO::attribute("limits:imagesize_MB", 8192);
    OIIO::attribute("limits:channels", 64);
  });
}

}  // namespace lenticule::frames::pictures
