// SPDX-License-Identifier: Apache-2.0
// Simulates a V4L2 camera from a table: answers the calls as drivers do, logs them, and fails on
// request. Time passes only while a caller waits.
#pragma once

#include <linux/videodev2.h>

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frames/capture/capture_format.h"
#include "frames/capture/v4l2_device.h"

namespace lenticule::test {

using frames::capture::Nanoseconds;

struct FakeControl {
  uint32_t id = 0;
  std::string name;
  int64_t minimum = 0;
  int64_t maximum = 1;
  int32_t value = 0;
  uint32_t flags = 0;
  int64_t step = 1;
  uint32_t type = V4L2_CTRL_TYPE_INTEGER;
};

/// A picture that the driver has ready. Members without a value get valid defaults.
struct FakeFrame {
  uint8_t code = 128;  ///< value of every byte
  uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::optional<uint32_t> bytesused{};
  std::optional<uint32_t> sequence{};
  std::optional<uint32_t> index{};
  std::optional<Nanoseconds> time{};
  std::vector<uint8_t> bytes{};  ///< the first bytes of the picture; the others are `code`
};

/// A fake camera. Its public members are the script; a test may change them at any time.
class FakeCamera {
 public:
  FakeCamera();

  std::string card = "Fake Camera";
  uint32_t device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<frames::capture::FormatOffer> formats;
  /// Changes a format that the driver accepts.
  std::function<void(v4l2_pix_format&)> adjust = [](v4l2_pix_format&) {};
  std::vector<FakeControl> controls;
  /// Appends odd controls without end.
  bool endless_controls = false;
  /// Called when a control is set, to change others.
  std::function<void(FakeCamera&, uint32_t id, int32_t value)> on_set;
  /// errno of the next calls of a request; 0 lets a call succeed.
  std::map<unsigned long, std::deque<int>> errors;
  /// After this many further calls every call fails with ENODEV.
  std::optional<int> calls_until_unplugged{};
  bool map_fails = false;
  uint32_t most_buffers = 32;
  v4l2_fract interval{1, 30};
  bool reports_rate = true;
  /// errno of QUERY_DV_TIMINGS: ENOTTY for a camera.
  int signal_error = ENOTTY;
  v4l2_bt_timings timings{};
  uint32_t input_status = 0;  ///< V4L2_IN_ST_...
  /// Frames per second of a format, as ENUM_FRAMEINTERVALS lists them; empty: not listed.
  std::function<double(uint32_t fourcc, uint32_t width)> fastest;
  std::deque<uint32_t> events;  ///< V4L2_EVENT_... that are ready
  /// Frames that are ready, in order; with `endless` more are made when they run out.
  std::deque<FakeFrame> frames;
  bool endless = true;
  /// Wrong results of poll(), one per call.
  std::deque<int> poll_answers;

  // Time and log of the calls so far.
  Nanoseconds clock = std::chrono::seconds{100};
  std::vector<std::string> log;  ///< "S_FMT", "set Gain=3", "map", ...
  int polls = 0;
  int open_count = 0;
  int mapped = 0;
  uint32_t reserved = 0;
  bool streaming = false;
  bool unplugged = false;

  [[nodiscard]] FakeControl& control(uint32_t id);
  [[nodiscard]] long logged(const std::string& what) const;
  /// Returns true if nothing is open, mapped, reserved or streaming.
  [[nodiscard]] bool released() const;

  int answer(unsigned long request, void* argument);
  int wait(Nanoseconds timeout);
  void* map(size_t size, uint32_t offset);

 private:
  int perform(unsigned long request, void* argument);
  int query_capabilities(v4l2_capability& capability);
  int enumerate_format(v4l2_fmtdesc& description);
  int enumerate_size(v4l2_frmsizeenum& size);
  int enumerate_interval(v4l2_frmivalenum& offer) const;
  int set_format(v4l2_format& format, bool really);
  int set_rate(v4l2_streamparm& parameters);
  int query_control(v4l2_query_ext_ctrl& asked);
  int get_controls(v4l2_ext_controls& controls);
  int set_controls(v4l2_ext_controls& controls);
  int request_buffers(v4l2_requestbuffers& request);
  int query_buffer(v4l2_buffer& buffer);
  int queue(const v4l2_buffer& buffer);
  int dequeue(v4l2_buffer& buffer);

  v4l2_pix_format current_{};
  std::vector<std::vector<uint8_t>> memory_;
  std::deque<uint32_t> queued_;
  uint32_t next_sequence_ = 0;
};

/// A system with device nodes and the fake cameras behind them.
class FakeSystem final : public frames::capture::V4l2System {
 public:
  struct Entry {
    frames::capture::V4l2Node node;
    FakeCamera* camera = nullptr;
    int open_error = 0;
  };
  std::vector<Entry> entries;
  std::string holder;
  std::string owning_group = "video";

  [[nodiscard]] std::vector<frames::capture::V4l2Node> nodes() override;
  [[nodiscard]] frames::capture::OpenedDevice open(const std::string& path) override;
  [[nodiscard]] std::string holders(const std::string&) override { return holder; }
  [[nodiscard]] std::string group(const std::string&) override { return owning_group; }
};

/// A system with one camera at /dev/video0.
struct OneCamera {
  OneCamera() { system.entries.push_back({{"/dev/video0", ""}, &camera, 0}); }
  FakeCamera camera;
  FakeSystem system;
};

}  // namespace lenticule::test
