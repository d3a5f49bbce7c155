// SPDX-License-Identifier: Apache-2.0
// ConfinedScenes has models read by a process without rights (lenticule-reader), so that a broken
// or malicious model can at most crash, block or take over that process.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>

#include "render/loaders/load_scene.h"

namespace lenticule::tools {

/// Limits for one model, in addition to those of render/loaders/formats.h. Each also grows with the
/// size of the file.
struct SceneLimits {
  /// Processor time of the reader, which does not depend on the load of the machine.
  std::chrono::milliseconds processor_time{60'000};
  std::chrono::milliseconds processor_time_per_mebibyte{5'000};
  /// Time in which the reader neither computes nor answers.
  std::chrono::milliseconds silence{60'000};
  /// A .gltf file says little about the size of its buffers, which are in other files.
  uint64_t memory = uint64_t{1} << 30;
  uint64_t memory_of_gltf = uint64_t{16} << 30;
  uint64_t memory_per_byte = 64;
};

/// Keeps its process for the next model. Errors name the file and the remedy. The textures are read
/// through frames/image_io.h.
class ConfinedScenes final : public render::SceneReader {
 public:
  /// If `program` is empty, it is searched for when the first model is read.
  explicit ConfinedScenes(std::filesystem::path program = {}, const SceneLimits& limits = {});
  /// Ends the process.
  ~ConfinedScenes() override;

  [[nodiscard]] render::SceneDescription load(const std::filesystem::path& file,
                                              const render::LoadOptions& options) const override;

 private:
  class Reader;

  const SceneLimits limits_;
  mutable std::mutex mutex_;
  mutable std::filesystem::path program_;
  mutable std::unique_ptr<Reader> reader_;
};

}  // namespace lenticule::tools
