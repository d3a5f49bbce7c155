// SPDX-License-Identifier: Apache-2.0
// Tests the two threads beside the presenter: one fills buffers, the other probes panels.
#include <poll.h>

#include <atomic>
#include <thread>

#include "display/kms/scanout/panel_monitor.h"
#include "kms_stage.h"

namespace lenticule::test {

class KmsThreads : public KmsStage {
 protected:
  static bool readable_within(int fd, int timeout_ms) {
    pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
    return poll(&entry, 1, timeout_ms) == 1;
  }
};

TEST_F(KmsThreads, PanelIsProbedOnItsOwnThread) {
  const UniqueFd fd = options.session->open_device(card.path);
  const auto seen = display::read_connector(fd.get(), connector->id, display::Probe::Cached);
  ASSERT_TRUE(seen);
  {
    display::ConnectorProber prober(fd.get(), *seen, {seen->id}, options.platform->watch_hotplug(),
                                    display::make_monotonic_clock());
    for (int i = 0; i < 3; ++i) {
      machine.announce_hotplug();
      ASSERT_TRUE(readable_within(prober.fd(), 20'000));
      const auto event = prober.take_event();
      ASSERT_TRUE(event);
      EXPECT_TRUE(event->all_connected());
      EXPECT_FALSE(prober.take_event());
    }
    prober.request_probe();
    EXPECT_TRUE(readable_within(prober.fd(), 20'000));
  }
  EXPECT_GE(card.full_probes, 4);
  options.session->close_device(fd.get());
}

TEST_F(KmsThreads, FramesAreFilledOnAnotherThreadThanThePresenters) {
  constexpr unsigned kFrames = 300;
  open();
  std::atomic<display::ScanoutBuffer*> handed{nullptr};
  std::thread frame_copier([&] {
    for (unsigned seed = 1; seed <= kFrames; ++seed) {
      display::ScanoutBuffer* buffer = nullptr;
      while ((buffer = show->acquire()) == nullptr) std::this_thread::yield();
      const frames::WovenFrame frame = make_frame(seed);
      buffer->fill(frame.view());
      while (handed.load() != nullptr) std::this_thread::yield();
      handed.store(buffer);
    }
  });
  for (unsigned seed = 1; seed <= kFrames; ++seed) {
    display::ScanoutBuffer* buffer = nullptr;
    while ((buffer = handed.exchange(nullptr)) == nullptr) std::this_thread::yield();
    EXPECT_EQ(show->submit(buffer, seed), SubmitStatus::Accepted);
    EXPECT_EQ(wait().id, seed);
    EXPECT_EQ(show->statistics().flips, seed);
    if (seed % 100 == 0) expect_displayed(seed);
  }
  frame_copier.join();
}

}  // namespace lenticule::test
