// SPDX-License-Identifier: Apache-2.0
#include "player/process/rig_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/installation.h"
#include "base/print.h"
#include "display/open/open_display.h"
#include "frames/sequence/sequence_reader.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr const char* kUsualSample = "kiosk-27-4k.toml";

/// Returns true for "kiosk.1.toml", which save_with_history() has kept, and "kiosk.trim.toml".
bool is_beside_a_rig(const fs::path& file) {
  const std::string version = file.stem().extension().string();
  return optics::is_trim_file(file) ||
         (version.size() > 1 && version.find_first_not_of("0123456789", 1) == std::string::npos);
}

std::vector<fs::path> rig_files_in(const fs::path& folder) {
  std::vector<fs::path> files = entries_of(folder);
  std::erase_if(files, [](const fs::path& file) {
    return file.extension() != ".toml" || is_beside_a_rig(file);
  });
  return files;
}

/// Returns the folder as a relative path if it lies in the working folder.
fs::path shortest(const fs::path& folder) {
  std::error_code error;
  const fs::path relative = fs::proximate(folder, error);
  return error || relative.empty() || *relative.begin() == ".." ? folder : relative;
}

/// Returns the rigs in share/lenticule/rigs of the installation or scenes/rigs of the source tree
/// that this program belongs to.
std::vector<fs::path> sample_rigs() {
  std::error_code error;
  fs::path above = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (; !error && above.has_relative_path(); above = above.parent_path())
    for (const fs::path& place :
         {fs::path(kDataFolder) / "lenticule/rigs", fs::path("scenes/rigs")})
      if (std::vector<fs::path> rigs = rig_files_in(shortest(above / place)); !rigs.empty())
        return rigs;
  return {};
}

/// Returns the rig of a film, in a file of its own; none if the film states none.
std::optional<ChosenRig> rig_of_film(const fs::path& film) {
  if (!frames::is_sequence_name(film)) return std::nullopt;
  const frames::SequenceReader reader(film);
  if (reader.info().rig_toml.empty()) return std::nullopt;
  auto folder = std::make_shared<const PrivateFolder>();
  const fs::path file = folder->path() / film.filename().replace_extension(".toml");
  write_text_file(file, reader.info().rig_toml);
  return ChosenRig{.file = file.string(), .kept = std::move(folder)};
}

/// RigsOfPanels holds the connected panels that a request allows, and the rigs that name them.
struct RigsOfPanels {
  std::vector<std::string> known{};  ///< all rigs of the folders
  /// Rigs that name a connected panel, in the first folder that has any.
  std::vector<std::string> fitting{};
  std::vector<std::string> panels{};  ///< "HDMI-A-1: LGD 0x1234"
  std::optional<Error> refusal{};     ///< set if no panel is connected
};

RigsOfPanels rigs_of_panels(const RigRequest& request, bool needs_panel) {
  RigsOfPanels found;
  std::vector<std::vector<NamedRig>> folders;
  bool any_names_one = needs_panel;
  for (const fs::path& folder : request.folders) {
    folders.push_back(rigs_in(folder, false));
    for (const NamedRig& named : folders.back()) {
      found.known.push_back(named.file);
      any_names_one = any_names_one || !named.rig.identity.empty();
    }
  }
  if (!any_names_one) return found;  // without asking the graphics cards
  display::KmsOptions options = request.kms;
  options.output = display::parse_kms_spec(needs_panel ? request.display : "kms");
  options.output.policy = display::IdentityPolicy::Ignore;
  if (!options.session) options.session = display::make_direct_session();
  const display::PanelSearch search = search_panel(options);
  if (search.present.empty()) found.refusal = search.refusal;
  for (const display::PanelInfo& panel : search.present)
    found.panels.push_back(fmt::format("{}: {}", panel.connector,
                                       panel.identity ? to_string(*panel.identity) : "no EDID"));
  for (const std::vector<NamedRig>& rigs : folders) {
    for (const NamedRig& named : rigs)
      if (std::any_of(search.present.begin(), search.present.end(),
                      [&](const display::PanelInfo& one) { return names_panel(named.rig, one); }))
        found.fitting.push_back(named.file);
    if (!found.fitting.empty()) break;
  }
  return found;
}

