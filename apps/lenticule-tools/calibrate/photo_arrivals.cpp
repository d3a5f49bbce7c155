// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/calibrate/photo_arrivals.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "calib/photo/photo_folder.h"

namespace lenticule::tools {
namespace {

namespace fs = std::filesystem;

/// Returns true also for HEIC, which phones store by default and which reading refuses by name.
bool is_picture(const fs::path& file) {
  constexpr std::array<std::string_view, 8> kExtensions = {".jpg", ".jpeg", ".png",  ".tif",
                                                           ".exr", ".tiff", ".heic", ".heif"};
  const std::string extension = lower_case(file.extension().string());
  return file.filename().string().front() != '.' &&
         std::ranges::find(kExtensions, extension) != kExtensions.end();
}

}  // namespace

PhotoArrivals::PhotoArrivals(fs::path folder, bool existing) : folder_(std::move(folder)) {
  for (const auto& [file, size] : sizes())
    if (!existing) known_.insert(file);
}

std::map<fs::path, uintmax_t> PhotoArrivals::sizes() const {
  std::map<fs::path, uintmax_t> out;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    std::error_code vanished;  // a file may be renamed between two calls
    if (!is_picture(entry->path()) || !entry->is_regular_file(vanished)) continue;
    const uintmax_t size = entry->file_size(vanished);
    if (!vanished && size > 0) out.emplace(entry->path(), size);
  }
  if (error)
    throw Error(ErrorKind::Input, folder_.string() + ": cannot be read: " + error.message(),
                "name the folder in which the photographs of the phone arrive");
  return out;
}

std::vector<fs::path> PhotoArrivals::arrived() {
  std::vector<fs::path> out;
  std::map<fs::path, uintmax_t> now = sizes();
  for (const auto& [file, size] : now) {
    const auto before = growing_.find(file);
    if (known_.contains(file) || before == growing_.end() || before->second != size) continue;
    known_.insert(file);
    out.push_back(file);
  }
  growing_ = std::move(now);
  std::ranges::sort(out, [](const fs::path& a, const fs::path& b) {
    return calib::stands_before(a.filename().string(), b.filename().string());
  });
  return out;
}

}  // namespace lenticule::tools
