// SPDX-License-Identifier: Apache-2.0
#include "player/rig_watch.h"

#include <sys/stat.h>

#include <exception>
#include <utility>

#include "optics/trim.h"

namespace lenticule::player {

RigWatch::RigWatch(std::filesystem::path rig_file)
    : rig_file_(std::move(rig_file)), trim_file_(optics::trim_file_of(rig_file_)) {}

RigWatch::Marks RigWatch::look() const {
  const auto mark = [](const std::filesystem::path& file) {
    struct stat status {};
    if (stat(file.c_str(), &status) != 0) return Mark{};
    return Mark{true, status.st_ino, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
  };
  return {mark(rig_file_), mark(trim_file_)};
}

std::optional<optics::Rig> RigWatch::changed() {
  const Marks now = look();
  if (seen_ == now) return std::nullopt;
  seen_ = now;
  complaint_.clear();
  try {
    return optics::load_trimmed_rig(rig_file_);
  } catch (const std::exception& error) {
    complaint_ = error.what();
    return std::nullopt;
  }
}

}  // namespace lenticule::player
