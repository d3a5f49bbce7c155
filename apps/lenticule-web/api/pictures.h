// SPDX-License-Identifier: Apache-2.0
// PictureMaker makes JPEG pictures of the displayed frame, as it is and as an eye sees it. The
// simulation runs in this process, so that it takes no time from the player.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "apps/lenticule-web/http/access.h"
#include "apps/lenticule-web/link/control_link.h"
#include "frames/frame.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::web {

/// SharedFrame is a copy of the frame that the player shares.
struct SharedFrame {
  frames::FrameGeometry geometry;
  size_t row_bytes = 0;
  std::vector<uint8_t> pixels;
  std::string rig_toml;
  uint64_t number = 0;
};
/// Copies the content of the memory that came with `answer`, the answer to `frame`. Throws
/// Error(Failed) if the memory is smaller than the answer states, or changes all the time.
[[nodiscard]] SharedFrame copy_shared_frame(const nlohmann::ordered_json& answer, int descriptor);

/// Returns the picture with the average of each block of pixels; `width` is at most the frame's.
[[nodiscard]] optics::RgbPicture reduced(const SharedFrame& frame, int width);
[[nodiscard]] std::string jpeg_of(const optics::RgbPicture& picture, int quality);

/// Returns, as JPEG, what the eye sees of a chart that is white for this eye only. The chart is
/// woven with the rig `woven` and seen through the sheet of the rig `seen`, to compare both.
[[nodiscard]] std::string comb_picture(const optics::Rig& woven, const optics::Rig& seen,
                                       const optics::Eye& eye);

/// Thread safety: any thread. One picture is made at a time, so that pages take at most one core.
class PictureMaker {
 public:
  explicit PictureMaker(ControlLink& link) : link_(link) {}

  static constexpr int kMinWidth = 64;
  static constexpr int kMaxWidth = 1920;

  /// Return JPEG files. Throw Error, and HttpError 403 for a frame that shows a code to a sender
  /// who may not change anything: the code may hold a token that may.
  [[nodiscard]] std::string frame(int width, Rights rights);
  [[nodiscard]] std::string eye(const optics::Eye& eye, int width, Rights rights);
  /// Returns the optical model of the rig, with its trim, for which frames are woven now.
  [[nodiscard]] optics::OpticalModel model();
  /// Returns the text of that rig file.
  [[nodiscard]] std::string rig_toml();

 private:
  /// Taken is a frame and the optical model of its rig.
  struct Taken {
    SharedFrame frame;
    bool shows_code = false;
    std::shared_ptr<const optics::OpticalModel> model;
  };
  [[nodiscard]] std::shared_ptr<const Taken> take_frame(std::chrono::milliseconds oldest);
  [[nodiscard]] std::shared_ptr<const Taken> take_frame_for(Rights rights);
  [[nodiscard]] bool panel_shows_code();

  ControlLink& link_;
  std::mutex one_picture_;  ///< held while a picture is made
  std::mutex mutex_;        ///< guards the members below
  std::shared_ptr<const Taken> taken_;
  std::chrono::steady_clock::time_point taken_at_{};
};

}  // namespace lenticule::web
