// SPDX-License-Identifier: Apache-2.0
#include "calib/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

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

/// Returns the data that a page draws.
nlohmann::json data_of(const std::string& html) {
  const std::string start = R"(<script type="application/json" id="data">)";
  const size_t begin = html.find(start) + start.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
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
  for (const char* outside :
       {"http:", "https:", "<link", "<img", "url(", "@import", "src=", "@DATA@"})
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  EXPECT_EQ(count(html, "<html"), 1U);
  EXPECT_EQ(count(html, "</html>"), 1U);
}

TEST(ReportHtml, HoldsTheReportAndWhatThePageAddsToIt) {
  const Calibration c = sample_calibration();
  const nlohmann::json data = data_of(report_html(c, sample_details()));
  EXPECT_EQ(data.at("report"), report_json(c, sample_details()));
  EXPECT_EQ(data.at("headline"), "Calibrated");
  EXPECT_EQ(data.at("worst_place"), "top right");
  EXPECT_EQ(data.at("eye_mm"), nlohmann::json({0.0, 20.0, 700.0}));
  EXPECT_EQ(data.at("small_changes").size(), 8U);
}

TEST(ReportHtml, TextsFromDevicesCannotEndTheirScript) {
  const std::string evil = "</script><script>alert('1')</script>@DATA@<!--&\"\xff\n";
  Calibration c = sample_calibration();
  RecordDetails details = sample_details();
  const size_t scripts = count(report_html(c, details), "<script");
  c.rig.name = c.rig.identity.serial = c.viewpoints[0].name = c.parameters[0].name = evil;
  c.reasons = c.warnings = c.link.findings = details.camera.unlocked = {evil};
  details.method = details.camera.name = details.camera.identity = evil;
  const std::string html = report_html(c, details);
  EXPECT_EQ(count(html, "<script"), scripts);
  EXPECT_EQ(count(html, "</script>"), scripts);
  EXPECT_EQ(data_of(html).at("report"), report_json(c, details));
}

TEST(ReportHtml, AcceptsUnknownValues) {
  EXPECT_TRUE(data_of(report_html(Calibration{}, RecordDetails{})).at("small_changes").empty());
  Calibration c = sample_calibration();
  for (Viewpoint& v : c.viewpoints) v.eye_mm = {kNan, kNan, kNan};
  c.rig.viewing.distance = Millimetres(kInfinity);
  c.drift = {kInfinity, kNan, kNan, {kNan, kNan, kNan}};
  const nlohmann::json data = data_of(report_html(c, sample_details()));
  EXPECT_EQ(data.at("eye_mm").at(2), 700.0);
  EXPECT_TRUE(data.at("report").at("drift").at("worst_lenses").is_null());
}

TEST(ReportText, EachVerdictNamesARemedy) {
  Calibration c = sample_calibration();
  EXPECT_THAT(advice(c).front(), HasSubstr("Use the rig"));
  c.verdict = Verdict::Effective;
  EXPECT_THAT(advice(c).front(), HasSubstr("viewers near 700 mm"));
  c.verdict = Verdict::Refused;
  c.link.chroma_subsampled = true;
  EXPECT_THAT(advice(c).front(), HasSubstr("4:4:4"));
}

TEST(ReportText, ErrorsDetermineTheDigits) {
  EXPECT_EQ(with_error({7.70123012, 1.25e-6}), "7.7012301 \u00b1 0.0000013");
  EXPECT_EQ(with_error({2.2, 0.0}), "2.2");
  EXPECT_EQ(with_error({2.2, kNan}), "2.2");
  EXPECT_EQ(with_error({kNan, 1.0}), "not known");
  EXPECT_EQ(with_error({1234.0, 25.0}), "1234 \u00b1 25");
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
