// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as an OBJ file, and what follows their first zero as each MTL file that it names:
// the result is an Error, or a scene that can be traced.
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "render/loaders/formats.h"
#include "render/loaders/scene_files.h"
#include "tests/fuzz/loaders/scene_checks.h"

namespace lenticule::render {
namespace {

/// Reads the same bytes as each file; pictures are not there.
class OneFile final : public SceneFiles {
 public:
  explicit OneFile(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  std::filesystem::path find(const std::filesystem::path&, const std::string&) const override {
    return "/nonexistent/file";
  }
  std::vector<uint8_t> read(const std::filesystem::path&) const override {
    return {bytes_.begin(), bytes_.end()};
  }

 private:
  std::span<const uint8_t> bytes_;
};

void run(std::span<const uint8_t> bytes) {
  const auto size = static_cast<size_t>(std::ranges::find(bytes, uint8_t{0}) - bytes.begin());
  const OneFile mtl(bytes.subspan(std::min(size + 1, bytes.size())));
  use_scene_files(&mtl);
  try {
    check_scene(parse_obj(bytes.first(size), "fuzz"));
  } catch (const Error& error) {
    LENTICULE_CHECK(error.kind() == ErrorKind::Input);
  }
  use_scene_files(nullptr);
}

}  // namespace
}  // namespace lenticule::render

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lenticule::render::run({data, size});
  return 0;
}
