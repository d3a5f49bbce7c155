// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a message between players in step, once as it arrives and once as if it had
// been made with the key. No value of an authentic message may break a follower or a leader.
#include "base/error.h"
#include "player/step/step_member.h"

namespace {

using namespace lenticule::player;
using std::chrono::nanoseconds;

StepIdentity identity() { return {.group = "fuzz", .key = StepKey(), .session = 1}; }

/// Gives the message to a member whose clock agrees with the sender's.
void receive(StepMember& member, const StepMessage& message) {
  const StepNow now{.monotonic = nanoseconds(1),
                    .group = message.sent + nanoseconds(1),
                    .stepped = message.stepped};
  (void)member.receive(StepKey().seal(message, "fuzz"), now);
  const StepPlace place{.started = 1, .next_frame = 5, .period_ns = 16'666'667, .loop_frames = 9};
  (void)member.tick(place, now);
  if (!member.timeline()) return;
  const StepTimeline& timeline = *member.timeline();
  const StepTimeline stated = timeline.stated_after(now.group);
  LENTICULE_CHECK(timeline.lateness(stated.frame, stated.due) <= nanoseconds{0});
  (void)timeline.lateness(place.next_frame, now.group);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span<const uint8_t> bytes(data, size);
  StepFollower follower(identity());
  (void)follower.receive(bytes, {});
  if (size != kStepMessageBytes) return 0;
  const auto message = read_step_fields(bytes);
  if (!message) return 0;
  const auto opened = StepKey().open(StepKey().seal(*message, "fuzz"), "fuzz");
  LENTICULE_CHECK(opened.message == message);
  receive(follower, *message);
  StepLeader leader(identity(), {});
  receive(leader, *message);
  return 0;
}
