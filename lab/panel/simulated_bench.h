// SPDX-License-Identifier: Apache-2.0
// SimulatedBench is an optical bench for testing and evaluating calibrations: a panel under a sheet
// of cylinder lenses, and a camera in front of it. Every ray is refracted at the real surface of
// its lens (vector form of Snell's law); the formulas that a calibration fits are not used. The
// bench therefore shows coma, vignetting and stray light of neighbours, which these formulas
// neglect.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "frames/frame_source.h"
#include "lab/panel/driven_panel.h"
#include "lab/panel/lens_sheet.h"
#include "lab/panel/simulated_sensor.h"
#include "lab/panel/simulated_setup.h"
#include "optics/panel.h"
#include "optics/vec.h"

namespace lenticule::lab {

class SampleMap;

/// SimulatedBench has a sink and a camera with one simulated clock, which only show() and grab()
/// advance: no call waits. The same arguments and calls give the same pictures, for any number of
/// helpers.
///
/// Thread safety: one thread; the bench starts helper threads and joins them before returning.
class SimulatedBench final : public frames::FrameSink, public calib::Camera {
 public:
  /// Takes the panel layout that the player assumes. Throws the Error(Input) of check_sheet and
  /// check_camera.
  SimulatedBench(const optics::Panel& panel, const SimulatedSheet& sheet,
                 const SimulatedPanelLink& link, const SimulatedCamera& camera, uint64_t seed);
  ~SimulatedBench() override;

  /// Returns the sink, which shows Rgb8 frames of the panel's size at the next vblank of the
  /// simulated clock.
  [[nodiscard]] frames::FrameSink& sink() { return *this; }
  /// Returns the camera. It grabs the next picture whose exposure ends after now; the exposure may
  /// have begun before the last show().
  [[nodiscard]] calib::Camera& camera() { return *this; }

  [[nodiscard]] frames::FrameGeometry geometry() const override;
  [[nodiscard]] frames::ShowResult show(const frames::FrameView& frame,
                                        std::chrono::nanoseconds timeout) override;

  [[nodiscard]] const calib::CameraFacts& facts() const override { return facts_; }
  [[nodiscard]] calib::GrabStatus grab(calib::CameraPicture& out, calib::Nanoseconds timeout,
                                       calib::Nanoseconds not_before) override;
  [[nodiscard]] calib::Nanoseconds now() const override { return now_; }
  [[nodiscard]] std::vector<std::string> drifted_controls() override { return {}; }
  [[nodiscard]] std::string failure() const override {
    return pictures_left_ == 0 ? "the camera was unplugged" : "";
  }

  /// Moves the camera. Throws Error(Input) if it is not in front of the panel.
  void move_camera(Vec3 position_mm, Vec3 look_at_mm, double roll_degrees);
  /// Stretches the sheet by this relative amount about the panel's centre. Throws Error(Input)
  /// above a tenth.
  void set_thermal_stretch(double relative);
  /// Unplugs the camera after this many more pictures: the next capture returns Gone.
  void unplug_after(int pictures) { pictures_left_ = std::max(0, pictures); }
  /// Sets the number of threads that trace and gather, 1 to 64 (default 2).
  void set_threads(int threads) { threads_ = std::clamp(threads, 1, 64); }

  /// Returns the camera's true position and properties.
  [[nodiscard]] const SimulatedCamera& ground_truth_camera() const { return camera_; }

  /// Returns the ground truth of Phi: the lens coordinate of the apex line whose lens shows panel
  /// point (x_px, y_px) to `eye` (panel frame, mm) in the middle of its light. The middle is the
  /// mean, over the lens and weighted by the size of each part as seen by the eye, of the landing
  /// points of the rays from the eye on the plane of the pixels. Includes deformation, bow, bend
  /// and thermal stretch. Uses `channel`'s refractive index. NaN if no light passes.
  [[nodiscard]] double ground_truth_phase(double x_px, double y_px, int channel, Vec3 eye,
                                          LightMiddle middle = LightMiddle::Centroid) const;

  /// Returns the picture point at which the undisturbed camera sees a panel point through the
  /// lenses in green light; picture coordinates (SimulatedCamera). Returns nothing if no light
  /// passes.
  [[nodiscard]] std::optional<Vec2> ground_truth_in_picture(double x_px, double y_px) const;

 private:
  /// ShownFrame is one frame on the panel, and its light at the camera once it was requested.
  struct ShownFrame {
    DrivenFrame driven;
    std::vector<float>
        light;  // light of the camera's pixels; empty = not gathered from this viewpoint yet
  };

  void forget_viewpoint();
  void trace_if_needed();
  const std::vector<float>& light_of(ShownFrame& frame);
  void keep_leftover_of_old_frame(double ms_since_shown);
  [[nodiscard]] double start_of_picture_ms(uint64_t picture) const;
  [[nodiscard]] double length_of_picture_ms() const;
  [[nodiscard]] uint64_t next_picture() const;
  void expose(uint64_t picture);
  void expose_row(int row, uint64_t picture, bool both_frames);
  [[nodiscard]] double old_part_of_row(int row, uint64_t picture) const;
  [[nodiscard]] double gain_of_row(int row, uint64_t picture) const;
  [[nodiscard]] double row_begins_ms(int row, uint64_t picture) const;
  void add_highlight(int row);

  optics::Panel panel_;  // panel with the true layout
  SimulatedSheet sheet_;
  SimulatedPanelLink link_;
  SimulatedCamera camera_;
  uint64_t seed_;
  int threads_ = 2;
  SheetShape shape_;
  SubpixelFinder finder_;
  Sensor sensor_;
  calib::CameraFacts facts_;
  std::array<float, 256> code_light_;
  LightTable table_;                // light of a hit if all rays of the pixel (samples) hit
  std::unique_ptr<SampleMap> map_;  // map of the present viewpoint; null = not traced yet

  calib::Nanoseconds now_{0};
  double shown_at_ms_ = 0.0;
  uint64_t shown_frames_ = 0;
  ShownFrame current_;
  ShownFrame previous_;
  std::vector<float> exposed_;
  double camera_starts_ms_;  // start of picture 0, relative to the panel's clock
  uint64_t pictures_ = 0;    // lower limit of the next picture's number
  int pictures_left_ = -1;   // -1 = no limit
};

}  // namespace lenticule::lab
