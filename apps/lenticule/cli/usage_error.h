// SPDX-License-Identifier: Apache-2.0
// usage_error explains an invalid command line.
#pragma once

#include "base/error.h"

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace lenticule::cli {

/// Returns the Error(Usage) for a command line that `app` could not parse. An unknown command or
/// flag is reported first, with the most similar known one, because other errors usually follow
/// from it.
[[nodiscard]] Error usage_error(const CLI::App& app, const CLI::ParseError& error);

}  // namespace lenticule::cli
