// SPDX-License-Identifier: Apache-2.0
#include "tests/support/fakes/fake_v4l2.h"

#include <poll.h>

#include <algorithm>

namespace lenticule::test {
namespace {

class FakeDevice final : public frames::capture::V4l2Device {
 public:
  explicit FakeDevice(FakeCamera& camera) : camera_(camera) { ++camera_.open_count; }
  ~FakeDevice() override {
    camera_.log.emplace_back("close");
    --camera_.open_count;
  }

  [[nodiscard]] int control(unsigned long request, void* argument) noexcept override {
    return camera_.answer(request, argument);
  }
  [[nodiscard]] int poll(Nanoseconds timeout) noexcept override { return camera_.wait(timeout); }
  [[nodiscard]] void* map(size_t size, uint32_t offset) noexcept override {
    return camera_.map(size, offset);
  }
  void unmap(void*, size_t) noexcept override {
    camera_.log.emplace_back("unmap");
    --camera_.mapped;
  }
  [[nodiscard]] Nanoseconds now() const noexcept override { return camera_.clock; }

 private:
  FakeCamera& camera_;
};

}  // namespace

FakeCamera::FakeCamera() { formats = {{V4L2_PIX_FMT_GREY, {{8, 4}}}}; }

FakeControl& FakeCamera::control(uint32_t id) {
  return *std::find_if(controls.begin(), controls.end(),
                       [id](const FakeControl& control) { return control.id == id; });
}

long FakeCamera::logged(const std::string& what) const {
  return std::count(log.begin(), log.end(), what);
}

bool FakeCamera::released() const {
  return open_count == 0 && mapped == 0 && reserved == 0 && !streaming;
}

int FakeCamera::answer(unsigned long request, void* argument) {
  if (calls_until_unplugged && (*calls_until_unplugged)-- <= 0) unplugged = true;
  if (unplugged) {
    // A driver stops streaming by itself when its device is unplugged.
    if (request == VIDIOC_STREAMOFF) streaming = false;
    if (request == VIDIOC_REQBUFS) reserved = 0;
    return ENODEV;
  }
  std::deque<int>& scripted = errors[request];
  if (!scripted.empty()) {
    const int error = scripted.front();
    scripted.pop_front();
    if (error != 0) return error;
  }
  return perform(request, argument);
}

int FakeCamera::wait(Nanoseconds timeout) {
  ++polls;
  if (!poll_answers.empty()) {
    const int answer = poll_answers.front();
    poll_answers.pop_front();
    clock += std::chrono::milliseconds{1};
    return answer;
  }
  if (unplugged) return POLLPRI | POLLERR | POLLHUP;
  if (!events.empty()) return POLLPRI;
  if (frames.empty() && endless) {
    const Nanoseconds frame = std::chrono::milliseconds{33};
    if (timeout >= frame) frames.emplace_back();
    clock += std::min(timeout, frame);
  } else if (frames.empty()) {
    clock += timeout;
  }
  return frames.empty() ? 0 : POLLIN;
}

void* FakeCamera::map(size_t, uint32_t offset) {
  if (map_fails) return nullptr;
  log.emplace_back("map");
  ++mapped;
  return memory_.at(offset / 4096).data();
}

int FakeCamera::request_buffers(v4l2_requestbuffers& request) {
  if (request.count == 0) log.emplace_back(mapped > 0 ? "free while mapped" : "free");
  request.count = std::min(request.count, most_buffers);
  reserved = request.count;
  memory_.assign(reserved, std::vector<uint8_t>(current_.sizeimage));
  queued_.clear();
  return 0;
}

int FakeCamera::query_buffer(v4l2_buffer& buffer) {
  if (buffer.index >= reserved) return EINVAL;
  buffer.length = current_.sizeimage;
  buffer.m.offset = buffer.index * 4096;
  return 0;
}

int FakeCamera::queue(const v4l2_buffer& buffer) {
  if (buffer.index >= reserved) return EINVAL;
  if (std::find(queued_.begin(), queued_.end(), buffer.index) != queued_.end()) return EINVAL;
  queued_.push_back(buffer.index);
  return 0;
}

int FakeCamera::dequeue(v4l2_buffer& buffer) {
  if (!streaming || queued_.empty()) return EINVAL;
  if (frames.empty()) return EAGAIN;
  const FakeFrame frame = frames.front();
  frames.pop_front();
  buffer.index = frame.index.value_or(queued_.front());
  queued_.pop_front();
  if (buffer.index < reserved) {
    std::vector<uint8_t>& bytes = memory_[buffer.index];
    std::fill(bytes.begin(), bytes.end(), frame.code);
    std::copy_n(frame.bytes.begin(), std::min(frame.bytes.size(), bytes.size()), bytes.begin());
  }
  buffer.flags = frame.flags;
  buffer.bytesused = frame.bytesused.value_or(current_.sizeimage);
  buffer.sequence = frame.sequence.value_or(next_sequence_);
  next_sequence_ = buffer.sequence + 1;
  const int64_t micros =
      std::chrono::duration_cast<std::chrono::microseconds>(frame.time.value_or(clock)).count();
  buffer.timestamp = {.tv_sec = micros / 1'000'000, .tv_usec = micros % 1'000'000};
  return 0;
}

std::vector<frames::capture::V4l2Node> FakeSystem::nodes() {
  std::vector<frames::capture::V4l2Node> nodes;
  for (const Entry& entry : entries) nodes.push_back(entry.node);
  return nodes;
}

frames::capture::OpenedDevice FakeSystem::open(const std::string& path) {
  for (const Entry& entry : entries) {
    if (entry.node.path != path) continue;
    if (entry.open_error != 0) return {nullptr, entry.open_error};
    if (entry.camera->unplugged) return {nullptr, ENODEV};
    return {std::make_unique<FakeDevice>(*entry.camera), 0};
  }
  return {nullptr, ENOENT};
}

}  // namespace lenticule::test
