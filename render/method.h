// SPDX-License-Identifier: Apache-2.0
// The render methods: how a scene becomes a woven frame.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/cpu.h"
#include "frames/frame.h"
#include "optics/model.h"
#include "render/depth_budget/prefilter.h"
#include "render/reuse_options.h"
#include "render/sampling/soft_light.h"
#include "render/scene.h"
#include "render/stage.h"
#include "render/work_clock.h"

namespace lenticule::render {

struct RenderOptions {
  int threads = 0;  ///< 0 = all cores
  int samples = 1;  ///< per subpixel, inside its angular footprint; 1 = the centre
  /// What is averaged over the beam of its subpixel, of method full; with one of `samples`.
  Prefilter prefilter = Prefilter::Off;
  int prefilter_samples = 17;  ///< rays of such a subpixel; but for Exhaustive, at most
  int max_depth = 5;           ///< of reflections and refractions
  SoftLight soft{};            ///< lamps that have a size, light from all around
  Isa isa = best_isa();        ///< of our own loops; the bytes do not depend on it
  /// Rays that are proved to meet nothing are not traced (render/shaft.h); the bytes are the same.
  bool use_shaft_proofs = true;
  /// Mirrored rays that cannot change their subpixel's code value, whatever they meet, are left
  /// out; the bytes are the same. Only with one sample per subpixel.
  bool skip_weak_rays = true;
  double tolerated_error = 2.0;  ///< code values, of method adaptive
  /// Primary rays that are proved to meet nothing are not traced (render/skips/background.h); the
  /// bytes are the same.
  bool skip_background = true;
  /// Frames whose scene and stage are those of the frame before are copied, not rendered. Methods
  /// full and adaptive, which keeps parts, too (docs/rendering.md). Off unless asked for, since
  /// whoever times frames renders one again and again.
  bool copy_unchanged = false;
  bool tiles_backwards = false;  ///< the bytes do not depend on the order; for tests
  ReuseOptions reuse{};          ///< of the methods that reuse points
  bool keep_missing = false;     ///< make Method::missing_subpixels()
  bool measure_work = false;     ///< fill RenderStatistics::work; costs some percent of time
  /// Asked between tiles; true ends the frame early (RenderStatistics::completed is false then).
  std::function<bool()> cancelled;
};

/// What one frame cost. Times are wall seconds.
struct RenderStatistics {
  bool completed = true;
  uint64_t subpixels = 0;
  uint64_t primary_rays = 0;
  uint64_t shadow_rays = 0;
  uint64_t secondary_rays = 0;
  uint64_t ambient_rays = 0;             ///< of sampled occlusion and surroundings
  uint64_t ambient_rays_proved = 0;      ///< of ambient_rays: not traced, nothing was near
  uint64_t invalid_rays = 0;             ///< not finite, so not shown to Embree
  uint64_t suspected_holes = 0;          ///< primary rays that went on where their neighbours ended
  uint64_t filled_holes = 0;             ///< and those that had slipped between triangles
  uint64_t primary_rays_proved = 0;      ///< of primary_rays: not traced, they meet nothing
  uint64_t lights_left_out = 0;          ///< they bring nothing to anything in the scene
  uint64_t shadow_rays_proved = 0;       ///< of shadow_rays: not traced, nothing was in their way
  uint64_t shadow_rays_blocked = 0;      ///< of shadow_rays: not traced, something surely was
  uint64_t secondary_rays_proved = 0;    ///< of secondary_rays: not traced, they meet nothing
  uint64_t secondary_rays_too_weak = 0;  ///< left out, and not counted in secondary_rays
  uint64_t rays_of_too_little = 0;       ///< left out by method adaptive, within its error
  // How subpixels got their colour; the first four add up to `subpixels`.
  uint64_t traced_subpixels = 0;
  uint64_t projected_subpixels = 0;     ///< from points of other micro-images or frames
  uint64_t interpolated_subpixels = 0;  ///< the mean of two neighbours
  uint64_t copied_subpixels = 0;        ///< of a frame in which nothing had changed
  uint64_t mended_subpixels = 0;        ///< traced after all, since an audit failed
  uint64_t audited_subpixels = 0;       ///< drawn at random and traced, too
  uint64_t audited_beyond = 0;          ///< of those: off by more than the tolerated error
  /// With 99 % confidence no larger a share of all subpixels is off by more than that.
  double beyond_bound = 0.0;
  uint64_t prefiltered_subpixels = 0;    ///< averaged over their beams, but for Exhaustive
  uint64_t prefilter_rays = 0;           ///< of primary_rays: for those, beside the middle ones
  uint64_t prefilter_rays_left_out = 0;  ///< not traced: neighbours were alike
  uint64_t missing_subpixels = 0;  ///< found empty by re-projection, then traced or interpolated
  double seconds = 0.0;
  /// Shares of the workers' time, which add up to 1; zeros unless they were asked for.
  std::array<double, kWorks> work{};
};

class Method {
 public:
  virtual ~Method() = default;
  /// The number of the next frame to be rendered; without being told, methods count.
  virtual void set_frame(uint64_t number) { static_cast<void>(number); }
  /// The first frame that has to be rendered before `number`, one after the other, for it to be as
  /// in a sequence without a break; `number` itself where it needs none.
  [[nodiscard]] virtual uint64_t first_needed(uint64_t number) const { return number; }
  /// Renders one frame; the frame has the rig's panel size. Same input, same bytes, whatever the
  /// number of threads. Not to be called from two threads at once.
  virtual RenderStatistics render(const Scene& scene, const Stage& stage,
                                  frames::WovenFrame& frame) = 0;
  /// White where re-projection left the last frame's subpixels empty; null unless it was asked for,
  /// and for methods that re-project nothing.
  [[nodiscard]] virtual const frames::WovenFrame* missing_subpixels() const { return nullptr; }
};

/// One of method_names(); throws Error(Usage) with the list of names otherwise. The model must
/// outlive it.
[[nodiscard]] std::unique_ptr<Method> make_method(const std::string& name,
                                                  const optics::OpticalModel& model,
                                                  const RenderOptions& options);
[[nodiscard]] const std::vector<std::string>& method_names();

}  // namespace lenticule::render
