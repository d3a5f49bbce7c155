// SPDX-License-Identifier: Apache-2.0
// Tests long runs with random faults: each accepted frame is displayed and reported once, in order,
// and memory does not grow.
#include <random>

#include "tests/unit/kms/kms_stage.h"

namespace lenticule::test {

class KmsSoak : public KmsStage {
 protected:
  void disturb(std::mt19937& random) {
    const auto once_in = [&](unsigned n) { return random() % n == 0; };
    if (once_in(50)) card.event_faults = {EventFault::Lose};
    if (once_in(50)) card.event_faults = {EventFault::Duplicate};
    if (once_in(50)) card.event_faults = {EventFault::Late};
    if (once_in(50)) card.event_faults = {EventFault::Stale};
    if (once_in(60)) card.flip_faults = {{.count = static_cast<int>(random() % 9), .error = EBUSY}};
    if (once_in(300)) card.flip_faults = {{.error = EINVAL}};
    if (once_in(500)) machine.sleep(seconds(5));
    if (once_in(100)) machine.announce_hotplug();
    if (once_in(400)) card.object(connector->id).find("link-status")->value = 1;
    if (once_in(500)) hide_panel_for(seconds(random() % 5));
    if (once_in(500)) lose_master_for(seconds(random() % 5));
  }
  void hide_panel_for(Nanoseconds time) {
    connector->connected = false;
    machine.announce_hotplug();
    machine.at(machine.now() + time, [this] {
      connector->connected = true;
      machine.announce_hotplug();
    });
  }
  void lose_master_for(Nanoseconds time) {
    card.foreign_master = true;
    machine.at(machine.now() + time, [this] { card.foreign_master = false; });
  }
  void submit_with_retries(unsigned seed) {
    for (int i = 0; i < 1000; ++i) {
      const SubmitStatus status = submit(seed);
      if (status == SubmitStatus::Accepted) return;
      ASSERT_EQ(status, SubmitStatus::Paused);
      idle(milliseconds(50));
    }
    FAIL() << "never taken";
  }
};

TEST_F(KmsSoak, EveryFrameIsReportedOnceInOrderDespiteFaults) {
  std::mt19937 random(7);
  open();
  uint64_t last = 0;
  for (unsigned seed = 1; seed <= 20'000; ++seed) {
    disturb(random);
    submit_with_retries(seed);
    const DisplayEvent event = wait(seconds(60));
    ASSERT_EQ(event.kind, EventKind::Flip) << seed;
    ASSERT_EQ(event.id, seed);
    ASSERT_GT(event.sequence, last);
    last = event.sequence;
    ASSERT_EQ(card.displayed(crtc), words_of(make_frame(seed))) << seed;
    ASSERT_EQ(card.buffers.size(), 3U);
  }
  EXPECT_EQ(show->statistics().flips, 20'000U);
  EXPECT_GT(show->statistics().recoveries, 100U);
}

}  // namespace lenticule::test
