// SPDX-License-Identifier: Apache-2.0
// lenticule panels lists the connected panels and the rig of each.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/installation.h"
#include "base/print.h"
#include "display/kms/inspect.h"
#include "player/process/rig_choice.h"
#include "player/session/panel_json.h"

namespace lenticule::cli {
namespace {

using player::NamedRig;

struct PanelsFlags {
  std::string rigs;
  bool json = false;
};

/// Loads the rigs of the folder, or without one those of the user's and the system's folders.
std::vector<NamedRig> load_rigs(const std::string& folder) {
  std::error_code error;
  if (!folder.empty() && !std::filesystem::is_directory(folder, error))
    throw input_error("{}: no folder", folder).remedy("use a folder of rig files");
  std::vector<NamedRig> rigs;
  for (const auto& each :
       folder.empty() ? player::rig_folders() : std::vector<std::filesystem::path>{folder})
    for (NamedRig& named : player::rigs_in(each, true)) rigs.push_back(std::move(named));
  return rigs;
}

/// Returns the rigs that name this panel; a rig without an identity matches none.
std::vector<std::string> rigs_of(const display::PanelInfo& panel,
                                 const std::vector<NamedRig>& rigs) {
  std::vector<std::string> files;
  for (const NamedRig& named : rigs)
    if (player::names_panel(named.rig, panel)) files.push_back(named.file);
  return files;
}

nlohmann::json panels_as_json(const display::Inspection& inspection,
                              const std::vector<NamedRig>& rigs) {
  nlohmann::json json = {{"cards", nlohmann::json::array()}, {"panels", nlohmann::json::array()}};
  for (const auto& card : inspection.cards) json["cards"].push_back(player::to_json(card));
  for (const auto& panel : inspection.panels) {
    nlohmann::json entry = player::to_json(panel);
    entry["rigs"] = rigs_of(panel, rigs);
    json["panels"].push_back(std::move(entry));
  }
  return json;
}

std::string text_of(const nlohmann::json& value) { return value.get<std::string>(); }

void print_identity(const nlohmann::json& panel) {
  const nlohmann::json& identity = panel["identity"];
  if (identity.is_null()) {
    print_out("  EDID        {}\n", text_of(panel["edid"]));
    return;
  }
  print_out("  panel       {} 0x{:04x} serial '{}' name '{}'\n", text_of(identity["manufacturer"]),
            identity["product"].get<unsigned>(), text_of(identity["serial"]),
            text_of(identity["name"]));
  print_out("  EDID        sha256 {}\n", text_of(identity["edid_sha256"]));
}

void print_panel(const nlohmann::json& panel) {
  const bool connected = panel["connected"].get<bool>();
  print_out("{} on {}: {}\n", text_of(panel["connector"]), text_of(panel["card"]),
            connected ? "connected" : "nothing connected");
  if (!connected) return;
  print_identity(panel);
  print_out("  size        {} x {} mm\n", panel["width_mm"].get<unsigned>(),
            panel["height_mm"].get<unsigned>());
  for (const auto& mode : panel["modes"])
    print_out("  mode        {}x{} at {} = {:.4f} Hz{}{}\n", mode["width_px"].get<int>(),
              mode["height_px"].get<int>(), text_of(mode["refresh"]),
              mode["refresh_hz"].get<double>(), mode["preferred"].get<bool>() ? " (own)" : "",
              mode["usable"].get<bool>() ? "" : " (interlaced or doubled)");
  for (const auto& rig : panel["rigs"]) print_out("  rig         {}\n", text_of(rig));
  if (panel["rigs"].empty()) print_out("  rig         none for this panel\n");
}

void print_text(const nlohmann::json& json) {
  for (const auto& card : json["cards"])
    if (!text_of(card["problem"]).empty())
      print_out("{}: {}\n", text_of(card["path"]), text_of(card["problem"]));
  for (const auto& panel : json["panels"]) print_panel(panel);
}

}  // namespace

Run declare_panels(CLI::App& app) {
  auto flags = std::make_shared<PanelsFlags>();
  add_option(app, "--rigs FOLDER", flags->rigs,
             "folder of the rigs that are matched with the panels")
      ->default_str(std::string("~/.config/lenticule and ") + kSystemFolder);
  app.add_flag("--json", flags->json, "print everything as JSON");
  return [flags]() -> ExitCode {
    const std::vector<NamedRig> rigs = load_rigs(flags->rigs);
    const nlohmann::json json =
        panels_as_json(display::inspect_cards(display::make_direct_session()), rigs);
    print_result(json, flags->json, print_text);
    if (!json["panels"].empty()) return kOk;
    throw Error(
        ErrorKind::Device, "no graphics card with an output was found",
        "only 'lenticule play' and 'lenticule calibrate' work without one: --display virtual");
  };
}

}  // namespace lenticule::cli
