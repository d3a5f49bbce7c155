// SPDX-License-Identifier: Apache-2.0
// The parts of `lenticule bench error`, which measures run time against error of the render methods
// frame by frame as JSON, and makes the table, plot and pictures from that.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "base/worker_threads.h"
#include "frames/frame.h"
#include "lab/fixtures.h"
#include "lab/flip.h"
#include "lab/measures.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "render/options/render_options.h"

namespace lenticule::bench {

/// A method to measure; methods with a tolerated error appear once for each error and each PSNR.
struct ErrorEntrant {
  std::string name;                 ///< "lens-view", "adaptive 0.5", "adaptive 40 dB"
  std::string method;               ///< name for make_method()
  std::optional<double> tolerated;  ///< E in code values; none if the method has no such option
  double proven_rmse = 0.0;         ///< 0: none
  bool exists = true;               ///< available in this build
};

/// Returns "full" first, even if it is not in `methods`, then the others in their order. `known`
/// are the build's methods, `psnrs` in dB. Throws Error(Usage) for an error below 0 or above 255,
/// and the errors of promise_psnr().
[[nodiscard]] std::vector<ErrorEntrant> error_entrants(const std::vector<std::string>& methods,
                                                       const std::vector<double>& errors,
                                                       const std::vector<double>& psnrs,
                                                       const std::vector<std::string>& known);

/// ErrorScene is a scene as for render, a built-in scene's name, or gltf:NAME: the built-in scene
/// with each frame written as glTF and read back, so that it has glTF's materials and linear light.
class ErrorScene {
 public:
  /// `rate` is the rate of an animated file. Throws the errors of SceneSequence.
  explicit ErrorScene(const std::string& name, frames::Rate rate = {});

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool still() const { return sequence_->still(); }
  /// Returns the scene `frames` frames after the one that determines size and depth.
  [[nodiscard]] render::SceneDescription after(uint64_t frames) const;
  /// Returns the name for measure_peers(); none for scenes that Tachyon would not read identically.
  [[nodiscard]] std::optional<std::string> name_for_peers() const;

 private:
  std::string name_;
  bool as_gltf_ = false;
  std::unique_ptr<tools::SceneSequence> sequence_;
  lab::ScratchFolder folder_;
};

/// Returns a scene whose objects and whose first light move, after some frames. Every third of the
/// objects that are smaller than half of the scene swings; if none is, every third of all. The
/// light goes round the scene; a scene without lights gets one.
[[nodiscard]] render::SceneDescription with_moving_objects(render::SceneDescription scene,
                                                           uint64_t frames);

/// Benchmark scenarios. Still: the same frame twice, of the same committed scene. Moving:
/// consecutive frames, the scene committed again if more than the camera moves. Turning: the same,
/// while the scene turns once about its vertical. Objects: with_moving_objects() under the camera
/// of the first frame.
enum class ErrorScenario { Still, Moving, Turning, Objects };
inline constexpr const char* kErrorScenarios[] = {"still", "moving", "turning", "objects"};

struct ErrorSetup {
  optics::Rig rig;
  std::vector<ErrorEntrant> entrants;  ///< the first is the reference
  ErrorScenario scenario = ErrorScenario::Moving;
  int frames = 6;  ///< number of frames, except in the Still scenario
  int threads = 0;
  int depth = 5;
  render::SoftLight soft{};
  int runs = 1;            ///< times are medians of these
  std::string pictures{};  ///< folder for the worst tiles; empty = none
  int first = 0;           ///< number of scene frames before the first one
  bool eyes = true;        ///< also compares what eyes see
};

/// Renders and compares all methods. Returns {"scene", "rig", "course", "subpixels", "copy_s",
/// "pictures": [...], "methods": [{"name", "method", "tolerated_error", "missing"} or with
/// "frames": [{"wall_s", "cpu_s", "build_s" (outside of rendering: evaluating, placing and
/// committing the scene; 0 if it was committed before), "rays", "traced", "missing", "subpixels",
/// and except for the reference "mse", "channel_mses", "max", "share_over_e", "share_over_8",
/// "share_over_32", "worst_view_mse", "eyes": [{"ssim", "flip_mean", "flip_p99", "flicker_mean",
/// "flicker_largest"}], and if audited "audited", "audited_beyond", "bound", "rmse_bound"}]}]}.
/// `done` is called after each rendered and measured frame. Null if interrupted.
[[nodiscard]] nlohmann::json measure_error(const ErrorSetup& setup, const ErrorScene& scene,
                                           const std::function<void()>& done);

/// Returns 1 - seconds / reference; null if the reference is 0.
[[nodiscard]] nlohmann::json saving(double seconds, double reference);
/// Returns the values of `key` in those frames that have it.
[[nodiscard]] std::vector<double> values_of(const nlohmann::json& frames, const char* key);

/// Adds to a method of measure_error()'s result, over its frames: "seconds_per_frame", "first_s",
/// "later_s" and "later_build_s" (null for one frame), "of_full", "cpu_of_full" and
/// "later_cpu_of_full" (time as a share of the reference's), "saved" (1 - of_full), "later_saved",
/// "rays_per_subpixel".
void add_times(nlohmann::json& method, const nlohmann::json& reference_frames);
/// Adds "psnr_mean_db" (over frames that differ), "psnr_worst_db", "worst_view_psnr_db" (null if
/// equal), "max", "share_over_e", "share_over_8", "share_over_32" and "bound" (bounds_of()).
void add_errors(nlohmann::json& method);

/// Adds these to each method, and "over_copy" and "over_tachyon" (rate over Tachyon's),
/// "ssim_mean", "ssim_worst", "flip_mean", "flip_p99_worst", "flicker_mean", "flicker_largest".
/// `tachyon` is stored as "tachyon": null, or the result of measure_peers(); its "ours_over_theirs"
/// is full's rate over Tachyon's.
void summarize_errors(nlohmann::json& scenario, const nlohmann::json& tachyon);

/// Returns how often the true share of subpixels with an error above E was within the reported
/// bound, over all frames of all methods of scenarios: {"frames", "within_percent",
/// "largest_share", "largest_excess", "mean_bound"}; null without a frame. The excess is share
/// minus bound if that is positive.
[[nodiscard]] nlohmann::json bound_of_all(const nlohmann::json& scenarios);

// ErrorEyes measures the visible difference of two woven frames for eyes at three places.

/// The eyes are in the middle of the viewing zone and a third of the zone to each side, from left
/// to right.
inline constexpr int kErrorEyes = 3;
using SeenPictures = std::array<frames::WovenFrame, kErrorEyes>;
/// The meters of one method in one scenario.
using EyeFlicker = std::array<lab::FlickerMeter, kErrorEyes>;

/// Returns the pixels of frames::decoded_geometry() per degree, in front of the panel at the
/// viewing distance; FLIP's default if that is infinite. Clamped to FLIP's range.
[[nodiscard]] double seen_pixels_per_degree(const optics::Rig& rig);

class ErrorEyes {
 public:
  /// Lifetime: both must outlive this object.
  ErrorEyes(const optics::OpticalModel& model, WorkerThreads& workers);

