// SPDX-License-Identifier: Apache-2.0
// The fields with which methods take an error that is tolerated, and say how far they kept to it.
// A build without such methods lacks them: then nothing is set and nothing is said.
#pragma once

#include <nlohmann/json.hpp>

namespace lenticule::player {

/// `Options` is render::RenderOptions.
template <class Options>
void tolerate(Options& options, [[maybe_unused]] double error) {
  if constexpr (requires { options.tolerated_error; }) options.tolerated_error = error;
}

/// `Statistics` is render::RenderStatistics. Adds "audited", "audited_beyond" and "bound" where the
/// method audited itself.
template <class Statistics>
void add_audit([[maybe_unused]] const Statistics& statistics,
               [[maybe_unused]] nlohmann::json& figures) {
  if constexpr (requires { statistics.beyond_bound; }) {
    if (statistics.audited_subpixels == 0) return;
    figures["audited"] = statistics.audited_subpixels;
    figures["audited_beyond"] = statistics.audited_beyond;
    figures["bound"] = statistics.beyond_bound;
  }
}

}  // namespace lenticule::player
