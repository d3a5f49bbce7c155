// SPDX-License-Identifier: Apache-2.0
#include "player/quilt_source.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <utility>

#include "optics/error.h"

namespace lenticule::player {

using frames::FastWeaver;
using frames::PullStatus;
using frames::ViewSet;

namespace {

/// How soon a new trim is noticed.
constexpr std::chrono::milliseconds kLook{100};
constexpr frames::Rate kStillRate{4, 1};
constexpr int kFewestSlots = 3;

frames::ViewShape shape_of_quilts(const frames::ImageSequence& quilts,
                                  const frames::QuiltLayout& layout) {
  const frames::WovenFrame like(quilts.geometry());
  return frames::shape_of(ViewSet::borrow(like.view(), layout));
}

}  // namespace

QuiltSource::QuiltSource(ViewSet still, const QuiltSourceOptions& options)
    : options_(options), still_(std::move(still)), rig_(options.rig_file) {
  start(frames::shape_of(*still_));
  Slot& first = slots_.front();
  weaver_->weave(*still_, first.frame);
  first.state = SlotState::Ready;
  worker_ = std::thread([this] { work(); });
  watcher_ = std::thread([this] { watch(); });
}

QuiltSource::QuiltSource(std::vector<std::filesystem::path> quilts,
                         const frames::QuiltLayout& layout, const QuiltSourceOptions& options)
    : options_(options),
      quilts_(std::make_unique<frames::ImageSequence>(
          std::move(quilts),
          frames::ImageSequenceOptions{
              .pool_frames = 3, .decoder_threads = options.decoder_threads, .rate = options.rate})),
      layout_(layout),
      rig_(options.rig_file) {
  count_ = quilts_->frame_count().value_or(1);
  start(shape_of_quilts(*quilts_, layout));
  worker_ = std::thread([this] { work(); });
  watcher_ = std::thread([this] { watch(); });
}

QuiltSource::~QuiltSource() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  watcher_.join();
  worker_.join();
}

void QuiltSource::start(const frames::ViewShape& shape) {
  shape_ = shape;
  round_end_ = count_;
  const std::optional<optics::Rig> rig = rig_.changed();
  if (!rig) throw Error(ErrorKind::Input, rig_.complaint());
  geometry_ = {.width = rig->panel.width_px, .height = rig->panel.height_px};
  weaver_ = std::make_shared<FastWeaver>(plan_for(*rig), options_.weaving_threads);
  plans_ = 1;
  slots_.resize(static_cast<size_t>(std::max(options_.pool_frames, kFewestSlots)));
  for (Slot& slot : slots_) slot.frame = frames::WovenFrame(geometry_);
}

std::shared_ptr<const frames::WeavePlan> QuiltSource::plan_for(const optics::Rig& rig) const {
  return std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig), shape_,
                                                   options_.weave);
}

// --- the watcher ----------------------------------------------------------------------------

/// A plan takes most of a second: it is made beside the weaving, in one thread.
void QuiltSource::watch() noexcept {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, kLook, [&] { return stopping_; })) return;
    }
    try {
      const std::optional<optics::Rig> rig = rig_.changed();
      if (!rig) {
        tell_complaint();
        continue;
      }
      const frames::FrameGeometry panel{.width = rig->panel.width_px,
                                        .height = rig->panel.height_px};
      if (panel != geometry_) {
        fmt::print(stderr, "{}: the panel became another one: still woven for the old\n",
                   options_.rig_file);
        continue;
      }
      auto weaver = std::make_shared<FastWeaver>(plan_for(*rig), options_.weaving_threads);
      const std::lock_guard lock(mutex_);
      weaver_ = std::move(weaver);
      ++plans_;
    } catch (const std::exception& error) {
      fmt::print(stderr, "{}: still woven for the old rig: {}\n", options_.rig_file, error.what());
    }
    changed_.notify_all();
  }
}

/// Once per change.
void QuiltSource::tell_complaint() {
  if (told_ == rig_.complaint()) return;
  told_ = rig_.complaint();
  if (!told_.empty()) fmt::print(stderr, "still woven for the old rig: {}\n", told_);
}

// --- the worker -----------------------------------------------------------------------------

std::shared_ptr<FastWeaver> QuiltSource::newest_weaver() {
  const std::lock_guard lock(mutex_);
  return weaver_;
}

void QuiltSource::wait_a_moment() {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kLook);
}

void QuiltSource::work() noexcept {
  std::shared_ptr<FastWeaver> used = newest_weaver();
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_ || !failure_.empty()) return;
    }
    try {
      const bool done = still_ ? weave_still(used) : weave_next(newest_weaver());
      if (!done) wait_a_moment();
    } catch (const std::exception& error) {
      fail(error.what());
    }
  }
}

