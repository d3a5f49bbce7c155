// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as each part of a request that lenticule-web parses itself.
#include <cstdint>
#include <filesystem>

#include "apps/lenticule-web/http/parse.h"
#include "base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lenticule::web;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto is_part = [&](std::string_view part) {
    return part.data() >= text.data() && part.data() + part.size() <= text.data() + text.size();
  };
  if (const auto value = cookie_value(text, "lenticule"))
    LENTICULE_CHECK(is_part(*value) && value->find(';') == std::string_view::npos);
  if (const auto credential = bearer_credential(text))
    LENTICULE_CHECK(is_part(*credential) && !credential->empty());
  if (const auto range = parse_content_range(text))
    LENTICULE_CHECK(range->first <= range->last && range->last < range->total &&
                    range->bytes() <= range->total);
  if (is_media_name(text)) {
    const std::filesystem::path joined = std::filesystem::path("/media") / text;
    LENTICULE_CHECK(joined.lexically_normal().parent_path() == "/media");
    LENTICULE_CHECK(joined.filename().native() == text);
  }
  return 0;
}
