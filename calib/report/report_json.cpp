// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calib/report/report_text.h"

namespace lenticule::calib {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

json numbers(const std::vector<double>& values) {
  json out = json::array();
  for (const double value : values) out.push_back(number(value));
  return out;
}

json texts(const std::vector<std::string>& lines) {
  json out = json::array();
  for (const std::string& line : lines) out.push_back(escaped(line));
  return out;
}

json vector(const Vec3& v) {
  return {number(v.x), number(v.y), number(v.z)};
}

json estimate(const Estimate& e) {
  return {{"value", number(e.value)}, {"sigma", number(e.sigma)}};
}

json field(const PanelField& f) {
  return {{"columns", f.columns}, {"rows", f.rows}, {"values", numbers(f.values)}};
}

json parameter(const Parameter& p) {
  return {{"name", escaped(p.name)},
          {"unit", escaped(p.unit)},
          {"value", number(p.estimate.value)},
          {"sigma", number(p.estimate.sigma)}};
}

json viewpoint(const Viewpoint& v) {
  return {{"name", escaped(v.name)},
          {"eye_mm", vector(v.eye_mm)},
          {"eye_sigma_mm", vector(v.eye_sigma_mm)},
          {"tilt_degrees", number(v.tilt_degrees)},
          {"effective_pitch_subpx", estimate(v.effective_pitch_subpx)},
          {"slant", estimate(v.slant)},
          {"effective_offset_lenses", estimate(v.effective_offset_lenses)},
          {"contrast", number(v.contrast)},
          {"covered", number(v.covered)},
          {"blocks", v.blocks},
          {"rms_lenses", number(v.rms_lenses)},
          {"max_lenses", number(v.max_lenses)},
          {"reprojection_rms_px", number(v.reprojection_rms_px)},
          {"held_out", v.held_out},
          {"foretold_lenses", number(v.predicted_lenses)},
          {"residual_lenses", field(v.residual)}};
}

json spot(const std::optional<LensSpot>& s) {
  if (!s) return nullptr;
  return {{"profile", numbers(s->profile)},
          {"sigma_lenses", number(s->sigma_lenses)},
          {"two_view_crosstalk", number(s->two_view_crosstalk)},
          {"veiling_glare", number(s->veiling_glare)}};
}

json link(const LinkCheck& l) {
  return {{"channels_swapped", l.channels_swapped},
          {"chroma_subsampled", l.chroma_subsampled},
          {"scaled", l.scaled},
          {"chroma_leak", number(l.chroma_leak)},
          {"findings", texts(l.findings)}};
}

json camera_model(const CameraModel& c) {
  return {{"focal_px", number(c.focal_px)},
          {"centre_x_px", number(c.centre_x_px)},
          {"centre_y_px", number(c.centre_y_px)},
          {"k1", number(c.k1)},
          {"k2", number(c.k2)}};
}

json drift(const DriftPrediction& d) {
  return {{"worst_lenses", number(d.worst_lenses)},
          {"panel_x_px", number(d.panel_x_px)},
          {"panel_y_px", number(d.panel_y_px)},
          {"eye_mm", vector(d.eye_mm)}};
}

json sheet(const optics::LensSheet& s) {
  const optics::ResidualMap& map = s.residual;
  return {{"pitch_subpx", number(s.pitch.value)},
          {"slant", number(s.slant)},
          {"offset_lenses", number(s.offset.value)},
          {"gap_mm", number(s.gap.value)},
          {"refraction_shape", number(s.refraction_shape)},
          {"spot_sigma_lenses", number(s.spot_sigma.value)},
          {"channel_offset_subpx",
           {number(s.channel_offset[0].value), number(s.channel_offset[1].value),
            number(s.channel_offset[2].value)}},
          {"residual_lenses", field({map.columns, map.rows, map.lenses})}};
}

json identity(const optics::PanelIdentity& id) {
  return {{"manufacturer", escaped(id.manufacturer)},
          {"product", id.product ? json(*id.product) : json(nullptr)},
          {"serial", escaped(id.serial)},
          {"edid_sha256", escaped(id.edid_sha256)}};
}

json panel(const optics::Panel& p) {
  return {{"width_px", p.width_px},
          {"height_px", p.height_px},
          {"pixel_width_mm", number(p.pixel_width.value)},
          {"pixel_height_mm", number(p.pixel_height.value)},
          {"layout", p.layout.name()}};
}

json provenance(const std::vector<std::pair<std::string, std::string>>& entries) {
  json out = json::array();
  for (const auto& [key, text] : entries) out.push_back({escaped(key), escaped(text)});
  return out;
}

json rig(const optics::Rig& r) {
  return {{"name", escaped(r.name)},
          {"fingerprint", optics::fingerprint(r)},
          {"panel", panel(r.panel)},
          {"sheet", sheet(r.sheet)},
          {"viewing",
           {{"distance_mm", number(r.viewing.distance.value)},
            {"height_mm", number(r.viewing.height.value)}}},
          {"identity", identity(r.identity)},
          {"provenance", provenance(r.provenance)}};
}

template <class Item, class Function>
json list(const std::vector<Item>& items, Function&& to_item) {
  json out = json::array();
  for (const Item& item : items) out.push_back(to_item(item));
  return out;
}

}  // namespace

json report_json(const Calibration& c) {
  return {{"format", 1},
          {"tool", std::string("lenticule ") + LENTICULE_VERSION},
          {"verdict", to_string(c.verdict)},
          {"reasons", texts(c.reasons)},
          {"warnings", texts(c.warnings)},
          {"advice", texts(advice(c))},
          {"rig", rig(c.rig)},
          {"parameters", list(c.parameters, parameter)},
          {"correlations", list(c.correlations, numbers)},
          {"viewpoints", list(c.viewpoints, viewpoint)},
          {"camera", camera_model(c.camera)},
          {"spot", spot(c.spot)},
          {"link", link(c.link)},
          {"drift", drift(c.drift)},
          {"seconds_computing", number(c.seconds_computing)}};
}

json report_json(const Calibration& calibration, const RecordDetails& details) {
  json out = report_json(calibration);
  const CameraFacts& used = details.camera;
  out["when"] = iso_utc(details.when);
  out["method"] = escaped(details.method);
  out["temperature_celsius"] =
      details.temperature_celsius ? number(*details.temperature_celsius) : json(nullptr);
  out["camera_used"] = {{"name", escaped(used.name)},
                        {"identity", escaped(used.identity)},
                        {"width_px", used.width},
                        {"height_px", used.height},
                        {"channels", used.channels},
                        {"frames_per_second", number(used.frames_per_second)},
                        {"pixel_format", escaped(used.pixel_format)},
                        {"unlocked", texts(used.unlocked)}};
  return out;
}

}  // namespace lenticule::calib
