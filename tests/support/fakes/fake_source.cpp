// SPDX-License-Identifier: Apache-2.0
#include "tests/support/fakes/fake_source.h"

#include <xxhash.h>

#include <utility>

namespace lenticule::test {

using frames::PullStatus;

frames::WovenFrame numbered_frame(frames::FrameGeometry geometry, uint64_t number) {
  frames::WovenFrame frame(geometry);
  uint64_t state = number * 0x9E3779B97F4A7C15u + 1;
  for (uint8_t& byte : frame.bytes()) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    byte = static_cast<uint8_t>(state >> 56);
  }
  return frame;
}

uint64_t checksum_of(const frames::FrameView& frame) {
  return XXH64(frame.bytes.data(), frame.bytes.size(), 0);
}

FakeSource::FakeSource(FakeSourceScript script) : script_(std::move(script)) {
  for (uint64_t k = 0; k < script_.frames; ++k)
    pixels_.push_back(numbered_frame(script_.geometry, k));
}

bool FakeSource::next_is_ready() const {
  return !script_.ready_at || script_.clock->now() >= script_.ready_at(pulled_);
}

PullStatus FakeSource::pull(frames::AcquiredFrame& out) {
  if (script_.fails_after && pulled_ >= *script_.fails_after) return PullStatus::Failed;
  if (position_ == script_.frames) return PullStatus::End;
  if (!next_is_ready()) return PullStatus::NotYet;
  out = {.frame = pixels_[position_].view(), .number = position_, .token = pulled_};
  ++position_;
  ++pulled_;
  ++acquired_;
  return PullStatus::Ready;
}

void FakeSource::release(uint64_t token) {
  (void)token;
  --acquired_;
}

bool FakeSource::rewind() {
  if (!script_.can_rewind || position_ != script_.frames) return false;
  position_ = 0;
  return true;
}

void RememberingRecorder::record(const display::ShownFrame& shown,
                                 const display::ScanoutView& scanout) noexcept {
  frames::WovenFrame frame(scanout.geometry);
  for (int j = 0; j < scanout.geometry.height; ++j)
    for (int i = 0; i < scanout.geometry.width; ++i) {
      const uint32_t word = scanout.row(j)[i];
      const int bits = display::bits_of(scanout.depth);
      for (int c = 0; c < 3; ++c)  // the upper eight bits of each colour
        frame.row(j)[3 * i + c] = static_cast<uint8_t>(word >> ((2 - c) * bits + bits - 8));
    }
  const std::lock_guard lock(mutex_);
  shown_.push_back({shown.sequence, shown.id, checksum_of(frame.view())});
}

std::vector<DisplayedFrame> RememberingRecorder::shown() const {
  const std::lock_guard lock(mutex_);
  return shown_;
}

}  // namespace lenticule::test
