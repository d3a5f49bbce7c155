// SPDX-License-Identifier: Apache-2.0
// Runs a player on a fake card, from the source to the panel, in simulated time.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "player/playback/playback.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/unit/kms/kms_stage.h"

namespace lenticule::test {

/// A displayed frame, and whether its pixels were correct.
struct Shown {
  uint64_t id = 0;
  bool right = false;
  friend bool operator==(const Shown&, const Shown&) = default;
};

/// Forwards every call, and reads the scan-out buffer whenever a flip is reported.
class WatchedDisplay final : public display::Display {
 public:
  WatchedDisplay(display::Display& inner, std::function<void(uint64_t)> on_flip)
      : inner_(inner), on_flip_(std::move(on_flip)) {}
  const display::DisplayMode& mode() const override { return inner_.mode(); }
  display::ScanoutBuffer* acquire() override { return inner_.acquire(); }
  void discard(display::ScanoutBuffer* buffer) override { inner_.discard(buffer); }
  display::SubmitStatus submit(display::ScanoutBuffer* buffer, uint64_t id) noexcept override {
    return inner_.submit(buffer, id);
  }
  bool request_vblank(uint64_t sequence) noexcept override {
    return inner_.request_vblank(sequence);
  }
  DisplayEvent wait_event(Nanoseconds deadline, int wake_fd) noexcept override {
    const DisplayEvent event = inner_.wait_event(deadline, wake_fd);
    if (event.kind == EventKind::Flip) on_flip_(event.id);
    return event;
  }
  bool set_power(bool on) noexcept override { return inner_.set_power(on); }
  Nanoseconds now() const noexcept override { return inner_.now(); }

 private:
  display::Display& inner_;
  std::function<void(uint64_t)> on_flip_;
};

class PanelFixture : public KmsStage {
 protected:
  PanelFixture() {
    script.geometry = kPanel;
    script.clock = machine.clock();
    playing.source_name = "fake";
    playing.filling = player::Filling::InPresenter;
  }

  /// Opens the display if necessary and plays the script on it.
  player::PlayResult play_script() {
    if (!show) open();
    test::FakeSource source(script);
    WatchedDisplay watched(*show, [this](uint64_t id) { look(id); });
    player::PlayResult result = player::play(watched, source, playing);
    EXPECT_EQ(source.acquired(), 0u) << "frames were not given back";
    const player::PaceCounts& pace = result.report.pace;
    EXPECT_EQ(pace.vblanks, pace.shown + pace.repeated_planned + pace.repeated_underrun +
                                pace.missed + pace.held);
    return result;
  }

  /// Returns the numbers of the displayed frames, in order; fails if the pixels of one were wrong.
  [[nodiscard]] std::vector<uint64_t> ids() const {
    std::vector<uint64_t> result;
    for (const Shown& s : shown) {
      EXPECT_TRUE(s.right) << "frame " << s.id;
      result.push_back(s.id);
    }
    return result;
  }

  test::FakeSourceScript script;
  player::PlaybackOptions playing;
  std::function<void(uint64_t)> on_shown;
  std::vector<Shown> shown;

 private:
  void look(uint64_t id) {
    const frames::WovenFrame frame = test::numbered_frame(kPanel, id % script.frames);
    shown.push_back({id, card.displayed(crtc) == words_of(frame)});
    if (on_shown) on_shown(id);
  }
};

}  // namespace lenticule::test
