// SPDX-License-Identifier: Apache-2.0
#include "player/filler.h"

#include <poll.h>

#include <exception>

#include "optics/error.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

/// Longest nap: what nobody signals (a source without a descriptor) is noticed that late.
constexpr milliseconds kNap{50};
constexpr milliseconds kNapWithoutDescriptor{2};

}  // namespace

bool FilledQueue::push(FilledFrame frame) noexcept {
  const size_t pushed = pushed_.load(std::memory_order_relaxed);
  if (pushed - popped_.load(std::memory_order_acquire) == kCapacity) return false;
  frames_[pushed % kCapacity] = frame;
  pushed_.store(pushed + 1);  // sequentially consistent with Filler::waiting_
  return true;
}

const FilledFrame* FilledQueue::peek() const noexcept {
  const size_t popped = popped_.load(std::memory_order_relaxed);
  return pushed_.load() == popped ? nullptr : &frames_[popped % kCapacity];
}

void FilledQueue::pop() noexcept {
  popped_.store(popped_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
}

size_t FilledQueue::size() const noexcept {
  return pushed_.load(std::memory_order_acquire) - popped_.load(std::memory_order_acquire);
}

Filler::Filler(frames::FrameSource& source, display::Display& display, FillerStatistics& statistics,
               FillerOptions options)
    : source_(source), display_(display), statistics_(statistics), options_(options) {}

Filler::~Filler() {
  if (buffer_ != nullptr) display_.discard(buffer_);
  for (; queue_.peek() != nullptr; queue_.pop()) display_.discard(queue_.peek()->buffer);
  if (kept_) source_.release(kept_->lent.token);
}

void Filler::request_stop() noexcept {
  stopping_.store(true, std::memory_order_release);
  freed_.signal();
}

void Filler::forget_buffers() noexcept {
  buffer_ = nullptr;
  while (queue_.peek() != nullptr) queue_.pop();
}

uint64_t Filler::begin_again() noexcept {
  stopping_.store(false, std::memory_order_release);
  patience_lost_ = false;
  const uint64_t index = kept_ ? kept_->index : next_index_;
  skip_before(index);
  if (!kept_) return index;
  display::ScanoutBuffer* const buffer = display_.acquire();
  if (buffer == nullptr) return next_index_;
  fill(*buffer, kept_->lent.frame);
  LENTICULE_CHECK(queue_.push({buffer, index}));
  return index;
}

void Filler::run() noexcept {
  while (!stopping_.load(std::memory_order_acquire)) {
    const Step result = step();
    if (result == Step::Over) return;
    if (result != Step::Worked) wait_for_change(kNap, result == Step::NoBuffer);
  }
}

void Filler::pump(milliseconds patience) noexcept {
  const auto deadline = SteadyClock::now() + patience;
  while (!stopping_.load(std::memory_order_acquire)) {
    const Step result = step();
    if (result == Step::Worked) patience_lost_ = false;
    if (result == Step::NoBuffer || result == Step::Over) return;
    if (result != Step::NoFrame) continue;
    if (patience_lost_ || source_.wake_fd() < 0) return;
    wait_for_change(kNap, false);
    patience_lost_ = SteadyClock::now() >= deadline;
  }
}

Filler::Step Filler::step() noexcept {
  if (state() != State::Running) return Step::Over;
  try {
    const Step result = pull_next();
    look_at_source();
    return result;
  } catch (const std::exception& error) {
    return end(State::Failed, error.what());
  }
}

Filler::Step Filler::pull_next() {
  const bool wanted = next_index_ >= skip_before_.load(std::memory_order_relaxed);
  if (wanted && buffer_ == nullptr) buffer_ = display_.acquire();
  if (wanted && buffer_ == nullptr) return Step::NoBuffer;

  frames::LentFrame lent;
  switch (source_.pull(lent)) {
    case frames::PullStatus::Ready:
      return take(lent);
    case frames::PullStatus::NotYet:
      return Step::NoFrame;
    case frames::PullStatus::End:
      return begin_next_loop();
    case frames::PullStatus::Failed:
      break;
  }
  return end(State::Failed, source_.failure().c_str());
}

Filler::Step Filler::take(const frames::LentFrame& lent) {
  const bool fits = lent.frame.geometry == display_.mode().geometry;
  const bool wanted = buffer_ != nullptr;
  if (fits && wanted) fill(*buffer_, lent.frame);
  keep_or_release(lent, fits && wanted);
  if (!fits) return end(State::Failed, "the source changed the size of its frames");

  if (next_index_ == 0) source_rate_ = source_.rate();
  between_sequences_.store(false);
  const uint64_t index = next_index_++;
  ++frames_this_loop_;
  statistics_.sample_ready(source_.ready_count());
  if (!wanted) {
    statistics_.released.add();
    return Step::Worked;
  }
  LENTICULE_CHECK(queue_.push({buffer_, index}));
  buffer_ = nullptr;
  notify_presenter();
  return Step::Worked;
}

void Filler::fill(display::ScanoutBuffer& buffer, const frames::FrameView& frame) noexcept {
  const auto begin = SteadyClock::now();
  buffer.fill(frame);
  statistics_.copy.record(SteadyClock::now() - begin);
  statistics_.filled.add();
}

/// The frame at hand has the number next_index_.
void Filler::keep_or_release(const frames::LentFrame& lent, bool keep) {
  if (!keep || !options_.keep_newest || source_.max_lent() < 2) return source_.release(lent.token);
  if (kept_) source_.release(kept_->lent.token);
  kept_ = {.lent = lent, .index = next_index_};
}

Filler::Step Filler::begin_next_loop() {
  if (between_sequences_.load()) return Step::NoFrame;
  if (frames_this_loop_ == 0) return end(State::Failed, "the sequence holds no frame");
  frames_this_loop_ = 0;
  statistics_.loops.add();
  if (statistics_.loops.get() == options_.loops) return end(State::Ended, "");
  if (source_.rewind()) return Step::Worked;
  if (options_.loops != kForever) return end(State::Failed, "the sequence cannot be played again");
  between_sequences_.store(true);
  notify_presenter();
  return Step::NoFrame;
}

Filler::Step Filler::end(State state, const char* failure) noexcept {
  failure_ = failure;
  state_.store(state);
  primed_.store(true);
  notify_presenter();
  return Step::Over;
}

void Filler::look_at_source() noexcept {
  if (state() != State::Running) return;
  const bool primed =
      queue_.size() + source_.ready_count() >= options_.prime || source_.saturated();
  if (primed == primed_.load(std::memory_order_relaxed)) return;
  primed_.store(primed);
  notify_presenter();
}

void Filler::wait_for_change(milliseconds timeout, bool for_buffer) noexcept {
  const int source_fd = source_.wake_fd();
  const bool blind = source_fd < 0 && !for_buffer;
  pollfd entries[2] = {{.fd = freed_.fd(), .events = POLLIN, .revents = 0},
                       {.fd = source_fd, .events = POLLIN, .revents = 0}};
  const milliseconds nap = blind ? kNapWithoutDescriptor : timeout;
  (void)poll(entries, 2, static_cast<int>(nap.count()));
  freed_.drain();
  if (source_fd >= 0) source_.service();
}

void Filler::notify_presenter() noexcept {
  if (WakeFd* const wake = waiting_.exchange(nullptr)) wake->signal();
}

}  // namespace lenticule::player
