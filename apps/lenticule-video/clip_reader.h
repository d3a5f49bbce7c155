// SPDX-License-Identifier: Apache-2.0
// ClipReader decodes one video stream of a file, frame after frame in display order.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdarg>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "apps/lenticule-video/av_handles.h"
#include "apps/lenticule-video/hardware_decoders.h"
#include "apps/lenticule-video/stream_pixels.h"

namespace lenticule::video {

/// Watchdog acts when a call of a library does not return in time.
///
/// Watchdog calls `expired` on a thread of its own when a Watch lasts longer than `limit`. Signals
/// would not do: FFmpeg repeats an interrupted poll(). The time is counted in short waits of that
/// thread, so that a machine that was suspended, or gives the process no time, does not count.
///
/// Thread safety: one thread makes watches, one at a time.
class Watchdog {
 public:
  /// `expired` should end the process; it is called at most once.
  Watchdog(std::chrono::milliseconds limit, std::function<void()> expired);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// Watch limits the time of its scope. Lifetime: must not outlive the watchdog.
  class Watch {
   public:
    /// Watches nothing without a watchdog.
    explicit Watch(Watchdog* watchdog);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

   private:
    Watchdog* watchdog_;
  };

 private:
  void watch(bool on);
  void count();

  const int most_waits_;
  const std::function<void()> expired_;
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool watching_ = false;
  int waits_ = 0;  ///< number of waits in the present watch
  bool stopping_ = false;
  std::thread thread_;  // last member: the thread uses everything above
};

/// Returns why the stream's codec cannot be decoded; empty if it may be.
[[nodiscard]] std::string codec_obstacle(const AVCodecParameters& stream);

/// Returns true if the stream is HEVC with a second layer, as films of two views are (MV-HEVC).
[[nodiscard]] bool has_second_layer(const AVCodecParameters& stream);
/// Returns true if FFmpeg decodes two views of the stream; before version 7.1 it decodes the first.
[[nodiscard]] bool decodes_two_views(const AVStream& stream);

/// Opens the regular file of that name for reading. Throws Error(Input). Call it before confine().
[[nodiscard]] int open_clip_file(const std::string& name);

/// Container is an opened video file. It never opens another file by name, even if the file asks
/// for that.
class Container {
 public:
  /// `name` is for messages. Throws Error(Input) if the file is not a video.
  Container(const int& fd, std::string name);
  [[nodiscard]] AVFormatContext& format() { return *format_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Returns the wanted stream, or the first with pictures. Throws Error(Input) if there is none.
  [[nodiscard]] AVStream& video_stream(std::optional<int> wanted);

 private:
  std::string name_;
  AvIo io_;
  AvInput format_;  // last member: uses io_
};

/// The number of frames that a file claims to present.
struct ExpectedFrames {
  uint64_t frames = 0;
  /// The number is that of a constant rate until `end`, in units of the stream's time stamps;
  /// otherwise an index or a header states it.
  bool by_duration = false;
  double end = 0.0;
};
/// Returns none if the container claims no number, or only estimates it. The number may grow while
/// a fragmented file is read.
[[nodiscard]] std::optional<ExpectedFrames> expected_frames(const AVFormatContext& format,
                                                            AVStream& stream);

/// SliceErrors collects the packets in which FFmpeg's decoder of FFV1 found a wrong checksum. The
/// decoder replaces their slices by those of the frame before and reports that only in its log.
///
/// Thread safety: any thread.
class SliceErrors {
 public:
  /// Installs the log callback that hears the reports.
  SliceErrors();
  SliceErrors(const SliceErrors&) = delete;
  SliceErrors& operator=(const SliceErrors&) = delete;

  /// Listens to this decoder and to its copies in other threads, whose member `opaque` it takes.
  void watch(AVCodecContext& codec);
  /// Numbers the packet that is sent to the decoder next.
  void begin(AVCodecContext& codec, AVPacket& packet);
  /// Returns true if the packet of that number was damaged; forgets it and all before it.
  [[nodiscard]] bool take(int64_t packet);

 private:
  static void hear(void* source, int level, const char* format, va_list arguments);

  /// Packet is what the decoder that works on a packet points to.
  struct Packet {
    SliceErrors* errors = nullptr;
    int64_t number = 0;
  };
  /// More than a decoder works on at once: one for each of its threads.
  static constexpr size_t kMostAtOnce = 1024;

