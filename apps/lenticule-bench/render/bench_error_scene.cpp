// SPDX-License-Identifier: Apache-2.0
// The methods and scenes of `lenticule bench error`.
#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "apps/lenticule-tools/offline/gltf_writer.h"
#include "base/error.h"
#include "render/loaders/load_scene.h"
#include "render/methods/adaptive/method_adaptive.h"

namespace lenticule::bench {
namespace {

constexpr std::string_view kGltf = "gltf:";
constexpr std::string_view kBuiltIn = "builtin:";
constexpr const char* kReference = "full";
/// The method that has a tolerated error.
constexpr const char* kTolerant = "adaptive";

ErrorEntrant entrant(const std::string& method, std::optional<double> tolerated,
                     const std::vector<std::string>& known) {
  return {.name = tolerated ? fmt::format("{} {:g}", method, *tolerated) : method,
          .method = method,
          .tolerated = tolerated,
          .proven_rmse = 0.0,
          .exists = std::ranges::find(known, method) != known.end()};
}

render::SceneDescription read_as_gltf(const render::SceneDescription& scene,
                                      const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out << tools::write_gltf(scene).json;
  out.close();
  if (!out) throw Error(ErrorKind::Failed, fmt::format("{}: cannot write", file));
  return render::at_time(render::load_scene(file), 0.0);
}

}  // namespace

const char* name_of(ErrorScenario scenario) {
  return scenario == ErrorScenario::Still    ? "still"
         : scenario == ErrorScenario::Moving ? "moving"
                                             : "turning";
}

std::vector<ErrorEntrant> error_entrants(const std::vector<std::string>& methods,
                                         const std::vector<double>& errors,
                                         const std::vector<double>& psnrs,
                                         const std::vector<std::string>& known) {
  for (const double error : errors)
    if (!(error >= 0.0 && error <= 255.0))
      throw Error(ErrorKind::Usage,
                  fmt::format("--errors {}: not in 0 ... 255 code values", error));
  std::vector<ErrorEntrant> entrants = {entrant(kReference, {}, known)};
  for (const std::string& method : methods) {
    if (method == kReference) continue;
    if (method != kTolerant) {
      entrants.push_back(entrant(method, {}, known));
      continue;
    }
    for (const double error : errors) entrants.push_back(entrant(method, error, known));
    for (const double psnr : psnrs) {
      render::RenderOptions options;
      render::promise_psnr(psnr, options);
      ErrorEntrant& added = entrants.emplace_back(entrant(method, options.tolerated_error, known));
      added.name = fmt::format("{} {:g} dB", method, psnr);
      added.proven_rmse = options.proven_rmse;
    }
  }
  return entrants;
}

ErrorScene::ErrorScene(const std::string& name, frames::Rate rate)
    : name_(name), as_gltf_(name.starts_with(kGltf)) {
  const std::string source = as_gltf_ ? name.substr(kGltf.size()) : name;
  sequence_ = std::make_unique<tools::SceneSequence>(bench_scene_name(source), rate);
}

render::SceneDescription ErrorScene::after(uint64_t frames) const {
  render::SceneDescription scene = sequence_->at(sequence_->reference_frame() + frames);
  return as_gltf_ ? read_as_gltf(scene, folder_.file("scene.gltf")) : scene;
}

std::optional<std::string> ErrorScene::name_for_peers() const {
  std::string built_in = bench_scene_name(name_);
  if (as_gltf_ || !built_in.starts_with(kBuiltIn)) return std::nullopt;
  return built_in;
}

}  // namespace lenticule::bench
