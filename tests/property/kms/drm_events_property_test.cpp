// SPDX-License-Identifier: Apache-2.0
// Tests that no bytes from a card make the reader invent an event or read beyond the end.
#include <drm.h>
#include <gtest/gtest.h>

#include <random>
#include <span>
#include <vector>

#include "display/kms/device/drm_events.h"

namespace lenticule::test {
namespace {

using display::DrmEvent;
using display::EventRead;

struct Collected {
  EventRead result;
  std::vector<uint64_t> ids;
};
Collected collect(std::span<const uint8_t> bytes) {
  Collected collected{};
  collected.result = display::parse_drm_events(
      bytes, [&](const DrmEvent& event) { collected.ids.push_back(event.id); });
  return collected;
}

template <typename Event>
void append(std::vector<uint8_t>& bytes, const Event& event) {
  const auto* begin = reinterpret_cast<const uint8_t*>(&event);
  bytes.insert(bytes.end(), begin, begin + sizeof(event));
}

std::vector<uint8_t> stream_of(std::mt19937& random, std::vector<uint64_t>& ids) {
  std::vector<uint8_t> bytes;
  for (unsigned i = 0; i < 1 + random() % 8; ++i) {
    const uint64_t id = random();
    if (random() % 3 == 0) {
      drm_event unknown{.type = 77, .length = sizeof(drm_event) + 8};
      append(bytes, unknown);
      append(bytes, id);
      continue;
    }
    ids.push_back(id);
    if (random() % 2 == 0) {
      drm_event_vblank event{};
      event.base = {.type = DRM_EVENT_FLIP_COMPLETE, .length = sizeof(event)};
      event.user_data = id;
      append(bytes, event);
    } else {
      drm_event_crtc_sequence event{};
      event.base = {.type = DRM_EVENT_CRTC_SEQUENCE, .length = sizeof(event)};
      event.user_data = id;
      append(bytes, event);
    }
  }
  return bytes;
}

}  // namespace

TEST(DrmEvents, CompleteStreamsAreReadAndUnknownEventsSkipped) {
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::vector<uint64_t> ids;
    const auto bytes = stream_of(random, ids);
    const Collected collected = collect(bytes);
    EXPECT_EQ(collected.result, EventRead::Ok);
    EXPECT_EQ(collected.ids, ids);
  }
}

TEST(DrmEvents, EveryCutGivesAPrefixOfTheEvents) {
  std::mt19937 random(2);
  for (int round = 0; round < 100; ++round) {
    std::vector<uint64_t> ids;
    const auto bytes = stream_of(random, ids);
    for (size_t cut = 0; cut < bytes.size(); ++cut) {
      const std::vector<uint8_t> part(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(cut));
      const Collected collected = collect(part);
      ASSERT_LE(collected.ids.size(), ids.size());
      EXPECT_TRUE(std::equal(collected.ids.begin(), collected.ids.end(), ids.begin()));
    }
  }
}

TEST(DrmEvents, GarbageTerminates) {
  std::mt19937 random(3);
  for (int round = 0; round < 20000; ++round) {
    std::vector<uint8_t> bytes(random() % 200);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 4 == 0 ? random() : 0);
    EXPECT_LE(collect(bytes).ids.size(), bytes.size() / sizeof(drm_event_vblank));
  }
}

}  // namespace lenticule::test
