// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/error_report.h"

#include <exception>
#include <nlohmann/json.hpp>

#include "base/print.h"

namespace lenticule::player {
namespace {

const char* name_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::Usage:
      return "usage";
    case ErrorKind::Device:
      return "device";
    case ErrorKind::Input:
      return "input";
    case ErrorKind::Quality:
      return "quality";
    case ErrorKind::Failed:
      break;
  }
  return "failed";
}

std::string json_line(const Error& error) {
  return json_text(nlohmann::ordered_json{{"error", error.what()},
                                          {"hint", error.hint()},
                                          {"kind", name_of(error.kind())},
                                          {"exit_code", static_cast<int>(error.kind())}});
}

}  // namespace

ExitCode report_error(const Error& error, bool as_json) noexcept {
  try {
    if (as_json) {
      say("{}\n", json_line(error));
      return exit_code_of(error.kind());
    }
  } catch (const std::exception&) {
    // Out of memory for JSON: print plain text instead.
  }
  say("lenticule: {}\n", error.what());
  if (!error.hint().empty()) say("  {}\n", error.hint());
  return exit_code_of(error.kind());
}

}  // namespace lenticule::player
