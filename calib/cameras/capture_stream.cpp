// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/capture_stream.h"

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>

#include "base/error.h"

namespace lenticule::calib {
namespace {

constexpr Nanoseconds kOldestStamp = std::chrono::seconds{10};
/// Tolerance in addition to the time of a frame: some drivers compute the expected end of the
/// frame.
constexpr Nanoseconds kAheadAllowed = std::chrono::milliseconds{5};

}  // namespace

Nanoseconds ExposureClock::exposed_at(const BufferStamp& stamp, Nanoseconds now) {
  const bool plausible = stamp.monotonic && stamp.time <= now + frame_ + kAheadAllowed &&
                         stamp.time > now - kOldestStamp && stamp.time >= last_stamp_;
  const Nanoseconds half = (frame_ + exposure_) / 2;
  if (!plausible) {
    unreliable_ = true;
    return now - half;
  }
  last_stamp_ = stamp.time;
  return std::min(stamp.start_of_exposure ? stamp.time + half : stamp.time - half, now);
}

uint64_t ExposureClock::count(uint32_t sequence) {
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

namespace {

constexpr uint32_t kWantedBuffers = 6;
constexpr uint32_t kFewestBuffers = 2;
constexpr uint32_t kMostBuffers = 64;
constexpr size_t kLargestBuffer = size_t{1} << 30;
constexpr int kMostLossesInARow = 64;
/// Limits the retries with a driver that reports "ready" without a picture, or during a flood of
/// signals.
constexpr int kMostEmptyLooks = 1000;

v4l2_buffer buffer_number(uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

int request_buffers(V4l2Device& device, uint32_t& count) {
  v4l2_requestbuffers request{};
  request.count = count;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  const int error = v4l2_call(device, VIDIOC_REQBUFS, &request);
  count = request.count;
  return error;
}

BufferStamp stamp_of(const v4l2_buffer& buffer) {
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

}  // namespace

CaptureStream::Reservation::~Reservation() {
  uint32_t none = 0;
  (void)request_buffers(device, none);
}

CaptureStream::Running::~Running() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  (void)v4l2_call(device, VIDIOC_STREAMOFF, &type);
}

CaptureStream::CaptureStream(V4l2Device& device, V4l2System& system, const std::string& path)
    : device_(device), reservation_(device) {
  uint32_t count = kWantedBuffers;
  int error = request_buffers(device_, count);
  if (error == 0 && (count < kFewestBuffers || count > kMostBuffers)) error = ENOMEM;
  for (uint32_t i = 0; error == 0 && i < count; ++i) error = map_buffer(i);
  for (uint32_t i = 0; error == 0 && i < count; ++i) error = queue(i);
  if (error != 0) throw camera_failure(system, path, "get buffers", error);
}

int CaptureStream::map_buffer(uint32_t index) {
  v4l2_buffer buffer = buffer_number(index);
  const int error = v4l2_call(device_, VIDIOC_QUERYBUF, &buffer);
  if (error != 0) return error;
  if (buffer.length == 0 || buffer.length > kLargestBuffer) return ENOMEM;
  void* const memory = device_.map(buffer.length, buffer.m.offset);
  if (memory == nullptr) return ENOMEM;
  buffers_.emplace_back(memory, Unmap{.device = &device_, .size = buffer.length});
  return 0;
}

int CaptureStream::queue(uint32_t index) {
  v4l2_buffer buffer = buffer_number(index);
  return v4l2_call(device_, VIDIOC_QBUF, &buffer);
}

void CaptureStream::start(V4l2System& system, const std::string& path) {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  const int error = v4l2_call(device_, VIDIOC_STREAMON, &type);
  if (error != 0) throw camera_failure(system, path, "start the stream", error);
  running_ = std::make_unique<Running>(device_);
}

GrabStatus CaptureStream::acquire(CapturedBuffer& out, Nanoseconds deadline) {
  if (!failure_.empty()) return GrabStatus::Gone;
  for (int looks = 0; looks < kMostEmptyLooks; ++looks) {
    const Nanoseconds left = std::max(deadline - device_.now(), Nanoseconds{0});
    switch (dequeue(out, left)) {
      case Step::Taken:
        losses_in_a_row_ = 0;
        return GrabStatus::Ready;
      case Step::Lost:
        return GrabStatus::Corrupt;
      case Step::Gone:
        return GrabStatus::Gone;
      case Step::Nothing:
        break;
    }
    if (device_.now() >= deadline) break;
  }
  return GrabStatus::TimedOut;
}

CaptureStream::Step CaptureStream::dequeue(CapturedBuffer& out, Nanoseconds left) {
  const int events = device_.poll(left);
  if (events < 0) return gone(-events);
  if (events == 0) return Step::Nothing;
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
  out.bytes = {static_cast<const uint8_t*>(memory.get()), std::min<size_t>(buffer.bytesused, room)};
  out.stamp = stamp_of(buffer);
  return Step::Taken;
}

/// Decides the next step after a failed dequeue. The kernel's documentation uses EIO for temporary
/// errors too, such as a lost signal; if the stream itself is broken, poll() reports an error as
/// well.
CaptureStream::Step CaptureStream::nothing_dequeued(int error, bool broken) {
  if (error == EAGAIN || error == EINTR) return broken ? gone(EIO) : Step::Nothing;
  if (error == EIO && !broken && ++losses_in_a_row_ < kMostLossesInARow) return Step::Lost;
  return gone(error);
}

CaptureStream::Step CaptureStream::gone(int error) {
  failure_ = error == ENODEV ? "unplugged" : "the stream broke: " + error_text(error);
  return Step::Gone;
}

bool CaptureStream::give_back(uint32_t index) {
  const int error = queue(index);
  if (error != 0) gone(error);
  return error == 0;
}

}  // namespace lenticule::calib
