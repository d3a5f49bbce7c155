// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/page_routes.h"

#include <algorithm>
#include <array>

#include "apps/lenticule-web/http/page_files.h"

namespace lenticule::web {
namespace {

template <const char* kName>
Response get_page(WebSite&, const Request& request, const std::string&) {
  return page_response(kName, request);
}
constexpr char kNowPage[] = "now.html";
constexpr char kEyePage[] = "eye.html";
constexpr char kTrimPage[] = "trim.html";
constexpr char kCalibratePage[] = "calibrate.html";
constexpr char kHealthPage[] = "health.html";
constexpr char kOpenApi[] = "openapi.json";

// The files of a page are named in CMakeLists.txt, too.
constexpr std::array kPageRoutes = {
    Route{"GET", "/", Rights::See, 0, get_page<kNowPage>},
    Route{"GET", "/eye", Rights::See, 0, get_page<kEyePage>},
    Route{"GET", "/trim", Rights::See, 0, get_page<kTrimPage>},
    Route{"GET", "/calibrate", Rights::See, 0, get_page<kCalibratePage>},
    Route{"GET", "/health", Rights::See, 0, get_page<kHealthPage>},
    Route{"GET", "/api/v1/openapi.json", Rights::None, 0, get_page<kOpenApi>},
};

}  // namespace

std::span<const Route> page_routes() {
  return kPageRoutes;
}

std::string_view asset_of(std::string_view path) {
  if (!path.starts_with('/')) return {};
  path.remove_prefix(1);
  return path.ends_with(".css") || path.ends_with(".js") || path.ends_with(".svg")
             ? path
             : std::string_view();
}

Response page_response(std::string_view name, const Request& request) {
  const auto files = page_files();
  const auto file = std::find_if(files.begin(), files.end(),
                                 [&](const PageFile& one) { return one.name == name; });
  if (file == files.end()) throw HttpError(404, "there is no such page");
  Response response;
  response.type = file->type;
  response.headers = {{"Cache-Control", "no-cache"}, {"ETag", file->tag}};
  if (request.header("If-None-Match").value_or("") == file->tag)
    response.status = 304;
  else
    response.borrowed = file->bytes;
  return response;
}

}  // namespace lenticule::web
