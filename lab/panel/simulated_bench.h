// SPDX-License-Identifier: Apache-2.0
// SimulatedBench is an optical bench for testing and evaluating calibrations: a panel under a sheet
// of cylinder lenses, and a camera in front of it. Every ray is refracted at the real surface of
// its lens (vector form of Snell's law); the formulas that a calibration fits are not used. The
// bench therefore shows coma, vignetting and stray light of neighbours, which these formulas
// neglect.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "calib/camera.h"
#include "frames/frame_sink.h"
#include "lab/panel/simulated_setup.h"
#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::lab {

/// SimulatedBench has a sink and a camera with one simulated clock, which only show() and grab()
/// advance: no call waits. The same arguments and calls give the same pictures, for any number of
/// helpers.
///
/// Thread safety: one thread; the bench starts helper threads and joins them before returning.
class SimulatedBench {
 public:
  /// Takes the panel layout that the player assumes. Throws the Error(Input) of check_sheet and
  /// check_camera.
  SimulatedBench(const optics::Panel& panel, const SimulatedSheet& sheet,
                 const SimulatedPanelLink& link, const SimulatedCamera& camera, uint64_t seed);
  ~SimulatedBench();
  SimulatedBench(const SimulatedBench&) = delete;
  SimulatedBench& operator=(const SimulatedBench&) = delete;

  /// Returns the sink, which shows Rgb8 frames of the panel's size at the next vblank of the
  /// simulated clock.
  [[nodiscard]] frames::FrameSink& sink();
  /// Returns the camera. It grabs the next picture whose exposure ends after now; the exposure may
  /// have begun before the last show().
  [[nodiscard]] calib::Camera& camera();

  /// Moves the camera. Throws Error(Input) if it is not in front of the panel.
  void move_camera(Vec3 position_mm, Vec3 look_at_mm, double roll_degrees);
  /// Stretches the sheet by this relative amount about the panel's centre. Throws Error(Input)
  /// above a tenth.
  void set_thermal_stretch(double relative);
  /// Unplugs the camera after this many more pictures: the next capture returns Gone.
  void unplug_after(int pictures);
  /// Sets the number of threads that trace and gather, 1 to 64 (default 2).
  void set_threads(int threads);

  /// Returns the camera's true position and properties.
  [[nodiscard]] const SimulatedCamera& ground_truth_camera() const;

  /// Returns the ground truth of Phi: the lens coordinate of the apex line whose lens shows panel
  /// point (x_px, y_px) to `eye` (panel frame, mm) in the middle of its light. The middle is the
  /// mean, over the lens and weighted by the size of each part as seen by the eye, of the landing
  /// points of the rays from the eye on the plane of the pixels. Includes deformation, bow, bend
  /// and thermal stretch. Uses `channel`'s refractive index. NaN if no light passes.
  [[nodiscard]] double ground_truth_phase(double x_px, double y_px, int channel, Vec3 eye,
                                          LightMiddle middle = LightMiddle::Centroid) const;

  /// Returns the picture point at which the undisturbed camera sees a panel point through the
  /// lenses in green light; picture coordinates (simulated_camera.h). Returns nothing if no light
  /// passes.
  [[nodiscard]] std::optional<Vec2> ground_truth_in_picture(double x_px, double y_px) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lenticule::lab
