// SPDX-License-Identifier: Apache-2.0
#include "player/sources/weaving_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "base/error.h"
#include "base/numbers.h"
#include "base/print.h"
#include "player/sources/pictures.h"

namespace lenticule::player {

using frames::PullStatus;

namespace {

/// Interval at which the trim is checked.
constexpr std::chrono::milliseconds kLook{100};
constexpr frames::Rate kStillRate{4, 1};
constexpr int kFewestSlots = 3;

}  // namespace

// --- weaving --------------------------------------------------------------------------------

frames::WeaveOptions weave_options(const WeavingFlags& flags) {
  frames::WeaveOptions options{.fit = frames::parse_picture_fit(flags.fit)};
  if (!flags.filter.empty()) options.filter = frames::parse_view_filter(flags.filter);
  return options;
}

std::optional<frames::Crosstalk> crosstalk_of(const std::string& text, const optics::Rig& rig,
                                              int views) {
  if (text.empty()) return std::nullopt;
  if (text == "spot") return frames::crosstalk_of_spot(rig.sheet.spot_sigma.value * views);
  const auto percent = number_from<double>(text);
  if (!percent)
    throw Error(ErrorKind::Usage, fmt::format("--crosstalk '{}': not a percentage", text),
                "for example --crosstalk 12, or --crosstalk spot");
  return frames::crosstalk_of_percent(*percent);
}

WeavingPipeline::WeavingPipeline(const optics::Rig& rig, const frames::ViewShape& shape,
                                 const WeavingFlags& flags, int threads)
    : weaver_(std::make_shared<const frames::WeavePlan>(optics::OpticalModel(rig), shape,
                                                        weave_options(flags), threads),
              threads),
      crosstalk_(crosstalk_of(flags.crosstalk, rig, shape.count)) {}

void WeavingPipeline::weave(const frames::ViewSet& views, frames::WovenFrame& frame) {
  if (crosstalk_)
    weaver_.weave(frames::compensate(views, *crosstalk_), frame);
  else
    weaver_.weave(views, frame);
}

// --- begin and end --------------------------------------------------------------------------

WeavingSource::WeavingSource(std::unique_ptr<frames::ViewInput> input,
                             const WeavingSourceOptions& options)
    : options_(options),
      input_(std::move(input)),
      still_(input_->frame_count() == uint64_t{1}),
      rate_(still_ ? std::optional(kStillRate) : input_->rate()),
      slots_(static_cast<size_t>(std::max(options.pool_frames, kFewestSlots))),
      count_(input_->frame_count()) {
  options_.rig->look();
  rig_version_ = options_.rig->version();
  const optics::Rig rig = options_.rig->rig();
  geometry_ = {.width = rig.panel.width_px, .height = rig.panel.height_px};
  pipeline_ = pipeline_for(rig);
  plans_ = 1;
  for (Slot& slot : slots_) slot.frame = frames::WovenFrame(geometry_);
  if (still_) weave_first_still();
  worker_ = std::thread([this] { work(); });
  watcher_ = std::thread([this] { watch(); });
}

WeavingSource::~WeavingSource() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  watcher_.join();
  worker_.join();
}

void WeavingSource::weave_first_still() {
  await_first(*input_, options_.name);
  Slot& first = slots_.front();
  pipeline_->weave(input_->views(), first.frame);
  first.state = SlotState::Ready;
  round_ends_ = {1};
}

std::shared_ptr<WeavingPipeline> WeavingSource::pipeline_for(const optics::Rig& rig) const {
  return std::make_shared<WeavingPipeline>(rig, input_->shape(), options_.weaving,
                                           options_.threads);
}

// --- watcher --------------------------------------------------------------------------------

/// Makes new plans beside the weaving, with as many threads: a plan is small work for a few of
/// them.
void WeavingSource::watch() noexcept {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, kLook, [&] { return stopping_; })) return;
    }
    try {
      look_at_rig();
    } catch (const std::exception& error) {
      say("{}: still woven for the previous rig: {}\n", options_.rig->file().string(),
          error.what());
    }
  }
}

void WeavingSource::look_at_rig() {
  LiveRig& rig = *options_.rig;
  rig.look();
  const uint64_t version = rig.version();
  if (version == rig_version_) return;
  rig_version_ = version;
  std::shared_ptr<WeavingPipeline> pipeline = pipeline_for(rig.rig());
  {
    const std::lock_guard lock(mutex_);
    pipeline_.swap(pipeline);
    ++plans_;
  }
  changed_.notify_all();
}

// --- worker ---------------------------------------------------------------------------------

std::shared_ptr<WeavingPipeline> WeavingSource::newest_pipeline() {
  const std::lock_guard lock(mutex_);
  return pipeline_;
}

void WeavingSource::wait_a_moment() {
  std::unique_lock lock(mutex_);
  if (!stopping_) changed_.wait_for(lock, kLook);
}

void WeavingSource::work() noexcept {
  std::shared_ptr<WeavingPipeline> used = newest_pipeline();
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_ || !failure_.empty()) return;
    }
    try {
      const bool done = still_ ? weave_still(used) : weave_next();
      if (!done) wait_a_moment();
    } catch (const std::exception& error) {
      fail(error.what());
    }
  }
}

void WeavingSource::fail(const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    failure_ = why;
  }
  wake_.signal();
}

WeavingSource::Slot* WeavingSource::free_slot() {
  const std::lock_guard lock(mutex_);
  for (Slot& slot : slots_) {
    if (slot.state != SlotState::Free) continue;
    slot.state = SlotState::Weaving;
    return &slot;
  }
  return nullptr;
}

