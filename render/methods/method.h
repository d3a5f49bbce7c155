// SPDX-License-Identifier: Apache-2.0
// Method is the interface of the render methods, which render a scene to a woven frame.
// make_method() creates one by its name.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "frames/frame.h"
#include "optics/model.h"
#include "render/options/render_options.h"
#include "render/scene/scene.h"
#include "render/scene/stage.h"

namespace lenticule::render {

class Method {
 public:
  virtual ~Method() = default;
  /// Sets the number of the next frame to be rendered. By default, methods count their frames.
  virtual void set_frame(uint64_t number) { static_cast<void>(number); }
  /// Returns the first frame of the consecutive frames that must be rendered before frame `number`
  /// to get the same bytes as in an uninterrupted sequence; `number` itself if the method needs
  /// none.
  [[nodiscard]] virtual uint64_t first_needed(uint64_t number) const { return number; }
  /// Changes the tolerated error of the next frames, in code values; it must be above 0. They get
  /// the bytes of a method that was made with this error. Returns false, and changes nothing, if
  /// the method tolerates no error.
  [[nodiscard]] virtual bool set_tolerated_error(double error) {
    static_cast<void>(error);
    return false;
  }
  /// Renders one frame; the frame has the rig's panel size. Equal input gives equal bytes,
  /// independent of the number of threads. Thread safety: one call at a time.
  virtual RenderStatistics render(const Scene& scene, const Stage& stage,
                                  frames::WovenFrame& frame) = 0;
  /// Returns a picture that is white where re-projection left the last frame's subpixels empty.
  /// Returns null if not requested (RenderOptions::keep_missing), and for methods without
  /// re-projection.
  [[nodiscard]] virtual const frames::WovenFrame* missing_subpixels() const { return nullptr; }
};

/// Creates the method called `name`, one of method_names(). Throws Error(Usage) with the list of
/// names for any other name. Lifetime: the model must outlive the method.
[[nodiscard]] std::unique_ptr<Method> make_method(const std::string& name,
                                                  const optics::OpticalModel& model,
                                                  const RenderOptions& options);
[[nodiscard]] const std::vector<std::string>& method_names();

// Method "adaptive": visibility is exact; shading is sampled and interpolated where it is smooth,
// and traced elsewhere.

/// Watches the items of the parallel loops of a frame, for benchmarks: called before and after each
/// item, on its thread, with the number of the loop.
using ItemWatcher = std::function<void(int loop, bool ends)>;

/// Makes method adaptive. RenderOptions::tolerated_error is the tolerated error in code values.
/// Throws Error(Usage) if it is negative or not finite.
[[nodiscard]] std::unique_ptr<Method> make_method_adaptive(const optics::OpticalModel& model,
                                                           const RenderOptions& options,
                                                           const ItemWatcher& watcher = {});

/// Makes method adaptive prove a PSNR of each frame, in dB: sets RenderOptions::proven_rmse, and a
/// tolerated error of single subpixels that suits it. Throws Error(Usage) outside 20 ... 70 dB.
void promise_psnr(double db, RenderOptions& options);

// The methods that reuse points: from neighbouring micro-images, from the previous frame, or both.

enum class Reuse { LensView, Interpolate, Temporal, Hybrid };

[[nodiscard]] std::optional<Reuse> reuse_named(std::string_view name);

/// Makes a method that reuses points. Requires options.samples == 1. Lifetime: the model must
/// outlive the method.
[[nodiscard]] std::unique_ptr<Method> make_method_reuse(Reuse reuse,
                                                        const optics::OpticalModel& model,
                                                        const RenderOptions& options);

}  // namespace lenticule::render
