// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/calibrate_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "apps/lenticule-web/api/photo_session.h"
#include "apps/lenticule-web/http/message.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "optics/rig_file.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr auto kDrawTime = seconds(50);
constexpr size_t kMaxLine = 400, kMaxMessage = 2000;

double number_at(const ordered_json& list, size_t k) {
  return list.is_array() && list.size() > k && list[k].is_number() ? list[k].get<double>() : NAN;
}

/// Returns the first reason of a report.
std::string first_reason(const ordered_json& report) {
  const ordered_json reasons = report.value("reasons", ordered_json::array());
  return reasons.is_array() && !reasons.empty() && reasons[0].is_string()
             ? reasons[0].get<std::string>()
             : std::string();
}

}  // namespace

CalibrationOutput parse_calibration_output(const std::string& output) {
  CalibrationOutput parsed;
  size_t begin = output.starts_with("{\n") ? 0 : output.find("\n{\n");
  if (begin != std::string::npos)
    parsed.report = ordered_json::parse(output.substr(begin), nullptr, false);
  if (!parsed.report.is_object()) {
    parsed.report = nullptr;
    begin = output.size();
  }
  const std::string_view before = std::string_view(output).substr(0, begin);
  for (size_t at = 0; at < before.size() && parsed.message.size() < kMaxMessage;) {
    const size_t end = std::min(before.find('\n', at), before.size());
    // Progress rewrites its line after '\r': only the last state counts.
    std::string_view line = before.substr(at, end - at);
    line.remove_prefix(std::min(line.size(), line.rfind('\r') + 1));
    if (!line.empty())
      parsed.message +=
          (parsed.message.empty() ? "" : "\n") + shortened(escaped(std::string(line)), kMaxLine);
    at = end + 1;
  }
  return parsed;
}

nlohmann::ordered_json shown_part(const ordered_json& report) {
  ordered_json result;
  for (const char* key : {"verdict", "reasons", "warnings", "advice", "parameters"})
    result[key] = report.value(key, ordered_json());
  const ordered_json viewpoints = report.value("viewpoints", ordered_json::array());
  const ordered_json place =
      viewpoints.is_array() && !viewpoints.empty() ? viewpoints[0] : ordered_json::object();
  for (const char* key : {"eye_mm", "covered", "rms_lenses", "max_lenses", "residual_lenses"})
    result[key] = place.value(key, ordered_json());
  result["photographs"] = viewpoints.size();
  return result;
}

void CalibrateCommand::draw_chart(const fs::path& rig, const fs::path& output) const {
  const ProgramRun run = run_and_capture({program_.string(), "calibrate", "show", "photo-chart",
                                          "--rig", rig.string(), "-o", output.string()},
                                         kDrawTime, stops_);
  if (run.exit_code != 0)
    throw HttpError(422, run.timed_out ? "drawing the chart took too long"
                                       : parse_calibration_output(run.output).message);
}

CalibrationFit CalibrateCommand::fit(const CalibrationFolder& folder,
                                     const std::vector<PhotoFile>& photos,
                                     Deadline deadline) const {
  const fs::path output = folder.found();
  fs::remove(output);
  std::vector<std::string> words = {program_.string(), "calibrate", "photos"};
  for (const PhotoFile& photo : photos) words.push_back(photo.file.string());
  words.insert(words.end(),
               {"--rig", folder.start().string(), "-o", output.string(), "--json", "--confined"});
  if (photos.size() > 1)
    words.insert(words.end(), {"--largest-error", std::to_string(PhotoSession::kUsableLenses)});
  else if (photos.front().distance_mm)
    words.insert(words.end(), {"--distance", fmt::format("{:.1f}", *photos.front().distance_mm)});
  const auto left =
      std::chrono::duration_cast<seconds>(deadline - std::chrono::steady_clock::now());
  const ProgramRun run = run_and_capture(words, std::max(left, seconds(1)), stops_);
  CalibrationOutput printed = parse_calibration_output(run.output);
  CalibrationFit fit{
      .report = std::move(printed.report), .message = std::move(printed.message), .found = {}};
  if (run.timed_out) fit.message = "judging the photographs took too long";
  if (fit.report.is_null()) return fit;
  fit.message = first_reason(fit.report);
  if (run.exit_code != 0) return fit;
  const ordered_json eye = shown_part(fit.report)["eye_mm"];
  fit.found =
      FoundSheet{.before = optics::load_rig(folder.before()),
                 .after = optics::load_rig(output),
                 .eye = {.x = number_at(eye, 0), .y = number_at(eye, 1), .z_mm = number_at(eye, 2)},
                 .photographs = photos.size()};
  return fit;
}

}  // namespace lenticule::web
