// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/calibration_routes.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "apps/lenticule-web/api/picture_routes.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/request_values.h"

namespace lenticule::web {
namespace {

Response get_calibration(WebSite& site, const Request&, const std::string&) {
  return json_response(site.calibration().state());
}
Response post_calibration_begin(WebSite& site, const Request&, const std::string&) {
  site.calibration().begin();
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response put_photograph(WebSite&, const Request&, const std::string&) {
  throw HttpError(400, "the photograph is empty");  // a body goes to the sink
}
std::unique_ptr<BodySink> photograph_sink(WebSite& site, const Request& request,
                                          const std::string&) {
  if (request.header("Content-Length") == "0") return nullptr;
  std::optional<double> distance_mm;
  if (request.query("distance")) {
    distance_mm = query_number(request, "distance", std::nullopt);
    if (*distance_mm < 1.0) throw HttpError(400, "distance: expected millimetres above 0");
  }
  return site.calibration().photograph(
      {.place = request.query("place"), .distance_mm = distance_mm});
}
Response delete_photograph(WebSite& site, const Request& request, const std::string&) {
  site.calibration().remove(request.query("place").value_or(""));
  return json_response(site.calibration().state());
}
Response get_calibration_before(WebSite& site, const Request&, const std::string&) {
  return jpeg_response(site.calibration().picture(false));
}
Response get_calibration_after(WebSite& site, const Request&, const std::string&) {
  return jpeg_response(site.calibration().picture(true));
}
Response get_calibration_rig(WebSite& site, const Request&, const std::string&) {
  Response response;
  response.type = "text/plain; charset=utf-8";
  response.body = site.calibration().rig_toml();
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"rig.toml\"");
  return response;
}
Response post_calibration_keep(WebSite& site, const Request& request, const std::string&) {
  site.calibration().keep(request.sender.name);
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response post_calibration_restore(WebSite& site, const Request& request, const std::string&) {
  const auto number = body_number(json_body(request), "number");
  site.calibration().restore(static_cast<uint64_t>(std::max(0.0, number.value_or(0.0))),
                             request.sender.name);
  site.player().refresh();
  return json_response(site.calibration().state());
}
Response get_calibration_possible(WebSite& site, const Request&, const std::string&) {
  const std::string obstacle = site.calibration().obstacle();
  return json_response({{"possible", obstacle.empty()}, {"cause", obstacle}});
}
Response post_calibration_discard(WebSite& site, const Request&, const std::string&) {
  site.calibration().discard();
  site.player().refresh();
  return json_response(site.calibration().state());
}

constexpr std::array kCalibrationRoutes = {
    Route{"GET", "/api/v1/calibration", Rights::See, 0, get_calibration},
    Route{"GET", "/api/v1/calibration/possible", Rights::See, 0, get_calibration_possible},
    Route{"POST", "/api/v1/calibration/begin", Rights::Change, kSmallBody, post_calibration_begin},
    Route{"PUT", "/api/v1/calibration/photograph", Rights::Change, PhotoCalibration::kLargestPhoto,
          put_photograph, photograph_sink},
    Route{"DELETE", "/api/v1/calibration/photograph", Rights::Change, kSmallBody,
          delete_photograph},
    Route{"GET", "/api/v1/calibration/before.jpg", Rights::See, 0, get_calibration_before},
    Route{"GET", "/api/v1/calibration/after.jpg", Rights::See, 0, get_calibration_after},
    Route{"GET", "/api/v1/calibration/rig.toml", Rights::See, 0, get_calibration_rig},
    Route{"POST", "/api/v1/calibration/keep", Rights::Change, kSmallBody, post_calibration_keep},
    Route{"POST", "/api/v1/calibration/restore", Rights::Change, kSmallBody,
          post_calibration_restore},
    Route{"POST", "/api/v1/calibration/discard", Rights::Change, kSmallBody,
          post_calibration_discard},
};

}  // namespace

std::span<const Route> calibration_routes() {
  return kCalibrationRoutes;
}

}  // namespace lenticule::web
