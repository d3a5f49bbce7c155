// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/assimp_loader.h"

#include <assimp/postprocess.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/text.h"
#include "optics/vec.h"
#include "render/loaders/assimp_scene.h"
#include "render/loaders/file_names.h"
#include "render/loaders/limits.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

// ---- guarded files

class BytesStream : public Assimp::IOStream {
 public:
  explicit BytesStream(std::vector<uint8_t> bytes) : bytes_(std::move(bytes)) {}

  size_t Read(void* buffer, size_t size, size_t count) override {
    if (size == 0) return 0;
    const size_t whole = std::min(count, (bytes_.size() - position_) / size);
    if (whole == 0) return 0;  // memcpy must not get the null pointer of an empty file
    std::memcpy(buffer, bytes_.data() + position_, whole * size);
    position_ += whole * size;
    return whole;
  }

  aiReturn Seek(size_t offset, aiOrigin origin) override {
    // A negative offset from aiOrigin_CUR or aiOrigin_END arrives as its two's complement, so the
    // wrapped sum is the intended position.
    const size_t base = origin == aiOrigin_SET   ? 0
                        : origin == aiOrigin_CUR ? position_
                                                 : bytes_.size();
    const size_t place = base + offset;
    if (place > bytes_.size()) return aiReturn_FAILURE;
    position_ = place;
    return aiReturn_SUCCESS;
  }

  size_t Write(const void*, size_t, size_t) override { return 0; }
  size_t Tell() const override { return position_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  std::vector<uint8_t> bytes_;
  size_t position_ = 0;
};

std::filesystem::path found(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::exists(file, error)) return file;
  return named_file(file.parent_path(), file.filename().string());
}

/// GuardedFiles restricts the files that assimp may open to regular files of limited size,
/// read-only. Each is read completely before assimp gets it, so that a scene can name neither an
/// endless pipe nor a device, and cannot cause writes. Finds files whose names differ in the
/// case of letters only.
class GuardedFiles : public Assimp::IOSystem {
 public:
  GuardedFiles() = default;
  /// Presents `bytes` as the content of one file.
  GuardedFiles(std::string replaced, std::vector<uint8_t> bytes)
      : replaced_(std::move(replaced)), bytes_(std::move(bytes)) {}

  bool Exists(const char* file) const override {
    std::error_code error;
    return std::filesystem::is_regular_file(found(file), error);
  }

  char getOsSeparator() const override { return '/'; }

  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
    try {
      if (!replaced_.empty() && replaced_ == file)
        return std::make_unique<BytesStream>(bytes_).release();
      return std::make_unique<BytesStream>(read_whole_file(found(file), kMaxSceneFileBytes))
          .release();
    } catch (const Error&) {
      return nullptr;  // tells assimp that the file cannot be read
    }
  }

  void Close(Assimp::IOStream* stream) override {
    const std::unique_ptr<Assimp::IOStream> closed(stream);
  }

 private:
  std::string replaced_;
  std::vector<uint8_t> bytes_;
};

// ---- OBJ files far from the origin, which are centred: assimp reads in single precision

struct CentredObj {
  std::vector<uint8_t> text;  ///< the file with all positions relative to the centre
  Vec3 centre;
};

/// At this multiple of the size, single precision still resolves a small fraction of a pixel.
constexpr double kFarMultiple = 64.0;

/// A line with a position: its numbers, and the text after the third.
struct Position {
  Vec3 point;
  std::string_view rest;
};

bool is_space(char c) {
  return c == ' ' || c == '\t';
}

/// Takes a number from the front of the text.
std::optional<double> take_number(std::string_view& text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return value;
}

bool is_position(std::string_view line) {
  return line.size() > 2 && line[0] == 'v' && is_space(line[1]);
}

/// Parses a line "v x y z ..."; returns nothing for one that cannot be moved.
std::optional<Position> position_of(std::string_view line) {
  line.remove_prefix(1);
  const auto x = take_number(line);
  const auto y = take_number(line);
  const auto z = take_number(line);
  if (!x || !y || !z || !is_finite(Vec3{*x, *y, *z})) return std::nullopt;
  // A fourth number alone is a homogeneous coordinate; three more are a colour.
  std::string_view rest = line;
  const auto w = take_number(rest);
  if (w && !take_number(rest)) return std::nullopt;
  return Position{{*x, *y, *z}, line};
}

