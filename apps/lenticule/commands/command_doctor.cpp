// SPDX-License-Identifier: Apache-2.0
// lenticule doctor checks whether every subpixel reaches the panel unchanged, and lists remedies.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/print.h"
#include "display/kms/inspect.h"
#include "display/open/open_display.h"
#include "optics/panel.h"
#include "player/session/panel_json.h"
#include "player/sound/sound_device.h"

namespace lenticule::cli {
namespace {

struct DoctorFlags {
  std::string display = "kms";
  int bits = optics::kUsualBits;
  bool json = false;
};

nlohmann::json examine(const DoctorFlags& flags) {
  display::OutputRequest request = display::parse_kms_spec(flags.display);
  request.depth = display::depth_of(flags.bits);
  const auto session = display::make_direct_session();
  nlohmann::json json = {{"cards", nlohmann::json::array()},
                         {"tiled_panels", nlohmann::json::array()},
                         {"outputs", nlohmann::json::array()}};
  const display::Inspection inspection = display::inspect_cards(session);
  for (const auto& card : inspection.cards) json["cards"].push_back(player::to_json(card));
  for (const auto& group : display::tile_groups(inspection.panels))
    json["tiled_panels"].push_back(player::to_json(group));
  for (const auto& diagnosis : display::diagnose(session, request)) {
    const player::PanelSound sound = player::sound_of_panel(diagnosis.connectors.front());
    json["outputs"].push_back(player::to_json(diagnosis));
    json["outputs"].back()["sound"] = {{"device", sound.device},
                                       {"card", sound.card},
                                       {"monitor", sound.monitor},
                                       {"problem", sound.problem},
                                       {"remedy", sound.remedy}};
  }
  return json;
}

std::string text_of(const nlohmann::json& value) { return value.get<std::string>(); }

void print_cards(const nlohmann::json& cards) {
  for (const auto& card : cards) {
    const std::string problem = text_of(card["problem"]);
    const auto& counts = card["counts_vblanks"];
    print_out("{} ({}, driver {}): {}; {}\n", text_of(card["path"]), text_of(card["bus"]),
              card["driver"].get<std::string>().empty() ? "?" : text_of(card["driver"]),
              !problem.empty()                       ? problem
              : card["master_available"].get<bool>() ? "free to use"
                                                     : "another program is DRM master",
              counts.is_null()     ? "vblank counter unknown while its outputs are off"
              : counts.get<bool>() ? "counts vblanks"
                                   : "has no vblank counter; time is used instead");
  }
}

void print_tiled_panels(const nlohmann::json& groups) {
  for (const auto& group : groups) {
    print_out("tiled panel {} on {}: {}x{} in {} x {} tiles, {}\n", group["group"].get<uint32_t>(),
              text_of(group["card"]), group["width_px"].get<int>(), group["height_px"].get<int>(),
              group["columns"].get<int>(), group["rows"].get<int>(),
              group["complete"].get<bool>() ? "all connected" : "not all connected");
    for (const auto& tile : group["tiles"])
      print_out("  column {}, row {}: {}\n", tile["column"].get<int>() + 1,
                tile["row"].get<int>() + 1,
                tile["connector"].is_null() ? "not connected" : text_of(tile["connector"]));
  }
}

void print_properties(const nlohmann::json& properties) {
  if (properties.empty()) return;
  print_out("  {:<10} {:<24} {:<16} {:<12} {}\n", "object", "property", "found", "wanted",
            "outcome");
  for (const auto& row : properties)
    print_out("  {:<10} {:<24} {:<16} {:<12} {}\n", text_of(row["object"]),
              text_of(row["property"]), text_of(row["found"]), text_of(row["wanted"]),
              text_of(row["outcome"]));
}

void print_list(const char* label, const nlohmann::json& lines) {
  for (const auto& line : lines) print_out("    {} {}\n", label, text_of(line));
}

void print_output(const nlohmann::json& output) {
  const nlohmann::json& panel = output["panel"];
  const nlohmann::json& exactness = output["exactness"];
  const auto connectors = output["connectors"].get<std::vector<std::string>>();
  print_out("{} on {}{}\n", fmt::format("{}", fmt::join(connectors, " and ")),
            text_of(panel["card"]),
            panel["variable_refresh"].get<bool>() ? ": can vary its refresh" : "");
  print_properties(exactness["properties"]);
  if (!text_of(output["problem"]).empty())
    print_out("  cannot be used: {}\n", text_of(output["problem"]));
  print_out("  EXACT {}{}\n", text_of(exactness["exact"]),
            output["tested"].get<bool>() ? "" : " (not tested with the driver)");
  print_list("because", exactness["reasons"]);
  print_list("could not check:", exactness["unseen"]);
  print_list("note:", exactness["remarks"]);
  print_list("proved:", exactness["proved"]);
  print_list("try:", exactness["remedies"]);
  if (!text_of(output["remedy"]).empty()) print_out("    try: {}\n", text_of(output["remedy"]));
  const nlohmann::json& sound = output["sound"];
  if (text_of(sound["problem"]).empty())
    print_out("  sound: {} of {}, panel '{}'\n", text_of(sound["device"]), text_of(sound["card"]),
              text_of(sound["monitor"]));
  else
    print_out("  sound: {}, because {}\n    try: {}\n", text_of(sound["device"]),
              text_of(sound["problem"]), text_of(sound["remedy"]));
}

/// Returns kDevice if no output can show frames, kQuality if frames would be altered, and kFailed
/// if the check was not possible. For several panels the worst result counts.
ExitCode verdict_of(const nlohmann::json& outputs) {
  const auto usable = [](const auto& output) { return text_of(output["problem"]).empty(); };
  const auto answers = [&](display::Verdict verdict) {
    return std::any_of(outputs.begin(), outputs.end(), [&](const auto& output) {
      return output["exactness"]["exact"] == display::verdict_name(verdict);
    });
  };
  if (std::none_of(outputs.begin(), outputs.end(), usable)) return kDevice;
  if (answers(display::Verdict::No)) return kQuality;
  return answers(display::Verdict::Unknown) ? kFailed : kOk;
}

}  // namespace

Run declare_doctor(CLI::App& app) {
  auto flags = std::make_shared<DoctorFlags>();
  add_option(app, "--display DISPLAY", flags->display,
             "kms[:CONNECTOR|:edid:MFG...|:/dev/dri/...]");
  add_option(app, "--bits", flags->bits, "bits per colour, as the rig states them (panel.bits)")
      ->check(CLI::IsMember({optics::kUsualBits, optics::kDeepBits}));
  app.add_flag("--json", flags->json, "print everything as JSON");
  return [flags]() -> ExitCode {
    const nlohmann::json json = examine(*flags);
    print_result(json, flags->json, [](const nlohmann::json& all) {
      print_cards(all["cards"]);
      print_tiled_panels(all["tiled_panels"]);
      for (const auto& output : all["outputs"]) print_output(output);
    });
    if (json["cards"].empty())
      throw Error(
          ErrorKind::Device, "no graphics card was found",
          "only 'lenticule play' and 'lenticule calibrate' work without one: --display virtual");
    if (json["outputs"].empty())
      throw device_error("{}: no such panel is connected", flags->display)
          .remedy("'lenticule panels' lists the connected panels");
    return verdict_of(json["outputs"]);
  };
}

}  // namespace lenticule::cli
