// SPDX-License-Identifier: Apache-2.0
// Common parts of the methods of `lenticule calibrate`: their entry in its list, the end of a
// calibration, and pictures of what a camera sees.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "calib/calibration.h"
#include "calib/camera.h"
#include "calib/report/report.h"
#include "display/display_sink.h"
#include "display/open/open_display.h"

namespace lenticule::tools {

struct ResultFlags {
  std::string output;
  std::string report;
  std::string picture;  ///< already written picture to name in the result; empty: none
  std::optional<double> temperature;
  bool json = false;
};

/// Groups of methods in the help of `calibrate`.
inline constexpr const char* kWithCamera = "Subcommands, with a camera";
inline constexpr const char* kWithoutCamera = "Subcommands, without a camera";

void declare_result_flags(CLI::App& app, ResultFlags& flags);

/// DisplayFlags choose the display that shows patterns.
struct DisplayFlags {
  std::string display = "kms";
  bool allow_inexact = false;
};

void declare_display_flags(CLI::App& app, DisplayFlags& flags);

/// PatternDisplay is a display that shows patterns. Thread safety: one thread.
class PatternDisplay {
 public:
  /// Throws the errors of display::open_display().
  PatternDisplay(const DisplayFlags& flags, const optics::Rig& rig);

  [[nodiscard]] display::Display& device() { return *display_; }
  [[nodiscard]] display::DisplaySink& sink() { return sink_; }
  /// Throws Error(Device) if the frame does not appear.
  void show(const frames::WovenFrame& frame);
  /// Lets the display work for a moment. Throws Error(Device) if it was disconnected.
  void pause();
  /// Lets the display work for a time, or if that is 0, until the user interrupts.
  void hold(double seconds);

 private:
  std::unique_ptr<display::Display> display_;
  display::DisplaySink sink_;
};

/// Writes the report beside the rig, saves the rig unless it was refused (the old one is kept under
/// a number), and prints both paths. The JSON also gets the keys of `more`. Returns kOk, or
/// kQuality if the rig was not saved.
ExitCode conclude_calibration(const calib::Calibration& found, calib::RecordDetails details,
                              const ResultFlags& flags,
                              const nlohmann::json& more = nlohmann::json::object());

// The calibration methods, one file each; `lenticule calibrate` lists them.

/// A method, named by the word after `calibrate`: its parsed flags and the function to run.
struct CalibrateWay {
  const CLI::App* app = nullptr;
  cli::Run run;
};

// Shows the user what a camera sees: small pictures and a short text about light and framing.

/// Takes one picture and writes it, at most 960 pixels wide. Returns false if no picture came
/// within a second. Throws Error(Failed) if it cannot be written.
bool write_preview(calib::Camera& camera, const std::string& file);

/// Returns "brightest 71 %, clipped 0.0 %": percent of full scale, and the clipped part of the
/// picture.
[[nodiscard]] std::string light_of(const calib::CameraPicture& picture);
/// Writes the picture as a PNG in sRGB.
void write_picture(const calib::CameraPicture& picture, const std::string& file);
}  // namespace lenticule::tools