  /// Sets the frame with which the next ones are compared.
  void set_reference(const frames::FrameView& woven);
  /// Returns one entry per eye: {"ssim" (null for tiny pictures), "flip_mean", "flip_p99",
  /// "flicker_mean", "flicker_largest"}.
  [[nodiscard]] nlohmann::json compare(const frames::FrameView& woven, EyeFlicker& flicker);

  [[nodiscard]] const SeenPictures& reference() const { return reference_; }
  /// Returns the pictures of the last compare().
  [[nodiscard]] const SeenPictures& test() const { return test_; }

 private:
  [[nodiscard]] frames::WovenFrame seen(const frames::FrameView& woven, int eye) const;

  const optics::OpticalModel& model_;
  WorkerThreads& workers_;
  double pixels_per_degree_;
  SeenPictures reference_;
  std::vector<lab::FlipPicture> reference_flip_;
  SeenPictures test_;
};

// WorstPlaces keeps the worst tiles of a method in a scenario as pictures for inspection.

/// Returns two rows of three magnified panes: reference, test, and their difference (colours of
/// frames::error_picture). The upper row shows the woven pixels of the tile, the lower row what an
/// eye sees there. The eye's pictures may have any size; they show the whole panel.
[[nodiscard]] frames::WovenFrame tile_sheet(const frames::FrameView& reference,
                                            const frames::FrameView& test,
                                            const frames::FrameView& seen_reference,
                                            const frames::FrameView& seen_test,
                                            const lab::Tile& tile);

/// Keeps the worst tiles of all added frames, at most one per place.
class WorstPlaces {
 public:
  void add(int frame, const frames::FrameView& reference, const frames::FrameView& test,
           const SeenPictures& seen_reference, const SeenPictures& seen_test);
  /// Writes FOLDER/STEM-1.png and so on, the worst first. Returns the list of files: [{"file",
  /// "frame", "x", "y", "width", "height", "mse", "eye"}]. Throws Error(Failed) if a file cannot be
  /// written.
  [[nodiscard]] nlohmann::json write(const std::string& folder, const std::string& stem) const;

 private:
  struct Place {
    lab::Tile tile;
    int frame;
    int eye;
    frames::WovenFrame sheet;
  };
  std::vector<Place> places_;  ///< worst first
};
}  // namespace lenticule::bench
