// SPDX-License-Identifier: Apache-2.0
#include "farm/chunk_report.h"

#include <fmt/format.h>

#include "base/numbers.h"
#include "base/text.h"
#include "farm/json_fields.h"

namespace lenticule::farm {
namespace {

using nlohmann::json;

constexpr size_t kDigits = 16;  ///< of a band's digest
constexpr uint64_t kAny = UINT64_MAX;

std::string bands_text(const std::vector<uint64_t>& bands) {
  std::string text;
  for (const uint64_t band : bands) text += fmt::format("{:016x}", band);
  return text;
}

std::vector<uint64_t> parse_bands(const JsonFields& fields, const char* key) {
  const std::string text = fields.text(key);
  if (text.size() % kDigits != 0) fields.fail(key, "not digests of 16 digits");
  std::vector<uint64_t> bands;
  for (size_t at = 0; at < text.size(); at += kDigits) {
    const auto band = number_from<uint64_t>(std::string_view(text).substr(at, kDigits), 16);
    if (!band) fields.fail(key, "not digests of 16 digits");
    bands.push_back(*band);
  }
  return bands;
}

}  // namespace

std::string chunk_report_to_json(const ChunkReport& report) {
  const json object = {{"plan", report.plan},
                       {"chunk", report.chunk},
                       {"begin", report.begin},
                       {"end", report.end},
                       {"digest", report.digest},
                       {"bytes", report.bytes},
                       {"first_bands", bands_text(report.first_bands)},
                       {"last_bands", bands_text(report.last_bands)},
                       {"node", report.node},
                       {"isa", report.isa},
                       {"threads", report.threads},
                       {"seconds", report.seconds},
                       {"render_seconds", report.render_seconds},
                       {"extra_seconds", report.extra_seconds},
                       {"started", report.started}};
  return json_text(object) + "\n";
}

ChunkReport parse_chunk_report(std::string_view text, const std::string& source) {
  const json object = parse_json(text, source);
  const JsonFields fields(object, source);
  return {.plan = fields.text("plan"),
          .chunk = fields.whole("chunk", kAny),
          .begin = fields.whole("begin", kAny),
          .end = fields.whole("end", kAny),
          .digest = fields.text("digest"),
          .bytes = fields.whole("bytes", kAny),
          .first_bands = parse_bands(fields, "first_bands"),
          .last_bands = parse_bands(fields, "last_bands"),
          .node = fields.text("node"),
          .isa = fields.text("isa"),
          .threads = static_cast<int>(fields.whole("threads", 1U << 20U)),
          .seconds = fields.number("seconds"),
          .render_seconds = fields.number("render_seconds"),
          .extra_seconds = fields.number("extra_seconds"),
          .started = fields.number("started")};
}

std::string chunk_progress_to_json(const ChunkProgress& progress) {
  return json_text(json{{"node", progress.node},
                        {"chunk", progress.chunk},
                        {"done", progress.done},
                        {"count", progress.count},
                        {"seconds", progress.seconds}}) +
         "\n";
}

ChunkProgress parse_chunk_progress(std::string_view text, const std::string& source) {
  const json object = parse_json(text, source);
  const JsonFields fields(object, source);
  return {.node = fields.text("node"),
          .chunk = fields.whole("chunk", kAny),
          .done = fields.whole("done", kAny),
          .count = fields.whole("count", kAny),
          .seconds = fields.number("seconds")};
}

std::string chunk_failure_to_json(const ChunkFailure& failure) {
  return json_text(json{{"node", failure.node},
                        {"chunk", failure.chunk},
                        {"error", failure.error},
                        {"hint", failure.hint}}) +
         "\n";
}

ChunkFailure parse_chunk_failure(std::string_view text, const std::string& source) {
  const json object = parse_json(text, source);
  const JsonFields fields(object, source);
  return {.node = fields.text("node"),
          .chunk = fields.whole("chunk", kAny),
          .error = fields.text("error"),
          .hint = fields.text("hint")};
}

}  // namespace lenticule::farm
