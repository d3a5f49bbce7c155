// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/content_routes.h"

#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/parse.h"
#include "apps/lenticule-web/http/request_values.h"
#include "base/numbers.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr uint64_t kListBody = size_t{1} << 20;
constexpr uint64_t kFileBody = UINT64_MAX / 2;  ///< Media has a limit of its own
constexpr const char* kMediaPath = "/api/v1/media/{name}";

Response get_list(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().read());
}
Response put_list(WebSite& site, const Request& request, const std::string&) {
  ordered_json body = json_body(request);
  std::string version;
  if (body.contains("version")) version = body_text(body, "version");
  for (const char* key : {"version", "file", "editable", "by_hand"}) body.erase(key);
  return json_response(site.list().replace(body, version, request.sender.name));
}
Response get_versions(WebSite& site, const Request&, const std::string&) {
  return json_response(site.list().versions());
}
Response post_restore(WebSite& site, const Request& request, const std::string&) {
  return json_response(
      site.list().restore(body_text(json_body(request), "name"), request.sender.name));
}
Response get_media(WebSite& site, const Request&, const std::string&) {
  return json_response(site.media().list());
}
Response get_file(WebSite& site, const Request&, const std::string& name) {
  return json_response(site.media().info(name));
}
Response put_file(WebSite&, const Request&, const std::string&) {
  throw HttpError(400, "the file is empty");  // a body goes to the sink
}
std::unique_ptr<BodySink> file_sink(WebSite& site, const Request& request,
                                    const std::string& name) {
  const auto text = request.header("Content-Range");
  const auto range = text ? parse_content_range(*text) : std::nullopt;
  if (text && !range)
    throw HttpError(400, "Content-Range: not understood", "for example bytes 0-99/1000");
  const auto length = request.header("Content-Length");
  if (length == "0") return nullptr;
  return site.media().upload(name, range, length ? number_from<uint64_t>(*length) : std::nullopt,
                             request.query("replace") == "yes");
}
Response delete_file(WebSite& site, const Request&, const std::string& name) {
  const fs::path file = site.media().path_of(name);
  std::string list;
  if (site.player().state()["connected"] == true && site.list().names(file, list))
    throw HttpError(409, name + ": is in the list " + list + ", which plays",
                    "remove it from the list first");
  site.media().remove(name);
  return json_response({{"deleted", name}});
}
Response post_check(WebSite& site, const Request&, const std::string& name) {
  return json_response(site.media().check(name, true));
}
Response post_restore_file(WebSite& site, const Request&, const std::string& name) {
  site.media().restore(name);
  return json_response(site.media().info(name));
}

constexpr std::array kContentRoutes = {
    Route{"GET", "/api/v1/list", Rights::See, 0, get_list},
    Route{"PUT", "/api/v1/list", Rights::Change, kListBody, put_list},
    Route{"GET", "/api/v1/list/versions", Rights::See, 0, get_versions},
    Route{"POST", "/api/v1/list/restore", Rights::Change, kSmallBody, post_restore},
    Route{"GET", "/api/v1/media", Rights::See, 0, get_media},
    Route{"GET", kMediaPath, Rights::See, 0, get_file},
    Route{"PUT", kMediaPath, Rights::Change, kFileBody, put_file, file_sink},
    Route{"DELETE", kMediaPath, Rights::Change, kSmallBody, delete_file},
    Route{"POST", "/api/v1/media/{name}/check", Rights::Change, kSmallBody, post_check},
    Route{"POST", "/api/v1/media/{name}/restore", Rights::Change, kSmallBody, post_restore_file},
};

}  // namespace

std::span<const Route> content_routes() {
  return kContentRoutes;
}

}  // namespace lenticule::web
