// SPDX-License-Identifier: Apache-2.0
// add_triple declares a flag with three numbers: "x,y,z" or "r,g,b".
#pragma once

#include <functional>
#include <string>

#include "optics/vec.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lenticule::cli {

inline constexpr const char* kExampleOfPoint = "-32,0,700";

/// Throws Error(Usage) "FLAG 'text': ..." unless `text` is three finite numbers separated by
/// commas. The remedy is `example`, which must be a value that the flag accepts.
[[nodiscard]] Vec3 parse_triple(const std::string& flag, const std::string& text,
                                const char* example = kExampleOfPoint);

/// Declares the flag; --help shows `type`, for example "X,Y,Z". Parsing the command line throws the
/// error of parse_triple(), else calls `take`.
CLI::Option* add_triple(CLI::App& app, const std::string& flag, const std::string& type,
                        const std::function<void(Vec3)>& take, const std::string& description);

}  // namespace lenticule::cli
