// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/model_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::bench {
namespace {

namespace fs = std::filesystem;

bool is_model(const fs::path& file) {
  const std::string extension = lower_case(file.extension().string());
  return extension == ".glb" || extension == ".gltf";
}

/// Returns letters, digits, dots and dashes only: a file name that is valid on any system.
std::string plain_name(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.') c = '-';
  return text;
}

void add(const fs::path& file, const fs::path& name, std::vector<ModelFile>& models) {
  const std::string text = fs::path(name).replace_extension().string();
  models.push_back({.file = file,
                    .name = text,
                    .stem = fmt::format("{:03}-{}", models.size() + 1, plain_name(text))});
}

}  // namespace

std::vector<ModelFile> find_models(const std::vector<std::string>& places) {
  std::vector<ModelFile> models;
  for (const std::string& place : places) {
    if (!fs::is_directory(place)) {
      if (!fs::exists(place))
        throw Error(ErrorKind::Input, fmt::format("{}: no such file or folder", place));
      const fs::path file = fs::absolute(place);
      add(place, file.parent_path().filename() / file.filename(), models);
      continue;
    }
    std::vector<fs::path> files;
    for (const auto& entry :
         fs::recursive_directory_iterator(place, fs::directory_options::follow_directory_symlink))
      if (entry.is_regular_file() && is_model(entry.path())) files.push_back(entry.path());
    std::ranges::sort(files);
    for (const fs::path& file : files) add(file, fs::relative(file, place), models);
  }
  if (models.empty())
    throw Error(ErrorKind::Input,
                fmt::format("{}: no model; expected .glb or .gltf files", places.front()));
  return models;
}

}  // namespace lenticule::bench
