// SPDX-License-Identifier: Apache-2.0
#include "small_sequences.h"

#include <cmath>
#include <random>

#include "frames/sequence/sequence_writer.h"

namespace lenticule::test {
namespace {

uint8_t subpixel(Content content, int row, size_t s, int number, std::mt19937& random) {
  const auto x = static_cast<double>(s);
  switch (content) {
    case Content::Noise:
      return static_cast<uint8_t>(random());
    case Content::Flat:
      return static_cast<uint8_t>(10 * number + 3);
    case Content::Ramp:
      return static_cast<uint8_t>(static_cast<size_t>(row + 5 * number) + s / 9);
    case Content::Grain:
      return static_cast<uint8_t>(static_cast<size_t>(row) / 3 + s / 32 + random() % 16);
    case Content::Lenses: {
      const double lens = (x + 0.756 * row) / 7.701;
      return static_cast<uint8_t>(255.0 * (lens - std::floor(lens)) + number);
    }
  }
  return 0;
}

}  // namespace

frames::WovenFrame make_frame(frames::FrameGeometry geometry, Content content, int number) {
  std::mt19937 random(static_cast<unsigned>(number) + 1);
  frames::WovenFrame frame(geometry);
  for (int j = 0; j < geometry.height; ++j) {
    for (size_t s = 0; s < geometry.row_bytes(); ++s)
      frame.row(j)[s] = subpixel(content, j, s, number, random);
  }
  return frame;
}

frames::SequenceInfo info_of(frames::FrameGeometry geometry) {
  frames::SequenceInfo info;
  info.geometry = geometry;
  info.rate = frames::make_rate(24000, 1001);
  info.rig_fingerprint = "0123456789abcdef";
  info.rig_toml = "format = 1\n";
  info.software = "test";
  return info;
}

void write_sequence(const std::filesystem::path& file, frames::FrameGeometry geometry,
                    Content content, int count) {
  frames::SequenceWriter writer(file, info_of(geometry), {.threads = 1});
  for (int n = 0; n < count; ++n) writer.append(make_frame(geometry, content, n).view());
  writer.finish();
}

}  // namespace lenticule::test