  std::mutex mutex_;
  std::set<int64_t> packets_;  ///< the damaged ones
  std::deque<Packet> begun_;
};

/// The decoder in use, and the reason for a change.
struct DecoderChoice {
  std::string name;  ///< FFmpeg's name
  bool hardware = false;
  std::string reason;  ///< the reason why it is not a hardware decoder; empty for one
};

struct ClipOptions {
  std::optional<int> stream{};              ///< default: the first with pictures
  int threads = 1;                          ///< threads of a software decoder
  std::vector<HardwareDecoder> hardware{};  ///< devices that this process may open
  /// Called for the first hardware decoder, and when a software decoder takes the place of
  /// hardware.
  std::function<void(const DecoderChoice&)> on_choice{};
  /// Called when a hardware decoder fails after its first picture, and on another thread when it
  /// does not answer; must end the process, so that a new one continues in software.
  std::function<void(const DecoderChoice&)> on_failure{};
};

/// ClipReader decodes in hardware where a device can. It changes to software for good if the device
/// reports an error, or gives a picture that the stream cannot have, instead of the first one.
///
/// Thread safety: one thread. Lifetime: the descriptor must outlive the reader.
class ClipReader {
 public:
  enum class Step { Frame, End };

  /// Throws Error(Input) for a file that cannot be decoded.
  ClipReader(const int& fd, std::string name, ClipOptions options);
  ~ClipReader();
  ClipReader(const ClipReader&) = delete;
  ClipReader& operator=(const ClipReader&) = delete;

  [[nodiscard]] const AVStream& stream() const { return *stream_; }
  /// Decodes the next picture. Packets that cannot be decoded, and pictures with a wrong checksum,
  /// are skipped and counted. Throws as the constructor.
  [[nodiscard]] Step next();
  [[nodiscard]] const AVFrame& frame() const { return *frame_; }
  /// Returns the other view of the same moment; null if the stream has one view.
  [[nodiscard]] const AVFrame* second_view() const { return two_views_ ? second_.get() : nullptr; }
  /// Returns true if frame() is for the right eye, and the second view for the left one.
  [[nodiscard]] bool begins_with_right() const;
  [[nodiscard]] std::optional<ExpectedFrames> expected() const {
    return expected_frames(container_->format(), *stream_);
  }
  /// Returns the time stamp of frame(), or AV_NOPTS_VALUE.
  [[nodiscard]] int64_t time() const {
    return untimed_ ? AV_NOPTS_VALUE : frame_->best_effort_timestamp;
  }
  /// Returns true if time may begin anew in the middle of the file.
  [[nodiscard]] bool times_may_jump() const;
  [[nodiscard]] uint64_t broken_packets() const { return broken_; }
  /// Returns the number of frames in which the decoder found errors.
  [[nodiscard]] uint64_t faulty_frames() const { return faulty_; }

  /// Seeks to the last key frame at or before `time`; returns false if the file does not support
  /// seeking. Throws as the constructor.
  [[nodiscard]] bool seek(int64_t time);
  /// Opens the file again, so that the first frame comes next, even if the container does not
  /// support seeking. Throws as the constructor.
  void reopen();

 private:
  void open();
  void open_decoder();
  [[nodiscard]] bool open_in_hardware();
  void open_in_software();
  void close_decoder();
  void begin(std::optional<int64_t> time);
  [[nodiscard]] Step next_in_software();
  [[nodiscard]] std::optional<Step> next_in_hardware();
  void give_up_hardware(const std::string& reason);
  [[nodiscard]] bool read_packet();
  [[nodiscard]] bool feed();
  [[nodiscard]] int send(const AVPacket* packet);
  [[nodiscard]] int receive();
  [[nodiscard]] bool is_spoilt();
  [[nodiscard]] bool completes_pair();

  const int& fd_;
  std::string name_;
  ClipOptions options_;
  std::unique_ptr<Watchdog> watchdog_;  ///< present while a hardware decoder is in use
  std::unique_ptr<Container> container_;
  AVStream* stream_ = nullptr;
  SliceErrors slice_errors_;  // must precede codec_, which uses it
  AvCodec codec_;
  AvPacket packet_;
  AvFrame frame_;
  AvFrame second_;
  bool two_views_ = false;
  bool awaits_second_ = false;  ///< second_ is a view whose other one has not been decoded yet
  bool in_hardware_ = false;
  bool draining_ = false;
  bool awaits_key_ = false;    ///< an FFV1 frame was damaged, and later ones may depend on it
  bool packet_waits_ = false;  ///< the device had no room for packet_
  bool untimed_ = false;       ///< the device replaces missing time stamps by zero
  std::string obstacle_;       ///< fault of the device
  uint64_t broken_ = 0;
  uint64_t faulty_ = 0;
  int read_errors_ = 0;

  std::optional<int64_t> start_;  ///< time of the last seek() since open()
  bool delivered_ = false;        ///< a hardware decoder gave a picture since then
  /// Times of frames that an edit list hides; a device does not know of that.
  std::set<int64_t> hidden_;
};

}  // namespace lenticule::video
