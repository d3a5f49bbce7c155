// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/realtime/run_log.h"

#include <sys/mman.h>

#include <cstring>
#include <new>

#include "base/error.h"

namespace lenticule::bench {
namespace {

constexpr size_t kHeaderBytes = 64;

}  // namespace

RunLog::RunLog(uint64_t capacity)
    : capacity_(capacity),
      bytes_(kHeaderBytes + capacity * sizeof(FrameRecord)),
      memory_(mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {
  static_assert(sizeof(Header) <= kHeaderBytes && kHeaderBytes % alignof(FrameRecord) == 0);
  if (memory_ == MAP_FAILED)
    throw Error(ErrorKind::Failed, "bench realtime: no memory for the records of all frames",
                "measure fewer --seconds");
  header_ = new (memory_) Header;
  records_ = reinterpret_cast<FrameRecord*>(static_cast<char*>(memory_) + kHeaderBytes);
}

RunLog::~RunLog() {
  munmap(memory_, bytes_);
}

void RunLog::prefault() noexcept {
  std::memset(static_cast<void*>(records_), 0, capacity_ * sizeof(FrameRecord));
}

void RunLog::add(const FrameRecord& record) noexcept {
  const uint64_t count = header_->count.load(std::memory_order_relaxed);
  LENTICULE_CHECK(count < capacity_);
  records_[count] = record;
  header_->count.store(count + 1, std::memory_order_release);
}

void RunLog::finish(double cpu_s) noexcept {
  header_->cpu_s.store(cpu_s, std::memory_order_release);
}

std::span<const FrameRecord> RunLog::frames() const noexcept {
  return {records_, header_->count.load(std::memory_order_acquire)};
}

double RunLog::cpu_s() const noexcept {
  return header_->cpu_s.load(std::memory_order_acquire);
}

void RunLog::set_player_finished(bool stop) noexcept {
  header_->stop.store(stop, std::memory_order_relaxed);
  header_->player_finished.store(true, std::memory_order_release);
}

bool RunLog::is_player_finished() const noexcept {
  return header_->player_finished.load(std::memory_order_acquire);
}

bool RunLog::is_stopped() const noexcept {
  return header_->stop.load(std::memory_order_acquire);
}

}  // namespace lenticule::bench
