// SPDX-License-Identifier: Apache-2.0
// What is wrong with a command line, in the program's own words.
#pragma once

#include "base/error.h"

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace lenticule::player {

/// Returns the Error(Usage) for a command line that `app` could not parse. A command or a flag that
/// does not exist is named first, with the one that may have been meant: what else is wrong usually
/// follows from it.
[[nodiscard]] Error usage_error(const CLI::App& app, const CLI::ParseError& error);

}  // namespace lenticule::player
