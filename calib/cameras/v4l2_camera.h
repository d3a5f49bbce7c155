// SPDX-License-Identifier: Apache-2.0
// Opens cameras of the kernel's V4L2: USB webcams, capture cards. Data flow: the driver's buffer,
// V4L2's colour rules, linear light. libv4l is not used, so it converts no picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "calib/cameras/pixel_unpack.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

// CaptureStream is a running capture: buffers that the driver fills, mapped into memory and read by
// the program.

// ExposureClock computes the exposure times of pictures and the number of lost pictures from the
// stamps of the driver's buffers.

/// BufferStamp is the driver's stamp of a buffer.
struct BufferStamp {
  uint32_t sequence = 0;
  Nanoseconds time{0};
  bool monotonic = false;          ///< the time is CLOCK_MONOTONIC
  bool start_of_exposure = false;  ///< otherwise the stamp was taken when the last byte arrived
};

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
  /// before the previous stamp are replaced with `now`.
  [[nodiscard]] Nanoseconds exposed_at(const BufferStamp& stamp, Nanoseconds now);
  /// Returns a 64-bit count, which continues where the camera's 32 bits wrap, and adds one where
  /// the camera restarts its count.
  [[nodiscard]] uint64_t count(uint32_t sequence);
  /// Returns true if any stamp so far had to be replaced.
  [[nodiscard]] bool unreliable() const { return unreliable_; }

 private:
  Nanoseconds exposure_;
  Nanoseconds frame_;
  Nanoseconds last_stamp_{0};
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
  CaptureStream(V4l2Device& device, V4l2System& system, const std::string& path);
  /// Starts the stream. Throws Error(Device).
  void start(V4l2System& system, const std::string& path);

  /// Waits until `deadline` on the device's clock for the oldest filled buffer. Ready: the caller
  /// must give the buffer back after reading. Corrupt: the driver lost a picture, and there is no
  /// buffer to give back. Gone: failure() has the cause, and all later calls return Gone too.
  [[nodiscard]] GrabStatus acquire(CapturedBuffer& out, Nanoseconds deadline);
  /// Returns a buffer to the driver, to be filled again. Returns false if the camera is gone.
  [[nodiscard]] bool give_back(uint32_t index);
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct FreeBuffers {
    void operator()(V4l2Device* device) const noexcept;
  };
  struct Unmap {
    V4l2Device* device;
    size_t size;
    void operator()(void* memory) const noexcept { device->unmap(memory, size); }
  };
  using Mapping = std::unique_ptr<void, Unmap>;
  struct StopStream {
    void operator()(V4l2Device* device) const noexcept;
  };

  [[nodiscard]] int map_buffer(uint32_t index);
  [[nodiscard]] int queue(uint32_t index);
  enum class Step { Taken, Nothing, Lost, Gone };
  [[nodiscard]] Step dequeue(CapturedBuffer& out, Nanoseconds left);
  [[nodiscard]] Step nothing_dequeued(int error, bool broken);
  Step gone(int error);

  V4l2Device& device_;
  // Members are destroyed from the last to the first.
  std::unique_ptr<V4l2Device, FreeBuffers> reservation_;
  std::vector<Mapping> buffers_;
  std::unique_ptr<V4l2Device, StopStream> running_;
  std::string failure_;
  int losses_in_a_row_ = 0;
};

struct FormatRequest {
  int width = 0;  ///< 0: as near to 1920x1080 as available
  int height = 0;
  double frames_per_second = 30.0;
  std::string pixel_format{};  ///< "YUYV"; empty: the best one for measuring
};

/// AgreedFormat is the format that the driver reports to deliver.
struct AgreedFormat {
  RawFormat raw;
  double frames_per_second = 0.0;  ///< 0 if the camera does not report it
};

struct FrameSize {
  int width = 0;
  int height = 0;
};

/// FormatOffer is one pixel format of a camera with its sizes; a range of sizes is represented by
/// its largest.
struct FormatOffer {
  uint32_t fourcc = 0;
  std::vector<FrameSize> sizes;
};

/// Returns the camera's formats, including formats that cannot be unpacked. Never throws for the
/// driver's answers; an endless list is cut off.
[[nodiscard]] std::vector<FormatOffer> offered_formats(V4l2Device& device);

/// Sets the format and the frame rate and reads them back. A format whose pictures have less than
/// half the requested pixels is tried after formats with more. Inputs that follow a signal (HDMI)
/// are set to the arriving signal. Throws Error(Device): no usable format, no signal, interlaced,
/// in use.
[[nodiscard]] AgreedFormat agree_on_format(V4l2Device& device, V4l2System& system,
                                           const std::string& path, const FormatRequest& request);

// CameraControls keeps a camera constant: it switches off all automatic controls, sets all manual
// ones, and remembers the values that the camera reports afterwards.

