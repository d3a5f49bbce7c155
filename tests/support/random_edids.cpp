// SPDX-License-Identifier: Apache-2.0
#include "random_edids.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <random>
#include <string_view>

namespace lenticule::test {
namespace {

constexpr size_t kBlock = 128;
using Bytes = std::vector<uint8_t>;

/// Draws random numbers. The standard's generators are the same everywhere, its distributions are
/// not.
class Dice {
 public:
  explicit Dice(uint64_t number) : engine_(number * 0x9e3779b97f4a7c15U + 1) {}
  [[nodiscard]] unsigned below(unsigned limit) { return static_cast<unsigned>(engine_() % limit); }
  [[nodiscard]] unsigned between(unsigned low, unsigned high) {
    return low + below(high - low + 1);
  }
  [[nodiscard]] bool one_in(unsigned n) { return below(n) == 0; }
  [[nodiscard]] uint8_t byte() { return static_cast<uint8_t>(below(256)); }
  [[nodiscard]] Bytes bytes(size_t count) {
    Bytes made(count);
    for (uint8_t& one : made) one = byte();
    return made;
  }

 private:
  std::mt19937_64 engine_;
};

uint8_t low(unsigned value) { return static_cast<uint8_t>(value); }
uint8_t high(unsigned value) { return static_cast<uint8_t>(value >> 8); }

void close_block(Bytes& block, size_t last) {
  const auto sum = std::accumulate(block.begin(), block.begin() + static_cast<ptrdiff_t>(last), 0U);
  block[last] = static_cast<uint8_t>(-sum);
}

void put(Bytes& block, size_t at, const Bytes& what) {
  std::copy(what.begin(), what.end(), block.begin() + static_cast<ptrdiff_t>(at));
}

// --- the base block -------------------------------------------------------------------------

Bytes detailed_timing(Dice& dice) {
  Bytes timing(18);
  const unsigned clock = dice.between(2500, 65535);
  const unsigned width = dice.between(64, 4095);
  const unsigned height = dice.between(64, 4095);
  const unsigned h_blank = dice.between(200, 800);
  const unsigned v_blank = dice.between(60, 200);
  timing[0] = low(clock);
  timing[1] = high(clock);
  timing[2] = low(width);
  timing[3] = low(h_blank);
  timing[4] = static_cast<uint8_t>((width >> 8) << 4 | h_blank >> 8);
  timing[5] = low(height);
  timing[6] = low(v_blank);
  timing[7] = static_cast<uint8_t>((height >> 8) << 4 | v_blank >> 8);
  timing[8] = 48;
  timing[9] = 32;
  timing[10] = 3 << 4 | 5;
  timing[12] = low(600);
  timing[13] = low(340);
  timing[14] = 2 << 4 | 1;
  timing[17] = dice.one_in(5) ? 0x9a : 0x1a;  // interlaced or not
  return timing;
}

Bytes text_descriptor(Dice& dice, uint8_t tag) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-+./";
  Bytes descriptor(18, 0x20);
  descriptor[0] = descriptor[1] = descriptor[2] = descriptor[4] = 0;
  descriptor[3] = tag;
  const size_t length = dice.between(1, 13);
  for (size_t i = 0; i < length; ++i)
    descriptor[5 + i] = static_cast<uint8_t>(kLetters[dice.below(kLetters.size())]);
  if (length < 13) descriptor[5 + length] = '\n';
  return descriptor;
}

Bytes empty_descriptor() {
  Bytes descriptor(18);
  descriptor[3] = 0x10;
  return descriptor;
}

Bytes base_block(Dice& dice, size_t extensions) {
  Bytes block(kBlock);
  std::fill(block.begin() + 1, block.begin() + 7, uint8_t{0xff});
  const bool letters = dice.one_in(2);
  unsigned maker = dice.below(1U << 15);
  if (letters) maker = dice.between(1, 26) << 10 | dice.between(1, 26) << 5 | dice.between(1, 26);
  block[8] = high(maker);
  block[9] = low(maker);
  put(block, 10, dice.bytes(6));
  block[16] = static_cast<uint8_t>(dice.between(1, 53));
  block[17] = static_cast<uint8_t>(dice.between(20, 33));
  block[18] = 1;
  block[19] = dice.one_in(2) ? 4 : 3;
  block[20] = dice.byte();
  block[21] = 60;
  block[22] = 34;
  block[23] = 120;
  block[24] = dice.byte();
  put(block, 25, dice.bytes(10));
  for (size_t i = 38; i < 54; ++i) block[i] = 1;  // no standard timings
  std::array<Bytes, 4> descriptors = {
      dice.one_in(6) ? empty_descriptor() : detailed_timing(dice), text_descriptor(dice, 0xfc),
      dice.one_in(2) ? text_descriptor(dice, 0xff) : empty_descriptor(),
      dice.one_in(2) ? detailed_timing(dice) : empty_descriptor()};
  for (size_t i = 0; i < descriptors.size(); ++i) put(block, 54 + 18 * i, descriptors[i]);
  block[126] = static_cast<uint8_t>(extensions);
  close_block(block, 127);
  return block;
}

// --- CTA-861 --------------------------------------------------------------------------------

/// Returns a VIC that exists.
uint8_t any_vic(Dice& dice) {
  const unsigned pick = dice.below(127 + 27);
  const auto vic = static_cast<uint8_t>(pick < 127 ? pick + 1 : pick - 127 + 193);
  return vic <= 64 && dice.one_in(8) ? vic | 0x80 : vic;  // the bit marks the mode as native
}

Bytes cta_data_block(Dice& dice) {
  const auto with_vics = [&](Bytes block) {
    const unsigned count = dice.between(1, 6);
    for (unsigned i = 0; i < count; ++i) block.push_back(any_vic(dice));
    block[0] = static_cast<uint8_t>(block[0] | (block.size() - 1));
    return block;
  };
  switch (dice.below(6)) {
    case 0:
      return with_vics({2 << 5});  // video
    case 1:
      return {1 << 5 | 3, 0x09, 0x07, 0x07};  // audio: LPCM
    case 2:
      return with_vics({7 << 5, 14});  // video modes with 4:2:0 only
    case 3:
      return {7 << 5 | 2, 15, dice.byte()};  // bit map of the modes above that also allow 4:2:0
    case 4:
      return {7 << 5 | 2, 0, 0xca};  // video capabilities
    default:
      if (dice.one_in(2)) return {3 << 5 | 5, 0x03, 0x0c, 0x00, 0x10, 0x00};  // HDMI
      return {3 << 5 | 7, 0x03, 0x0c, 0x00, 0x10, 0x00, low(dice.below(8) << 4), 60};
  }
}

Bytes cta_block(Dice& dice) {
  Bytes block(kBlock);
  block[0] = 2;
  block[1] = static_cast<uint8_t>(dice.between(1, 3));
  size_t offset = 4;
  if (block[1] == 3)
    for (unsigned i = dice.below(5); i > 0; --i) {
      const Bytes data = cta_data_block(dice);
      put(block, offset, data);
      offset += data.size();
    }
  block[2] = static_cast<uint8_t>(dice.one_in(10) ? 0 : offset);
  if (block[1] > 1) block[3] = dice.byte() & 0xf0;
  if (block[2] != 0 && dice.one_in(2)) put(block, offset, detailed_timing(dice));
  close_block(block, 127);
  return block;
}

// --- DisplayID ------------------------------------------------------------------------------

Bytes displayid_timing_1_or_7(Dice& dice, unsigned level) {
  Bytes timing(20);
  const auto word = [&](size_t at, unsigned value) {
    timing[at] = low(value);
    timing[at + 1] = high(value);
  };
  put(timing, 0, {dice.byte(), dice.byte(), static_cast<uint8_t>(dice.between(1, 8))});
  timing[3] = static_cast<uint8_t>(dice.below(8));
  if (dice.one_in(3)) timing[3] |= 0x80;  // preferred; from level 2 YCbCr 4:2:0
  if (level < 2 && dice.one_in(4)) timing[3] |= 0x10;
  word(4, dice.between(63, 8191));
  word(6, 159);
  word(8, 47);
  word(10, 31);
  word(12, dice.between(63, 8191));
  word(14, 61);
  word(16, 2);
  word(18, 4);
  return timing;
}

Bytes displayid_parameters(Dice& dice, uint8_t tag, size_t length) {
  Bytes block(3 + length);
  block[0] = tag;
  block[2] = static_cast<uint8_t>(length);
  const unsigned width = dice.one_in(8) ? 0 : dice.between(64, 8192);
  const unsigned height = width == 0 ? 0 : dice.between(64, 8192);
  put(block, 3, {low(6000), high(6000), low(3400), high(3400)});
  put(block, 7, {low(width), high(width), low(height), high(height)});
  return block;
}

Bytes with_header(uint8_t tag, unsigned revision, const Bytes& payload) {
  Bytes block = {tag, static_cast<uint8_t>(revision), static_cast<uint8_t>(payload.size())};
  block.insert(block.end(), payload.begin(), payload.end());
  return block;
}

Bytes displayid_timing_2(Dice& dice) {
  Bytes timing = dice.bytes(11);
  timing[2] = 1;
  timing[3] = timing[3] & 0x98;
  return timing;
}

Bytes displayid_timing_5(Dice& dice) {
  Bytes timing = dice.bytes(7);
  timing[0] = timing[0] & 0x80;
  timing[3] = timing[3] & 0x1f;
  timing[5] = timing[5] & 0x1f;
  timing[6] = 59;
  return timing;
}

Bytes displayid_timing_6(Dice& dice) {
  Bytes timing = dice.bytes(14);
  timing[2] = timing[2] & 0xbf;  // clears the bit for the image size
  timing[7] = 159;
  timing[8] = 47;
  timing[9] = 0;
  timing[10] = 31;
  return timing;
}

Bytes displayid_data_block(Dice& dice, bool version_2) {
  if (version_2) switch (dice.below(4)) {
      case 0:
        return displayid_parameters(dice, 0x21, 29);
      case 1: {
        const unsigned level = dice.below(3);
        return with_header(0x22, level, displayid_timing_1_or_7(dice, level));
      }
      case 2: {
        Bytes features(9);
        features[0] = 0x02;
        for (size_t i = 1; i < 4; ++i) features[i] = dice.one_in(3) ? 0x02 : 0;
        return with_header(0x26, 0, features);
      }
      default:
        return with_header(0x81, 0, cta_data_block(dice));
    }
  switch (dice.below(7)) {
    case 0:
      return displayid_parameters(dice, 0x01, 12);
    case 1: {
      const unsigned level = dice.below(2);
      Bytes two = displayid_timing_1_or_7(dice, level);
      const Bytes second = displayid_timing_1_or_7(dice, level);
      two.insert(two.end(), second.begin(), second.end());
      return with_header(0x03, level, two);
    }
    case 2:
      return with_header(0x04, 0, displayid_timing_2(dice));
    case 3:
      return with_header(0x11, 0, displayid_timing_5(dice));
    case 4:
      return with_header(0x13, 0, displayid_timing_6(dice));
    case 5: {
      Bytes interface(10);
      for (size_t i = 2; i < 5; ++i) interface[i] = dice.one_in(3) ? 0x02 : 0;
      return with_header(0x0f, 0, interface);
    }
    default:
      return with_header(0x81, 0, cta_data_block(dice));
  }
}

Bytes displayid_block(Dice& dice) {
  constexpr std::array<uint8_t, 3> kVersions = {0x12, 0x13, 0x20};
  Bytes block(kBlock);
  block[0] = 0x70;
  block[1] = kVersions.at(dice.below(3));
  block[3] = 3;
  size_t offset = 5;
  for (unsigned i = dice.below(4); i > 0; --i) {
    const Bytes data = displayid_data_block(dice, block[1] == 0x20);
    if (offset + data.size() > 5 + 121) break;
    put(block, offset, data);
    offset += data.size();
  }
  block[2] = static_cast<uint8_t>(offset - 5);
  const auto sum =
      std::accumulate(block.begin() + 1, block.begin() + static_cast<ptrdiff_t>(offset), 0U);
  block[offset] = static_cast<uint8_t>(-sum);
  close_block(block, 127);
  return block;
}

}  // namespace

std::vector<uint8_t> random_edid(uint64_t number) {
  Dice dice(number);
  const size_t extensions = dice.below(4);
  Bytes edid = base_block(dice, extensions);
  for (size_t i = 0; i < extensions; ++i) {
    const Bytes block = dice.one_in(2) ? cta_block(dice) : displayid_block(dice);
    edid.insert(edid.end(), block.begin(), block.end());
  }
  return edid;
}

}  // namespace lenticule::test
