// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/triple.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/numbers.h"

namespace lenticule::cli {

Vec3 parse_triple(const std::string& flag, const std::string& text, const char* example) {
  const auto values = numbers_from<double, 3>(text, ',');
  if (!values)
    throw Error(ErrorKind::Usage, fmt::format("{} '{}': not three numbers", flag, text),
                fmt::format("for example {} {}", flag, example));
  return {(*values)[0], (*values)[1], (*values)[2]};
}

CLI::Option* add_triple(CLI::App& app, const std::string& flag, const std::string& type,
                        const std::function<void(Vec3)>& take, const std::string& description) {
  const char* const example = type == "R,G,B" ? "0.2,0.3,0.5" : kExampleOfPoint;
  const auto parse = [take, flag, example](const std::string& text) {
    take(parse_triple(flag, text, example));
  };
  return app.add_option_function<std::string>(flag, parse, description)->type_name(type);
}

}  // namespace lenticule::cli
