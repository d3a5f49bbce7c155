// SPDX-License-Identifier: Apache-2.0
// Declares flags that several commands share: the rig, the layout of views in a source, weaving.
#pragma once

#include <string>

#include "player/sources/source_spec.h"
#include "player/sources/weaving_source.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lenticule::cli {

/// Declares --rig, which may be left out: choose_rig() takes its value.
CLI::Option* declare_rig_flag(CLI::App& app, std::string& rig,
                              const std::string& what = "rig file of the panel");
void declare_content_flags(CLI::App& app, player::ContentFlags& flags);
void declare_weaving_flags(CLI::App& app, player::WeavingFlags& flags);

}  // namespace lenticule::cli
