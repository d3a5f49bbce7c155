// SPDX-License-Identifier: Apache-2.0
#include "player/playback/frame_copier.h"

#include <poll.h>

#include <algorithm>
#include <exception>

#include "base/error.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

/// Longest sleep. It bounds the delay until a change is noticed that signals no descriptor.
constexpr milliseconds kNap{50};
constexpr milliseconds kNapWithoutDescriptor{2};

}  // namespace

bool FilledQueue::push(FilledFrame frame) noexcept {
  const size_t pushed = pushed_.load(std::memory_order_relaxed);
  if (pushed - popped_.load(std::memory_order_acquire) == kCapacity) return false;
  frames_[pushed % kCapacity] = frame;
  pushed_.store(pushed + 1);  // sequentially consistent with FrameCopier::waiting_
  return true;
}

const FilledFrame* FilledQueue::peek() const noexcept {
  const size_t popped = popped_.load(std::memory_order_relaxed);
  return pushed_.load() == popped ? nullptr : &frames_[popped % kCapacity];
}

FrameCopier::FrameCopier(frames::FrameSource& source, display::Display& display,
                         FrameCopierStatistics& statistics, const PlaybackOptions& options)
    : source_(source), display_(display), statistics_(statistics), options_(options) {}

FrameCopier::~FrameCopier() {
  if (buffer_ != nullptr) display_.discard(buffer_);
  for (; queue_.peek() != nullptr; queue_.pop()) display_.discard(queue_.peek()->buffer);
  while (kept_count_ > 0) release_oldest();
}

void FrameCopier::request_stop() noexcept {
  stopping_.store(true, std::memory_order_release);
  freed_.signal();
  copy_over_.notify_all();
}

void FrameCopier::forget_buffers() noexcept {
  buffer_ = nullptr;
  while (queue_.peek() != nullptr) queue_.pop();
}

uint64_t FrameCopier::begin_again() noexcept {
  stopping_.store(false, std::memory_order_release);
  timed_out_ = false;
  if (kept_count_ == 0) {
    skip_before(next_index_);
    return next_index_;
  }
  const KeptFrame& newest = kept_.at(kept_count_ - 1);
  skip_before(newest.index);
  display::ScanoutBuffer* const buffer = display_.acquire();
  if (buffer == nullptr) return next_index_;
  fill(*buffer, newest.acquired.frame);
  LENTICULE_CHECK(queue_.push({.buffer = buffer,
                               .index = newest.index,
                               .cut = source_.cut(),
                               .number = newest.acquired.number,
                               .item = newest.acquired.item,
                               .rate = source_.rate()}));
  return newest.index;
}

void FrameCopier::run() noexcept {
  Step result = Step::Worked;
  while (result != Step::Over && !stopping_.load(std::memory_order_acquire)) {
    const auto now = SteadyClock::now().time_since_epoch();
    statistics_.turn_ns.set(static_cast<uint64_t>(std::chrono::nanoseconds(now).count()));
    result = step();
    if (result != Step::Worked && result != Step::Over)
      wait_for_change(kNap, result == Step::NoBuffer);
  }
  statistics_.turn_ns.set(0);
}

void FrameCopier::pump(milliseconds timeout, bool until_primed) noexcept {
  const auto deadline = SteadyClock::now() + timeout;
  if (source_.wake_fd() >= 0) source_.service();
  while (!stopping_.load(std::memory_order_acquire)) {
    const Step result = step();
    if (result == Step::Worked) timed_out_ = false;
    const bool filled = result == Step::NoBuffer && (!until_primed || primed());
    if (filled || result == Step::Over) return;
    if (result == Step::Worked) continue;
    if (timed_out_ || source_.wake_fd() < 0) return;
    wait_for_change(kNap, false);
    timed_out_ = SteadyClock::now() >= deadline;
  }
}

FrameCopier::Step FrameCopier::step() noexcept {
  if (copy_wanted_.load(std::memory_order_acquire)) serve_copy();
  if (state() != State::Running) return Step::Over;
  try {
    follow_cut();
    const Step result = pull_next();
    look_at_source();
    return result;
  } catch (const std::exception& error) {
    return end(State::Failed, error.what());
  }
}

FrameCopier::Step FrameCopier::pull_next() {
  const bool wanted = next_index_ >= skip_before_.load(std::memory_order_relaxed);
  if (wanted && buffer_ == nullptr) buffer_ = display_.acquire();
  if (wanted && buffer_ == nullptr) return Step::NoBuffer;

  frames::AcquiredFrame acquired;
  switch (source_.pull(acquired)) {
    case frames::PullStatus::Ready:
      return take(acquired);
    case frames::PullStatus::NotYet:
      idle_.store(source_.nothing_due());
      statistics_.waits_for_others.set(source_.waits_for_others() ? 1 : 0);
      return Step::NoFrame;
    case frames::PullStatus::End:
      return begin_next_loop();
    case frames::PullStatus::Failed:
      break;
  }
  return end(State::Failed, source_.failure().c_str());
}

FrameCopier::Step FrameCopier::take(const frames::AcquiredFrame& acquired) {
  const bool fits = acquired.frame.geometry == display_.mode().geometry;
  const bool wanted = buffer_ != nullptr;
  if (fits && wanted) fill(*buffer_, acquired.frame);
  keep_or_release(acquired, fits && wanted);
  if (!fits) return end(State::Failed, "the source changed the size of its frames");

  follow_cut();
  idle_.store(false);
  between_sequences_.store(false);
  const uint64_t index = next_index_++;
  ++frames_this_loop_;
  statistics_.sample_ready(source_.ready_count());
  if (!wanted) {
    statistics_.released.add();
    return Step::Worked;
  }
  LENTICULE_CHECK(queue_.push({.buffer = buffer_,
                               .index = index,
                               .cut = cut(),
                               .number = acquired.number,
                               .item = acquired.item,
                               .rate = source_.rate()}));
  buffer_ = nullptr;
  notify_presenter();
  return Step::Worked;
}

