// SPDX-License-Identifier: Apache-2.0
// The figures of `lenticule compare`: gathered frame by frame, as JSON and as a table made of it.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "apps/lenticule/commands/picture_pairs.h"
#include "frames/compare.h"
#include "optics/model.h"

namespace lenticule::player {

/// Measures pairs and adds them up. Figures of a set of samples are "mse", "rmse", "psnr_db" (null
/// where equal), "max", and "over_N" and "share_over_N": how many differ by more than N levels.
class CompareReport {
 public:
  /// `model` may be null: no figures per view. It must outlive the report.
  CompareReport(const optics::OpticalModel* model, int views);

  /// Throws what reading and comparing pictures throws.
  void add(const PicturePair& files);

  /// The pair whose total MSE is largest, of those added.
  [[nodiscard]] size_t worst_frame() const { return worst_frame_; }
  /// "frames", "worst_frame", "worst" (a copy of that frame), "means" and, with a rig,
  /// "worst_view" {"frame", "view", ...}: the view that is furthest off in any frame.
  [[nodiscard]] nlohmann::json json() const;

 private:
  /// Of a picture in its three channels; what is pooled over frames.
  struct Pooled {
    frames::PictureDifference difference;
    double psnr_sum = 0.0;
    size_t psnr_count = 0;  ///< frames that differ
    double rmse_sum = 0.0;
    double ssim_sum = 0.0;
    size_t ssim_count = 0;
    size_t frames = 0;

    void add(const frames::PictureDifference& frame, std::optional<double> ssim);
    [[nodiscard]] nlohmann::json figures() const;
  };

  nlohmann::json measure_view(const frames::FrameView& reference, const frames::FrameView& test,
                              const frames::Difference& subpixels, int view);
  void note_worst_view(const nlohmann::json& views);

  const optics::OpticalModel* model_;
  int views_;
  std::vector<nlohmann::json> frames_;
  size_t worst_frame_ = 0;
  Pooled whole_;
  std::vector<Pooled> seen_;  ///< per view, what eyes see
  nlohmann::json worst_view_;
};

/// The table for people, made of the JSON.
void print_compare_report(const nlohmann::json& report);

}  // namespace lenticule::player
