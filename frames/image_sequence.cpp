// SPDX-License-Identifier: Apache-2.0
#include "frames/image_sequence.h"

#include <fmt/format.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <system_error>

#include "frames/image_io.h"
#include "optics/error.h"

namespace lenticule::frames {
namespace {

constexpr int kMinPoolFrames = 2;  // one on the glass, one being decoded
constexpr int kMaxDecoderThreads = 64;

UniqueFd make_wake_fd() {
  UniqueFd fd(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!fd)
    throw Error(ErrorKind::Failed, fmt::format("image sequence: no eventfd: {}",
                                               std::generic_category().message(errno)));
  return fd;
}

}  // namespace

std::vector<std::filesystem::path> list_frame_files(const std::string& source) {
  if (!FilePattern::looks_like_pattern(source)) return {source};
  const FilePattern pattern(source);
  const std::vector<uint64_t> numbers = pattern.existing();
  if (numbers.empty()) throw Error(ErrorKind::Input, fmt::format("{}: no such files", source));
  std::vector<std::filesystem::path> files;
  for (const uint64_t number : numbers) {
    const uint64_t expected = numbers.front() + files.size();
    if (number != expected)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: missing between {} and {}", pattern.path(expected).string(),
                              pattern.path(numbers.front()).filename().string(),
                              pattern.path(numbers.back()).filename().string()));
    files.push_back(pattern.path(number));
  }
  return files;
}

ImageSequence::ImageSequence(std::vector<std::filesystem::path> files,
                             const ImageSequenceOptions& options)
    : files_(std::move(files)), rate_(options.rate), first_(options.first), wake_(make_wake_fd()) {
  if (files_.empty()) throw Error(ErrorKind::Input, "image sequence: no files");
  LENTICULE_CHECK(first_ < files_.size());
  next_decode_ = next_pull_ = first_;
  geometry_ = probe_image(files_.front());
  round_end_ = files_.size();
  const auto pool = static_cast<size_t>(std::max(options.pool_frames, kMinPoolFrames));
  slots_.resize(std::min(pool, files_.size()));
  const int threads = std::clamp(options.decoder_threads, 1, kMaxDecoderThreads);
  for (int t = 0; t < threads; ++t) decoders_.emplace_back([this] { decode_ahead(); });
}

ImageSequence::~ImageSequence() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  slot_freed_.notify_all();
}

bool ImageSequence::is_ready(uint64_t ticket) const {
  const Slot& slot = slot_of(ticket);
  // A resident frame may be lent any number of times; nobody writes it any more.
  return slot.state == SlotState::Ready && (resident() || slot.ticket == ticket);
}

PullStatus ImageSequence::pull(LentFrame& out) {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_end_) return PullStatus::End;
  Slot& slot = slot_of(next_pull_);
  if (slot.state == SlotState::Failed) {
    failed_ = true;
    return PullStatus::Failed;
  }
  if (!is_ready(next_pull_)) return PullStatus::NotYet;
  if (!resident()) slot.state = SlotState::Lent;
  out = {.frame = slot.frame.view(), .number = next_pull_ % files_.size(), .token = next_pull_};
  ++next_pull_;
  return PullStatus::Ready;
}

void ImageSequence::release(uint64_t token) {
  if (resident()) return;
  {
    const std::lock_guard lock(mutex_);
    Slot& slot = slot_of(token);
    LENTICULE_CHECK(slot.state == SlotState::Lent && slot.ticket == token);
    slot.state = SlotState::Free;
  }
  slot_freed_.notify_one();
}

int ImageSequence::max_lent() const {
  return resident() ? std::numeric_limits<int>::max() : static_cast<int>(slots_.size()) - 1;
}

uint64_t ImageSequence::ready_count() const {
  const std::lock_guard lock(mutex_);
  uint64_t ready = 0;
  while (ready < slots_.size() && is_ready(next_pull_ + ready)) ++ready;
  return ready;
}

bool ImageSequence::saturated() const {
  const std::lock_guard lock(mutex_);
  return decoding_ == 0 && !can_decode_next();
}

bool ImageSequence::rewind() {
  const std::lock_guard lock(mutex_);
  const bool at_start = next_pull_ == round_end_ - files_.size();
  if (next_pull_ == round_end_) round_end_ += files_.size();
  return at_start || next_pull_ == round_end_ - files_.size();
}

void ImageSequence::service() {
  eventfd_t count = 0;
  static_cast<void>(::eventfd_read(wake_.get(), &count));
}

std::string ImageSequence::failure() const {
  const std::lock_guard lock(mutex_);
  return failed_ ? slot_of(next_pull_).failure : std::string();
}

bool ImageSequence::can_decode_next() const {
  if (broken_ || (resident() && next_decode_ == first_ + files_.size())) return false;
  return slot_of(next_decode_).state == SlotState::Free;
}

void ImageSequence::decode_ahead() {
  std::unique_lock lock(mutex_);
  while (true) {
    slot_freed_.wait(lock, [this] { return stopping_ || can_decode_next(); });
    if (stopping_) return;
    const uint64_t ticket = next_decode_++;
    Slot& slot = slot_of(ticket);
    slot.state = SlotState::Decoding;
    slot.ticket = ticket;
    slot.failure.clear();
    ++decoding_;

    lock.unlock();
    slot_freed_.notify_one();  // another decoder may have waited for this slot, not for the next
    decode(slot, files_[ticket % files_.size()]);
    lock.lock();

    --decoding_;
    broken_ = broken_ || !slot.failure.empty();
    slot.state = slot.failure.empty() ? SlotState::Ready : SlotState::Failed;
    wake();
  }
}

void ImageSequence::decode(Slot& slot, const std::filesystem::path& file) const {
  try {
    if (slot.frame.geometry() != geometry_) slot.frame = WovenFrame(geometry_);
    read_woven_into(file, slot.frame);
  } catch (const std::exception& error) {
    slot.failure = error.what();
    if (slot.failure.empty()) slot.failure = file.string() + ": cannot read";
  }
}

void ImageSequence::wake() const {
  static_cast<void>(::eventfd_write(wake_.get(), 1));
}

}  // namespace lenticule::frames
