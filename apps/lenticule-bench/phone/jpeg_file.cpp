// SPDX-License-Identifier: Apache-2.0
#include <turbojpeg.h>

#include <array>
#include <cmath>
#include <memory>

#include "apps/lenticule-bench/phone/phone_photo.h"
#include "base/error.h"
#include "base/file.h"

namespace lenticule::bench {
namespace {

struct Close {
  void operator()(void* handle) const { tjDestroy(handle); }
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

std::string compressed(const Photo& photo, int quality) {
  const std::unique_ptr<void, Close> writer(tjInitCompress());
  unsigned char* made = nullptr;
  unsigned long size = 0;
  const int failed = tjCompress2(writer.get(), photo.codes.data(), photo.width, 0, photo.height,
                                 TJPF_RGB, &made, &size, TJSAMP_420, quality, 0);
  const std::unique_ptr<unsigned char, Close> bytes(made);
  if (failed != 0) throw Error(ErrorKind::Failed, "cannot compress a photograph");
  return {reinterpret_cast<const char*>(bytes.get()), size};
}

/// TiffBlock writes big-endian EXIF entries.
class TiffBlock {
 public:
  void two(unsigned value) {
    bytes_ += static_cast<char>(value >> 8);
    bytes_ += static_cast<char>(value & 255U);
  }
  void four(unsigned value) {
    two(value >> 16);
    two(value & 0xffffU);
  }
  void entry(unsigned tag, unsigned type, unsigned value) {
    two(tag);
    two(type);
    four(1);
    if (type == kShort) {
      two(value);
      two(0);
    } else {
      four(value);
    }
  }
  static constexpr unsigned kShort = 3, kLong = 4;
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Returns an APP1 segment with the orientation and the focal length on 35 mm film (EXIF 2.3).
std::string exif_segment(const Photo& photo) {
  TiffBlock tiff;
  tiff.two(0x4d4d);  // "MM"
  tiff.two(42);
  tiff.four(8);
  tiff.two(2);
  tiff.entry(0x0112, TiffBlock::kShort, static_cast<unsigned>(photo.orientation));
  tiff.entry(0x8769, TiffBlock::kLong, 8 + 2 + 2 * 12 + 4);
  tiff.four(0);
  tiff.two(1);
  tiff.entry(0xa405, TiffBlock::kShort,
             static_cast<unsigned>(std::lround(photo.stated_focal_35mm)));
  tiff.four(0);
  TiffBlock segment;
  segment.two(0xffe1);
  segment.two(static_cast<unsigned>(2 + 6 + tiff.bytes().size()));
  return segment.bytes() + std::string("Exif\0\0", 6) + tiff.bytes();
}

}  // namespace

void write_photo(const Photo& photo, int quality, const std::filesystem::path& file) {
  std::string bytes = compressed(photo, quality);
  bytes.insert(2, exif_segment(photo));  // after the marker that starts the picture
  write_text_file(file, bytes);
}

void round_trip(Photo& photo, int quality) {
  const std::string bytes = compressed(photo, quality);
  const std::unique_ptr<void, Close> reader(tjInitDecompress());
  if (tjDecompress2(reader.get(), reinterpret_cast<const unsigned char*>(bytes.data()),
                    bytes.size(), photo.codes.data(), photo.width, 0, photo.height, TJPF_RGB,
                    0) != 0)
    throw Error(ErrorKind::Failed, "cannot decompress a photograph");
}

}  // namespace lenticule::bench
