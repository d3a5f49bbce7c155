// SPDX-License-Identifier: Apache-2.0
// Compresses and decompresses with libjpeg-turbo.
#include "calib/simulation/jpeg_round_trip.h"

#include <turbojpeg.h>

#include <memory>

namespace lenticule::calib {
namespace {

struct CloseJpeg {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using JpegHandle = std::unique_ptr<void, CloseJpeg>;

struct FreeJpeg {
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

}  // namespace

bool jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels,
                     int quality) {
  const int format = channels == 1 ? TJPF_GRAY : TJPF_RGB;
  const int chroma = channels == 1 ? TJSAMP_GRAY : TJSAMP_420;
  const JpegHandle writer(tjInitCompress());
  const JpegHandle reader(tjInitDecompress());
  if (!writer || !reader) return false;
  unsigned char* made = nullptr;
  unsigned long size = 0;
  const int written = tjCompress2(writer.get(), codes.data(), width, 0, height, format, &made,
                                  &size, chroma, quality, 0);
  const std::unique_ptr<unsigned char, FreeJpeg> bytes(made);
  if (written != 0) return false;
  return tjDecompress2(reader.get(), bytes.get(), size, codes.data(), width, 0, height, format,
                       0) == 0;
}

}  // namespace lenticule::calib
