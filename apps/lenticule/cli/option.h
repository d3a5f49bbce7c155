// SPDX-License-Identifier: Apache-2.0
// Options with what --help shows of their value: "-o,--output FILE", and its default. add_triple
// declares one with three numbers: "x,y,z" or "r,g,b".
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <type_traits>

#include "base/error_kinds.h"
#include "base/numbers.h"
#include "optics/vec.h"

namespace lenticule::cli {

/// Declares an option. `form` is its names and the word for its value: "--loop N|forever". --help
/// shows numbers and texts as they are now as the default, unless default_str() replaces it.
template <class Value>
CLI::Option* add_option(CLI::App& app, const std::string& form, Value& value,
                        const std::string& help) {
  const size_t blank = form.find(' ');
  CLI::Option* const option = app.add_option(form.substr(0, blank), value, help);
  if (blank != std::string::npos) option->type_name(form.substr(blank + 1));
  if constexpr (std::is_arithmetic_v<Value> || std::is_same_v<Value, std::string>)
    option->capture_default_str();
  return option;
}

/// Declares an option whose text is given to `take`.
inline CLI::Option* add_option_function(CLI::App& app, const std::string& form,
                                        const std::function<void(const std::string&)>& take,
                                        const std::string& help) {
  const size_t blank = form.find(' ');
  return app.add_option_function<std::string>(form.substr(0, blank), take, help)
      ->type_name(form.substr(blank + 1));
}

inline constexpr const char* kExampleOfPoint = "-32,0,700";

/// Throws Error(Usage) "FLAG 'text': ..." unless `text` is three finite numbers separated by
/// commas. The remedy is `example`, which must be a value that the flag accepts.
[[nodiscard]] inline Vec3 parse_triple(const std::string& flag, const std::string& text,
                                       const char* example = kExampleOfPoint) {
  const auto values = numbers_from<double, 3>(text, ',');
  if (!values)
    throw usage_error("{} '{}': not three numbers", flag, text)
        .remedy(fmt::format("for example {} {}", flag, example));
  return {(*values)[0], (*values)[1], (*values)[2]};
}

/// Declares an option such as "--eye X,Y,Z". Parsing the command line throws the error of
/// parse_triple(), else calls `take`.
inline CLI::Option* add_triple(CLI::App& app, const std::string& form,
                               const std::function<void(Vec3)>& take, const std::string& help) {
  const std::string flag = form.substr(0, form.find(' '));
  const char* const example = form.ends_with("R,G,B") ? "0.2,0.3,0.5" : kExampleOfPoint;
  const auto parse = [take, flag, example](const std::string& text) {
    take(parse_triple(flag, text, example));
  };
  return add_option_function(app, form, parse, help);
}

}  // namespace lenticule::cli
