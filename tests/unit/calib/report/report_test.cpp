// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "calib/report/field_picture.h"
#include "calib/report/report_html.h"
#include "calib/report/report_json.h"
#include "calib/report/report_text.h"
#include "calib/report/sensitivity.h"
#include "sample_calibration.h"

namespace lenticule::calib {
namespace {

using test::sample_calibration;
using test::sample_details;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

size_t count(const std::string& text, const std::string& part) {
  size_t found = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

/// Returns true if every start tag has its end tag in the right order.
bool is_balanced(const std::string& html) {
  static const std::set<std::string> kAlone = {"meta", "!DOCTYPE"};
  std::vector<std::string> open;
  for (size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at + 1)) {
    const size_t end = html.find('>', at);
    if (end == std::string::npos) return false;
    if (html[end - 1] == '/') continue;
    const bool closes = html[at + 1] == '/';
    const size_t begin = at + (closes ? 2 : 1);
    const std::string name = html.substr(begin, html.find_first_of(" >", begin) - begin);
    if (kAlone.contains(name)) continue;
    if (!closes) {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return false;
    } else {
      open.pop_back();
    }
  }
  return open.empty();
}

TEST(ReportJson, HoldsTheResults) {
  const auto json = report_json(sample_calibration(), sample_details());
  EXPECT_EQ(json.at("verdict"), "intrinsic");
  EXPECT_EQ(json.at("when"), "2026-03-01T12:34:56Z");
  EXPECT_EQ(json.at("rig").at("sheet").at("pitch_subpx"), 7.70123);
  EXPECT_EQ(json.at("rig").at("identity").at("product"), 10019);
  EXPECT_EQ(json.at("parameters").at(3).at("sigma"), 0.011);
  EXPECT_EQ(json.at("correlations").at(0).at(3), -0.83);
  EXPECT_EQ(json.at("viewpoints").size(), 4U);
  EXPECT_EQ(json.at("viewpoints").at(3).at("held_out"), true);
  EXPECT_EQ(json.at("viewpoints").at(0).at("residual_lenses").at("values").size(), 2040U);
  EXPECT_EQ(json.at("camera").at("k1"), -0.031);
  EXPECT_EQ(json.at("spot").at("profile").size(), 16U);
  EXPECT_EQ(json.at("drift").at("worst_lenses"), 0.0123);
  EXPECT_EQ(json.at("camera_used").at("unlocked").at(0), "no manual focus");
}

TEST(ReportJson, NonFiniteNumbersAreNull) {
  Calibration c = sample_calibration();
  c.parameters[0].estimate = {kNan, kInfinity};
  c.rig.viewing.distance = Millimetres(kInfinity);
  c.spot.reset();
  const auto json = report_json(c);
  EXPECT_TRUE(json.at("parameters").at(0).at("value").is_null());
  EXPECT_TRUE(json.at("parameters").at(0).at("sigma").is_null());
  EXPECT_TRUE(json.at("rig").at("viewing").at("distance_mm").is_null());
  EXPECT_TRUE(json.at("viewpoints").at(0).at("residual_lenses").at("values").at(0).is_null());
  EXPECT_TRUE(json.at("spot").is_null());
}

TEST(ReportJson, AcceptsAnyBytesInNames) {
  Calibration c = sample_calibration();
  c.viewpoints[0].name = "\xff\xfe";
  RecordDetails details = sample_details();
  details.camera.name = "caf\xe9";
  EXPECT_THAT(report_json(c, details).dump(), HasSubstr("caf\\\\xe9"));
}

TEST(ReportJson, AnEmptyCalibrationIsRefused) {
  const auto json = report_json(Calibration{});
  EXPECT_EQ(json.at("verdict"), "refused");
  EXPECT_TRUE(json.at("viewpoints").is_array());
  EXPECT_TRUE(json.at("viewpoints").empty());
}

TEST(ReportHtml, IsOneDocumentWithoutExternalResources) {
  const std::string html = report_html(sample_calibration(), sample_details());
  EXPECT_TRUE(is_balanced(html));
  for (const char* outside : {"<script", "http:", "https:", "<link", "<img", "url(", "@import"})
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_EQ(count(html, "<html"), 1U);
}

TEST(ReportHtml, ShowsTheResults) {
  const std::string html = report_html(sample_calibration(), sample_details());
  EXPECT_THAT(html, HasSubstr("<strong>Calibrated</strong>"));
  EXPECT_THAT(html, HasSubstr("7.7012301 \u00b1 0.0000042"));
  EXPECT_THAT(html, HasSubstr("at the top right of the panel"));
  EXPECT_THAT(html, HasSubstr("(L_bw - L_bb) / (L_wb - L_bb)"));
  EXPECT_THAT(html, HasSubstr("6.2 %"));
  EXPECT_THAT(html, HasSubstr("Passed."));
  EXPECT_THAT(html, HasSubstr("no manual focus"));
  // Four maps, the local one, two colour bars and the spot.
  EXPECT_EQ(count(html, "<svg"), 8U);
}

TEST(ReportHtml, MarksValuesOutsideTheirLimits) {
  Calibration c = sample_calibration();
  EXPECT_EQ(count(report_html(c, sample_details()), "<td class=\"bad\""), 0U);
  c.viewpoints[0].max_lenses = 0.021;
  c.viewpoints[3].max_lenses = 0.051;
  c.viewpoints[1].contrast = 0.24;
  const std::string html = report_html(c, sample_details());
  EXPECT_EQ(count(html, "<td class=\"bad\""), 3U);
  EXPECT_THAT(html, HasSubstr("Missed."));
}

TEST(ReportHtml, EscapesTextsFromDevices) {
  const std::string evil = "<script>alert('1')</script>&\"\xff\n";
  Calibration c = sample_calibration();
  RecordDetails details = sample_details();
  c.rig.name = c.rig.identity.serial = c.viewpoints[0].name = c.parameters[0].name = evil;
  c.parameters[0].unit = evil;
  c.reasons = c.warnings = c.link.findings = details.camera.unlocked = {evil};
  details.method = details.camera.name = details.camera.identity = evil;
  details.camera.pixel_format = evil;
  const std::string html = report_html(c, details);
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html,
              HasSubstr("&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&amp;&quot;\\xff\\x0a"));
  EXPECT_TRUE(is_balanced(html));
}

TEST(ReportHtml, ReportsUnknownValuesAsUnknown) {
  EXPECT_TRUE(is_balanced(report_html(Calibration{}, RecordDetails{})));
  Calibration c = sample_calibration();
  c.viewpoints.resize(1);
  c.viewpoints[0].residual = {7, 5, {1.0}};  // values missing
  c.viewpoints[0].eye_mm = {kNan, kNan, kNan};
  c.viewpoints[0].rms_lenses = kNan;
  c.correlations.pop_back();
  c.rig.viewing.distance = Millimetres(kInfinity);
  c.drift = {kInfinity, kNan, kNan, {kNan, kNan, kNan}};
  const std::string html = report_html(c, sample_details());
  EXPECT_TRUE(is_balanced(html));
  EXPECT_THAT(html, HasSubstr("not known"));
  EXPECT_THAT(html, HasSubstr("No place was kept aside"));
  EXPECT_THAT(html, Not(HasSubstr("are correlated")));
}

TEST(ReportText, EachVerdictNamesARemedy) {
  Calibration c = sample_calibration();
  EXPECT_THAT(advice(c).front(), HasSubstr("Use the rig"));
  c.verdict = Verdict::Effective;
  EXPECT_THAT(advice(c).front(), HasSubstr("viewers near 700 mm"));
  c.verdict = Verdict::Refused;
  c.link.chroma_subsampled = true;
  EXPECT_THAT(advice(c).front(), HasSubstr("4:4:4"));
  EXPECT_THAT(report_html(c, sample_details()), HasSubstr("verdict refused"));
}

TEST(ReportText, ErrorsDetermineTheDigits) {
  EXPECT_EQ(with_error({7.70123012, 1.25e-6}), "7.7012301 \u00b1 0.0000013");
  EXPECT_EQ(with_error({2.2, 0.0}), "2.2");
  EXPECT_EQ(with_error({2.2, kNan}), "2.2");
  EXPECT_EQ(with_error({kNan, 1.0}), "not known");
  EXPECT_EQ(with_error({1234.0, 25.0}), "1234 \u00b1 25");
}

TEST(FieldPicture, ColoursShowTheSignAndSaturate) {
  EXPECT_EQ(signed_colour(0.0), "#fafaf7");
  EXPECT_EQ(signed_colour(1.0), signed_colour(5.0));
  EXPECT_EQ(signed_colour(-1.0), "#2154a0");
  EXPECT_NE(signed_colour(0.5), signed_colour(-0.5));
  EXPECT_EQ(signed_colour(kNan), "#c4c4c4");
}

TEST(FieldPicture, FineFieldsAreAveragedWithoutMissingValues) {
  PanelField field{128, 72, std::vector<double>(128 * 72, 2.0)};
  for (int i : {0, 1, 128, 129}) field.values[static_cast<size_t>(i)] = kNan;
  field.values[2] = 6.0;
  field.values[3] = kNan;
  const PanelField coarse = coarser(field);
  ASSERT_EQ(coarse.columns, 64);
  ASSERT_EQ(coarse.rows, 36);
  EXPECT_TRUE(std::isnan(coarse.values[0]));
  EXPECT_DOUBLE_EQ(coarse.values[1], 10.0 / 3.0);
  EXPECT_DOUBLE_EQ(coarse.values[2], 2.0);
}

// Numbers of the design: 27 inches, pitch 7.7 subpixels, 700 mm.
TEST(Sensitivity, AgreesWithTheToleranceTable) {
  const auto rows = sensitivities(test::sample_rig(), {0.0, 0.0, 700.0});
  const auto worst = [&](const std::string& part) {
    for (const Sensitivity& s : rows)
      if (s.change.find(part) != std::string::npos) return s.worst_lenses;
    ADD_FAILURE() << part;
    return kNan;
  };
  // The expected phase error by the gradient alone (3/P times half the panel's extent along it).
  const double half = 3.0 * (1920.0 + 0.2521 * 1080.0) / 7.70123;
  EXPECT_NEAR(worst("warmer"), 7e-5 * half, 0.002);
  EXPECT_NEAR(worst("pitch off"), 1e-5 * half, 0.0003);
  EXPECT_NEAR(worst("slant off"), 1e-5 * 3.0 * 1080.0 / 7.70123, 0.0001);
  EXPECT_NEAR(worst("offset off"), 0.01, 1e-12);
  // The change on the axis is 0.0080 lens per millimetre.
  EXPECT_NEAR(worst("to the side"), 5 * 0.0080, 0.004);
  // 10 mm of distance change the pitch by 4.4e-5, and by less toward the corners, where light bends
  // more: the derivative of the shift, by its formula.
  const double r = 0.15565 * std::hypot(1920.0, 1080.0) / 705.0;
  const double bent = std::pow(1.0 + 0.55 * r * r, -1.5);
  EXPECT_NEAR(worst("nearer"), 2.2 * 10.0 / (705.0 * 705.0) * bent * half, 0.002);
}

}  // namespace
}  // namespace lenticule::calib
