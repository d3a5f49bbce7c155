// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/pending_flip.h"

namespace lenticule::display {
namespace {

constexpr int kRefusalsBeforeStuck = 5;

}  // namespace

void PendingFlip::queue(KmsBuffer* buffer, uint64_t id) noexcept {
  *this = PendingFlip{};
  phase_ = Phase::Queued;
  buffer_ = buffer;
  id_ = id;
  due_ = Nanoseconds{0};
}

void PendingFlip::arm(uint64_t serial, Nanoseconds patience_ends) noexcept {
  phase_ = Phase::Armed;
  serial_ = serial;
  due_ = patience_ends;
  refusals_ = 0;
}

void PendingFlip::put_off(Nanoseconds until) noexcept {
  phase_ = ++refusals_ > kRefusalsBeforeStuck ? Phase::Stuck : Phase::Queued;
  due_ = until;
}

void PendingFlip::stick(Nanoseconds due) noexcept {
  if (!under_way()) return;
  phase_ = Phase::Stuck;
  due_ = due;
}

void PendingFlip::land(Vblank vblank, Nanoseconds report_at) noexcept {
  phase_ = Phase::Landed;
  vblank_ = vblank;
  due_ = report_at;
}

PendingFlip::Landed PendingFlip::deliver() noexcept {
  const Landed landed{.buffer = buffer_, .id = id_, .vblank = vblank_};
  *this = PendingFlip{};
  return landed;
}

}  // namespace lenticule::display
