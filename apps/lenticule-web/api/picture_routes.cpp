// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/picture_routes.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/request_values.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

int width_in_query(const Request& request) {
  const double width = query_number(request, "width", 640.0);
  if (width < PictureMaker::kMinWidth || width > PictureMaker::kMaxWidth)
    throw HttpError(400, fmt::format("width: expected {} to {}", PictureMaker::kMinWidth,
                                     PictureMaker::kMaxWidth));
  return static_cast<int>(width);
}

Response get_frame(WebSite& site, const Request& request, const std::string&) {
  return jpeg_response(site.pictures().frame(width_in_query(request), request.sender.rights));
}

Response get_eye(WebSite& site, const Request& request, const std::string&) {
  const optics::Eye eye{.x = query_number(request, "x", std::nullopt),
                        .y = query_number(request, "y", 0.0),
                        .z_mm = query_number(request, "z", std::nullopt)};
  if (eye.z_mm < 1.0) throw HttpError(400, "z: expected at least 1 mm in front of the panel");
  return jpeg_response(site.pictures().eye(eye, width_in_query(request), request.sender.rights));
}

Response get_optics(WebSite& site, const Request&, const std::string&) {
  const optics::OpticalModel model = site.pictures().model();
  const optics::Rig& rig = model.rig();
  const double width = rig.panel.pixel_width.value * rig.panel.width_px;
  const double height = rig.panel.pixel_height.value * rig.panel.height_px;
  const double distance = rig.viewing.distance.value;
  const auto finite = [](double value) {
    return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  };
  return json_response({{"name", rig.name},
                        {"width_px", rig.panel.width_px},
                        {"height_px", rig.panel.height_px},
                        {"width_mm", width},
                        {"height_mm", height},
                        {"viewing_distance_mm", finite(distance)},
                        {"viewing_height_mm", rig.viewing.height.value},
                        {"lobe_width_mm", finite(model.lobe_width_mm(distance))},
                        {"views_per_lens", rig.sheet.pitch.value},
                        {"spot_sigma_lenses", rig.sheet.spot_sigma.value},
                        {"depth_of_field_mm", finite(model.depth_of_field_mm())}});
}

constexpr std::array kPictureRoutes = {
    Route{"GET", "/api/v1/frame.jpg", Rights::See, 0, get_frame},
    Route{"GET", "/api/v1/eye.jpg", Rights::See, 0, get_eye},
    Route{"GET", "/api/v1/optics", Rights::See, 0, get_optics},
};

}  // namespace

std::span<const Route> picture_routes() {
  return kPictureRoutes;
}

Response jpeg_response(std::string jpeg) {
  Response response;
  response.type = "image/jpeg";
  response.body = std::move(jpeg);
  return response;
}

}  // namespace lenticule::web