/// Calls visit(line, end of line) for each line; stops when it returns false.
template <class Visit>
bool each_line(std::string_view text, Visit visit) {
  while (!text.empty()) {
    const size_t size = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, size);
    text.remove_prefix(std::min(size + 1, text.size()));
    while (!line.empty() && is_space(line.front())) line.remove_prefix(1);
    if (!visit(line)) return false;
  }
  return true;
}

/// Returns the file with the middle of its positions moved to the origin, if its distance from the
/// origin is a multiple of its size; otherwise nothing, as for files with continued lines or
/// homogeneous coordinates.
std::optional<CentredObj> centre_obj(std::span<const uint8_t> file) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  if (text.find("\\\n") != std::string_view::npos || text.find("\\\r") != std::string_view::npos)
    return std::nullopt;
  Bounds bounds;
  const bool movable = each_line(text, [&](std::string_view line) {
    if (!is_position(line)) return true;
    const auto position = position_of(line);
    if (!position) return false;
    bounds.extend(position->point);
    return true;
  });
  if (!movable || bounds.empty()) return std::nullopt;
  const Vec3 size = bounds.high - bounds.low;
  const Vec3 centre = bounds.low + size / 2.0;
  const double extent = std::max({size.x, size.y, size.z});
  const double distance = std::max({std::abs(centre.x), std::abs(centre.y), std::abs(centre.z)});
  if (!(distance > kFarMultiple * extent) || !std::isfinite(distance)) return std::nullopt;

  CentredObj centred{{}, centre};
  centred.text.reserve(file.size());
  auto out = std::back_inserter(centred.text);
  each_line(text, [&](std::string_view line) {
    if (is_position(line)) {
      const auto position = position_of(line);
      const Vec3 p = position->point - centre;
      fmt::format_to(out, "v {:.9g} {:.9g} {:.9g}{}\n", p.x, p.y, p.z, position->rest);
    } else {
      fmt::format_to(out, "{}\n", line);
    }
    return true;
  });
  return centred;
}

// ---- loader

/// Shortens assimp's messages, which are meant for programmers: first line only, printable, limited
/// length.
std::string tidy(const std::string& message) {
  constexpr size_t kLongest = 160;
  if (message.starts_with("No suitable reader"))
    return "not in the format of its extension, or damaged or truncated";
  std::string out;
  for (const char c : message.substr(0, std::min(message.find('\n'), kLongest)))
    out += c >= ' ' && c < 127 ? c : '?';
  while (out.ends_with('.')) out.pop_back();
  return out.empty() ? "cannot be parsed" : out;
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& reason) {
  throw Error(ErrorKind::Input, fmt::format("{}: {}", file.string(), reason));
}

/// Reads the file. The data is checked before assimp's own post-processing runs, which trusts the
/// data. The importer deletes `files`.
const aiScene& read(Assimp::Importer& importer, const std::filesystem::path& file,
                    std::unique_ptr<GuardedFiles> files) {
  importer.SetIOHandler(files.release());
  importer.SetPropertyBool("IMPORT_NO_SKELETON_MESHES", true);
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  if (scene->mNumMeshes == 0) refuse_empty({.source = file.string()});
  check_meshes(*scene, file.string());
  // Not aiProcess_JoinIdenticalVertices, which merges vertices within 1e-5 units and so collapses a
  // small scene to a point.
  scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType |
                                       aiProcess_FlipUVs);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  check_meshes(*scene, file.string());
  return *scene;
}

}  // namespace

bool assimp_reads(const std::string& extension) {
  return !extension.empty() && Assimp::Importer().IsExtensionSupported(extension);
}

SceneDescription load_with_assimp(const std::filesystem::path& file) {
  try {
    Assimp::Importer importer;
    std::optional<CentredObj> centred;
    if (lower_case(file.extension().string()) == ".obj")
      centred = centre_obj(read_whole_file(file, kMaxSceneFileBytes));
    if (!centred)
      return import_scene(read(importer, file, std::make_unique<GuardedFiles>()), file, {});
    auto files = std::make_unique<GuardedFiles>(file.string(), std::move(centred->text));
    return import_scene(read(importer, file, std::move(files)), file, centred->centre);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    refuse(file, "needs more memory than is available");
  } catch (const std::exception& failure) {
    refuse(file, tidy(failure.what()));
  }
}

}  // namespace lenticule::render
