// SPDX-License-Identifier: Apache-2.0
// CalibrateCommand lets `lenticule calibrate` draw the chart and fit photographs of it, in a
// process of its own.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::web {

/// CalibrationOutput is what `lenticule calibrate photos --json` printed.
struct CalibrationOutput {
  nlohmann::ordered_json report;  ///< null if it printed no report
  std::string message;            ///< printable lines on standard error
};
[[nodiscard]] CalibrationOutput parse_calibration_output(const std::string& output);

/// CalibrationFolder names the files of a calibration.
struct CalibrationFolder {
  std::filesystem::path path;

  [[nodiscard]] std::filesystem::path chart() const { return path / "chart.png"; }
  /// Returns the file of the rig of before the calibration.
  [[nodiscard]] std::filesystem::path before() const { return path / "before.toml"; }
  /// Returns the file of the rig for which the chart was drawn.
  [[nodiscard]] std::filesystem::path start() const { return path / "rig.toml"; }
  /// Returns the file of the rig that the command found.
  [[nodiscard]] std::filesystem::path found() const { return path / "found.toml"; }
  /// Returns the folder of photographs that are not accepted yet.
  [[nodiscard]] std::filesystem::path incoming() const { return path / "incoming"; }
};

/// PhotoFile is a photograph in a file.
struct PhotoFile {
  std::filesystem::path file;
  std::optional<double> distance_mm;  ///< from the panel to the camera
  uint64_t number = 0;                ///< another one for each photograph
};

struct FoundSheet {
  optics::Rig before;
  optics::Rig after;
  optics::Eye eye;  ///< place of the first photograph's camera
  size_t photographs = 0;
};

/// CalibrationFit is what the command found in some photographs.
struct CalibrationFit {
  nlohmann::ordered_json report;    ///< null if the command failed
  std::string message;              ///< reason why there is no report, or why the rig is refused
  std::optional<FoundSheet> found;  ///< none if the rig is refused
};

/// Returns the part of a report that the page shows.
[[nodiscard]] nlohmann::ordered_json shown_part(const nlohmann::ordered_json& report);

/// Thread safety: any thread. Fits in one folder exclude each other.
class CalibrateCommand {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// `stops` returns true when the server ends.
  CalibrateCommand(std::filesystem::path program, std::function<bool()> stops)
      : program_(std::move(program)), stops_(std::move(stops)) {}

  /// Throws HttpError 422 with the command's message.
  void draw_chart(const std::filesystem::path& rig, const std::filesystem::path& output) const;
  /// Fits the photographs, at least one: one for its place, several for every eye.
  [[nodiscard]] CalibrationFit fit(const CalibrationFolder& folder,
                                   const std::vector<PhotoFile>& photos, Deadline deadline) const;

 private:
  std::filesystem::path program_;
  std::function<bool()> stops_;
};

}  // namespace lenticule::web