void FrameCopier::fill(display::ScanoutBuffer& buffer, const frames::FrameView& frame) noexcept {
  const auto begin = SteadyClock::now();
  buffer.fill(frame);
  statistics_.copy.record(SteadyClock::now() - begin);
  statistics_.filled.add();
}

/// Keeps or releases the frame whose index is next_index_.
void FrameCopier::keep_or_release(const frames::AcquiredFrame& acquired, bool keep) {
  const size_t limit = keep ? keep_limit() : 0;
  const uint64_t displayed = displayed_.load(std::memory_order_acquire);
  const auto is_over = [&] {
    return options_.control != nullptr && kept_.front().index < displayed;
  };
  if (keep)
    while (kept_count_ > 0 && (kept_count_ >= limit || is_over())) release_oldest();
  if (limit == 0) return source_.release(acquired.token);
  kept_.at(kept_count_++) = {.acquired = acquired, .index = next_index_};
}

/// Returns how many frames may be kept. One of the frames that the source lends is reserved for the
/// next pull.
size_t FrameCopier::keep_limit() const {
  const auto spare = static_cast<size_t>(std::max(0, source_.max_acquired() - 1));
  if (options_.control != nullptr) return std::min(spare, kept_.size());
  return options_.reconnect ? std::min<size_t>(spare, 1) : 0;
}

void FrameCopier::release_oldest() noexcept {
  source_.release(kept_.front().acquired.token);
  std::move(kept_.begin() + 1, kept_.begin() + static_cast<ptrdiff_t>(kept_count_), kept_.begin());
  --kept_count_;
}

void FrameCopier::follow_cut() noexcept {
  const uint64_t cut = source_.cut();
  if (cut == cut_.load(std::memory_order_relaxed)) return;
  cut_.store(cut);
  if (cut_wake_ != nullptr) cut_wake_->signal();
}

void FrameCopier::serve_copy() noexcept {
  {
    const std::lock_guard lock(copy_mutex_);
    const uint64_t displayed = displayed_.load(std::memory_order_acquire);
    for (size_t k = 0; k < kept_count_ && copy_into_ != nullptr; ++k) {
      if (kept_.at(k).index != displayed) continue;
      const frames::FrameView& all = kept_.at(k).acquired.frame;
      const bool has_part = copied_part_ < std::max<size_t>(all.parts.size(), 1);
      if (!has_part) continue;
      const frames::FrameView& frame = all.parts.empty() ? all : all.parts[copied_part_];
      if (frame.geometry != copy_into_->geometry()) continue;
      std::copy(frame.bytes.begin(), frame.bytes.end(), copy_into_->bytes().begin());
      copied_ = true;
    }
    copy_into_ = nullptr;
    copy_wanted_.store(false, std::memory_order_release);
  }
  copy_over_.notify_all();
}

bool FrameCopier::copy_shown(frames::WovenFrame& into, size_t part, milliseconds timeout) {
  std::unique_lock lock(copy_mutex_);
  copy_into_ = &into;
  copied_part_ = part;
  copied_ = false;
  copy_wanted_.store(true, std::memory_order_release);
  freed_.signal();
  copy_over_.wait_for(lock, timeout, [this] {
    return copy_into_ == nullptr || stopping_.load(std::memory_order_acquire);
  });
  copy_into_ = nullptr;
  copy_wanted_.store(false, std::memory_order_release);
  return copied_;
}

FrameCopier::Step FrameCopier::begin_next_loop() {
  if (between_sequences_.load()) return Step::NoFrame;
  if (frames_this_loop_ == 0) {
    // A source that can be repeated would be empty again; a ring waits for the next renderer.
    const bool another_may_come = options_.loops == kForever && !source_.rewind();
    if (!another_may_come) return end(State::Failed, "the sequence contains no frame");
    between_sequences_.store(true);
    notify_presenter();
    return Step::NoFrame;
  }
  frames_this_loop_ = 0;
  statistics_.loops.add();
  if (statistics_.loops.get() == options_.loops) return end(State::Ended, "");
  if (source_.rewind()) return Step::Worked;
  if (options_.loops != kForever) return end(State::Failed, "the sequence cannot be repeated");
  between_sequences_.store(true);
  notify_presenter();
  return Step::NoFrame;
}

FrameCopier::Step FrameCopier::end(State state, const char* failure) noexcept {
  failure_ = failure;
  state_.store(state);
  primed_.store(true);
  notify_presenter();
  return Step::Over;
}

void FrameCopier::look_at_source() noexcept {
  if (state() != State::Running) return;
  const bool primed =
      queue_.size() + source_.ready_count() >= options_.prime || source_.saturated();
  if (primed == primed_.load(std::memory_order_relaxed)) return;
  primed_.store(primed);
  notify_presenter();
}

void FrameCopier::wait_for_change(milliseconds timeout, bool for_buffer) noexcept {
  const int source_fd = source_.wake_fd();
  const bool blind = source_fd < 0 && !for_buffer;
  pollfd entries[2] = {{.fd = freed_.fd(), .events = POLLIN, .revents = 0},
                       {.fd = source_fd, .events = POLLIN, .revents = 0}};
  const milliseconds nap = blind ? kNapWithoutDescriptor : timeout;
  (void)poll(entries, 2, static_cast<int>(nap.count()));
  freed_.drain();
  if (source_fd >= 0) source_.service();
}

}  // namespace lenticule::player