[[noreturn]] void refuse_none(const RigRequest& request, const RigsOfPanels& found) {
  if (found.refusal) throw Error(*found.refusal);
  std::vector<std::string> candidates = found.known, folders;
  for (const fs::path& folder : request.folders) folders.push_back(folder.string());
  for (const fs::path& sample : sample_rigs()) candidates.push_back(sample.string());
  throw Error(
      ErrorKind::Usage,
      fmt::format("--rig: missing, and no rig in {} names the connected panel ({})",
                  fmt::join(folders, " or "), fmt::join(found.panels, ", ")),
      fmt::format(
          "choose one with --rig, or give it the panel's identity, which 'lenticule panels' "
          "prints: {}",
          fmt::join(candidates, ", ")));
}

}  // namespace

std::vector<fs::path> rig_folders() {
  std::vector<fs::path> folders;
  const char* const home = std::getenv("HOME");
  if (const char* const users = std::getenv("XDG_CONFIG_HOME"); users && *users == '/')
    folders.push_back(fs::path(users) / "lenticule");
  else if (home && *home == '/')
    folders.push_back(fs::path(home) / ".config/lenticule");
  folders.emplace_back(kSystemFolder);
  return folders;
}

std::vector<NamedRig> rigs_in(const fs::path& folder, bool reports) {
  std::vector<NamedRig> rigs;
  for (const fs::path& file : rig_files_in(folder)) {
    try {
      rigs.push_back({file.string(), optics::load_rig(file)});
    } catch (const Error& problem) {
      if (reports) say("lenticule: {}\n", problem.what());
    }
  }
  return rigs;
}

bool names_panel(const optics::Rig& rig, const display::PanelInfo& panel) {
  const optics::PixelGrid sent = rig.panel.sent_size();
  return panel.identity && !rig.identity.empty() && matches(rig.identity, *panel.identity) &&
         std::any_of(panel.modes.begin(), panel.modes.end(), [&](const display::ModeInfo& mode) {
           return mode.usable && mode.width == sent.width && mode.height == sent.height;
         });
}

ChosenRig choose_rig(const RigRequest& request) {
  if (!request.given.empty()) return {request.given};
  const bool needs_panel = display::is_kms_spec(request.display);
  if (!needs_panel)
    if (auto own = rig_of_film(request.source)) return *own;
  const RigsOfPanels found = rigs_of_panels(request, needs_panel);
  if (found.fitting.size() > 1)
    throw usage_error("--rig: missing, and {} rigs name a connected panel ({})",
                      found.fitting.size(), fmt::join(found.panels, ", "))
        .remedy(fmt::format("choose one with --rig: {}", fmt::join(found.fitting, ", ")));
  if (found.fitting.size() == 1) {
    say("no --rig: using {}, which names the connected panel\n", found.fitting.front());
    return {found.fitting.front()};
  }
  if (needs_panel) refuse_none(request, found);
  const std::vector<fs::path> samples = sample_rigs();
  if (samples.empty())
    throw Error(ErrorKind::Usage, "--rig: missing, and this program has no sample rigs",
                "sample rigs are in share/lenticule/rigs of an installation, and in scenes/rigs of "
                "the sources");
  const auto usual = std::find_if(samples.begin(), samples.end(), [](const fs::path& sample) {
    return sample.filename() == kUsualSample;
  });
  const fs::path& sample = usual != samples.end() ? *usual : samples.front();
  say("no --rig: using the sample {}\n", sample.string());
  return {sample.string()};
}

std::optional<ChosenRig> choose_rig_when_connected(
    const RigRequest& request, std::optional<display::Nanoseconds> longest,
    const std::function<void(const Error& reason)>& report) {
  constexpr display::Nanoseconds kRound = std::chrono::seconds(1);
  const auto clock = request.kms.clock ? request.kms.clock : display::make_monotonic_clock();
  const display::Nanoseconds begin = clock->now();
  while (!interrupted()) {
    try {
      return choose_rig(request);
    } catch (const Error& error) {
      const bool over = longest && clock->now() - begin >= *longest;
      if (error.kind() != ErrorKind::Device || over) throw;
      report(error);
    }
    (void)clock->wait_until(clock->now() + kRound, interrupt_fd());
  }
  return std::nullopt;
}

}  // namespace lenticule::player
