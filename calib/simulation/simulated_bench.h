// SPDX-License-Identifier: Apache-2.0
// A bench on which calibrations can be tried and judged: a panel under a sheet of cylinder lenses,
// and a camera in front of it. Every ray is refracted at the real surface of its lens (vector form
// of Snell's law), none follows the formulas that a calibration fits; so it shows coma, vignetting
// and stray light of neighbours that those leave out.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "calib/camera.h"
#include "calib/simulation/simulated_camera.h"
#include "calib/simulation/simulated_link.h"
#include "calib/simulation/simulated_sheet.h"
#include "frames/frame_sink.h"
#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// Sink and camera share one simulated clock, which only show() and grab() advance: nothing waits.
/// One thread uses a bench; it starts helpers of its own and joins them before returning. The same
/// arguments and calls give the same pictures, whatever the number of helpers.
class SimulatedBench {
 public:
  /// `panel` is what the player believes. Throws Error(Input) where check_sheet and check_camera
  /// do.
  SimulatedBench(const optics::Panel& panel, const SimulatedSheet& sheet,
                 const SimulatedPanelLink& link, const SimulatedCamera& camera, uint64_t seed);
  ~SimulatedBench();
  SimulatedBench(const SimulatedBench&) = delete;
  SimulatedBench& operator=(const SimulatedBench&) = delete;

  /// Shows at the next vblank of the simulated clock. Rgb8 frames of the panel's size.
  [[nodiscard]] frames::FrameSink& sink();
  /// The next picture whose exposure ends after now; it may have begun before the last show().
  [[nodiscard]] Camera& camera();

  /// Where the camera is from now on. Throws Error(Input) if it is not in front of the panel.
  void move_camera(Vec3 position_mm, Vec3 look_at_mm, double roll_degrees);
  /// The sheet grows by this part about the panel's centre; throws Error(Input) beyond a tenth.
  void set_thermal_stretch(double relative);
  /// The camera is Gone after this many more pictures.
  void unplug_after(int pictures);
  /// Helpers that trace and gather, 1 to 64; two at first.
  void set_threads(int threads);

  /// Where the camera is, and the rest of it.
  [[nodiscard]] const SimulatedCamera& camera_truth() const;

  /// Phi: the lens coordinate of the apex line of which `eye` (panel frame, mm) sees panel point
  /// (x_px, y_px) in the middle of the light of its lens: over the lens, as large as the eye
  /// sees each part of it, the mean of where the rays from the eye land on the plane of the pixels
  /// is the panel point. Includes deformation, bow, bend and thermal stretch. Rays of `channel`'s
  /// index. NaN where no light passes.
  [[nodiscard]] double truth_phase(double x_px, double y_px, int channel, Vec3 eye,
                                   LightMiddle middle = LightMiddle::Centroid) const;

  /// Where the undisturbed camera's picture has a panel point, seen through the lenses in green
  /// light; picture coordinates (simulated_camera.h). None where no light passes.
  [[nodiscard]] std::optional<Vec2> truth_in_picture(double x_px, double y_px) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::calib
