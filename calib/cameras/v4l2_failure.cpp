// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/v4l2_failure.h"

#include <fmt/format.h>

#include <cctype>
#include <cerrno>
#include <system_error>

namespace lenticule::calib {
namespace {

std::string busy_hint(V4l2System& system, const std::string& path) {
  const std::string holders = system.holders(path);
  if (holders.empty())
    return fmt::format("close the program that uses the camera: 'sudo fuser -v {}' names it", path);
  return "close the program that uses the camera: " + holders;
}

std::string forbidden_hint(V4l2System& system, const std::string& path) {
  const std::string group = system.group(path);
  if (group.empty() || group == "root")
    return fmt::format("only root may use {}: install the udev rules, or run as root", path);
  return fmt::format("join its group: 'sudo usermod -aG {} $USER', then log in again", group);
}

std::string hint_for(V4l2System& system, const std::string& path, int error) {
  switch (error) {
    case EBUSY:
      return busy_hint(system, path);
    case EACCES:
    case EPERM:
      return forbidden_hint(system, path);
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return "connect the camera; 'lenticule calibrate camera --list' lists the cameras";
    case ENOTTY:
      return "choose a camera with --device; 'lenticule calibrate camera --list' lists the cameras";
    case ENOMEM:
    case ENOSPC:
      return "use a smaller picture, fewer frames per second, or a separate USB port";
    default:
      return "disconnect the camera, connect it again, and read the kernel's messages (dmesg)";
  }
}

std::string cause_of(int error) {
  switch (error) {
    case EBUSY:
      return "in use by another program";
    case ENOTTY:
      return "not a video device";
    case ENOSPC:
      return "not enough bandwidth on the USB bus";
    default:
      return error_text(error);
  }
}

}  // namespace

std::string error_text(int error) {
  std::string text = std::generic_category().message(error);
  if (text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])) != 0)
    text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return text;
}

Error camera_failure(V4l2System& system, const std::string& path, const std::string& doing,
                     int error) {
  return {ErrorKind::Device, fmt::format("{}: cannot {}: {}", path, doing, cause_of(error)),
          hint_for(system, path, error)};
}

}  // namespace lenticule::calib
