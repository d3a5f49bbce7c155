// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/photo_pack.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <system_error>

#include "base/error.h"
#include "base/file.h"
#include "base/temporary.h"
#include "optics/rig_file.h"
#include "player/process/child_process.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

std::string command_of(const PhotoPack& pack, const std::vector<std::string>& names) {
  std::string command = "lenticule calibrate photos";
  for (const std::string& name : names) command += " '" + name + "'";
  command += " --rig start.toml -o again.toml";
  if (pack.focal_px) command += fmt::format(" --focal-px {}", *pack.focal_px);
  if (!pack.distances_mm.empty())
    command += fmt::format(" --distance {}", fmt::join(pack.distances_mm, ","));
  return command;
}

/// Returns "02-IMG_7.jpg" for the second source.
std::string name_in_pack(size_t index, const fs::path& source) {
  std::string name = source.filename().string();
  if (name.empty()) name = source.parent_path().filename().string();  // "folder/"
  std::erase(name, '\'');
  return fmt::format("{:02}-{}", index + 1, name);
}

void run_tar(const fs::path& folder, const fs::path& archive) {
  constexpr std::chrono::minutes kLimit{10};
  const std::optional<std::string> tar = player::find_program("tar");
  if (!tar) throw Error(ErrorKind::Failed, "tar: no such program", "install the package tar");
  const ProgramRun run = player::run_child({*tar, "-cf", archive.string(), "-C", folder.string(),
                                            "--owner=0", "--group=0", "calibration"},
                                           kLimit);
  if (run.exit_code != 0)
    throw Error(ErrorKind::Failed, archive.string() + ": tar failed: " + run.output);
}

}  // namespace

void declare_pack_flag(CLI::App& app, std::string& archive) {
  app.add_option("--pack", archive,
                 "also write a tar archive of photographs, rig and result\n"
                 "Others can repeat the calibration with it.")
      ->type_name("FILE");
}

void write_photo_pack(const PhotoPack& pack, const fs::path& archive) {
  const fs::path parent = archive.has_parent_path() ? archive.parent_path() : fs::path(".");
  const TemporaryFolder work(parent);
  const fs::path folder = work.path() / "calibration";
  try {
    fs::create_directory(folder);
    std::vector<std::string> names;
    for (size_t k = 0; k < pack.sources.size(); ++k) {
      names.push_back(name_in_pack(k, pack.sources[k]));
      fs::copy(pack.sources[k], folder / names.back(), fs::copy_options::recursive);
    }
    optics::save_rig(pack.start, folder / "start.toml");
    write_text_file(folder / "report.json", pack.report.dump(2) + "\n");
    write_text_file(folder / "README.txt",
                    fmt::format("Photographs of a lens sheet, for lenticule {}. To repeat the "
                                "calibration, run in this folder:\n\n    {}\n\n"
                                "report.json is the result of the original run.\n",
                                LENTICULE_VERSION, command_of(pack, names)));
    const fs::path made = work.path() / "pack.tar";
    run_tar(work.path(), made);
    fs::rename(made, archive);
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::Failed, fmt::format("{}: cannot be packed: {}", error.path1().string(),
                                               error.code().message()));
  }
}

}  // namespace lenticule::tools
