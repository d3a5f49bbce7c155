// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/ring_layout.h"

#include <cmath>
#include <cstring>

namespace lenticule::frames {
namespace {

constexpr size_t round_up(size_t bytes, size_t unit) { return (bytes + unit - 1) / unit * unit; }

const char* content_problem(const RingContent& content, const FrameGeometry& picture) {
  const auto lies_inside = [&](const RingRect& part) {
    return part.width > 0 && part.height > 0 && part.left + part.width <= picture.width &&
           part.top + part.height <= picture.height;
  };
  constexpr double kMostAspect = 1e4;
  const bool woven = content.kind == RingContent::Woven;
  if (content.kind > RingContent::Colours || content.reserved != 0 ||
      (woven && content != RingContent{}))
    return "unknown content";
  if (!(content.aspect <= kMostAspect) || std::signbit(content.aspect))
    return "aspect out of range";
  if (content.kind == RingContent::Quilt) {
    const bool fits = content.columns > 0 && content.rows > 0 && content.columns <= picture.width &&
                      content.rows <= picture.height && content.views > 0 &&
                      content.views <= content.columns * content.rows;
    if (!fits) return "tiles do not fit the picture";
  }
  const bool inside = content.kind != RingContent::Colours ||
                      (lies_inside(content.colours) && lies_inside(content.depth));
  return inside ? nullptr : "colours or depth lie outside of the picture";
}

RingFields fields_of(const RingLayout& layout) {
  RingFields fields = {
      .magic = {},
      .abi_version = kRingAbiVersion,
      .endian_tag = kEndianTag,
      .slots = static_cast<uint32_t>(layout.slots),
      .format = static_cast<uint32_t>(layout.geometry.format),
      .width = static_cast<uint32_t>(layout.geometry.width),
      .height = static_cast<uint32_t>(layout.geometry.height),
      .row_bytes = layout.geometry.row_bytes(),
      .frame_bytes = layout.geometry.frame_bytes(),
      .table_offset = layout.table_offset,
      .entry_bytes = sizeof(SlotEntry),
      .slots_offset = layout.slots_offset,
      .slot_stride = layout.slot_stride,
      .memory_bytes = layout.memory_bytes,
      .content = layout.content,
  };
  std::memcpy(fields.magic, kRingMagic, sizeof fields.magic);
  return fields;
}

}  // namespace

RingLayout plan_layout(const FrameGeometry& geometry, int slots) {
  const size_t frame_bytes = geometry.frame_bytes();
  const size_t unit = frame_bytes >= kHugePageBytes ? kHugePageBytes : kPageBytes;
  const size_t table_bytes = static_cast<size_t>(slots) * sizeof(SlotEntry);
  RingLayout layout = {.geometry = geometry, .slots = slots};
  layout.table_offset = kHeaderBytes;
  layout.slots_offset = round_up(layout.table_offset + table_bytes, unit);
  layout.slot_stride = round_up(frame_bytes, unit);
  layout.memory_bytes = layout.slot_offset(slots);
  return layout;
}

RingRect place_of_view(const FrameGeometry& picture, const RingContent& content, int view) {
  if (content.kind != RingContent::Quilt) return view == 0 ? content.colours : content.depth;
  const int tile = content.rightmost_first != 0 ? content.views - 1 - view : view;
  const int width = picture.width / content.columns, height = picture.height / content.rows;
  const int rows_from_bottom = tile / content.columns + 1;
  return {.left = static_cast<uint16_t>(tile % content.columns * width),
          .top = static_cast<uint16_t>(picture.height - rows_from_bottom * height),
          .width = static_cast<uint16_t>(width),
          .height = static_cast<uint16_t>(height)};
}

const char* geometry_problem(const FrameGeometry& geometry, int64_t slots) {
  if (geometry.format != PixelFormat::Rgb8 && geometry.format != PixelFormat::Rgb10)
    return "unknown pixel format";
  if (geometry.width < 1 || geometry.width > kMaxFrameSide) return "width outside 1 ... 32768";
  if (geometry.height < 1 || geometry.height > kMaxFrameSide) return "height outside 1 ... 32768";
  if (slots < kMinSlots || slots > kMaxSlots) return "number of slots outside 3 ... 4096";
  return nullptr;
}

void write_header(const RingLayout& layout, RingHeader& header) {
  const RingFields fields = fields_of(layout);
  std::memcpy(static_cast<void*>(&header), &fields, sizeof fields);
}

const char* read_header(const RingHeader& header, size_t available_bytes, RingLayout& layout) {
  RingFields fields;
  std::memcpy(static_cast<void*>(&fields), &header, sizeof fields);
  if (std::memcmp(fields.magic, kRingMagic, sizeof fields.magic) != 0) return "not a ring";
  if (fields.endian_tag != kEndianTag) return "written in another byte order";
  if (fields.abi_version != kRingAbiVersion) return "unsupported version of the ring";
  if (fields.width > kMaxFrameSide) return "width outside 1 ... 32768";
  if (fields.height > kMaxFrameSide) return "height outside 1 ... 32768";
  const FrameGeometry geometry = {.width = static_cast<int>(fields.width),
                                  .height = static_cast<int>(fields.height),
                                  .format = static_cast<PixelFormat>(fields.format)};
  if (const char* problem = geometry_problem(geometry, fields.slots)) return problem;
  if (const char* problem = content_problem(fields.content, geometry)) return problem;
  RingLayout planned = plan_layout(geometry, static_cast<int>(fields.slots));
  planned.content = fields.content;
  const RingFields expected = fields_of(planned);
  if (std::memcmp(&fields, &expected, sizeof fields) != 0) return "inconsistent offsets or sizes";
  if (planned.memory_bytes > available_bytes) return "memory smaller than the header says";
  layout = planned;
  return nullptr;
}

}  // namespace lenticule::frames
