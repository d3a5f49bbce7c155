# SPDX-License-Identifier: Apache-2.0
# Writes a source with the page of reports: cmake -DOUTPUT=FILE -DPAGE=FILE -P embed_page.cmake
file(READ ${PAGE} page)
file(WRITE ${OUTPUT} "// Written by embed_page.cmake.
#include \"calib/report/report.h\"

namespace lenticule::calib {

std::string_view report_page() {
  return R\"page(${page})page\";
}

}  // namespace lenticule::calib
")