void QuiltSource::fail(const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    failure_ = why;
  }
  wake_.signal();
}

QuiltSource::Slot* QuiltSource::free_slot() {
  const std::lock_guard lock(mutex_);
  for (Slot& slot : slots_) {
    if (slot.state != SlotState::Free) continue;
    slot.state = SlotState::Weaving;
    return &slot;
  }
  return nullptr;
}

/// False if there is nothing to do.
bool QuiltSource::weave_still(std::shared_ptr<FastWeaver>& used) {
  const std::shared_ptr<FastWeaver> newest = newest_weaver();
  if (newest == used) return false;
  Slot* const slot = free_slot();
  if (slot == nullptr) return false;
  newest->weave(*still_, slot->frame);
  publish_still(*slot);
  used = newest;
  return true;
}

/// The slot that was shown so far is free when its last loan is back.
void QuiltSource::publish_still(Slot& slot) {
  const std::lock_guard lock(mutex_);
  for (Slot& other : slots_)
    if (other.state == SlotState::Ready)
      other.state = other.lent > 0 ? SlotState::Stale : SlotState::Free;
  slot.state = SlotState::Ready;
}

/// False if no slot is free.
bool QuiltSource::weave_next(const std::shared_ptr<FastWeaver>& weaver) {
  Slot* const slot = free_slot();
  if (slot == nullptr) return false;
  frames::LentFrame quilt;
  PullStatus status = quilts_->pull(quilt);
  if (status == PullStatus::End && quilts_->rewind()) status = quilts_->pull(quilt);
  const bool got = status == PullStatus::Ready;
  if (got) {
    weaver->weave(ViewSet::borrow(quilt.frame, layout_), slot->frame);
    quilts_->release(quilt.token);
  }
  {
    const std::lock_guard lock(mutex_);
    slot->state = got ? SlotState::Ready : SlotState::Free;
    if (got) slot->ticket = next_weave_++;
  }
  if (status == PullStatus::Failed) fail(quilts_->failure());
  if (got) wake_.signal();
  if (status == PullStatus::NotYet) wait_for_quilt();
  return status != PullStatus::End;
}

/// Until one is decoded, but not for ever.
void QuiltSource::wait_for_quilt() {
  pollfd decoded{.fd = quilts_->wake_fd(), .events = POLLIN, .revents = 0};
  (void)poll(&decoded, 1, static_cast<int>(kLook.count()));
  quilts_->service();
}

// --- the player -----------------------------------------------------------------------------

std::optional<frames::Rate> QuiltSource::rate() const {
  return still_ ? std::optional(kStillRate) : options_.rate;
}

QuiltSource::Slot* QuiltSource::ready_slot(uint64_t ticket) {
  for (Slot& slot : slots_)
    if (slot.state == SlotState::Ready && (still_ || slot.ticket == ticket)) return &slot;
  return nullptr;
}

PullStatus QuiltSource::pull(frames::LentFrame& out) {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_end_) return PullStatus::End;
  Slot* const slot = ready_slot(next_pull_);
  if (slot == nullptr) return failure_.empty() ? PullStatus::NotYet : PullStatus::Failed;
  if (!still_) slot->state = SlotState::Lent;
  ++slot->lent;
  out = {.frame = slot->frame.view(),
         .number = next_pull_ % count_,
         .token = static_cast<uint64_t>(slot - slots_.data())};
  ++next_pull_;
  return PullStatus::Ready;
}

void QuiltSource::release(uint64_t token) {
  {
    const std::lock_guard lock(mutex_);
    LENTICULE_CHECK(token < slots_.size() && slots_[token].lent > 0);
    Slot& slot = slots_[token];
    if (--slot.lent == 0 && slot.state != SlotState::Ready) slot.state = SlotState::Free;
  }
  changed_.notify_all();
}

/// The worker keeps one slot of a sequence; loans of a still share theirs.
int QuiltSource::max_lent() const {
  return still_ ? 1'000'000 : static_cast<int>(slots_.size()) - 1;
}

uint64_t QuiltSource::ready_count() const {
  const std::lock_guard lock(mutex_);
  if (still_) return next_pull_ < round_end_ ? 1 : 0;
  return static_cast<uint64_t>(std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.state == SlotState::Ready;
  }));
}

bool QuiltSource::saturated() const {
  if (still_) return true;
  const std::lock_guard lock(mutex_);
  return !failure_.empty() || std::none_of(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.state == SlotState::Free || slot.state == SlotState::Weaving;
  });
}

bool QuiltSource::rewind() {
  const std::lock_guard lock(mutex_);
  if (next_pull_ != round_end_) return next_pull_ + count_ == round_end_;
  round_end_ += count_;
  return true;
}

std::string QuiltSource::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

}  // namespace lenticule::player
