// SPDX-License-Identifier: Apache-2.0
// Reads the frames of a film that a phone took of the chart; the confined decoder decodes them.
#pragma once

#include <poll.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "calib/camera.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "player/process/interrupt.h"
#include "player/sources/source_spec.h"
#include "player/sources/video_probe.h"
#include "player/sources/video_source.h"

namespace lenticule::tools {

/// Returns true for a film that is not hidden.
inline bool is_film(const std::filesystem::path& file) {
  std::error_code unreadable;  // an unreadable entry counts as not a regular file
  return std::filesystem::is_regular_file(file, unreadable) && file.filename().string()[0] != '.' &&
         player::kind_of_file(file) == player::SourceKind::Video;
}

/// Returns a frame in linear light as the sensor stored it: rows are read from the top.
inline calib::CameraPicture sensor_picture(const frames::FrameView& frame,
                                           frames::Orientation orientation) {
  using frames::Orientation;
  frames::FrameGeometry size = frame.geometry;
  std::vector<uint8_t> codes(frame.bytes.begin(), frame.bytes.end());
  if (orientation != Orientation::Upright) {
    const Orientation back = orientation == Orientation::QuarterTurn ? Orientation::ThreeQuarterTurn
                             : orientation == Orientation::ThreeQuarterTurn
                                 ? Orientation::QuarterTurn
                                 : orientation;
    frames::turn_upright(frame.bytes, frame.geometry, back, codes);
    size = frames::oriented_geometry(size, back);
  }
  calib::CameraPicture picture;
  picture.width = size.width;
  picture.height = size.height;
  picture.channels = 3;
  picture.light.reserve(codes.size());
  for (const uint8_t code : codes)
    picture.light.push_back(static_cast<float>(frames::linear_of_codes()[code]));
  return picture;
}

/// Calls `use` with the wanted frames, each with its number and its time in seconds, in their order
/// until it returns false. `wanted` gets the number and the rate. `use` may keep a frame.
/// Returns false if the user interrupted. Throws Error(Input) if the file is not a film, states no
/// rate, or is damaged.
inline bool read_film(const std::filesystem::path& file,
                      const std::function<bool(uint64_t, double)>& wanted,
                      const std::function<bool(uint64_t, double, calib::CameraPicture)>& use) {
  const auto accept = [&file](const frames::FrameGeometry& size) {
    constexpr int64_t kMostPixels = 40'000'000;
    if (int64_t{size.width} * size.height > kMostPixels)
      throw input_error("{}: {} x {} pixels are too many for a film of a phone", file.string(),
                        size.width, size.height);
  };
  const auto source =
      player::open_video({.file = file, .slots = 4, .before_weaving = true, .accept = accept});
  const auto orientation = player::probe_video(file).front().orientation;
  if (!source->rate())
    throw input_error("{}: the film states no frame rate", file.string())
        .remedy("give the file as the phone stored it");
  const double hertz = source->rate()->hertz();
  const auto see = [&](const frames::AcquiredFrame& frame) {
    // A repeated frame is of an earlier time.
    if (frame.repeats || !wanted(frame.number, hertz)) return true;
    return use(frame.number, static_cast<double>(frame.number) / hertz,
               sensor_picture(frame.frame, orientation.value_or(frames::Orientation::Upright)));
  };
  while (!player::interrupted()) {
    frames::AcquiredFrame frame;
    switch (source->pull(frame)) {
      case frames::PullStatus::Ready: {
        const bool goes_on = see(frame);
        source->release(frame.token);
        if (!goes_on) return true;
        break;
      }
      case frames::PullStatus::NotYet: {  // the source replaces a decoder that hangs, or fails
        constexpr int kLookMs = 50;
        pollfd wake{source->wake_fd(), POLLIN, 0};
        (void)poll(&wake, 1, kLookMs);
        source->service();
        break;
      }
      case frames::PullStatus::End:
        return true;
      case frames::PullStatus::Failed:
        throw Error(ErrorKind::Input, source->failure(), "give the file as the phone stored it");
    }
  }
  return false;
}

}  // namespace lenticule::tools
