// SPDX-License-Identifier: Apache-2.0
// Writes reports of calibrations, whose pages report_page_test.py opens: write_reports FOLDER
#include <filesystem>
#include <limits>

#include "base/file.h"
#include "calib/report/report.h"
#include "tests/unit/calib/report/sample_calibration.h"

namespace lenticule::calib {
namespace {

using test::sample_calibration;
using test::sample_details;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Calibration beyond_limits() {
  Calibration c = sample_calibration();
  c.viewpoints[0].max_lenses = 0.021;
  c.viewpoints[3].max_lenses = 0.051;
  c.viewpoints[1].contrast = 0.24;
  return c;
}

Calibration with_unknown_values() {
  Calibration c = sample_calibration();
  c.viewpoints.resize(1);
  c.viewpoints[0].residual = {7, 5, {1.0}};  // values missing
  c.viewpoints[0].eye_mm = {kNan, kNan, kNan};
  c.viewpoints[0].rms_lenses = kNan;
  c.correlations.pop_back();
  c.rig.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  c.drift = {kNan, kNan, kNan, {kNan, kNan, kNan}};
  c.reasons = {"</script><script>document.title = 'changed'</script><b>bold</b>"};
  return c;
}

void write(const std::filesystem::path& folder) {
  write_text_file(folder / "sample.html", report_html(sample_calibration(), sample_details()));
  write_text_file(folder / "limits.html", report_html(beyond_limits(), sample_details()));
  write_text_file(folder / "unknown.html", report_html(with_unknown_values(), sample_details()));
  write_text_file(folder / "empty.html", report_html(Calibration{}, RecordDetails{}));
}

}  // namespace
}  // namespace lenticule::calib

int main(int count, char** arguments) {
  if (count != 2) return 2;
  lenticule::calib::write(arguments[1]);
}
