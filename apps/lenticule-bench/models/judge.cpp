// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/judge.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/lenticule-bench/models/plain_camera.h"
#include "base/file.h"
#include "player/process/child_process.h"

namespace lenticule::bench {
namespace {

using nlohmann::json;

json triple(Vec3 v) {
  return {v.x, v.y, v.z};
}

json camera_json(const std::optional<render::Camera>& camera) {
  if (!camera)
    return {{"toward", triple(toward_framing_camera())},
            {"vertical_fov_degrees", kModelFovDegrees}};
  return {{"from", triple(camera->from)},
          {"at", triple(camera->at)},
          {"up", triple(camera->up)},
          {"vertical_fov_degrees", camera->vertical_fov_degrees}};
}

std::string reason_file(const JudgeJob& job) {
  return job.picture + ".txt";
}

/// Returns the last line that is not empty.
std::string last_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

}  // namespace

std::string jobs_text(const std::vector<JudgeJob>& jobs) {
  json list = json::array();
  for (const JudgeJob& job : jobs)
    list.push_back({{"model", job.model},
                    {"picture", job.picture},
                    {"width", job.side_px},
                    {"height", job.side_px},
                    {"camera", camera_json(job.camera)},
                    {"background", triple({})},
                    {"environment", job.environment},
                    {"environment_ahead", triple(job.environment_ahead)},
                    {"light_scale", job.light_scale},
                    {"shadows", true},
                    {"tone_map", "pbr-neutral"},
                    {"exposure", 1.0}});
  return list.dump(1) + '\n';
}

std::string run_judge(const std::string& program, const std::filesystem::path& jobs_file,
                      const std::vector<JudgeJob>& jobs, std::chrono::seconds limit) {
  for (const JudgeJob& job : jobs) {
    std::filesystem::remove(job.picture);
    std::filesystem::remove(reason_file(job));
  }
  write_text_file(jobs_file, jobs_text(jobs));
  const ProgramRun run = player::run_child({program, jobs_file.string()}, limit);
  if (run.timed_out) return fmt::format("ended after {} s, the limit", limit.count());
  if (run.exit_code == 0) return {};
  const std::string said = last_line(run.output);
  return said.empty() ? fmt::format("failed with exit code {}", run.exit_code) : said;
}

std::string missing_picture(const JudgeJob& job) {
  if (std::filesystem::is_regular_file(job.picture)) return {};
  constexpr uint64_t kLongestReason = 64 << 10;
  if (!std::filesystem::is_regular_file(reason_file(job))) return "no picture";
  const std::string reason = last_line(read_text_file(reason_file(job), kLongestReason));
  return reason.empty() ? "no picture" : reason;
}

}  // namespace lenticule::bench
