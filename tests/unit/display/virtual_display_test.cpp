// SPDX-License-Identifier: Apache-2.0
#include "display/virtual/virtual_display.h"

#include <gtest/gtest.h>

#include <atomic>

#include "base/error.h"
#include "display/clock.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::display {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::EventFate;
using test::numbered_frame;
using test::RememberingRecorder;
using test::ScriptedFaults;

constexpr frames::FrameGeometry kSmall{.width = 33, .height = 5};
constexpr Nanoseconds kFar = hours(1000000);

class VirtualDisplayTest : public testing::Test {
 protected:
  std::shared_ptr<SimulatedClock> clock = std::make_shared<SimulatedClock>(seconds(100));
  std::shared_ptr<ScriptedFaults> faults = std::make_shared<ScriptedFaults>();
  std::shared_ptr<RememberingRecorder> recorder = std::make_shared<RememberingRecorder>();
  VblankTimeline timeline{seconds(100), {60, 1}};
  std::unique_ptr<Display> display = open();

  [[nodiscard]] std::unique_ptr<Display> open(int buffers = 3) const {
    return test::open_virtual_display({.geometry = kSmall,
                                       .refresh = {60, 1},
                                       .buffers = buffers,
                                       .clock = clock,
                                       .recorder = recorder},
                                      faults);
  }

  void show(uint64_t id) {
    ScanoutBuffer* const buffer = display->acquire();
    ASSERT_NE(buffer, nullptr);
    buffer->fill(numbered_frame(kSmall, id).view());
    ASSERT_EQ(display->submit(buffer, id), SubmitStatus::Accepted);
  }
};

TEST_F(VirtualDisplayTest, FlipsAtTheFirstVblankAfterSubmission) {
  clock->advance(milliseconds(20));  // between vblanks 1 and 2
  show(7);
  const DisplayEvent event = display->wait_event(kFar, -1);
  EXPECT_EQ(event.kind, EventKind::Flip);
  EXPECT_EQ(event.id, 7u);
  EXPECT_EQ(event.sequence, 2u);
  EXPECT_EQ(event.time, timeline.time_of(2));
  EXPECT_EQ(display->now(), timeline.time_of(2));
}

TEST_F(VirtualDisplayTest, ShowsEverySubpixelUnchanged) {
  for (uint64_t id = 0; id < 8; ++id) {
    show(id);
    EXPECT_EQ(display->wait_event(kFar, -1).kind, EventKind::Flip);
  }
  const auto shown = recorder->shown();
  ASSERT_EQ(shown.size(), 8u);
  for (uint64_t id = 0; id < 8; ++id)
    EXPECT_EQ(shown[id], (test::DisplayedFrame{
                             .sequence = id + 1,
                             .id = id,
                             .checksum = test::checksum_of(numbered_frame(kSmall, id).view())}));
}

TEST_F(VirtualDisplayTest, ARecordingOfTenBitsHasTheFramesOfEight) {
  display = open_virtual_display({.geometry = kSmall,
                                  .depth = ScanoutDepth::Bits10,
                                  .refresh = {60, 1},
                                  .clock = clock,
                                  .recorder = recorder});
  show(3);
  EXPECT_EQ(display->wait_event(kFar, -1).kind, EventKind::Flip);
  ASSERT_EQ(recorder->shown().size(), 1u);
  EXPECT_EQ(recorder->shown()[0].checksum, test::checksum_of(numbered_frame(kSmall, 3).view()));
}

TEST_F(VirtualDisplayTest, HoldsOneFlipAtATime) {
  show(1);
  ScanoutBuffer* const second = display->acquire();
  EXPECT_EQ(display->submit(second, 2), SubmitStatus::Busy);
  EXPECT_EQ(display->wait_event(kFar, -1).id, 1u);
  EXPECT_EQ(display->submit(second, 2), SubmitStatus::Accepted);
}

