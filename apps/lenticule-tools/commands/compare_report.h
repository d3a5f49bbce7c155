// SPDX-License-Identifier: Apache-2.0
// CompareReport gathers the figures of `lenticule compare` frame by frame, as JSON and as a table.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "apps/lenticule-tools/commands/picture_pairs.h"
#include "frames/compare.h"
#include "optics/model.h"

namespace lenticule::tools {

/// Measures pairs and accumulates the results. Figures of a set of samples are "mse", "rmse",
/// "psnr_db" (null if equal), "max", and "over_N" and "share_over_N": how many differ by more than
/// N levels. FLIP of a frame is "flip" {"mean", "percentile_99", "pixels_per_degree"}.
class CompareReport {
 public:
  /// `model` may be null; then there are no figures per view. Lifetime: it must outlive the report.
  /// With `flip_pixels_per_degree`, frames have FLIP too.
  CompareReport(const optics::OpticalModel* model, int views,
                std::optional<double> flip_pixels_per_degree);

  /// Adds a pair. Throws the errors of reading and comparing pictures.
  void add(const PicturePair& files);

  /// Returns the added pair with the largest total MSE.
  [[nodiscard]] size_t worst_frame() const { return worst_frame_; }
  /// Returns "frames", "worst_frame", "worst" (a copy of that frame), "means" (with FLIP as "flip",
  /// the mean over frames) and, with a rig,
  /// "worst_view" {"frame", "view", ...}: the view with the largest difference in any frame.
  [[nodiscard]] nlohmann::json json() const;

 private:
  /// Figures of a picture in its three channels, pooled over frames.
  struct Pooled {
    frames::PictureDifference difference;
    double psnr_sum = 0.0;
    size_t psnr_count = 0;  ///< number of frames that differ
    double rmse_sum = 0.0;
    double ssim_sum = 0.0;
    size_t ssim_count = 0;
    size_t frames = 0;

    void add(const frames::PictureDifference& frame, std::optional<double> ssim);
    [[nodiscard]] nlohmann::json figures() const;
  };

  nlohmann::json measure_flip(const frames::FrameView& reference, const frames::FrameView& test);
  nlohmann::json measure_view(const frames::FrameView& reference, const frames::FrameView& test,
                              const frames::Difference& subpixels, int view);
  void note_worst_view(const nlohmann::json& views);

  const optics::OpticalModel* model_;
  int views_;
  std::optional<double> flip_pixels_per_degree_;
  double flip_sum_ = 0.0;
  std::vector<nlohmann::json> frames_;
  size_t worst_frame_ = 0;
  Pooled whole_;
  std::vector<Pooled> seen_;  ///< per view, as an eye sees it
  nlohmann::json worst_view_;
};

/// Prints the table for people, made from the JSON.
void print_compare_report(const nlohmann::json& report);

}  // namespace lenticule::tools
