// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report_html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/report/field_picture.h"
#include "calib/report/plain_text.h"
#include "calib/report/report_text.h"
#include "calib/report/sensitivity.h"

namespace lenticule::calib {
namespace {

constexpr std::string_view kStyle = R"(
body { font: 16px/1.5 "DejaVu Sans", Verdana, sans-serif; color: #222; background: #fff;
  max-width: 60em; margin: 0 auto; padding: 1.5em; }
h1 { font-size: 1.5em; margin: 0 0 .3em; } h2 { font-size: 1.15em; margin: 2em 0 .5em; }
.verdict { border-left: 12px solid; padding: 1em 1.3em; }
.verdict strong { display: block; font-size: 2em; line-height: 1.25; }
.intrinsic { border-color: #1b7f4b; background: #eaf6ef; }
.effective { border-color: #b97a00; background: #fdf5e2; }
.refused { border-color: #b3261e; background: #fcebea; }
table { border-collapse: collapse; font-size: .9em; }
th, td { padding: .25em .7em; text-align: right; border-bottom: 1px solid #ddd;
  font-variant-numeric: tabular-nums; white-space: nowrap; } th { white-space: normal; }
th { background: #f4f4f2; } .words td { text-align: left; white-space: normal; } th:first-child, td:first-child { text-align: left; }
td.bad { background: #fbe3d6; font-weight: bold; }
.wide { overflow-x: auto; }
figure { display: inline-block; margin: 0 1.2em 1em 0; vertical-align: top; }
figcaption { font-size: .85em; max-width: 320px; } .note { font-size: .85em; color: #555; }
code { font-size: .95em; background: #f4f4f2; padding: .1em .3em; }
@media print { body { font-size: 11px; max-width: none; padding: 0; } .wide { overflow: visible; }
  figure, table, .verdict { break-inside: avoid; } h2 { break-after: avoid; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; } }
)";

/// Page is growing HTML text; all foreign text is added through text().
class Page {
 public:
  template <class... Arguments>
  void add(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(html_), format, std::forward<Arguments>(arguments)...);
    html_ += '\n';
  }
  void heading(std::string_view title) { add("<h2>{}</h2>", html_escaped(title)); }
  void note(std::string_view text) { add("<p class=\"note\">{}</p>", html_escaped(text)); }
  void list(const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    add("<ul>");
    for (const std::string& line : lines) add("<li>{}</li>", html_escaped(line));
    add("</ul>");
  }
  [[nodiscard]] std::string take() { return std::move(html_); }

 private:
  std::string html_;
};

/// Cell is a cell of a table, already escaped.
struct Cell {
  std::string html;
  bool bad = false;
};

Cell text(std::string_view words) {
  return {html_escaped(words)};
}

Cell number(double value, int digits) {
  return {std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "not known"};
}

/// Marks a value beyond its limit; an unknown value is neither good nor bad.
Cell limited(double value, int digits, double most) {
  Cell cell = number(value, digits);
  cell.bad = value > most;
  return cell;
}

void add_table(Page& page, const std::vector<std::string>& heads,
               const std::vector<std::vector<Cell>>& rows) {
  // A table without heads is a list of texts, not of figures.
  page.add("<div class=\"wide\"><table{}>", heads.empty() ? " class=\"words\"" : "");
  if (!heads.empty()) page.add("<tr>");
  for (const std::string& head : heads) page.add("<th>{}</th>", html_escaped(head));
  if (!heads.empty()) page.add("</tr>");
  for (const std::vector<Cell>& row : rows) {
    page.add("<tr>");
    for (const Cell& cell : row)
      page.add("<td{}>{}</td>", cell.bad ? " class=\"bad\"" : "", cell.html);
    page.add("</tr>");
  }
  page.add("</table></div>");
}

void add_verdict(Page& page, const Calibration& c) {
  page.add("<div class=\"verdict {}\"><strong>{}</strong>{}", to_string(c.verdict),
           html_escaped(verdict_headline(c.verdict)), html_escaped(verdict_explained(c)));
  if (!c.reasons.empty()) page.add("<p>Why the result is not better:</p>");
  page.list(c.reasons);
  page.add("</div>");
  page.heading("What to do");
  page.list(advice(c));
  if (c.warnings.empty()) return;
  page.heading("Good to know");
  page.list(c.warnings);
}

std::string camera_words(const CameraFacts& camera) {
  if (camera.name.empty()) return "none";
  std::string out = camera.name;
  if (!camera.identity.empty()) out += ", " + camera.identity;
  if (camera.width > 0) out += fmt::format(", {} x {} pixels", camera.width, camera.height);
  if (!camera.pixel_format.empty()) out += ", " + camera.pixel_format;
  return out;
}

std::string panel_words(const optics::Rig& rig) {
  std::string out = fmt::format("{} x {} pixels", rig.panel.width_px, rig.panel.height_px);
  const optics::PanelIdentity& id = rig.identity;
  if (!id.manufacturer.empty()) out += ", " + id.manufacturer;
  if (id.product) out += fmt::format(" product {}", *id.product);
  if (!id.serial.empty()) out += ", serial " + id.serial;
  return out;
}

void add_origin(Page& page, const Calibration& c, const RecordDetails& details) {
  page.heading("What was measured, and with what");
  std::vector<std::vector<Cell>> rows = {
      {text("rig"), text(c.rig.name.empty() ? "without a name" : c.rig.name)},
      {text("panel"), text(panel_words(c.rig))},
      {text("when (UTC)"), text(iso_utc(details.when))},
      {text("how"), text(details.method)},
      {text("camera"), text(camera_words(details.camera))},
      {text("tool"), text(std::string("lenticule ") + LENTICULE_VERSION)},
      {text("computing took"), text(fmt::format("{:.1f} s", c.seconds_computing))}};
  if (details.temperature_celsius)
    rows.push_back(
        {text("temperature"), text(fmt::format("{:.1f} \u00b0C", *details.temperature_celsius))});
  add_table(page, {}, rows);
  if (details.camera.unlocked.empty()) return;
  page.note("What the camera could not keep constant:");
  page.list(details.camera.unlocked);
}

void add_parameters(Page& page, const Calibration& c) {
  if (c.parameters.empty()) return;
  page.heading("The numbers found");
  std::vector<std::vector<Cell>> rows;
  for (const Parameter& p : c.parameters)
    rows.push_back({text(p.name), text(with_error(p.estimate)), text(p.unit)});
  add_table(page, {"parameter", "value \u00b1 standard error", "unit"}, rows);
}

void add_correlation_row(Page& page, const Calibration& c, size_t row) {
  page.add("<tr><td>{}</td>", html_escaped(c.parameters[row].name));
  for (const double r : c.correlations[row]) {
    const char* ink = std::abs(r) > 0.75 ? "#fff" : "#222";
    page.add("<td style=\"background:{};color:{}\">{}</td>", signed_colour(r), ink,
             number(std::round(100.0 * r) / 100.0 + 0.0, 2).html);  // never "-0.00"
  }
  page.add("</tr>");
}

void add_correlations(Page& page, const Calibration& c) {
  const size_t count = c.correlations.size();
  const auto whole = [&](const std::vector<double>& row) { return row.size() == count; };
  if (count == 0 || count > c.parameters.size() || !std::ranges::all_of(c.correlations, whole))
    return;
  page.heading("How the numbers are correlated");
  page.add("<div class=\"wide\"><table><tr><th>correlation</th>");
  for (size_t n = 0; n < count; ++n) page.add("<th>{}</th>", html_escaped(c.parameters[n].name));
  page.add("</tr>");
  for (size_t row = 0; row < count; ++row) add_correlation_row(page, c, row);
  page.add("</table></div>");
  page.note(
      "Near 1 or -1, an error of one number is compensated by an error of the other: only both "
      "together are determined.");
}

Cell name_of(const Viewpoint& v) {
  return text(v.held_out ? v.name + " (kept aside)" : v.name);
}

std::vector<Cell> lens_row(const Viewpoint& v) {
  return {name_of(v), text(with_error(v.effective_pitch_subpx)), text(with_error(v.slant)),
          text(with_error(v.effective_offset_lenses))};
}

std::vector<Cell> quality_row(const Viewpoint& v) {
  const double most = v.held_out ? kWantedHeldOutMaxLenses : kWantedMaxLenses;
  Cell contrast = number(v.contrast, 2);
  contrast.bad = v.contrast > 0.0 && v.contrast < kWantedContrast;  // 0: not measured
  return {name_of(v),
          text(fmt::format("{:.0f}, {:.0f}, {:.0f}", v.eye_mm.x, v.eye_mm.y, v.eye_mm.z)),
          number(v.tilt_degrees, 1),
          contrast,
          number(100.0 * v.covered, 0),
          limited(v.rms_lenses, 4, v.held_out ? most : kWantedRmsLenses),
          limited(v.max_lenses, 4, most),
          number(v.reprojection_rms_px, 2)};
}

void add_viewpoints(Page& page, const Calibration& c) {
  if (c.viewpoints.empty()) return;
  page.heading("Results of each viewpoint");
  std::vector<std::vector<Cell>> lenses, qualities;
  for (const Viewpoint& v : c.viewpoints) {
    lenses.push_back(lens_row(v));
    qualities.push_back(quality_row(v));
  }
  add_table(page,
            {"place", "eye x, y, z (mm)", "tilt (\u00b0)", "contrast", "covered (%)",
             "residual, rms (lenses)", "residual, max (lenses)", "geometry, rms (px)"},
            qualities);
  page.note(
      fmt::format("Wanted: rms below {} and maximum below {} lenses where the fit used the data, "
                  "maximum below {} elsewhere; contrast above {}. x is to the right, y up, z "
                  "toward the viewer, from the middle of the sheet.",
                  kWantedRmsLenses, kWantedMaxLenses, kWantedHeldOutMaxLenses, kWantedContrast));
  add_table(page,
            {"place", "effective pitch (subpixels)", "slant (px/px)", "effective offset (lenses)"},
            lenses);
}

double shape_of(const optics::Panel& panel) {
  const double width = panel.width_px * panel.pixel_width.value;
  const double height = panel.height_px * panel.pixel_height.value;
  return width > 0.0 && height > 0.0 ? height / width : 9.0 / 16.0;
}

void add_field(Page& page, const Calibration& c, const PanelField& field, double full_scale,
               const std::string& title) {
  page.add("<figure>{}<figcaption>{}</figcaption></figure>",
           field_svg(field, shape_of(c.rig.panel), full_scale, title), html_escaped(title));
}

/// Returns the scale of the colours. Full colour for tiny values would make rounding noise look
/// alarming.
double scale_for(double largest) {
  constexpr double kFinest = 0.002;
  return std::max(largest, kFinest);
}

void add_residuals(Page& page, const Calibration& c) {
  double largest = 0.0;
  bool any = false;
  for (const Viewpoint& v : c.viewpoints) {
    const PanelField shown = coarser(v.residual);
    largest = std::max(largest, largest_magnitude(shown));
    any = any || !shown.values.empty();
  }
  if (!any) return;
  page.heading("Residuals of the fit");
  for (const Viewpoint& v : c.viewpoints) {
    if (coarser(v.residual).values.empty()) continue;
    add_field(page, c, v.residual, scale_for(largest),
              v.name + (v.held_out ? " (kept aside)" : ""));
  }
  page.add(
      "<figure>{}<figcaption>Phase measured minus phase fitted; the same colours in every "
      "map. Grey: not measured.</figcaption></figure>",
      colour_bar_svg(scale_for(largest), "lenses"));
}

void add_local_map(Page& page, const Calibration& c) {
  const PanelField map = field_of(c.rig.sheet.residual);
  if (coarser(map).values.empty()) return;
  page.heading("The sheet's own shape (local map dL)");
  const double scale = scale_for(largest_magnitude(coarser(map)));
  add_field(page, c, map, scale, "Lens coordinate minus that of an even grating");
  page.add(
      "<figure>{}<figcaption>Frames are corrected for it. {} by {} knots; the colours differ from "
      "those of the maps above.</figcaption></figure>",
      colour_bar_svg(scale, "lenses"), map.columns, map.rows);
}

void add_held_out(Page& page, const Calibration& c) {
  page.heading("Check at a place that the fit did not use");
  const ResidualSummary held_out = residual_summary(c, true);
  double predicted = 0.0;
  for (const Viewpoint& v : c.viewpoints)
    if (std::isfinite(v.predicted_lenses)) predicted = std::max(predicted, v.predicted_lenses);
  if (predicted > 0.0)
    page.add(
        "<p>Each place was left out once and predicted by the others: to {} lenses at worst; {} "
        "are allowed.</p>",
        number(predicted, 4).html, kWantedPredictedLenses);
  if (held_out.viewpoints == 0 && predicted > 0.0) return;
  if (held_out.viewpoints == 0) {
    page.add(
        "<p>No place was kept aside. The residuals above were measured with the pictures of the "
        "fit, and say little about other places.</p>");
    return;
  }
  const bool good = held_out.max_lenses <= kWantedHeldOutMaxLenses;
  page.add("<p>{} kept aside: off by {} lenses at most and {} rms; {} are allowed. <b>{}</b></p>",
           held_out.viewpoints == 1 ? "One place" : fmt::format("{} places", held_out.viewpoints),
           number(held_out.max_lenses, 4).html, number(held_out.rms_lenses, 4).html,
           kWantedHeldOutMaxLenses, good ? "Passed." : "Missed.");
}

void add_spot(Page& page, const Calibration& c) {
  if (!c.spot) return;
  page.heading("The lens spot and crosstalk");
  const LensSpot& spot = *c.spot;
  page.add(
      "<figure>{}<figcaption>Light that an eye gets from each place under a lens. Nearest "
      "Gaussian: sigma {} lenses.</figcaption></figure>",
      spot_svg(spot), number(spot.sigma_lenses, 3).html);
  page.add(
      "<p>Crosstalk of two views: <b>{} %</b> of the other eye's light, as "
      "<code>(L_bw - L_bb) / (L_wb - L_bb)</code>, the mean over the panel. L is the light at "
      "this eye; the first letter is what its own view shows, the second what the other one "
      "shows, b black, w white.</p>",
      number(100.0 * spot.two_view_crosstalk, 1).html);
  page.add(
      "<p>Veiling glare: {} % of white, seen where a comb turned by 90\u00b0 leaves no light. "
      "It is part of the crosstalk, and no calibration removes it.</p>",
      number(100.0 * spot.veiling_glare, 1).html);
}

void add_link(Page& page, const Calibration& c) {
  page.heading("The path from the player to the panel");
  const LinkCheck& link = c.link;
  const auto answer = [](bool wrong, const char* if_wrong, const char* if_right) {
    return Cell{wrong ? if_wrong : if_right, wrong};
  };
  add_table(
      page, {"question", "answer"},
      {{text("own pixels of the panel?"), answer(link.scaled, "no, scaled", "yes")},
       {text("full colour resolution?"), answer(link.chroma_subsampled, "no, subsampled", "yes")},
       {text("red left of blue?"), answer(link.channels_swapped, "no, swapped", "yes")},
       {text("light in channels that should be dark"),
        {number(100.0 * link.chroma_leak, 1).html + " %"}}});
  page.list(link.findings);
}

void add_drift(Page& page, const Calibration& c) {
  page.heading("Largest expected error");
  const DriftPrediction& d = c.drift;
  page.add(
      "<p>From twice the standard errors: at worst <b>{} lenses</b> at the {} of the panel (pixel "
      "{:.0f}, {:.0f}) for an eye at ({:.0f}, {:.0f}, {:.0f}) mm. {} lenses are hardly "
      "visible.</p>",
      number(d.worst_lenses, 4).html, panel_place(c.rig.panel, d.panel_x_px, d.panel_y_px),
      d.panel_x_px, d.panel_y_px, d.eye_mm.x, d.eye_mm.y, d.eye_mm.z, kVisiblePhaseLenses);
}

optics::Eye usual_eye(const Calibration& c) {
  for (const Viewpoint& v : c.viewpoints)
    if (!v.held_out && is_finite(v.eye_mm) && v.eye_mm.z > 0.0)
      return {v.eye_mm.x, v.eye_mm.y, v.eye_mm.z};
  const optics::ViewingLine& line = c.rig.viewing;
  constexpr double kArmsLength = 700.0;
  return {line.centre.value, line.height.value,
          std::isfinite(line.distance.value) ? line.distance.value : kArmsLength};
}

void add_sensitivities(Page& page, const Calibration& c) {
  if (optics::find_problem(c.rig)) return;
  const optics::Eye eye = usual_eye(c);
  page.heading("Effects of small changes");
  std::vector<std::vector<Cell>> rows;
  for (const Sensitivity& s : sensitivities(c.rig, eye))
    rows.push_back({text(s.change), number(s.worst_lenses, 4), text(s.allowed)});
  add_table(page,
            {"change", "phase at the worst place (lenses)",
             fmt::format("allowed for {} lenses", kVisiblePhaseLenses)},
            rows);
  page.note(fmt::format(
      "Computed with these numbers for an eye at ({:.0f}, {:.0f}, {:.0f}) mm that frames are made "
      "for, without trimming. Temperature: acrylic that is free to expand by {} per kelvin "
      "relative to the panel's glass; a bonded sheet expands less.",
      eye.x, eye.y, eye.z_mm, kPitchPerKelvin));
}

void add_head(Page& page, const Calibration& c, const RecordDetails& details) {
  const std::string title =
      fmt::format("Calibration of {}", c.rig.name.empty() ? "a panel" : c.rig.name);
  page.add(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<title>{0}</title><style>{1}</style></head><body>\n<h1>{0}</h1>"
      "<p class=\"note\">{2}</p>",
      html_escaped(title), kStyle, html_escaped(iso_utc(details.when)));
}

}  // namespace

std::string report_html(const Calibration& calibration, const RecordDetails& details) {
  Page page;
  add_head(page, calibration, details);
  add_verdict(page, calibration);
  add_origin(page, calibration, details);
  add_parameters(page, calibration);
  add_correlations(page, calibration);
  add_viewpoints(page, calibration);
  add_residuals(page, calibration);
  add_local_map(page, calibration);
  add_spot(page, calibration);
  add_link(page, calibration);
  add_drift(page, calibration);
  add_held_out(page, calibration);
  add_sensitivities(page, calibration);
  page.add("</body></html>");
  return page.take();
}

}  // namespace lenticule::calib
