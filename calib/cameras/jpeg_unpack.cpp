// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/jpeg_unpack.h"

#include <turbojpeg.h>

#include <string_view>

#include "base/error.h"

namespace lenticule::calib {
namespace {

/// Returns true for a harmless warning. The library keeps its first warning; if that warning is
/// about bytes before the end marker, the picture was complete.
bool harmless(tjhandle handle) {
  if (tjGetErrorCode(handle) != TJERR_WARNING) return false;
  return std::string_view(tjGetErrorStr2(handle)).ends_with("extraneous bytes before marker 0xd9");
}

}  // namespace

void JpegDecoder::Close::operator()(void* handle) const noexcept {
  tjDestroy(handle);
}

JpegDecoder::JpegDecoder() : handle_(tjInitDecompress()) {
  if (!handle_) throw Error(ErrorKind::Failed, "jpeg decoder: out of memory");
}

bool JpegDecoder::header_fits(std::span<const uint8_t> bytes, int width, int height) {
  int coded_width = 0;
  int coded_height = 0;
  int subsampling = 0;
  int colorspace = 0;
  const int failed = tjDecompressHeader3(handle_.get(), bytes.data(), bytes.size(), &coded_width,
                                         &coded_height, &subsampling, &colorspace);
  return failed == 0 && coded_width == width && coded_height == height &&
         (colorspace == TJCS_YCbCr || colorspace == TJCS_GRAY || colorspace == TJCS_RGB);
}

std::span<const uint8_t> JpegDecoder::decode(std::span<const uint8_t> bytes, int width,
                                             int height) {
  if (bytes.empty() || !header_fits(bytes, width, height)) return {};
  rgb_.resize(static_cast<size_t>(width) * static_cast<size_t>(height) * 3);
  const int failed = tjDecompress2(handle_.get(), bytes.data(), bytes.size(), rgb_.data(), width, 0,
                                   height, TJPF_RGB, TJFLAG_LIMITSCANS | TJFLAG_ACCURATEDCT);
  if (failed != 0 && !harmless(handle_.get())) return {};
  return rgb_;
}

}  // namespace lenticule::calib