void WeavingSource::give_back(Slot& slot) {
  const std::lock_guard lock(mutex_);
  slot.state = SlotState::Free;
}

/// Returns false if there is nothing to do.
bool WeavingSource::weave_still(std::shared_ptr<WeavingPipeline>& used) {
  const std::shared_ptr<WeavingPipeline> newest = newest_pipeline();
  if (newest == used) return false;
  Slot* const slot = free_slot();
  if (slot == nullptr) return false;
  newest->weave(input_->views(), slot->frame);
  publish_still(*slot);
  used = newest;
  return true;
}

/// Publishes a still. The previous slot becomes free when its last frame is released.
void WeavingSource::publish_still(Slot& slot) {
  const std::lock_guard lock(mutex_);
  for (Slot& other : slots_)
    if (other.state == SlotState::Ready)
      other.state = other.acquired > 0 ? SlotState::Stale : SlotState::Free;
  slot.state = SlotState::Ready;
}

void WeavingSource::publish(Slot& slot) {
  {
    const std::lock_guard lock(mutex_);
    slot.state = SlotState::Ready;
    slot.ticket = next_weave_++;
    slot.number = input_->number();
  }
  wake_.signal();
}

/// Returns false if no slot is free, or the next round is not requested yet.
bool WeavingSource::weave_next() {
  if (at_end_) {
    {
      const std::lock_guard lock(mutex_);
      nothing_to_do_ = !options_.plays_again && rounds_wanted_ <= rounds_woven_;
      if (nothing_to_do_) return false;
    }
    if (!input_->rewind()) throw Error(ErrorKind::Failed, options_.name + ": cannot be restarted");
    at_end_ = false;
  }
  Slot* const slot = free_slot();
  if (slot == nullptr) return false;
  PullStatus status = PullStatus::Failed;
  try {
    status = input_->next();
    if (status == PullStatus::Ready) newest_pipeline()->weave(input_->views(), slot->frame);
  } catch (...) {
    give_back(*slot);
    throw;
  }
  if (status == PullStatus::Ready) {
    publish(*slot);
    input_->release();
    return true;
  }
  give_back(*slot);
  if (status == PullStatus::Failed) fail(input_->failure());
  if (status == PullStatus::End) finish_round();
  if (status == PullStatus::NotYet) input_->wait(kLook);
  return true;
}

void WeavingSource::finish_round() {
  {
    const std::lock_guard lock(mutex_);
    at_end_ = true;
    ++rounds_woven_;
    const bool empty = next_weave_ == (round_ends_.empty() ? round_begin_ : round_ends_.back());
    if (empty) failure_ = options_.name + ": has no frames";
    round_ends_.push_back(next_weave_);
    if (!count_) count_ = next_weave_ - round_begin_;
  }
  wake_.signal();
}

// --- player ---------------------------------------------------------------------------------

std::optional<uint64_t> WeavingSource::frame_count() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

WeavingSource::Slot* WeavingSource::ready_slot(uint64_t ticket) {
  for (Slot& slot : slots_)
    if (slot.state == SlotState::Ready && (still_ || slot.ticket == ticket)) return &slot;
  return nullptr;
}

PullStatus WeavingSource::pull(frames::AcquiredFrame& out) {
  const std::lock_guard lock(mutex_);
  if (!round_ends_.empty() && next_pull_ == round_ends_.front() && failure_.empty())
    return PullStatus::End;
  Slot* const slot = ready_slot(next_pull_);
  if (slot == nullptr) return failure_.empty() ? PullStatus::NotYet : PullStatus::Failed;
  if (!still_) slot->state = SlotState::Acquired;
  ++slot->acquired;
  out = {.frame = slot->frame.view(),
         .number = slot->number,
         .token = static_cast<uint64_t>(slot - slots_.data())};
  ++next_pull_;
  return PullStatus::Ready;
}

void WeavingSource::release(uint64_t token) {
  {
    const std::lock_guard lock(mutex_);
    LENTICULE_CHECK(token < slots_.size() && slots_[token].acquired > 0);
    Slot& slot = slots_[token];
    if (--slot.acquired == 0 && slot.state != SlotState::Ready) slot.state = SlotState::Free;
  }
  changed_.notify_all();
}

/// Returns how many frames may be borrowed. The worker keeps one slot of a sequence; all frames of
/// a still share a slot.
int WeavingSource::max_acquired() const {
  return still_ ? 1'000'000 : static_cast<int>(slots_.size()) - 1;
}

uint64_t WeavingSource::ready_count() const {
  const std::lock_guard lock(mutex_);
  if (still_) return next_pull_ < round_ends_.front() ? 1 : 0;
  return static_cast<uint64_t>(std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.state == SlotState::Ready;
  }));
}

bool WeavingSource::saturated() const {
  if (still_) return true;
  const std::lock_guard lock(mutex_);
  if (!failure_.empty() || nothing_to_do_) return true;
  return std::none_of(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.state == SlotState::Free || slot.state == SlotState::Weaving;
  });
}

bool WeavingSource::rewind() {
  {
    const std::lock_guard lock(mutex_);
    const bool at_end = !round_ends_.empty() && next_pull_ == round_ends_.front();
    if (!at_end) return next_pull_ == round_begin_;
    round_begin_ = round_ends_.front();
    round_ends_.pop_front();
    if (still_) round_ends_.push_back(round_begin_ + 1);
    ++rounds_wanted_;
    nothing_to_do_ = false;
  }
  changed_.notify_all();
  return true;
}

std::string WeavingSource::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

}  // namespace lenticule::player
