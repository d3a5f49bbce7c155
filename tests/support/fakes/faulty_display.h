// SPDX-License-Identifier: Apache-2.0
// A virtual display with the faults that real displays have, and a script of them, vblank by
// vblank.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "display/virtual/virtual_display.h"

namespace lenticule::test {

enum class EventFate {
  Deliver,
  Drop,       ///< the flip happens, without an event
  Duplicate,  ///< the event is delivered twice
  Unplug,     ///< the display is lost from this event on
};

/// Asked once per event when it is planned, on the presenter thread. The defaults describe a
/// perfect display.
class VirtualFaults {
 public:
  virtual ~VirtualFaults() = default;
  [[nodiscard]] virtual display::Nanoseconds event_delay(uint64_t /*sequence*/) noexcept {
    return display::Nanoseconds{0};
  }
  [[nodiscard]] virtual EventFate fate(uint64_t /*sequence*/) noexcept {
    return EventFate::Deliver;
  }
};

class ScriptedFaults final : public VirtualFaults {
 public:
  std::map<uint64_t, display::Nanoseconds> delays;
  std::map<uint64_t, EventFate> fates;
  EventFate otherwise = EventFate::Deliver;

  [[nodiscard]] display::Nanoseconds event_delay(uint64_t sequence) noexcept override {
    const auto found = delays.find(sequence);
    return found == delays.end() ? display::Nanoseconds{0} : found->second;
  }
  [[nodiscard]] EventFate fate(uint64_t sequence) noexcept override {
    const auto found = fates.find(sequence);
    return found == fates.end() ? otherwise : found->second;
  }
};

class FaultyDisplay final : public display::Display {
 public:
  FaultyDisplay(display::VirtualDisplayOptions options, std::shared_ptr<VirtualFaults> faults)
      : faults_(std::move(faults)) {
    options.event_delay = [this](uint64_t sequence) {
      const display::Nanoseconds delay = faults_->event_delay(sequence);
      // A flip and a tick at one vblank are delivered in this order or in the other one.
      if (const EventFate fate = faults_->fate(sequence); fate != EventFate::Deliver)
        fates_[sequence] = fate;
      return delay;
    };
    inner_ = display::open_virtual_display(options);
  }
  [[nodiscard]] const display::DisplayMode& mode() const override { return inner_->mode(); }
  [[nodiscard]] display::ScanoutBuffer* acquire() override { return inner_->acquire(); }
  void discard(display::ScanoutBuffer* buffer) override { inner_->discard(buffer); }
  [[nodiscard]] display::SubmitStatus submit(display::ScanoutBuffer* buffer,
                                             uint64_t id) noexcept override {
    return unplugged_ ? display::SubmitStatus::Lost : inner_->submit(buffer, id);
  }
  [[nodiscard]] bool request_vblank(uint64_t sequence) noexcept override {
    return !unplugged_ && inner_->request_vblank(sequence);
  }
  [[nodiscard]] display::DisplayEvent wait_event(display::Nanoseconds deadline,
                                                 int wake_fd) noexcept override {
    if (repeat_) return *std::exchange(repeat_, std::nullopt);
    while (!unplugged_) {
      const display::DisplayEvent event = inner_->wait_event(deadline, wake_fd);
      const auto fate = fates_.find(event.sequence);
      if (event.kind == display::EventKind::Timeout || fate == fates_.end()) return event;
      if (fate->second == EventFate::Duplicate) return *(repeat_ = event);
      unplugged_ = fate->second == EventFate::Unplug;
    }
    return {.kind = display::EventKind::Lost};
  }
  [[nodiscard]] bool set_power(bool on) noexcept override { return inner_->set_power(on); }
  [[nodiscard]] display::Nanoseconds now() const noexcept override { return inner_->now(); }

 private:
  std::shared_ptr<VirtualFaults> faults_;
  std::map<uint64_t, EventFate> fates_;  ///< of planned vblanks whose events have a fault
  std::optional<display::DisplayEvent> repeat_;
  bool unplugged_ = false;
  std::unique_ptr<display::Display> inner_;
};

/// Opens a virtual display with faults; null = none.
[[nodiscard]] inline std::unique_ptr<display::Display> open_virtual_display(
    display::VirtualDisplayOptions options, std::shared_ptr<VirtualFaults> faults) {
  if (faults == nullptr) return display::open_virtual_display(options);
  return std::make_unique<FaultyDisplay>(std::move(options), std::move(faults));
}

}  // namespace lenticule::test
