// SPDX-License-Identifier: Apache-2.0
#include "frames/decoded_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "base/error.h"

namespace lenticule::frames {
namespace {

constexpr int kMinPoolFrames = 2;  // one displayed, one being decoded

}  // namespace

DecodedSource::DecodedSource(const char* name, std::unique_ptr<FrameDecoding> decoding)
    : rounds_(decoding->rounds()), wake_(name), decoding_(std::move(decoding)) {
  LENTICULE_CHECK(rounds_.first < rounds_.last && rounds_.loop < rounds_.last);
  LENTICULE_CHECK(rounds_.skipped < rounds_.last - rounds_.first);
  next_decode_ = next_pull_ = round_begin_ = rounds_.skipped;
  round_end_ = rounds_.last - rounds_.first;
  make_slots();
  const int threads = std::clamp(rounds_.decoder_threads, 1, kMaxDecoderThreads);
  for (int t = 0; t < threads; ++t) threads_.emplace_back([this, t] { decode_ahead(t); });
}

DecodedSource::~DecodedSource() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  slot_freed_.notify_all();
}

void DecodedSource::make_slots() {
  const uint64_t count = rounds_.last - rounds_.first;
  const uint64_t pool = static_cast<uint64_t>(std::max(rounds_.pool_frames, kMinPoolFrames));
  resident_ = pool >= count && rounds_.loop == rounds_.first;
  slots_.resize(resident_ ? count : std::clamp<uint64_t>(count, kMinPoolFrames, pool));
  for (size_t slot = slots_.size(); slot-- > 0;) free_.push_back(slot);
  order_.resize(slots_.size());
}

uint64_t DecodedSource::frame_of(uint64_t ticket) const {
  const uint64_t first_round = rounds_.last - rounds_.first;
  if (ticket < first_round) return rounds_.first + ticket;
  return rounds_.loop + (ticket - first_round) % (rounds_.last - rounds_.loop);
}

bool DecodedSource::is_ready(uint64_t ticket) const {
  const Slot& slot = slot_of(ticket);
  // A resident frame may be acquired any number of times; no thread writes it any more.
  const uint64_t round = resident_ ? slots_.size() : UINT64_MAX;
  return slot.state == SlotState::Ready && slot.ticket % round == ticket % round;
}

PullStatus DecodedSource::pull(AcquiredFrame& out) {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_end_) return PullStatus::End;
  Slot& slot = slot_of(next_pull_);
  if (slot.state == SlotState::Failed) {
    failed_ = true;
    return PullStatus::Failed;
  }
  if (!is_ready(next_pull_)) return PullStatus::NotYet;
  if (!resident_) slot.state = SlotState::Acquired;
  out = {.frame = slot.frame.view(),
         .number = frame_of(next_pull_),
         .token = static_cast<uint64_t>(&slot - slots_.data())};
  ++next_pull_;
  return PullStatus::Ready;
}

void DecodedSource::release(uint64_t token) {
  if (resident_) return;
  {
    const std::lock_guard lock(mutex_);
    LENTICULE_CHECK(token < slots_.size() && slots_[token].state == SlotState::Acquired);
    slots_[token].state = SlotState::Free;
    free_.push_back(token);
  }
  slot_freed_.notify_one();
}

int DecodedSource::max_acquired() const {
  return resident_ ? std::numeric_limits<int>::max() : static_cast<int>(slots_.size()) - 1;
}

uint64_t DecodedSource::ready_count() const {
  const std::lock_guard lock(mutex_);
  uint64_t ready = 0;
  while (ready < slots_.size() && is_ready(next_pull_ + ready)) ++ready;
  return ready;
}

bool DecodedSource::saturated() const {
  const std::lock_guard lock(mutex_);
  return decoding_now_ == 0 && !can_decode_next();
}

