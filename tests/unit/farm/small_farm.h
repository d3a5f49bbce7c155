// SPDX-License-Identifier: Apache-2.0
// SmallFarm makes plans of small films, and chunks as `lenticule farm render` makes them, without a
// renderer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "farm/work_folder.h"
#include "frames/frame.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {

inline constexpr frames::FrameGeometry kFarmGeometry{30, 20};

/// Returns frame `number` of the film: its bands repeat from time to time.
frames::WovenFrame farm_frame(uint64_t number);

farm::Plan small_plan(uint64_t begin, uint64_t end, uint64_t chunk_frames);

class SmallFarm {
 public:
  explicit SmallFarm(const farm::Plan& plan);

  [[nodiscard]] std::filesystem::path work() const { return folder_ / "work"; }
  [[nodiscard]] std::filesystem::path film() const { return folder_ / "film.lts"; }
  [[nodiscard]] const farm::WorkFolder& folder() const { return work_; }
  [[nodiscard]] const farm::Plan& plan() const { return work_.plan(); }

  /// Renders a chunk and makes it done. `other_bytes`: as a faulty node does. Returns what
  /// WorkFolder::finish_chunk() returns.
  bool render(uint64_t chunk, const std::string& node = "node", bool other_bytes = false,
              double seconds = 1.0) const;
  void render_all() const;
  /// Returns the bytes of the film as one writer writes it.
  [[nodiscard]] std::vector<uint8_t> film_of_one_run() const;
  [[nodiscard]] std::filesystem::path chunk_file(uint64_t chunk) const;

 private:
  ScratchFolder folder_;
  farm::WorkFolder work_;
};

/// LateFiles does not see a file at the first looks, as a network file system may not.
class LateFiles : public farm::FolderFiles {
 public:
  explicit LateFiles(int late_looks) : late_looks_(late_looks) {}
  [[nodiscard]] std::optional<std::string> read(const std::filesystem::path& file) const override {
    return is_late(file) ? std::nullopt : FolderFiles::read(file);
  }
  [[nodiscard]] std::optional<farm::FileFacts> facts(
      const std::filesystem::path& file) const override {
    return is_late(file) ? std::nullopt : FolderFiles::facts(file);
  }

 private:
  [[nodiscard]] bool is_late(const std::filesystem::path& file) const {
    return file.filename() != "plan.json" && looks_[file]++ < late_looks_;
  }
  int late_looks_;
  mutable std::map<std::filesystem::path, int> looks_;
};

}  // namespace lenticule::test
