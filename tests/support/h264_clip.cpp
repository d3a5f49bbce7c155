// SPDX-License-Identifier: Apache-2.0
#include "tests/support/h264_clip.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <fstream>
#include <span>
#include <utility>

namespace lenticule::test {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr int kBlock = 16;  ///< side of a macroblock
constexpr unsigned kBaseline = 66;
constexpr unsigned kLevel = 40;
constexpr unsigned kPcmInIntra = 25;  ///< mb_type I_PCM
constexpr unsigned kPredicted = 5;    ///< slice_type
constexpr unsigned kIntraOnly = 7;    ///< slice_type
constexpr uint8_t kSequenceUnit = 0x67;
constexpr uint8_t kPictureUnit = 0x68;
constexpr uint8_t kKeyUnit = 0x65;
constexpr uint8_t kCopyUnit = 0x41;
constexpr unsigned kFrameNumbers = 16;

/// Writes the bits of a NAL unit (section 7.2 and 9.1).
class Bits {
 public:
  void put(unsigned value, int count) {
    for (int i = count - 1; i >= 0; --i) put_bit((value >> i & 1) != 0);
  }
  /// Writes an unsigned number in the Exp-Golomb code.
  void put_number(unsigned value) {
    const int length = std::bit_width(value + 1);
    put(0, length - 1);
    put(value + 1, length);
  }
  void align() {
    while (used_ != 0) put_bit(false);
  }
  void put_byte(uint8_t byte) { bytes_.push_back(byte); }

  /// Returns the unit with its header, and with a 3 wherever three bytes would look like a mark.
  [[nodiscard]] Bytes unit(uint8_t header) {
    put_bit(true);
    align();
    Bytes out = {header};
    int zeros = 0;
    for (const uint8_t byte : bytes_) {
      if (zeros == 2 && byte <= 3) {
        out.push_back(3);
        zeros = 0;
      }
      zeros = byte == 0 ? zeros + 1 : 0;
      out.push_back(byte);
    }
    return out;
  }

 private:
  void put_bit(bool bit) {
    last_ = static_cast<uint8_t>(last_ << 1 | (bit ? 1 : 0));
    if (++used_ < 8) return;
    bytes_.push_back(std::exchange(last_, uint8_t{0}));
    used_ = 0;
  }

  Bytes bytes_;
  uint8_t last_ = 0;  ///< bits of the next byte
  int used_ = 0;      ///< number of bits in last_
};

unsigned blocks(int size) { return static_cast<unsigned>((size + kBlock - 1) / kBlock); }

void put_range(Bits& bits) {
  bits.put(0, 2);  // aspect ratio, overscan
  bits.put(1, 1);  // video signal type
  bits.put(5, 3);  // unspecified format
  bits.put(1, 1);  // full range
  bits.put(0, 1);  // no colour description
  bits.put(0, 5);  // chroma position, timing, both HRD, picture structure
  bits.put(0, 1);  // bitstream restriction
}

Bytes sequence_unit(int width, int height, bool full_range) {
  Bits bits;
  bits.put(kBaseline, 8);
  bits.put(0, 8);
  bits.put(kLevel, 8);
  bits.put_number(0);  // number of the set
  bits.put_number(0);  // 4 bits of frame numbers
  bits.put_number(2);  // display order is coding order
  bits.put_number(1);  // reference frames
  bits.put(0, 1);
  bits.put_number(blocks(width) - 1);
  bits.put_number(blocks(height) - 1);
  bits.put(1, 1);  // frames only
  bits.put(1, 1);
  const unsigned right = (blocks(width) * kBlock - static_cast<unsigned>(width)) / 2;
  const unsigned bottom = (blocks(height) * kBlock - static_cast<unsigned>(height)) / 2;
  bits.put(right + bottom > 0 ? 1 : 0, 1);
  if (right + bottom > 0)
    for (const unsigned crop : {0U, right, 0U, bottom}) bits.put_number(crop);
  bits.put(full_range ? 1 : 0, 1);
  if (full_range) put_range(bits);
  return bits.unit(kSequenceUnit);
}

Bytes picture_unit() {
  Bits bits;
  bits.put_number(0);
  bits.put_number(0);
  bits.put(0, 2);                                  // CAVLC
  bits.put_number(0);                              // one slice group
  for (int i = 0; i < 2; ++i) bits.put_number(0);  // reference indices
  bits.put(0, 3);                                  // no weighted prediction
  for (int i = 0; i < 3; ++i) bits.put_number(0);  // quantisers
  bits.put(1, 1);                                  // slices control deblocking
  bits.put(0, 2);
  return bits.unit(kPictureUnit);
}

/// A plane of a picture; the last sample is repeated beyond the edges.
struct Plane {
  const uint8_t* samples;
  int width;
  int height;
  [[nodiscard]] uint8_t at(int x, int y) const {
    return samples[std::min(y, height - 1) * width + std::min(x, width - 1)];
  }
};

void put_block(Bits& bits, const Plane& plane, int column, int row, int side) {
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) bits.put_byte(plane.at(column * side + x, row * side + y));
}