bool DecodedSource::rewind() {
  const std::lock_guard lock(mutex_);
  if (next_pull_ == round_begin_) return true;
  if (next_pull_ != round_end_) return false;
  round_begin_ = round_end_;
  round_end_ += rounds_.last - rounds_.loop;
  return true;
}

void DecodedSource::service() {
  wake_.drain();
}

std::string DecodedSource::failure() const {
  const std::lock_guard lock(mutex_);
  return failed_ ? slot_of(next_pull_).failure : std::string();
}

void DecodedSource::decode_ahead(int thread) {
  std::unique_lock lock(mutex_);
  while (true) {
    slot_freed_.wait(lock, [this] { return stopping_ || can_decode_next(); });
    if (stopping_) return;
    const uint64_t ticket = next_decode_++;
    order_[ticket % slots_.size()] = free_.back();
    free_.pop_back();
    Slot& slot = slot_of(ticket);
    slot.state = SlotState::Decoding;
    slot.ticket = ticket;
    ++decoding_now_;

    lock.unlock();
    slot_freed_.notify_one();  // another decoder may have waited for this slot, not for the next
    slot.failure = decode(thread, ticket, slot.frame);
    lock.lock();

    --decoding_now_;
    broken_ = broken_ || !slot.failure.empty();
    slot.state = slot.failure.empty() ? SlotState::Ready : SlotState::Failed;
    wake();
  }
}

std::string DecodedSource::decode(int thread, uint64_t ticket, WovenFrame& to) {
  try {
    return decoding_->decode(thread, frame_of(ticket), frame_of(ticket + 1), to);
  } catch (const std::exception& error) {
    const std::string why = error.what();
    return why.empty() ? fmt::format("frame {}: cannot decode", frame_of(ticket)) : why;
  }
}

void DecodedSource::wake() const {
  wake_.signal();
}

class ImageSequence::Files final : public FrameDecoding {
 public:
  Files(std::vector<std::filesystem::path> files, const ImageSequenceOptions& options)
      : files_(std::move(files)), options_(options), first_(header_of_first()) {
    if (options_.accept) options_.accept(first_);
  }

  [[nodiscard]] double pixel_aspect() const { return upright_pixel_aspect(first_); }

  [[nodiscard]] DecodedRounds rounds() const override {
    const FrameGeometry geometry = oriented_geometry(first_.geometry, first_.orientation);
    const uint64_t fit = options_.pool_bytes / geometry.frame_bytes();
    const auto most = static_cast<uint64_t>(std::max(options_.pool_frames, 2));
    return {.geometry = geometry,
            .rate = options_.rate,
            .last = files_.size(),
            .skipped = options_.first,
            .pool_frames = static_cast<int>(std::clamp<uint64_t>(fit, 2, most)),
            .decoder_threads = options_.decoder_threads};
  }

  std::string decode(int /*thread*/, uint64_t frame, uint64_t /*next*/, WovenFrame& to) override {
    read_woven_into(files_[frame], oriented_geometry(first_.geometry, first_.orientation), to,
                    options_.use);
    return {};
  }

 private:
  [[nodiscard]] PictureInfo header_of_first() const {
    if (files_.empty()) throw Error(ErrorKind::Input, "image sequence: no files");
    return probe_picture(files_.front(), options_.use);
  }

  std::vector<std::filesystem::path> files_;
  ImageSequenceOptions options_;
  PictureInfo first_;
};

std::vector<std::filesystem::path> list_frame_files(const std::string& source) {
  if (!FilePattern::looks_like_pattern(source)) return {source};
  const FilePattern pattern(source);
  const std::vector<uint64_t> numbers = pattern.existing_or_throw();
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
    : ImageSequence(std::make_unique<Files>(std::move(files), options)) {}

ImageSequence::ImageSequence(std::unique_ptr<Files> files)
    : DecodedSource("image sequence", std::move(files)),
      pixel_aspect_(static_cast<const Files&>(decoding()).pixel_aspect()) {}

}  // namespace lenticule::frames