TEST_F(VirtualDisplayTest, FreesABufferOnlyWhenItsSuccessorIsDisplayed) {
  show(1);
  EXPECT_EQ(display->wait_event(kFar, -1).id, 1u);
  show(2);
  ScanoutBuffer* const third = display->acquire();
  EXPECT_NE(third, nullptr);
  EXPECT_EQ(display->acquire(), nullptr) << "one displayed, one pending, one taken";
  EXPECT_EQ(display->wait_event(kFar, -1).id, 2u);
  EXPECT_NE(display->acquire(), nullptr);
}

TEST_F(VirtualDisplayTest, TakesDiscardedBuffersBack) {
  for (int i = 0; i < 3; ++i) (void)display->acquire();
  ASSERT_EQ(display->acquire(), nullptr);
  display = open();
  ScanoutBuffer* const buffer = display->acquire();
  display->discard(buffer);
  int available = 0;
  while (display->acquire() != nullptr) ++available;
  EXPECT_EQ(available, 3);
}

TEST_F(VirtualDisplayTest, SendsOneVblankEventPerRequest) {
  ASSERT_TRUE(display->request_vblank(4));
  const DisplayEvent event = display->wait_event(kFar, -1);
  EXPECT_EQ(event.kind, EventKind::Vblank);
  EXPECT_EQ(event.sequence, 5u);
  EXPECT_EQ(event.time, timeline.time_of(5));
  EXPECT_EQ(display->wait_event(display->now() + seconds(1), -1).kind, EventKind::Timeout);
}

TEST_F(VirtualDisplayTest, SendsTheEventOfAPastVblankAtOnce) {
  clock->advance(seconds(1));
  ASSERT_TRUE(display->request_vblank(3));
  const DisplayEvent event = display->wait_event(kFar, -1);
  EXPECT_EQ(event.sequence, 60u);
  EXPECT_EQ(event.time, timeline.time_of(60));
  EXPECT_EQ(display->now(), timeline.time_of(60));
}

TEST_F(VirtualDisplayTest, GivesUpAtTheDeadline) {
  const Nanoseconds deadline = display->now() + milliseconds(3);
  EXPECT_EQ(display->wait_event(deadline, -1).kind, EventKind::Timeout);
  EXPECT_EQ(display->now(), deadline);
}

TEST_F(VirtualDisplayTest, JitterDelaysTheEventNotTheVblank) {
  faults->delays[1] = milliseconds(9);
  show(1);
  const DisplayEvent event = display->wait_event(kFar, -1);
  EXPECT_EQ(event.time, timeline.time_of(1));
  EXPECT_EQ(display->now(), timeline.time_of(1) + milliseconds(9));
  show(2);
  EXPECT_EQ(display->wait_event(kFar, -1).sequence, 2u);
}

TEST_F(VirtualDisplayTest, ALateSubmissionMissesItsVblank) {
  faults->delays[1] = milliseconds(20);
  show(1);
  EXPECT_EQ(display->wait_event(kFar, -1).sequence, 1u);
  show(2);
  EXPECT_EQ(display->wait_event(kFar, -1).sequence, 3u);
}

TEST_F(VirtualDisplayTest, ADroppedEventStillFlips) {
  faults->fates[1] = EventFate::Drop;
  show(1);
  EXPECT_EQ(display->wait_event(display->now() + milliseconds(250), -1).kind, EventKind::Timeout);
  show(2);
  EXPECT_EQ(display->wait_event(kFar, -1).id, 2u);
  ASSERT_EQ(recorder->shown().size(), 2u);
  EXPECT_EQ(recorder->shown()[0].sequence, 1u);
}

TEST_F(VirtualDisplayTest, ADuplicatedEventArrivesTwice) {
  faults->fates[1] = EventFate::Duplicate;
  show(1);
  EXPECT_EQ(display->wait_event(kFar, -1).id, 1u);
  EXPECT_EQ(display->wait_event(kFar, -1).id, 1u);
  EXPECT_EQ(recorder->shown().size(), 1u);
}

