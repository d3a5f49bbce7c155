// SPDX-License-Identifier: Apache-2.0
// Measures the difference of two pictures in code values: in total, per channel, and per view of a
// rig.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"

namespace lenticule::frames {

/// Difference accumulates differences of 8-bit code values, sample by sample.
class Difference {
 public:
  void add(uint8_t reference, uint8_t test) {
    const auto distance =
        static_cast<unsigned>(reference > test ? reference - test : test - reference);
    ++histogram_[distance];
  }
  void add(const Difference& other);

  [[nodiscard]] uint64_t samples() const { return count_over(-1); }
  /// Returns the mean squared error; 0 without samples.
  [[nodiscard]] double mse() const;
  [[nodiscard]] double rmse() const;
  /// Returns 10 log10(255^2 / MSE); empty if the pictures are equal.
  [[nodiscard]] std::optional<double> psnr_db() const;
  [[nodiscard]] int max() const;
  /// Returns the number of samples that differ by more than `levels`.
  [[nodiscard]] uint64_t count_over(int levels) const;
  /// Returns the same number as a fraction of all samples, 0 to 1.
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

/// Compares all samples. Throws Error(Input) if the sizes differ.
[[nodiscard]] PictureDifference compare_pictures(const FrameView& reference, const FrameView& test);

/// Returns a picture of the differences. The colour of a pixel shows the largest difference of its
/// channels on a fixed logarithmic scale, so that single levels are visible too: black for none,
/// then blue, green, yellow and red to white for 255. Throws Error(Input) if the sizes differ.
[[nodiscard]] WovenFrame error_picture(const FrameView& reference, const FrameView& test);

/// Returns round(P): one view per subpixel under a lens.
[[nodiscard]] int native_view_count(const optics::Rig& rig);

/// Returns the differences of the subpixels of each of `views` views: a subpixel with view number v
/// belongs to view ceil(v) - 1; 0 is the leftmost. Throws Error(Input) if a picture does not have
/// the panel's size, Error(Usage) unless 1 <= views <= 4096.
[[nodiscard]] std::vector<Difference> compare_views(const FrameView& reference,
                                                    const FrameView& test,
                                                    const optics::OpticalModel& model, int views);

/// Returns the index of the view with the largest MSE; the first one if several are equal.
[[nodiscard]] int worst_view(const std::vector<Difference>& views);

// Structural similarity (SSIM) of two pictures, 1 for equal ones.

/// Side of SSIM's window in pixels.
inline constexpr int kSimilarityWindow = 11;

/// Returns the mean SSIM of the luma 0.299 R + 0.587 G + 0.114 B of code values, as its authors
/// published it in 2004: Gaussian window of 11 x 11 pixels with sigma 1.5 that sums to 1, C1 =
/// (0.01 * 255)^2, C2 = (0.03 * 255)^2, over all positions of the window inside the picture.
/// Returns nothing for pictures smaller than the window. Throws Error(Input) if the sizes differ.
[[nodiscard]] std::optional<double> structural_similarity(const FrameView& reference,
                                                          const FrameView& test);

}  // namespace lenticule::frames
