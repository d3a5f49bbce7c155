// SPDX-License-Identifier: Apache-2.0
// PlannedFilm renders frames of a farm's plan as `lenticule render` does with the same flags.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule-tools/cli/render_flags.h"
#include "apps/lenticule-tools/offline/film_renderer.h"
#include "farm/plan.h"

namespace lenticule::tools {

/// Returns digests of everything that the film is made from: scene with textures, camera path,
/// environment picture, rig.
[[nodiscard]] std::map<std::string, std::string> digests_of_inputs(const RenderFlags& flags,
                                                                   const FilmRenderer& renderer);
/// Returns the digest of the numbered scene files of a chunk; empty if all frames have one file.
[[nodiscard]] std::string digest_of_chunk_inputs(const RenderFlags& flags,
                                                 const farm::Chunk& chunk);

class PlannedFilm {
 public:
  /// Throws Error(Input) if the plan was made by another version, or if an input has changed since.
  PlannedFilm(const farm::Plan& plan, int threads);

  [[nodiscard]] FilmRenderer& renderer() { return *renderer_; }
  [[nodiscard]] int threads() const;
  /// Throws Error(Input) if the numbered scene files of the chunk have changed.
  void require_inputs_of(const farm::Chunk& chunk) const;

 private:
  const farm::Plan& plan_;
  RenderFlags flags_;
  std::unique_ptr<FilmRenderer> renderer_;
};

/// Returns the name and version of this program, which a plan states.
[[nodiscard]] std::string program_version();

}  // namespace lenticule::tools
