// SPDX-License-Identifier: Apache-2.0
// add_triple declares a flag with three numbers: "x,y,z" or "r,g,b".
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "base/error.h"
#include "base/numbers.h"
#include "optics/vec.h"

namespace lenticule::cli {

inline constexpr const char* kExampleOfPoint = "-32,0,700";

/// Throws Error(Usage) "FLAG 'text': ..." unless `text` is three finite numbers separated by
/// commas. The remedy is `example`, which must be a value that the flag accepts.
[[nodiscard]] inline Vec3 parse_triple(const std::string& flag, const std::string& text,
                                       const char* example = kExampleOfPoint) {
  const auto values = numbers_from<double, 3>(text, ',');
  if (!values)
    throw Error(ErrorKind::Usage, fmt::format("{} '{}': not three numbers", flag, text),
                fmt::format("for example {} {}", flag, example));
  return {(*values)[0], (*values)[1], (*values)[2]};
}

/// Declares the flag; --help shows `type`, for example "X,Y,Z". Parsing the command line throws the
/// error of parse_triple(), else calls `take`.
inline CLI::Option* add_triple(CLI::App& app, const std::string& flag, const std::string& type,
                               const std::function<void(Vec3)>& take,
                               const std::string& description) {
  const char* const example = type == "R,G,B" ? "0.2,0.3,0.5" : kExampleOfPoint;
  const auto parse = [take, flag, example](const std::string& text) {
    take(parse_triple(flag, text, example));
  };
  return app.add_option_function<std::string>(flag, parse, description)->type_name(type);
}

}  // namespace lenticule::cli
