// SPDX-License-Identifier: Apache-2.0
#include "display/display_sink.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "display/virtual/virtual_display.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::display {
namespace {

using frames::ShowResult;
using std::chrono::milliseconds;
using std::chrono::seconds;
using test::EventFate;
using test::VirtualFaults;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 4};

/// A fault that drops every flip event.
class Deaf final : public VirtualFaults {
 public:
  EventFate what = EventFate::Drop;
  [[nodiscard]] EventFate fate(uint64_t) noexcept override { return what; }
};

class DisplaySinkTest : public testing::Test {
 protected:
  std::shared_ptr<SimulatedClock> clock = std::make_shared<SimulatedClock>();
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();

  [[nodiscard]] std::unique_ptr<Display> open(std::shared_ptr<VirtualFaults> faults) const {
    return test::open_virtual_display({.geometry = kSmall, .clock = clock, .recorder = recorder},
                                      std::move(faults));
  }
};

TEST_F(DisplaySinkTest, ReturnsWhenTheFrameIsDisplayed) {
  const auto display = open(nullptr);
  DisplaySink sink(*display);
  for (uint64_t k = 0; k < 20; ++k) {
    const frames::WovenFrame frame = test::numbered_frame(kSmall, k);
    ASSERT_EQ(sink.show(frame.view(), seconds(1)), ShowResult::Shown);
    ASSERT_EQ(recorder->shown().size(), k + 1);
    EXPECT_EQ(recorder->shown().back().checksum, test::checksum_of(frame.view()));
  }
}

TEST_F(DisplaySinkTest, TimesOutAndStaysUsable) {
  const auto deaf = std::make_shared<Deaf>();
  const auto display = open(deaf);
  DisplaySink sink(*display);
  const frames::WovenFrame frame = test::numbered_frame(kSmall, 0);
  EXPECT_EQ(sink.show(frame.view(), milliseconds(100)), ShowResult::TimedOut);
  EXPECT_EQ(clock->now(), milliseconds(100));
  deaf->what = EventFate::Deliver;
  for (int k = 0; k < 5; ++k) EXPECT_EQ(sink.show(frame.view(), seconds(1)), ShowResult::Shown);
}

TEST_F(DisplaySinkTest, ReportsALostDisplay) {
  const auto gone = std::make_shared<Deaf>();
  gone->what = EventFate::Unplug;
  const auto display = open(gone);
  DisplaySink sink(*display);
  const frames::WovenFrame frame = test::numbered_frame(kSmall, 0);
  EXPECT_EQ(sink.show(frame.view(), seconds(1)), ShowResult::Lost);
  EXPECT_EQ(sink.show(frame.view(), seconds(1)), ShowResult::Lost);
}

TEST_F(DisplaySinkTest, RefusesFramesOfAnotherSize) {
  const auto display = open(nullptr);
  DisplaySink sink(*display);
  const frames::WovenFrame frame({.width = 8, .height = 4});
  EXPECT_THROW((void)sink.show(frame.view(), seconds(1)), Error);
}

}  // namespace
}  // namespace lenticule::display
