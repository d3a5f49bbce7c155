// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/sequence_source.h"

#include <fmt/format.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <system_error>

#include "optics/error.h"

namespace lenticule::frames {
namespace {

constexpr int kMinPoolFrames = 2;  // one on the glass, one being decoded
constexpr int kMaxDecoderThreads = 64;
constexpr uint64_t kMaxDistance = 64;  ///< frames that a replacement may be away

UniqueFd make_wake_fd() {
  UniqueFd fd(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!fd)
    throw Error(ErrorKind::Failed,
                fmt::format("sequence: no eventfd: {}", std::generic_category().message(errno)),
                "raise the limit of open files");
  return fd;
}

uint64_t checked_end(const std::filesystem::path& file, const SequenceSourceOptions& options,
                     uint64_t count) {
  if (count == 0)
    throw Error(ErrorKind::Input, fmt::format("{}: has no frames", file.string()),
                "its writer was stopped before the first one: go on with --resume");
  const uint64_t end = options.end.value_or(count);
  if (options.begin < end && end <= count) return end;
  throw Error(ErrorKind::Input,
              fmt::format("{}: has frames 0 to {}, not {} to {}", file.string(), count - 1,
                          options.begin, end - 1),
              "name a range of frames that exist");
}

}  // namespace

SequenceSource::SequenceSource(const std::filesystem::path& file,
                               const SequenceSourceOptions& options)
    : reader_(file), wake_(make_wake_fd()) {
  first_ = loop_ = options.begin;
  last_ = checked_end(file, options, reader_.frame_count());
  const bool whole = options.begin == 0 && !options.end;
  const SequenceInfo& info = reader_.info();
  if (whole && info.loop_begin < last_) {  // a file cut short may end before its loop does
    last_ = std::min(last_, info.loop_end.value_or(last_));
    loop_ = info.loop_begin;
  }
  round_end_ = last_ - first_;
  skipped_ = options.first < last_ - first_ ? options.first : 0;
  next_decode_ = next_pull_ = round_begin_ = skipped_;
  spare_cache_ = reader_.file_bytes() > options.cached_file_bytes;
  const auto pool = static_cast<size_t>(std::max(options.pool_frames, kMinPoolFrames));
  slots_.resize(std::min<uint64_t>(pool, last_ - first_));
  resident_ = slots_.size() == last_ - first_ && loop_ == first_;
  if (!resident_ && slots_.size() < kMinPoolFrames) slots_.resize(kMinPoolFrames);
  for (Slot& slot : slots_) slot.frame = WovenFrame(geometry());
  const int threads = std::clamp(options.decoder_threads, 1, kMaxDecoderThreads);
  decoders_.reserve(static_cast<size_t>(threads));
  for (int t = 0; t < threads; ++t) decoders_.push_back(reader_.make_decoder());
  for (FrameDecoder& decoder : decoders_)
    threads_.emplace_back([this, &decoder] { decode_ahead(decoder); });
}

SequenceSource::~SequenceSource() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  slot_freed_.notify_all();
}

uint64_t SequenceSource::frame_of(uint64_t ticket) const {
  const uint64_t first_round = last_ - first_;
  return ticket < first_round ? first_ + ticket : loop_ + (ticket - first_round) % loop_length();
}

bool SequenceSource::is_ready(uint64_t ticket) const {
  const Slot& slot = slot_of(ticket);
  // A resident frame may be lent any number of times; nobody writes it any more.
  return slot.state == SlotState::Ready && (resident_ || slot.ticket == ticket);
}

PullStatus SequenceSource::pull(LentFrame& out) {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_end_) return PullStatus::End;
  Slot& slot = slot_of(next_pull_);
  if (slot.state == SlotState::Failed) {
    failed_ = true;
    return PullStatus::Failed;
  }
  if (!is_ready(next_pull_)) return PullStatus::NotYet;
  if (!resident_) slot.state = SlotState::Lent;
  out = {.frame = slot.frame.view(), .number = frame_of(next_pull_), .token = next_pull_};
  ++next_pull_;
  return PullStatus::Ready;
}

void SequenceSource::release(uint64_t token) {
  if (resident_) return;
  {
    const std::lock_guard lock(mutex_);
    Slot& slot = slot_of(token);
    LENTICULE_CHECK(slot.state == SlotState::Lent && slot.ticket == token);
    slot.state = SlotState::Free;
  }
  slot_freed_.notify_one();
}

int SequenceSource::max_lent() const {
  return resident_ ? std::numeric_limits<int>::max() : static_cast<int>(slots_.size()) - 1;
}

uint64_t SequenceSource::ready_count() const {
  const std::lock_guard lock(mutex_);
  uint64_t ready = 0;
  while (ready < slots_.size() && is_ready(next_pull_ + ready)) ++ready;
  return ready;
}

bool SequenceSource::saturated() const {
  const std::lock_guard lock(mutex_);
  return decoding_ == 0 && !can_decode_next();
}

bool SequenceSource::rewind() {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_begin_) return true;
  if (next_pull_ != round_end_) return false;
  round_begin_ = round_end_;
  round_end_ += loop_length();
  return true;
}

void SequenceSource::service() {
  eventfd_t count = 0;
  static_cast<void>(::eventfd_read(wake_.get(), &count));
}

std::string SequenceSource::failure() const {
  const std::lock_guard lock(mutex_);
  return failed_
             ? fmt::format("frame {}: neither it nor any near it can be read", frame_of(next_pull_))
             : std::string();
}

bool SequenceSource::can_decode_next() const {
  if (broken_ || (resident_ && next_decode_ == skipped_ + slots_.size())) return false;
  return slot_of(next_decode_).state == SlotState::Free;
}

void SequenceSource::decode_ahead(FrameDecoder& decoder) {
  std::unique_lock lock(mutex_);
  while (true) {
    slot_freed_.wait(lock, [this] { return stopping_ || can_decode_next(); });
    if (stopping_) return;
    const uint64_t ticket = next_decode_++;
    Slot& slot = slot_of(ticket);
    slot.state = SlotState::Decoding;
    slot.ticket = ticket;
    ++decoding_;

    lock.unlock();
    slot_freed_.notify_one();  // another decoder may have waited for this slot, not for the next
    reader_.will_need(frame_of(ticket + 1));
    const bool decoded = decode_or_replace(decoder, frame_of(ticket), slot.frame);
    if (spare_cache_) reader_.done_with(frame_of(ticket));
    lock.lock();

    --decoding_;
    broken_ = broken_ || !decoded;
    slot.state = decoded ? SlotState::Ready : SlotState::Failed;
    wake();
  }
}

bool SequenceSource::decode_or_replace(FrameDecoder& decoder, uint64_t frame, WovenFrame& to) {
  if (decoder.decode(frame, to.bytes())) return true;
  damaged_.fetch_add(1);
  const uint64_t back = std::min(frame, kMaxDistance);
  for (uint64_t distance = 1; distance <= back; ++distance) {
    if (decoder.decode(frame - distance, to.bytes())) return true;
  }
  const uint64_t ahead = std::min(reader_.frame_count() - 1 - frame, kMaxDistance);
  for (uint64_t distance = 1; distance <= ahead; ++distance) {
    if (decoder.decode(frame + distance, to.bytes())) return true;
  }
  return false;
}

void SequenceSource::wake() const {
  static_cast<void>(::eventfd_write(wake_.get(), 1));
}

}  // namespace lenticule::frames
