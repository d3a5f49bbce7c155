// SPDX-License-Identifier: Apache-2.0
// Provides one fake card with one panel and a display on it for most tests.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "base/error.h"
#include "display/kms/scanout/kms_display.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_drm.h"

namespace lenticule::test {

using display::DisplayEvent;
using display::EventKind;
using display::SubmitStatus;
using std::chrono::milliseconds;
using std::chrono::seconds;

inline constexpr int kWidth = 24;
inline constexpr int kHeight = 6;
inline constexpr frames::FrameGeometry kPanel{kWidth, kHeight, frames::PixelFormat::Rgb8};

/// Returns a frame whose every subpixel depends on `seed`.
inline frames::WovenFrame make_frame(unsigned seed) {
  frames::WovenFrame frame(kPanel);
  unsigned value = seed * 77 + 1;
  for (uint8_t& byte : frame.bytes()) {
    byte = static_cast<uint8_t>(value >> 16);
    value = value * 1103515245U + 12345U;
  }
  return frame;
}

inline std::vector<uint32_t> words_of(const frames::WovenFrame& frame) {
  std::vector<uint32_t> words;
  const auto bytes = frame.bytes();
  for (size_t i = 0; i < bytes.size(); i += 3)
    words.push_back(static_cast<uint32_t>(bytes[i]) << 16 |
                    static_cast<uint32_t>(bytes[i + 1]) << 8 | bytes[i + 2]);
  return words;
}

class KmsStage : public ::testing::Test {
 protected:
  KmsStage() : card(machine.add_card()) {
    crtc = card.add_crtc();
    connector = &card.add_connector(DRM_MODE_CONNECTOR_HDMIA, 1, make_mode(kWidth, kHeight, 60),
                                    EdidMaker{.serial_text = "ONE"}.bytes());
    options.output.panel = kPanel;
    options.output.identity = {
        .manufacturer = "LGD", .product = 0x1234, .serial = "ONE", .edid_sha256 = {}};
    options.clock = machine.clock();
    options.session = machine.session();
    options.platform = machine.platform();
  }

  void open() { show = display::open_kms_display(options); }
  /// Returns the error with which the display cannot be opened.
  [[nodiscard]] Error failure() {
    return error_of([this] { open(); });
  }

  [[nodiscard]] SubmitStatus submit(unsigned seed) {
    display::ScanoutBuffer* buffer = show->acquire();
    EXPECT_NE(buffer, nullptr);
    if (buffer == nullptr) return SubmitStatus::Lost;
    const frames::WovenFrame frame = make_frame(seed);
    buffer->fill(frame.view());
    const SubmitStatus status = show->submit(buffer, seed);
    if (status != SubmitStatus::Accepted) show->discard(buffer);
    return status;
  }
  [[nodiscard]] DisplayEvent wait(Nanoseconds time = milliseconds(100)) {
    return show->wait_event(machine.now() + time, -1);
  }
  /// Submits and waits for the flip.
  DisplayEvent flip(unsigned seed, Nanoseconds timeout = seconds(5)) {
    EXPECT_EQ(submit(seed), SubmitStatus::Accepted);
    const DisplayEvent event = wait(timeout);
    EXPECT_EQ(event.kind, EventKind::Flip);
    EXPECT_EQ(event.id, seed);
    return event;
  }
  /// Plays one frame, then dies; returns the state for the next player.
  std::shared_ptr<display::PreviousOutput> die_after(unsigned seed) {
    options.exit = display::ExitPolicy::Hold;
    open();
    flip(seed);
    auto left = std::make_shared<display::PreviousOutput>();
    left->state = show->takeover_state();
    // The same open file has another number, as in systemd's descriptor store.
    const int old_fd = show->card_fd();
    left->card = UniqueFd(fcntl(old_fd, F_DUPFD_CLOEXEC, 0));
    const int ours = card.ends.at(old_fd);
    card.ends.erase(old_fd);
    card.ends[left->card.get()] = ours;
    card.master_fd = left->card.get();
    show.reset();
    card.modesets = card.blocking_commits = 0;
    return left;
  }
  void expect_displayed(unsigned seed) {
    EXPECT_EQ(card.displayed(crtc), words_of(make_frame(seed)));
  }
  /// Advances time without submitting frames.
  void idle(Nanoseconds time) {
    const Nanoseconds until = machine.now() + time;
    while (machine.now() < until && show->wait_event(until, -1).kind != EventKind::Lost) {
    }
  }

  /// Plugs a cable in or out, and expects the state that the display then reports.
  void plug(FakeConnector& cable, bool connected) {
    cable.connected = connected;
    machine.announce_hotplug();
    idle(seconds(1));
    EXPECT_EQ(show->statistics().panel,
              connected ? display::PanelState::Showing : display::PanelState::Disconnected);
  }

  FakeDrm machine;
  FakeCard& card;
  uint32_t crtc = 0;
  FakeConnector* connector = nullptr;
  display::KmsOptions options;
  std::unique_ptr<display::KmsDisplay> show;
};

}  // namespace lenticule::test
