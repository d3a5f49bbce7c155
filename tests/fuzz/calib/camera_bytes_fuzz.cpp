// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a camera's format and picture: the result is an Error, a damaged picture, or
// light in [0, 1], and codes for a panel.
//   byte 0     index of the pixel format
//   bytes 1-2  width and height
//   byte 3     padding of rows
//   bytes 4-7  colour space, Y'CbCr encoding, quantization, transfer function
//   the rest   the picture
#include <algorithm>
#include <vector>

#include "base/error.h"
#include "calib/cameras/pixel_unpack.h"
#include "frames/capture/code_converter.h"

namespace {

using namespace lenticule::calib;

constexpr size_t kHeaderBytes = 8;

RawFormat format_of(std::span<const uint8_t> header) {
  const std::span<const PixelLayout> layouts = kLayouts;
  const PixelLayout& layout = layouts[header[0] % layouts.size()];
  RawFormat format{.fourcc = layout.fourcc,
                   .width = header[1],
                   .height = header[2],
                   .bytes_per_line = 0,
                   .coding = {header[4], header[5], header[6], header[7]}};
  // 1 in 256 inputs has rows that are too short.
  if (header[3] > 0) format.bytes_per_line = row_bytes(layout, format.width) + header[3] - 1;
  if (header[3] == 255) format.bytes_per_line = 1;
  return format;
}

void check_light(const CameraPicture& picture, const RawFormat& format, int channels) {
  LENTICULE_CHECK(picture.width == format.width && picture.height == format.height);
  LENTICULE_CHECK(picture.channels == channels);
  LENTICULE_CHECK(picture.light.size() ==
                  static_cast<size_t>(format.width * format.height * channels));
  LENTICULE_CHECK(std::all_of(picture.light.begin(), picture.light.end(),
                              [](float light) { return light >= 0.0F && light <= 1.0F; }));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < kHeaderBytes) return 0;
  const RawFormat format = format_of({data, kHeaderBytes});
  try {
    PixelUnpacker unpacker(format, "fuzz");
    // The copy has exactly the picture's size, so that the sanitizer finds a read of one byte more.
    const std::vector<uint8_t> picture_bytes(data + kHeaderBytes, data + size);
    CameraPicture picture;
    if (unpacker.unpack(picture_bytes, picture))
      check_light(picture, format, unpacker.channels());
    else
      LENTICULE_CHECK(unpacker.bytes_needed() == 0 ||
                      picture_bytes.size() < unpacker.bytes_needed());
    // Another fuzz target has the decoder of JPEG.
    if (layout_of(format.fourcc)->packing == Packing::Jpeg) return 0;
    const size_t stride = static_cast<size_t>(format.width) * 3;
    std::vector<uint8_t> codes(stride * static_cast<size_t>(format.height));
    const bool whole = CodeConverter(format, "fuzz")
                           .convert(picture_bytes, {.pixels = codes.data(), .stride = stride}, 1);
    LENTICULE_CHECK(whole == (picture_bytes.size() >= unpacker.bytes_needed()));
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Device);
  }
  return 0;
}
