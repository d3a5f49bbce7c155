// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the files that other machines write into a work folder: the result is an Error
// that names the file, or a value that is the same after writing and reading it again. The first
// byte chooses the file: a plan, a plan with a correct identity, a report, progress, a failure,
// jobs.
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "farm/plan.h"
#include "farm/sequence_joiner.h"
#include "farm/slurm.h"
#include "farm/work_folder.h"

namespace lenticule::farm {
namespace {

void check_plan(std::string_view text) {
  const Plan plan = parse_plan(text, "fuzz");
  LENTICULE_CHECK(plan.chunks() >= 1 && plan.chunk(plan.chunks() - 1).end == plan.end);
  const std::string written = plan_to_json(plan);
  LENTICULE_CHECK(plan_to_json(parse_plan(written, "again")) == written);
}

/// Replaces the identity of a plan by the digest of its content, which no fuzzer guesses.
std::string with_identity(std::string_view text) {
  nlohmann::json object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object() || !object.contains("result")) return std::string(text);
  object["identity"] = farm::digest_of_text(json_text(object["result"]));
  return json_text(object);
}

void check(uint8_t kind, std::string_view text) {
  if (kind == 0) check_plan(text);
  if (kind == 1) check_plan(with_identity(text));
  if (kind == 2) {
    const ChunkReport report = parse_record<ChunkReport>(text, "fuzz");
    LENTICULE_CHECK(parse_record<ChunkReport>(record_to_json(report), "again").bytes ==
                    report.bytes);
  }
  if (kind == 3) static_cast<void>(parse_record<ChunkProgress>(text, "fuzz"));
  if (kind == 4) static_cast<void>(parse_record<ChunkFailure>(text, "fuzz"));
  if (kind == 5) static_cast<void>(parse_slurm_jobs(text, "fuzz"));
  static_cast<void>(parse_queue(text, "/films/work"));
  static_cast<void>(parse_max_array_size(text));
  static_cast<void>(parse_sbatch_id(text));
}

}  // namespace
}  // namespace lenticule::farm

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  try {
    lenticule::farm::check(data[0] % 6, {reinterpret_cast<const char*>(data + 1), size - 1});
  } catch (const lenticule::Error& error) {
    LENTICULE_CHECK(error.kind() == lenticule::ErrorKind::Input);
    LENTICULE_CHECK(std::string_view(error.what()).starts_with("fuzz"));
  }
  return 0;
}
