// SPDX-License-Identifier: Apache-2.0
// CaptureStream is a running capture: buffers that the driver fills, mapped into memory and read by
// the program. ExposureClock computes the exposure times of pictures and the number of lost
// pictures from the stamps of these buffers.
#pragma once

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "frames/capture/grab_status.h"
#include "frames/capture/v4l2_device.h"

namespace lenticule::frames::capture {

/// BufferStamp is the driver's stamp of a buffer.
struct BufferStamp {
  uint32_t sequence = 0;
  Nanoseconds time{0};
  bool monotonic = false;          ///< the time is CLOCK_MONOTONIC
  bool start_of_exposure = false;  ///< otherwise the stamp was taken when the last byte arrived
};

inline constexpr Nanoseconds kOldestStamp = std::chrono::seconds{10};
/// Tolerance in addition to the time of a frame: some drivers compute the expected end of the
/// frame.
inline constexpr Nanoseconds kAheadAllowed = std::chrono::milliseconds{5};

inline constexpr uint32_t kWantedBuffers = 6;
inline constexpr uint32_t kFewestBuffers = 2;
inline constexpr uint32_t kMostBuffers = 64;
inline constexpr size_t kLargestBuffer = size_t{1} << 30;
inline constexpr int kMostLossesInARow = 64;
/// Limits the retries with a driver that reports "ready" without a picture, or during a flood of
/// signals.
inline constexpr int kMostEmptyLooks = 1000;

inline v4l2_buffer buffer_number(uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

inline int request_buffers(V4l2Device& device, uint32_t& count) {
  v4l2_requestbuffers request{};
  request.count = count;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  const int error = v4l2_call(device, VIDIOC_REQBUFS, &request);
  count = request.count;
  return error;
}

inline BufferStamp stamp_of(const v4l2_buffer& buffer) {
  const auto clock = buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK;
  const auto source = buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK;
  // Drivers may return any value; values that would overflow are implausible and clamped.
  const int64_t seconds = std::clamp<int64_t>(buffer.timestamp.tv_sec, 0, int64_t{1} << 32);
  const int64_t micros = std::clamp<int64_t>(buffer.timestamp.tv_usec, 0, 999'999);
  return {.sequence = buffer.sequence,
          .time = std::chrono::seconds{seconds} + std::chrono::microseconds{micros},
          .monotonic = clock == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
          .start_of_exposure = source == V4L2_BUF_FLAG_TSTAMP_SRC_SOE};
}

/// ExposureClock tracks one stream.
///
/// Thread safety: one thread.
class ExposureClock {
 public:
  /// Takes the exposure time, if known, and the time between two pictures, 0 if unknown.
  ExposureClock(std::optional<Nanoseconds> exposure, Nanoseconds frame)
      : exposure_(exposure.value_or(frame)), frame_(frame) {}

  /// Returns the time of the middle of the middle row's exposure. A stamp at the end is taken when
  /// the whole sensor has been read, for which one frame is assumed: most sensors read row by row
  /// during the whole frame. Stamps of another clock, in the future, ten or more seconds old, or
  /// before the previous stamp are replaced with `now`. Each returned time is later than the last.
  [[nodiscard]] Nanoseconds exposed_at(const BufferStamp& stamp, Nanoseconds now) {
    const bool plausible = stamp.monotonic && stamp.time <= now + frame_ + kAheadAllowed &&
                           stamp.time > now - kOldestStamp && stamp.time >= last_stamp_;
    const Nanoseconds half = (frame_ + exposure_) / 2;
    Nanoseconds time = now - half;
    if (plausible) {
      last_stamp_ = stamp.time;
      time = std::min(stamp.start_of_exposure ? stamp.time + half : stamp.time - half, now);
    }
    unreliable_ |= !plausible;
    return last_time_ = std::max(time, last_time_ + Nanoseconds{1});
  }
  /// Returns a 64-bit count, which continues where the camera's 32 bits wrap, and adds one where
  /// the camera restarts its count.
  [[nodiscard]] uint64_t count(uint32_t sequence) {
    if (!last_sequence_) {
      count_ = sequence;
    } else {
      const uint32_t gone_on = sequence - *last_sequence_;
      const bool backwards = gone_on == 0 || gone_on > UINT32_MAX / 2;
      count_ += backwards ? 1 : gone_on;
    }
    last_sequence_ = sequence;
    return count_;
  }
  /// Returns true if any stamp so far had to be replaced.
  [[nodiscard]] bool unreliable() const { return unreliable_; }

 private:
  Nanoseconds exposure_;
  Nanoseconds frame_;
  Nanoseconds last_stamp_{0};
  Nanoseconds last_time_ = Nanoseconds::min();
  std::optional<uint32_t> last_sequence_;
  uint64_t count_ = 0;
  bool unreliable_ = false;
};

struct CapturedBuffer {
  uint32_t index = 0;
  bool damaged = false;  ///< the driver reports damage, or a length beyond the buffer
  std::span<const uint8_t> bytes;
  BufferStamp stamp;
};

/// CaptureStream reserves, maps and queues buffers. Its destructor stops the stream, unmaps and
/// frees the buffers, in this order: otherwise the next program that opens the camera would get
/// EBUSY.
///
/// Thread safety: one thread.
///
/// Lifetime: the device must outlive the stream.
class CaptureStream {
 public:
  /// Throws Error(Device) that names `path`: in use, no memory, fewer than two buffers.
  CaptureStream(V4l2Device& device, V4l2System& system, const std::string& path)
      : device_(device), reservation_(&device) {
    uint32_t count = kWantedBuffers;
    int error = request_buffers(device_, count);
    if (error == 0 && (count < kFewestBuffers || count > kMostBuffers)) error = ENOMEM;
    for (uint32_t i = 0; error == 0 && i < count; ++i) error = map_buffer(i);
    for (uint32_t i = 0; error == 0 && i < count; ++i) error = queue(i);
    if (error != 0) throw camera_failure(system, path, "get buffers", error);
  }
  /// Starts the stream. Throws Error(Device).
  void start(V4l2System& system, const std::string& path) {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    const int error = v4l2_call(device_, VIDIOC_STREAMON, &type);
    if (error != 0) throw camera_failure(system, path, "start the stream", error);
    running_.reset(&device_);
  }

  /// Waits until `deadline` on the device's clock for the oldest filled buffer. Ready: the caller
  /// must give the buffer back after reading. Corrupt: the driver lost a picture, and there is no
  /// buffer to give back. Gone: failure() has the cause, and all later calls return Gone too.
  [[nodiscard]] GrabStatus acquire(CapturedBuffer& out, Nanoseconds deadline) {
    if (!failure_.empty()) return GrabStatus::Gone;
    for (int looks = 0; looks < kMostEmptyLooks; ++looks) {
      const Nanoseconds left = std::max(deadline - device_.now(), Nanoseconds{0});
      const GrabStatus status = dequeue(out, left);
      if (status != GrabStatus::TimedOut) return status;
      if (device_.now() >= deadline) break;
    }
    return GrabStatus::TimedOut;
  }
  /// Returns a buffer to the driver, to be filled again. Returns false if the camera is gone.
  [[nodiscard]] bool give_back(uint32_t index) {
    const int error = queue(index);
    if (error != 0) gone(error);
    return error == 0;
  }
  /// Returns the number of buffers that the driver gave.
  [[nodiscard]] size_t buffers() const { return buffers_.size(); }
  /// Ends the stream when the signal of an input changes. Other cameras never say so.
  void follow_source_changes() {
    v4l2_event_subscription wanted{};
    wanted.type = V4L2_EVENT_SOURCE_CHANGE;
    (void)v4l2_call(device_, VIDIOC_SUBSCRIBE_EVENT, &wanted);
  }
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct FreeBuffers {
    void operator()(V4l2Device* device) const noexcept {
      uint32_t none = 0;
      (void)request_buffers(*device, none);
    }
  };
  struct Unmap {
    V4l2Device* device;
    size_t size;
    void operator()(void* memory) const noexcept { device->unmap(memory, size); }
  };
  using Mapping = std::unique_ptr<void, Unmap>;
  struct StopStream {
    void operator()(V4l2Device* device) const noexcept {
      int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      (void)v4l2_call(*device, VIDIOC_STREAMOFF, &type);
    }
  };

  [[nodiscard]] int map_buffer(uint32_t index) {
    v4l2_buffer buffer = buffer_number(index);
    const int error = v4l2_call(device_, VIDIOC_QUERYBUF, &buffer);
    if (error != 0) return error;
    if (buffer.length == 0 || buffer.length > kLargestBuffer) return ENOMEM;
    void* const memory = device_.map(buffer.length, buffer.m.offset);
    if (memory == nullptr) return ENOMEM;
    buffers_.emplace_back(memory, Unmap{.device = &device_, .size = buffer.length});
    return 0;
  }
  [[nodiscard]] int queue(uint32_t index) {
    v4l2_buffer buffer = buffer_number(index);
    return v4l2_call(device_, VIDIOC_QBUF, &buffer);
  }
  /// Returns TimedOut when there is nothing yet, perhaps before the time is over.
  [[nodiscard]] GrabStatus dequeue(CapturedBuffer& out, Nanoseconds left) {
    const int events = device_.poll(left);
    if (events < 0) return gone(-events);
    if (events == 0) return GrabStatus::TimedOut;
    if ((events & POLLPRI) != 0 && source_changed()) return gone("the signal changed");
    const bool broken = (events & (POLLERR | POLLHUP | POLLNVAL)) != 0;
    v4l2_buffer buffer = buffer_number(0);
    const int error = v4l2_call(device_, VIDIOC_DQBUF, &buffer);
    if (error != 0) return nothing_dequeued(error, broken);
    if (buffer.index >= buffers_.size()) return gone(EBADMSG);
    const Mapping& memory = buffers_[buffer.index];
    const size_t room = memory.get_deleter().size;
    const bool flagged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    out.index = buffer.index;
    out.damaged = flagged || buffer.bytesused > room;
    out.bytes = {static_cast<const uint8_t*>(memory.get()),
                 std::min<size_t>(buffer.bytesused, room)};
    out.stamp = stamp_of(buffer);
    losses_in_a_row_ = 0;
    return GrabStatus::Ready;
  }
  /// Decides the next step after a failed dequeue. The kernel's documentation uses EIO for
  /// temporary errors too, such as a lost signal; if the stream itself is broken, poll() reports an
  /// error as well.
  [[nodiscard]] GrabStatus nothing_dequeued(int error, bool broken) {
    if (error == EAGAIN || error == EINTR) return broken ? gone(EIO) : GrabStatus::TimedOut;
    if (error == EIO && !broken && ++losses_in_a_row_ < kMostLossesInARow)
      return GrabStatus::Corrupt;
    return gone(error);
  }
  GrabStatus gone(int error) {
    return gone(error == ENODEV ? "unplugged" : "the stream broke: " + error_text(error));
  }
  GrabStatus gone(std::string failure) {
    failure_ = std::move(failure);
    return GrabStatus::Gone;
  }
  /// Takes an event of the driver, of those that follow_source_changes() asked for.
  [[nodiscard]] bool source_changed() {
    v4l2_event event{};
    return v4l2_call(device_, VIDIOC_DQEVENT, &event) == 0 &&
           event.type == V4L2_EVENT_SOURCE_CHANGE;
  }

  V4l2Device& device_;
  // Members are destroyed from the last to the first.
  std::unique_ptr<V4l2Device, FreeBuffers> reservation_;
  std::vector<Mapping> buffers_;
  std::unique_ptr<V4l2Device, StopStream> running_;
  std::string failure_;
  int losses_in_a_row_ = 0;
};

}  // namespace lenticule::frames::capture
