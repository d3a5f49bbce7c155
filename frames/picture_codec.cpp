// SPDX-License-Identifier: Apache-2.0
#include "frames/picture_codec.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "base/error.h"
#include "frames/png_codec.h"

namespace lenticule::frames {
namespace {

/// A name without a folder is searched along this program's run path and the system's library
/// folders, like any library that the program is linked with.
constexpr const char* kModule = LENTICULE_PICTURES_MODULE;

[[noreturn]] void fail(const std::string& cause) {
  throw Error(
      ErrorKind::Failed, fmt::format("{}: cannot be used: {}", kModule, cause),
      "install the package lenticule-media of the same version, which reads pictures, or use PNG");
}

std::string loader_message() {
  const char* message = dlerror();
  return message != nullptr ? message : "no reason given";
}

const PictureCodec& load() {
  // RTLD_LOCAL: no symbol of OpenImageIO may replace a symbol of this program.
  void* module = dlopen(kModule, RTLD_NOW | RTLD_LOCAL);
  if (module == nullptr) fail(loader_message());
  const auto entry = reinterpret_cast<PictureCodecEntry>(dlsym(module, kPictureCodecEntry));
  if (entry == nullptr) fail(loader_message());
  const PictureCodec* codec = entry(LENTICULE_VERSION);
  if (codec == nullptr) fail("it is of another version");
  return *codec;
}

}  // namespace

const PictureCodec& picture_codec(ImageFormat format) {
  if (format == ImageFormat::Png) return png_codec();
  static const PictureCodec& codec = load();
  return codec;
}

const PictureCodec& picture_codec(std::span<const uint8_t> bytes) {
  return picture_codec(detect_format(bytes, {}));
}

}  // namespace lenticule::frames
