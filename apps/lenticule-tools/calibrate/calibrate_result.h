// SPDX-License-Identifier: Apache-2.0
// conclude_calibration ends every calibration: it prints the result, writes the report and saves
// the rig.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::tools {

struct ResultFlags {
  std::string output;
  std::string report;
  std::string picture;  ///< already written picture to name in the result; empty: none
  std::optional<double> temperature;
  bool json = false;
};

void declare_result_flags(CLI::App& app, ResultFlags& flags);

/// Writes the report beside the rig, saves the rig unless it was refused (the old one is kept under
/// a number), and prints both paths. The JSON also gets the keys of `more`. Returns kOk, or
/// kQuality if the rig was not saved.
ExitCode conclude_calibration(const calib::Calibration& found, calib::RecordDetails details,
                              const ResultFlags& flags,
                              const nlohmann::json& more = nlohmann::json::object());

}  // namespace lenticule::tools
