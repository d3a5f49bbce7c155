// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "frames/ring/ring_layout.h"
#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

constexpr FrameGeometry kKiosk = {.width = 3840, .height = 2160, .format = PixelFormat::Rgb8};
constexpr FrameGeometry kSmall = {.width = 160, .height = 120, .format = PixelFormat::Rgb8};

std::unique_ptr<RingHeader> header_of(const RingLayout& layout) {
  auto header = std::make_unique<RingHeader>();
  write_header(layout, *header);
  return header;
}

TEST(RingLayout, SlotsNeitherOverlapNorLeaveTheMemory) {
  for (const int slots : {3, 64, 65, 4096})
    for (const int width : {1, 683, 700, 32768}) {
      const FrameGeometry geometry = {.width = width, .height = 1000, .format = PixelFormat::Rgb10};
      const RingLayout layout = plan_layout(geometry, slots);
      EXPECT_GE(layout.slots_offset, layout.table_offset + slots * sizeof(SlotEntry));
      EXPECT_GE(layout.slot_stride, geometry.frame_bytes());
      EXPECT_EQ(layout.slot_offset(slots), layout.memory_bytes);
      EXPECT_EQ(layout.slots_offset % kPageBytes, 0u);
      EXPECT_EQ(layout.slot_stride % kPageBytes, 0u);
    }
}

TEST(RingLayout, SurvivesARoundTrip) {
  const RingLayout layout = plan_layout(kKiosk, 8);
  RingLayout read;
  EXPECT_EQ(read_header(*header_of(layout), layout.memory_bytes, read), nullptr);
  EXPECT_EQ(read, layout);
}

TEST(RingLayout, TheContentSurvivesARoundTripAndIsChecked) {
  RingLayout layout = plan_layout(kSmall, 8), read;
  const auto problem = [&](const RingContent& content) {
    layout.content = content;
    const char* text = read_header(*header_of(layout), layout.memory_bytes, read);
    return std::string(text ? text : "none");
  };
  const RingContent quilt{
      .kind = RingContent::Quilt, .columns = 4, .rows = 3, .views = 11, .aspect = 0.75};
  EXPECT_EQ(problem(quilt), "none");
  EXPECT_EQ(read.content, quilt);
  const auto with = [&](auto change) {
    RingContent content = quilt;
    change(content);
    return problem(content);
  };
  EXPECT_EQ(with([](auto& c) { c.views = 13; }), "tiles do not fit the picture");
  EXPECT_EQ(with([](auto& c) { c.columns = 0; }), "tiles do not fit the picture");
  EXPECT_EQ(with([](auto& c) { c.rows = 65535; }), "tiles do not fit the picture");
  EXPECT_EQ(with([](auto& c) { c.aspect = -1.0; }), "aspect out of range");
  EXPECT_EQ(with([](auto& c) { c.aspect = std::nan(""); }), "aspect out of range");
  EXPECT_EQ(with([](auto& c) { c.kind = 3; }), "unknown content");
  EXPECT_EQ(with([](auto& c) { c.kind = RingContent::Colours; }),
            "colours or depth lie outside of the picture");
}

TEST(RingLayout, RejectsAHeaderWithAnyByteChanged) {
  const RingLayout layout = plan_layout(kSmall, 8);
  const auto good = header_of(layout);
  const size_t constant_bytes = sizeof(RingFields);
  for (size_t at = 0; at < constant_bytes; ++at)
    for (const int change : {1, 0x80, 0xff}) {
      const auto bad = header_of(layout);
      reinterpret_cast<uint8_t*>(bad.get())[at] ^= static_cast<uint8_t>(change);
      RingLayout read;
      // No single change gives another consistent layout: sizes and offsets follow from the
      // geometry, which would have to change with them.
      EXPECT_NE(read_header(*bad, SIZE_MAX, read), nullptr) << "byte " << at << " ^ " << change;
      EXPECT_EQ(read, RingLayout()) << "a bad header must leave no layout";
    }
}

TEST(RingLayout, NamesTheInvalidFieldOfAHeader) {
  const RingLayout layout = plan_layout(kSmall, 8);
  RingLayout read;
  const auto problem = [&](auto change) {
    const auto header = header_of(layout);
    change(*header);
    const char* text = read_header(*header, layout.memory_bytes, read);
    return std::string(text ? text : "none");
  };
  EXPECT_EQ(problem([](RingHeader&) {}), "none");
  EXPECT_EQ(problem([](RingHeader& h) { h.magic[0] = 'X'; }), "not a ring");
  EXPECT_EQ(problem([](RingHeader& h) { h.abi_version = 2; }), "unsupported version of the ring");
  EXPECT_EQ(problem([](RingHeader& h) { h.endian_tag = 0x04030201; }),
            "written in another byte order");
  EXPECT_EQ(problem([](RingHeader& h) { h.slots = 2; }), "number of slots outside 3 ... 4096");
  EXPECT_EQ(problem([](RingHeader& h) { h.slots = UINT32_MAX; }),
            "number of slots outside 3 ... 4096");
  EXPECT_EQ(problem([](RingHeader& h) { h.format = 0; }), "unknown pixel format");
  EXPECT_EQ(problem([](RingHeader& h) { h.width = 0; }), "width outside 1 ... 32768");
  EXPECT_EQ(problem([](RingHeader& h) { h.width = UINT32_MAX; }), "width outside 1 ... 32768");
  EXPECT_EQ(problem([](RingHeader& h) { h.height = 0x80000000; }), "height outside 1 ... 32768");
  for (uint64_t RingHeader::*field :
       {&RingHeader::row_bytes, &RingHeader::frame_bytes, &RingHeader::table_offset,
        &RingHeader::entry_bytes, &RingHeader::slots_offset, &RingHeader::slot_stride,
        &RingHeader::memory_bytes})
    EXPECT_EQ(problem([field](RingHeader& h) { h.*field += 4096; }),
              "inconsistent offsets or sizes");
}

}  // namespace
}  // namespace lenticule::frames