Bytes slice_unit(const Picture420& picture, unsigned number) {
  const int width = picture.width;
  const int height = picture.height;
  const Plane luma{picture.samples.data(), width, height};
  const Plane blue{luma.samples + ptrdiff_t{width} * height, width / 2, height / 2};
  const Plane red{blue.samples + ptrdiff_t{width} * height / 4, width / 2, height / 2};
  Bits bits;
  bits.put_number(0);
  bits.put_number(kIntraOnly);
  bits.put_number(0);
  bits.put(0, 4);               // frame number
  bits.put_number(number % 2);  // differs between neighbouring key frames
  bits.put(0, 2);               // reference marking
  bits.put_number(0);           // quantiser
  bits.put_number(1);           // no deblocking
  for (int row = 0; row < static_cast<int>(blocks(height)); ++row)
    for (int column = 0; column < static_cast<int>(blocks(width)); ++column) {
      bits.put_number(kPcmInIntra);
      bits.align();
      put_block(bits, luma, column, row, kBlock);
      put_block(bits, blue, column, row, kBlock / 2);
      put_block(bits, red, column, row, kBlock / 2);
    }
  return bits.unit(kKeyUnit);
}

/// Returns the SEI message "frame packing arrangement" (section D.1.26).
Bytes packing_unit(unsigned arrangement, bool right_first) {
  constexpr uint8_t kMessageUnit = 6, kPacking = 45, kBytes = 7;
  Bits bits;
  bits.put(kPacking, 8);
  bits.put(kBytes, 8);
  bits.put_number(0);  // number of the arrangement
  bits.put(0, 1);      // not cancelled
  bits.put(arrangement, 7);
  bits.put(0, 1);                    // no quincunx
  bits.put(right_first ? 2 : 1, 6);  // which eye's picture is the first
  bits.put(0, 6);                    // flips, fields, current frame, self-contained
  bits.put(0, 16);                   // positions of the grids
  bits.put(0, 8);
  bits.put_number(1);  // until the next one
  bits.put(0, 1);      // no extension
  bits.put(1, 1);      // end of the message
  bits.align();
  return bits.unit(kMessageUnit);
}

/// Returns a picture all of whose macroblocks are skipped: a copy of the one before. `number`
/// counts from the key frame.
Bytes copy_unit(const Picture420& picture, unsigned number) {
  Bits bits;
  bits.put_number(0);
  bits.put_number(kPredicted);
  bits.put_number(0);
  bits.put(number % kFrameNumbers, 4);
  bits.put(0, 3);      // reference lists and marking
  bits.put_number(0);  // quantiser
  bits.put_number(1);  // no deblocking
  bits.put_number(blocks(picture.width) * blocks(picture.height));
  return bits.unit(kCopyUnit);
}

// --- FLV -----------------------------------------------------------------------------------------

void append(Bytes& out, size_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

void append(Bytes& out, std::span<const uint8_t> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

/// Returns the decoder's configuration of ISO/IEC 14496-15.
Bytes configuration(const Bytes& sequence, const Bytes& picture) {
  Bytes out = {1, sequence[1], sequence[2], sequence[3], 0xff, 0xe1};
  append(out, sequence.size(), 2);
  append(out, sequence);
  out.push_back(1);
  append(out, picture.size(), 2);
  append(out, picture);
  return out;
}

enum class Tag { Configuration, Key, Copy };

void append_tag(Bytes& out, unsigned time, Tag kind, std::span<const uint8_t> payload) {
  constexpr uint8_t kVideoTag = 9;
  constexpr uint8_t kKeyFrameOfAvc = 0x17;
  constexpr uint8_t kOtherFrameOfAvc = 0x27;
  constexpr size_t kTagHeader = 11;
  constexpr size_t kVideoHeader = 5;
  out.push_back(kVideoTag);
  append(out, payload.size() + kVideoHeader, 3);
  append(out, time, 3);
  append(out, 0, 4);
  out.push_back(kind == Tag::Copy ? kOtherFrameOfAvc : kKeyFrameOfAvc);
  out.push_back(kind == Tag::Configuration ? 0 : 1);
  append(out, 0, 3);
  append(out, payload);
  append(out, payload.size() + kVideoHeader + kTagHeader, 4);
}

}  // namespace

void write_h264_clip(const H264Clip& clip, const std::vector<Picture420>& pictures) {
  Bytes out = {'F', 'L', 'V', 1, 1};
  append(out, 9, 4);
  append(out, 0, 4);
  const Picture420& first = pictures.at(0);
  append_tag(
      out, 0, Tag::Configuration,
      configuration(sequence_unit(first.width, first.height, clip.full_range), picture_unit()));
  for (unsigned number = 0; number < pictures.size(); ++number) {
    const unsigned since_key = number % clip.key_interval;
    const Bytes slice = since_key == 0 ? slice_unit(pictures[number], number / clip.key_interval)
                                       : copy_unit(pictures[number], since_key);
    Bytes packet;
    if (clip.packing != 0) {
      const Bytes message = packing_unit(clip.packing, clip.right_first);
      append(packet, message.size(), 4);
      append(packet, message);
    }
    append(packet, slice.size(), 4);
    append(packet, slice);
    append_tag(out, number * static_cast<unsigned>(clip.milliseconds),
               since_key == 0 ? Tag::Key : Tag::Copy, packet);
  }
  std::ofstream(clip.file, std::ios::binary)
      .write(reinterpret_cast<const char*>(out.data()), static_cast<std::streamsize>(out.size()));
}

}  // namespace lenticule::test