struct ControlRequests {
  double refresh_hz = 60.0;  ///< refresh rate of the display
  int exposure_periods =
      2;  ///< refreshes per exposure: every row is then exposed for whole refreshes
  std::optional<int> gain{};  ///< camera's own units, like the next two; absent: unchanged
  std::optional<int> white_balance_kelvin{};
  std::optional<int> focus{};
};

/// ControlInfo describes a control as the driver reports it. Ranges are clipped to 32 bits.
struct ControlInfo {
  uint32_t id = 0;
  uint32_t type = 0;
  uint32_t flags = 0;
  std::string name;
  int64_t minimum = 0;
  int64_t maximum = 0;
  int64_t step = 1;
};

/// Returns the exposure nearest to `periods` refreshes that the control supports, in its unit of
/// 100 us: fewer refreshes if the control's maximum is too small, more if its minimum is too large;
/// if no whole number of refreshes fits, the nearest value.
[[nodiscard]] int64_t whole_refreshes(const ControlInfo& exposure, double refresh_hz, int periods);

/// CameraControls locks the controls of one camera.
///
/// Thread safety: one thread.
///
/// Lifetime: the device must outlive this object.
class CameraControls {
 public:
  CameraControls(V4l2Device& device, const ControlRequests& requests);

  /// Switches automatic controls off first, since they make the others inactive, then sets values,
  /// then reads all values back. Call it again after the stream has started, because some cameras
  /// forget the values. Returns 0, or ENODEV if the camera is gone; other failures become sentences
  /// in unlocked().
  [[nodiscard]] int lock();
  /// Returns the properties that the last lock() could not hold constant.
  [[nodiscard]] const std::vector<std::string>& unlocked() const { return unlocked_; }
  /// Returns the controls that have changed by themselves since the last lock().
  [[nodiscard]] std::vector<std::string> drifted();
  /// Returns the exposure time, if the camera reports it.
  [[nodiscard]] std::optional<Nanoseconds> exposure() const { return exposure_; }

 private:
  struct Rule;
  struct Locked {
    uint32_t id;
    std::string name;
    int64_t value;
  };
  static const std::vector<Rule>& rules();

  [[nodiscard]] std::vector<ControlInfo> enumerate();
  [[nodiscard]] std::optional<ControlInfo> query(uint32_t id_and_flags);
  [[nodiscard]] int transfer(unsigned long request, uint32_t id, int64_t& value);
  [[nodiscard]] int apply(const Rule& rule);
  [[nodiscard]] int set(const Rule& rule, const ControlInfo& control, int64_t wanted);
  [[nodiscard]] int keep(const Rule& rule, const ControlInfo& control);
  [[nodiscard]] std::optional<int64_t> wanted_value(const Rule& rule, const ControlInfo& control);
  void evaluate(const Rule& rule, const ControlInfo& control, int64_t wanted, int64_t got);
  void evaluate_exposure(int64_t got);
  void say_what_is_missing(const std::vector<ControlInfo>& controls);

  V4l2Device& device_;
  ControlRequests requests_;
  std::vector<Locked> locked_;
  std::vector<std::string> unlocked_;
  std::optional<Nanoseconds> exposure_;
};

/// Returns the node that the user's text names; see V4l2Options::device. Throws Error(Device) when
/// there is no camera, Error(Usage) when there are several and none is named.
[[nodiscard]] V4l2Node find_camera(V4l2System& system, const std::string& wanted);

struct V4l2Options : FormatRequest, ControlRequests {
  /// "/dev/video2", "video2", or a name in /dev/v4l/by-id or by-path; empty: the only camera.
  std::string device;
  /// Pictures dropped after the start, because cameras deliver old ones or are still adjusting.
  int skipped_pictures = 4;
};

/// Opens a camera, negotiates a format, locks the controls and starts the stream. facts() reports
/// the format that the driver really delivers; facts().unlocked grows when timestamps turn out to
/// be unusable. now() is CLOCK_MONOTONIC. A camera that is Gone has been closed and must be opened
/// again. Throws Error(Device): missing, busy, no permission, not a camera, no usable format;
/// Error(Usage): several cameras and none named, options out of range.
///
/// Lifetime: `system` must outlive the camera.
[[nodiscard]] std::unique_ptr<Camera> open_v4l2_camera(const V4l2Options& options,
                                                       V4l2System& system = linux_v4l2());

struct CameraFormat {
  std::string pixel_format;
  bool usable = false;
  std::vector<std::string> sizes;  ///< "1920x1080"
};

struct CameraListing {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/...", empty if there is none
  std::string name;
  std::string bus;
  std::vector<CameraFormat> formats;
  std::string problem;  ///< reason why the node could not be queried; empty if it could
};

/// Lists all nodes that are cameras, and nodes that could not be opened. Starts no stream.
[[nodiscard]] std::vector<CameraListing> list_cameras(V4l2System& system = linux_v4l2());

}  // namespace lenticule::calib
