// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/edid_extensions.h"

#include <algorithm>

namespace lenticule::display {
namespace {

using Bytes = std::span<const uint8_t>;

constexpr uint8_t kCtaBlock = 0x02;
constexpr uint8_t kDisplayIdBlock = 0x70;

int little_endian_16(Bytes at) {
  return at[0] | at[1] << 8;
}

// --- CTA-861 --------------------------------------------------------------------------------

/// Returns the VIC. 1 to 127 and 193 to 253 are VICs; 129 to 192 are VICs with a bit for "native".
uint8_t vic_of(uint8_t descriptor) {
  return descriptor >= 129 && descriptor <= 192 ? descriptor & 0x7f : descriptor;
}

/// Returns true for HDMI's own data block with its flag for 30 bits per pixel.
bool accepts_30_bits(Bytes block) {
  constexpr uint8_t kHdmi[] = {0x03, 0x0c, 0x00};  // its identifier, lowest byte first
  constexpr size_t kFlags = 6;
  constexpr uint8_t kThirtyBits = 0x10;
  return block.size() > kFlags && std::ranges::equal(block.subspan(1, 3), kHdmi) &&
         (block[kFlags] & kThirtyBits) != 0;
}

void read_cta_data_block(Bytes block, EdidExtensions& found) {
  constexpr uint8_t kVendor = 3;
  constexpr uint8_t kExtended = 7;
  constexpr uint8_t kVideo420 = 14;
  constexpr uint8_t kCapability420 = 15;
  if (block[0] >> 5 == kVendor && accepts_30_bits(block)) found.deep_colour = true;
  if (block[0] >> 5 != kExtended || block.size() < 2) return;
  if (block[1] != kVideo420 && block[1] != kCapability420) return;
  found.offers_ycbcr = true;
  if (block[1] == kCapability420) return;
  for (const uint8_t descriptor : block.subspan(2))
    if (vic_of(descriptor) != 0 && vic_of(descriptor) != 128)
      found.only_as_420.push_back(vic_of(descriptor));
}

void read_cta_data_blocks(Bytes blocks, EdidExtensions& found) {
  while (!blocks.empty()) {
    const size_t size = 1 + (blocks[0] & 0x1fU);
    if (size > blocks.size()) return;
    read_cta_data_block(blocks.first(size), found);
    blocks = blocks.subspan(size);
  }
}

/// Parses a CTA block. Data blocks precede the offset of the timings; revision 1 has no flags,
/// revision 2 no data blocks.
void read_cta(Bytes block, EdidExtensions& found) {
  constexpr uint8_t kYcbcr444And422 = 0x30;
  constexpr size_t kHeader = 4;
  const uint8_t revision = block[1];
  const size_t offset = block[2];
  if (offset < kHeader) return;
  if (revision >= 2 && (block[3] & kYcbcr444And422) != 0) found.offers_ycbcr = true;
  if (revision >= 3 && offset < block.size())
    read_cta_data_blocks(block.subspan(kHeader, offset - kHeader), found);
}

// --- DisplayID ------------------------------------------------------------------------------

/// The relevant fields of a timing.
struct ListedTiming {
  bool preferred = false;
  bool interlaced = false;
  PixelSize size;
};

ListedTiming type_1_or_7(Bytes x, bool may_be_preferred) {
  return {.preferred = may_be_preferred && (x[3] & 0x80) != 0,
          .interlaced = (x[3] & 0x10) != 0,
          .size = {1 + little_endian_16(x.subspan(4)), 1 + little_endian_16(x.subspan(12))}};
}

ListedTiming type_2(Bytes x) {
  return {.preferred = (x[3] & 0x80) != 0,
          .interlaced = (x[3] & 0x10) != 0,
          .size = {8 + 8 * (x[4] | (x[5] & 1) << 8), 1 + (x[7] | (x[8] & 15) << 8)}};
}

ListedTiming type_3(Bytes x) {
  struct Aspect {
    int width, height;
  };
  constexpr Aspect kAspects[] = {{1, 1},  {5, 4},   {4, 3},   {15, 9},
                                 {16, 9}, {16, 10}, {64, 27}, {256, 135}};
  const size_t aspect = x[0] & 15U;
  if (aspect >= std::size(kAspects)) return {};
  const int width = 8 + 8 * x[1];
  return {.preferred = (x[0] & 0x80) != 0,
          .interlaced = (x[2] & 0x80) != 0,
          .size = {width, width * kAspects[aspect].height / kAspects[aspect].width}};
}

ListedTiming type_5(Bytes x) {
  return {.preferred = (x[0] & 0x80) != 0,
          .interlaced = false,
          .size = {1 + little_endian_16(x.subspan(2)), 1 + little_endian_16(x.subspan(4))}};
}

ListedTiming type_6(Bytes x) {
  return {.preferred = (x[2] & 0x80) != 0,
          .interlaced = (x[13] & 0x80) != 0,
          .size = {1 + (x[3] | (x[4] & 0x3f) << 8), 1 + (x[5] | (x[6] & 0x3f) << 8)}};
}

void note_timing(const ListedTiming& timing, EdidExtensions& found) {
  if (timing.preferred && !timing.interlaced && !found.displayid_preferred)
    found.displayid_preferred = timing.size;
}

template <typename Read>
void read_timings(Bytes payload, size_t size, const Read& read, EdidExtensions& found) {
  for (; payload.size() >= size; payload = payload.subspan(size))
    note_timing(read(payload.first(size)), found);
}

void read_type_6_timings(Bytes payload, EdidExtensions& found) {
  while (payload.size() >= 14) {
    // Size with or without the image's size.
    const size_t size = (payload[2] & 0x40) != 0 ? 17 : 14;
    note_timing(type_6(payload), found);
    payload = payload.subspan(std::min(size, payload.size()));
  }
}

void note_native(Bytes pixels, EdidExtensions& found) {
  const PixelSize size{little_endian_16(pixels), little_endian_16(pixels.subspan(2))};
  if (size.width > 0 && size.height > 0 && !found.displayid_native) found.displayid_native = size;
}

bool any_bit(Bytes bytes) {
  return std::any_of(bytes.begin(), bytes.end(), [](uint8_t byte) { return byte != 0; });
}

void read_displayid_data_block(uint8_t tag, uint8_t revision, Bytes payload,
                               EdidExtensions& found) {
  const unsigned level = revision & 7U;
  switch (tag) {
    case 0x01:  // display parameters
      if (payload.size() == 12) note_native(payload.subspan(4), found);
      return;
    case 0x21:
      if (payload.size() == 29) note_native(payload.subspan(4), found);
      return;
    case 0x03:  // detailed timings; from level 2 the "preferred" bit means YCbCr 4:2:0
    case 0x22: {
      const size_t longer = tag == 0x22 ? revision >> 4 & 7U : 0U;
      return read_timings(
          payload, 20 + longer,
          [&](Bytes x) {
            if (level >= 2 && (x[3] & 0x80) != 0) found.offers_ycbcr = true;
            return type_1_or_7(x, level < 2);
          },
          found);
    }
    case 0x04:
      return read_timings(payload, 11, type_2, found);
    case 0x05:
      return read_timings(payload, 3, type_3, found);
    case 0x11:
      return read_timings(payload, 7, type_5, found);
    case 0x13:
      return read_type_6_timings(payload, found);
    case 0x0f:  // display interface: depths of RGB, 4:4:4, 4:2:2
      if (payload.size() == 10 && any_bit(payload.subspan(3, 2))) found.offers_ycbcr = true;
      return;
    case 0x26:  // display interface features: depths of RGB, 4:4:4, 4:2:2, 4:2:0
      if (payload.size() >= 9 && any_bit(payload.subspan(1, 3))) found.offers_ycbcr = true;
      return;
    case 0x81:
      return read_cta_data_blocks(payload, found);
    default:
      return;
  }
}

void read_displayid(Bytes block, EdidExtensions& found) {
  constexpr size_t kHeader = 5;
  constexpr size_t kMostBytes = 121;
  Bytes rest = block.subspan(kHeader, std::min<size_t>(block[2], kMostBytes));
  while (rest.size() >= 3) {
    const size_t size = 3U + rest[2];
    const bool at_the_end = rest[0] == 0 && rest[2] == 0;
    if (size > rest.size() || at_the_end) return;
    read_displayid_data_block(rest[0], rest[1], rest.subspan(3, size - 3), found);
    rest = rest.subspan(size);
  }
}

}  // namespace

EdidExtensions read_extensions(Bytes edid) {
  EdidExtensions found;
  for (size_t at = kEdidBlockBytes; at + kEdidBlockBytes <= edid.size(); at += kEdidBlockBytes) {
    const Bytes block = edid.subspan(at, kEdidBlockBytes);
    if (block[0] == kCtaBlock) read_cta(block, found);
    if (block[0] == kDisplayIdBlock) read_displayid(block, found);
  }
  return found;
}

}  // namespace lenticule::display
