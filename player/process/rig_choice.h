// SPDX-License-Identifier: Apache-2.0
// choose_rig chooses the rig of a command. Without --rig it is the rig that a film states, the one
// in the rig folders whose identity is that of the connected panel, or a sample rig.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "display/kms/inspect.h"
#include "optics/rig.h"
#include "player/process/private_folder.h"

namespace lenticule::player {

struct NamedRig {
  std::string file;
  optics::Rig rig;
};

/// Returns the folders with the rigs of this machine's panels: the user's
/// (~/.config/lenticule, or that of $XDG_CONFIG_HOME), then the system's (/etc/lenticule).
[[nodiscard]] std::vector<std::filesystem::path> rig_folders();

/// Loads every rig of the folder, sorted by name; there are none in a missing folder. Reports files
/// that cannot be read on standard error if `reports`, and skips them.
[[nodiscard]] std::vector<NamedRig> rigs_in(const std::filesystem::path& folder, bool reports);

/// Returns true if the rig states an identity and a size, and the panel has both.
[[nodiscard]] bool names_panel(const optics::Rig& rig, const display::PanelInfo& panel);

struct RigRequest {
  std::string given{};    ///< value of --rig
  std::string display{};  ///< name of the display; empty: nothing is displayed
  std::string source{};   ///< source to play; a film on a virtual display states its rig
  std::vector<std::filesystem::path> folders = rig_folders();
  display::KmsOptions kms{};  ///< session and platform; the real ones if null
};

struct ChosenRig {
  std::string file;
  /// The folder that holds the file if the rig comes from a film. Lifetime: as long as the file is
  /// used.
  std::shared_ptr<const PrivateFolder> kept{};
};

/// Returns the given rig, or chooses one and names it in a line on standard error. Throws
/// Error(Usage) with the candidates if none or several fit, Error(Device) if the display is a
/// panel that is not connected.
[[nodiscard]] ChosenRig choose_rig(const RigRequest& request);

/// Does the same, but waits at most `longest` (none = forever) for a panel that is not connected;
/// `report` is called with the reason about every second. None when interrupted.
[[nodiscard]] std::optional<ChosenRig> choose_rig_when_connected(
    const RigRequest& request, std::optional<display::Nanoseconds> longest,
    const std::function<void(const Error& reason)>& report);

}  // namespace lenticule::player
