// SPDX-License-Identifier: Apache-2.0
// CaptureSource provides the pictures of cameras and HDMI grabbers as they come: the newest picture
// replaces older ones, so that no queue adds to the delay. The pictures of several cameras are
// paired by their time stamps, and lie side by side in one picture.
//
//   driver's buffer -> LiveCameras (newest of each camera, codes) -> CaptureFeed (a thread, newest
//   picture) -> CaptureSource of each item that shows it
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "frames/capture/capture_stream.h"
#include "frames/capture/code_converter.h"
#include "frames/frame_source.h"
#include "player/playback/play_statistics.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

/// CaptureStatistics is written by the threads that capture and weave. Thread safety: any thread
/// reads; each member has one writer at a time.
struct CaptureStatistics {
  std::string device;           ///< constant: devices, size, format and rate
  Counter pictures;             ///< pictures that were captured whole
  Counter lost;                 ///< gaps in the driver's numbers
  Counter damaged;              ///< pictures that the driver or the decoder called damaged
  Counter unpaired;             ///< pictures without one of the other cameras at the same time
  Counter superseded;           ///< pictures replaced by a newer one before they were used
  Counter woven_superseded;     ///< the same, after weaving
  LatencyHistogram arrival;     ///< from the driver's stamp until the picture was taken
  LatencyHistogram conversion;  ///< to codes
  LatencyHistogram weaving;
  LatencyHistogram apart;  ///< between the stamps of the pictures of one moment
};
[[nodiscard]] nlohmann::ordered_json to_json(const CaptureStatistics& statistics);

/// LiveCameras opens the cameras of a source and returns the pictures of one moment.
///
/// Thread safety: one thread.
class LiveCameras {
 public:
  using Nanoseconds = frames::capture::Nanoseconds;

  /// `panel` is the size that the display can use. Throws Error(Device) and Error(Usage) as
  /// open_camera() and agree_on_format() do, and for cameras of different sizes.
  ///
  /// Lifetime: `system` and `statistics` must outlive the object.
  LiveCameras(const CaptureSpec& spec, const frames::FrameGeometry& panel,
              frames::capture::V4l2System& system, CaptureStatistics& statistics);
  ~LiveCameras();

  /// Returns the size of all pictures side by side.
  [[nodiscard]] frames::FrameGeometry geometry() const;
  /// Returns the rate of the slowest camera; none if one does not say.
  [[nodiscard]] std::optional<frames::Rate> rate() const;
  /// Waits at most `timeout` for new pictures of all cameras and converts the newest ones. `to` has
  /// geometry(); `captured` is the earliest stamp. Gone: failure() has the cause.
  [[nodiscard]] frames::capture::GrabStatus next(frames::WovenFrame& to, Nanoseconds& captured,
                                                 Nanoseconds timeout);
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct Camera;
  [[nodiscard]] frames::capture::GrabStatus fetch(Camera& camera, Nanoseconds timeout);
  [[nodiscard]] frames::capture::GrabStatus silent(Camera& camera, Nanoseconds waited);
  [[nodiscard]] static bool give_back_before(Camera& camera, size_t end);
  [[nodiscard]] bool found_moment();
  [[nodiscard]] bool convert(frames::WovenFrame& to, Nanoseconds& captured);
  [[nodiscard]] frames::capture::GrabStatus gone(const Camera& camera, const std::string& why);

  std::vector<std::unique_ptr<Camera>> cameras_;
  CaptureStatistics& statistics_;
  std::string failure_;
};

struct OpenedCapture {
  std::unique_ptr<frames::FrameSource> pictures;
  std::shared_ptr<CaptureStatistics> statistics{};
};

/// Opens cameras, or shares those that another item of this process shows by the same name. pull()
/// returns Failed with the cause when a camera is unplugged, its signal is lost or changes, or it
/// sends no picture for three seconds; its devices are closed then. Throws as parse_capture() and
/// LiveCameras do.
///
/// Lifetime: `system` must outlive the source.
[[nodiscard]] OpenedCapture open_capture(
    const std::string& text, const frames::FrameGeometry& panel,
    frames::capture::V4l2System& system = frames::capture::linux_v4l2());

/// Returns the formats and sizes that the cameras of a source offer, for --preflight.
[[nodiscard]] nlohmann::ordered_json capture_offers(
    const std::string& text, frames::capture::V4l2System& system = frames::capture::linux_v4l2());

}  // namespace lenticule::player
