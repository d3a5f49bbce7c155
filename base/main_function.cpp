// SPDX-License-Identifier: Apache-2.0
#include "base/main_function.h"

#include <exception>
#include <new>
#include <nlohmann/json.hpp>

#include "base/cpu.h"
#include "base/text.h"

namespace lenticule {
namespace {

const char* name_of(ErrorKind kind) {
  constexpr const char* kNames[] = {"failed", "usage", "device", "input", "quality"};
  return kNames[static_cast<size_t>(kind) - 1];
}

std::string json_line(const Error& error) {
  return json_text(nlohmann::ordered_json{{"error", error.what()},
                                          {"hint", error.hint()},
                                          {"kind", name_of(error.kind())},
                                          {"exit_code", static_cast<int>(error.kind())}});
}

}  // namespace

int report_error(const Error& error, const ErrorStyle& style) noexcept {
  try {
    if (style.as_json) {
      say("{}\n", json_line(error));
      return exit_code_of(error.kind());
    }
  } catch (const std::exception&) {
    // Out of memory for JSON: print plain text instead.
  }
  say("{}: {}\n", style.program, error.what());
  if (!error.hint().empty()) say("  {}\n", error.hint());
  return exit_code_of(error.kind());
}

int run_reporting_errors(const std::function<int()>& run, const ErrorStyle& style) {
  try {
    const int code = run();
    finish_results();
    return code;
  } catch (const Error& error) {
    return report_error(error, style);
  } catch (const std::bad_alloc&) {
    return report_error({ErrorKind::Failed, "out of memory", style.memory_hint}, style);
  } catch (const std::exception& error) {
    return report_error({ErrorKind::Failed, error.what()}, style);
  }
}

int prepare_program(const ErrorStyle& style) {
  prepare_standard_streams();
  const auto choose_kernels = [] {
    static_cast<void>(best_isa());
    return kOk;
  };
  return run_reporting_errors(choose_kernels, style);
}

}  // namespace lenticule
