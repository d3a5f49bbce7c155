// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench error`: run time against error of the render methods, measured
// frame by frame into JSON, and the table, plot and pictures that are made of that.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule/offline/scene_sequence.h"
#include "apps/lenticule/offline/scratch_folder.h"
#include "optics/rig.h"
#include "render/options/soft_light.h"

namespace lenticule::player {

/// A method as it takes part: those that take a tolerated error once for each.
struct ErrorEntrant {
  std::string name;                 ///< "lens-view", "adaptive 0.5"
  std::string method;               ///< as make_method() takes it
  std::optional<double> tolerated;  ///< E in code values; none where a method takes none
  bool exists = true;               ///< in this build
};

/// "full" first, whether it is among `methods` or not, then the others in their order. `known` are
/// the build's methods. Throws Error(Usage) for an error below 0 or above 255.
[[nodiscard]] std::vector<ErrorEntrant> error_entrants(const std::vector<std::string>& methods,
                                                       const std::vector<double>& errors,
                                                       const std::vector<std::string>& known);

/// A scene as for render, a built-in one's name, or gltf:NAME: the built-in scene, each of its
/// frames written as glTF and read back, so that it has glTF's materials and linear light.
class ErrorScene {
 public:
  /// Throws where SceneSequence does.
  explicit ErrorScene(const std::string& name);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool still() const { return sequence_->still(); }
  /// The scene `frames` after the one that decides about size and depth.
  [[nodiscard]] render::SceneDescription after(uint64_t frames) const;
  /// As measure_peers() takes it; none for scenes that Tachyon would not get as we do.
  [[nodiscard]] std::optional<std::string> name_for_peers() const;

 private:
  std::string name_;
  bool as_gltf_ = false;
  std::unique_ptr<SceneSequence> sequence_;
  ScratchFolder folder_;
};

/// Still: the same frame twice, of the same committed scene. Moving: frames in a row, of a scene
/// that is committed anew for each.
enum class ErrorCourse { Still, Moving };

struct ErrorSetup {
  optics::Rig rig;
  std::vector<ErrorEntrant> entrants;  ///< the first is the reference
  ErrorCourse course = ErrorCourse::Moving;
  int frames = 6;  ///< of a moving course
  int threads = 0;
  int depth = 5;
  render::SoftLight soft{};
  int runs = 1;            ///< times are medians of these
  std::string pictures{};  ///< folder for the worst tiles; empty = none
};

/// Renders and compares all. {"scene", "rig", "course", "subpixels", "copy_s", "pictures": [...],
/// "methods": [{"name", "method", "tolerated_error", "missing"} or with "frames": [{"wall_s",
/// "cpu_s", "rays", "traced", "subpixels", and but for the reference "mse", "max", "share_over_e",
/// "share_over_8", "share_over_32", "worst_view_mse", "eyes": [{"ssim", "flip_mean", "flip_p99",
/// "flicker_mean", "flicker_largest"}], and where audited "audited", "audited_beyond",
/// "bound"}]}]}. `done` is called after each rendered and measured frame. Null if interrupted.
[[nodiscard]] nlohmann::json measure_error(const ErrorSetup& setup, const ErrorScene& scene,
                                           const std::function<void()>& done);

/// How often a reported upper bound of the share of subpixels beyond E held.
class BoundTally {
 public:
  /// Both from 0 to 1; a share that is the bound itself is within it.
  void add(double true_share, double bound);
  /// {"frames", "within_percent", "largest_share", "largest_excess", "mean_bound"}; null without
  /// a frame. The excess is share minus bound where it is positive.
  [[nodiscard]] nlohmann::json figures() const;

 private:
  int frames_ = 0;
  int within_ = 0;
  double largest_share_ = 0.0;
  double largest_excess_ = 0.0;
  double bounds_ = 0.0;
};

/// Adds to each method of measure_error()'s result, over its frames: "seconds_per_frame",
/// "first_s", "later_s" (null for one frame), "of_full", "cpu_of_full" and "later_cpu_of_full"
/// (time as a share of the reference's), "saved" (1 - of_full), "later_saved",
/// "rays_per_subpixel", "over_copy", "over_tachyon" (rate over Tachyon's), "psnr_mean_db" (over
/// frames that differ), "psnr_worst_db", "worst_view_psnr_db" (null where nothing differs), "max",
/// "share_over_e", "share_over_8", "share_over_32", "ssim_mean", "ssim_worst", "flip_mean",
/// "flip_p99_worst", "flicker_mean", "flicker_largest", "bound" (of BoundTally). `tachyon` is kept
/// as "tachyon": null, or what measure_peers() says of it; its "ours_over_theirs" is full's rate
/// over Tachyon's.
void summarize_errors(nlohmann::json& course, const nlohmann::json& tachyon);

/// BoundTally's figures over all frames of all methods and courses.
[[nodiscard]] nlohmann::json bound_of_all(const nlohmann::json& courses);

void print_error_course(const nlohmann::json& course);
/// Nothing where no method said a bound.
void print_bound_of_all(const nlohmann::json& courses);

/// Time as a share of full's against PSNR, a mark for each method, scene, rig and course.
void plot_errors(const nlohmann::json& courses, const std::string& file);

}  // namespace lenticule::player
