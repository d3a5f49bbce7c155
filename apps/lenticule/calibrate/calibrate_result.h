// SPDX-License-Identifier: Apache-2.0
// The end of every calibration: what is printed, which report is written, whether the rig is saved.
#pragma once

#include <optional>
#include <string>

#include "apps/lenticule/cli/command.h"
#include "calib/calibration.h"
#include "calib/report/rig_record.h"

namespace lenticule::player {

struct ResultFlags {
  std::string output;
  std::string report;
  std::optional<double> temperature;
  bool json = false;
};

void declare_result_flags(CLI::App& app, ResultFlags& flags);

/// Writes the report beside the rig, saves the rig unless it was refused (the old one is kept under
/// a number), prints both. kOk, or kQuality where nothing was saved.
ExitCode conclude_calibration(const calib::Calibration& found, calib::RecordDetails details,
                              const ResultFlags& flags);

}  // namespace lenticule::player
