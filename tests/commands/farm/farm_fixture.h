// SPDX-License-Identifier: Apache-2.0
// FarmTest makes plans in a test's folder and runs their commands.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

class FarmTest : public CommandTest {
 protected:
  using json = nlohmann::json;
  static constexpr int kFrames = 40;

  /// Makes the plan of film.lts in the folder "work"; `more` are further flags.
  void plan(const std::string& frames = "0:40", const std::string& chunk = "8",
            const std::vector<std::string>& more = {}) const {
    expect_end(run(plan_words(frames, chunk, more)), 0);
  }
  [[nodiscard]] std::vector<std::string> plan_words(
      const std::string& frames, const std::string& chunk,
      const std::vector<std::string>& more = {}) const {
    const std::vector<std::string> words =
        joined({"farm", "plan", "builtin:teapot", "--rig", rig_, "--frames", frames, "--chunk",
                chunk, "--timed-frames", "1", "-o", path("film.lts"), "--work", work()},
               more);
    return words;
  }

  [[nodiscard]] std::string work() const { return path("work"); }
  [[nodiscard]] std::vector<std::string> chunk_words(uint64_t chunk) const {
    return program({"farm", "render", work(), std::to_string(chunk), "--threads", "1"});
  }
  ProcessResult render_chunk(uint64_t chunk) const { return run_process(chunk_words(chunk)); }
  void render_all() const {
    for (uint64_t chunk = 0; chunk < chunks(); ++chunk)
      ASSERT_EQ(render_chunk(chunk).exit_code, 0) << chunk;
  }
  [[nodiscard]] uint64_t chunks() const {
    return json::parse(std::ifstream(work() + "/plan.json")).at("chunks").get<uint64_t>();
  }
  [[nodiscard]] ProcessResult merge(const std::vector<std::string>& more = {}) const {
    return run(joined({"farm", "merge", work()}, more));
  }
  [[nodiscard]] json status() const {
    const ProcessResult result = run({"farm", "status", work(), "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out, nullptr, false);
  }
  /// Returns the bytes of the film as one process writes it.
  [[nodiscard]] std::vector<uint8_t> film_of_one_run(
      const std::string& frames, const std::vector<std::string>& more = {}) const {
    expect_end(run(joined({"render", "builtin:teapot", "--rig", rig_, "--frames", frames, "-o",
                           path("whole.lts")},
                          more),
                   {.timeout = std::chrono::seconds(600)}),
               0);
    std::vector<uint8_t> bytes = read_bytes(path("whole.lts"));
    std::filesystem::remove(path("whole.lts"));
    return bytes;
  }
  [[nodiscard]] std::vector<uint8_t> film() const { return read_bytes(path("film.lts")); }
  [[nodiscard]] std::string chunk_file(uint64_t chunk) const {
    for (const auto& entry : std::filesystem::directory_iterator(work() + "/chunks"))
      if (std::stoull(entry.path().filename().string().substr(0, 6)) == chunk)
        return entry.path().string();
    return {};
  }

  std::string rig_ = source_file("scenes/rigs/tiny.toml");
};

}  // namespace lenticule::test