TEST_F(VirtualDisplayTest, AnUnpluggedDisplayStaysLost) {
  faults->fates[1] = EventFate::Unplug;
  show(1);
  EXPECT_EQ(display->wait_event(kFar, -1).kind, EventKind::Lost);
  EXPECT_EQ(display->wait_event(kFar, -1).kind, EventKind::Lost);
  EXPECT_EQ(display->submit(display->acquire(), 2), SubmitStatus::Lost);
  EXPECT_FALSE(display->request_vblank(9));
}

TEST_F(VirtualDisplayTest, IsExactAfter400Days) {
  clock->advance(400 * hours(24) + milliseconds(1));
  show(1);
  const DisplayEvent event = display->wait_event(kFar, -1);
  EXPECT_EQ(event.sequence, uint64_t{400} * 24 * 3600 * 60 + 1);
  EXPECT_EQ(event.time, seconds(100) + 400 * hours(24) + Nanoseconds(16'666'666));
}

TEST(VirtualDisplayOpening, RefusesAbsurdOptions) {
  const auto expect_refusal = [](const VirtualDisplayOptions& options) {
    test::expect_error(test::error_of([&] { (void)open_virtual_display(options); }),
                       ErrorKind::Usage);
  };
  expect_refusal({.geometry = {.width = 0, .height = 5}});
  expect_refusal({.geometry = {.width = 5, .height = -1}});
  expect_refusal({.geometry = {.width = 32769, .height = 5}});
  expect_refusal({.geometry = kSmall, .buffers = 1});
  expect_refusal({.geometry = kSmall, .buffers = 17});
  expect_refusal({.geometry = {.width = 8, .height = 8, .format = frames::PixelFormat::Rgb10}});
}

/// Shows frames 0 ... `frames` - 1 as fast as the display accepts them.
void show_frames(Display& display, uint64_t frames) {
  for (uint64_t id = 0; id < frames;) {
    ScanoutBuffer* const buffer = display.acquire();
    if (buffer == nullptr) {
      (void)display.wait_event(display.now() + milliseconds(10), -1);
      continue;
    }
    buffer->fill(numbered_frame(kSmall, id).view());
    while (display.submit(buffer, id) == SubmitStatus::Busy)
      ASSERT_NE(display.wait_event(display.now() + seconds(10), -1).kind, EventKind::Lost);
    ++id;
  }
  while (display.wait_event(display.now() + seconds(10), -1).id != frames - 1) {
  }
}

TEST(VirtualDisplayInRealTime, SlowRecordingCountsEveryMissedFrame) {
  /// A recorder that finishes its first frame only after the playback.
  struct Stuck final : ScanoutRecorder {
    std::atomic<bool> stuck{true};
    std::atomic<uint64_t> recorded{0};
    void record(const ShownFrame&, const ScanoutView&) noexcept override {
      stuck.wait(true);
      ++recorded;
    }
    void finish() override {}
  };
  const auto recorder = std::make_shared<Stuck>();
  auto display =
      open_virtual_display({.geometry = kSmall, .refresh = {500, 1}, .recorder = recorder});
  constexpr uint64_t kFrames = 100;
  show_frames(*display, kFrames);
  EXPECT_EQ(recorder->skipped(), kFrames - 64) << "the queue to the disk is 64 long";
  recorder->stuck = false;
  recorder->stuck.notify_all();
  display.reset();
  EXPECT_EQ(recorder->recorded + recorder->skipped(), kFrames);
}

TEST(VirtualDisplayInRealTime, RecordsOnItsOwnThreadWithoutTearing) {
  const auto recorder = std::make_shared<RememberingRecorder>();
  auto display =
      open_virtual_display({.geometry = kSmall, .refresh = {500, 1}, .recorder = recorder});
  constexpr uint64_t kFrames = 100;
  show_frames(*display, kFrames);
  display.reset();
  const auto shown = recorder->shown();
  EXPECT_EQ(shown.size() + recorder->skipped(), kFrames);
  for (const test::DisplayedFrame& displayed : shown)
    EXPECT_EQ(displayed.checksum, test::checksum_of(numbered_frame(kSmall, displayed.id).view()));
}

}  // namespace
}  // namespace lenticule::display
