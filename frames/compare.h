// SPDX-License-Identifier: Apache-2.0
// How far one picture is from another, in code values: in total, per channel, and per view of a
// rig.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::frames {

/// Differences of 8-bit code values, gathered sample by sample.
class Difference {
 public:
  void add(uint8_t reference, uint8_t test) {
    const auto distance =
        static_cast<unsigned>(reference > test ? reference - test : test - reference);
    ++histogram_[distance];
  }
  void add(const Difference& other);

  [[nodiscard]] uint64_t samples() const { return count_over(-1); }
  /// Mean squared error; 0 without samples.
  [[nodiscard]] double mse() const;
  [[nodiscard]] double rmse() const;
  /// 10 log10(255^2 / MSE); empty where nothing differs.
  [[nodiscard]] std::optional<double> psnr_db() const;
  [[nodiscard]] int max() const;
  /// Samples that differ by more than `levels`.
  [[nodiscard]] uint64_t count_over(int levels) const;
  /// The same as a share of all samples, 0 to 1.
  [[nodiscard]] double share_over(int levels) const;

 private:
  std::array<uint64_t, 256> histogram_{};  // exact and independent of the order
};

struct PictureDifference {
  std::array<Difference, 3> channels;  ///< red, green, blue
  Difference total;
};

/// Throws Error(Input) if the sizes differ.
void require_same_size(const FrameView& reference, const FrameView& test);

/// Throws Error(Input) if the sizes differ.
[[nodiscard]] PictureDifference compare_pictures(const FrameView& reference, const FrameView& test);

/// Where the pictures differ: per pixel the largest difference of its channels as a colour, the
/// same for every picture: black none, then blue, green, yellow and red to white for 255, by the
/// logarithm, so that single levels show, too. Throws Error(Input) if the sizes differ.
[[nodiscard]] WovenFrame error_picture(const FrameView& reference, const FrameView& test);

/// round(P): as many views as subpixels lie under a lens.
[[nodiscard]] int native_view_count(const optics::Rig& rig);

/// The differences of the subpixels of each of `views` views: subpixel with view number v belongs
/// to view ceil(v) - 1, 0 is the leftmost. Throws Error(Input) if a picture is not of the panel's
/// size, Error(Usage) unless 1 <= views <= 4096.
[[nodiscard]] std::vector<Difference> compare_views(const FrameView& reference,
                                                    const FrameView& test,
                                                    const optics::OpticalModel& model, int views);

/// Index of the view that is furthest off by MSE; the first of equals.
[[nodiscard]] int worst_view(const std::vector<Difference>& views);

}  // namespace lenticule::frames
