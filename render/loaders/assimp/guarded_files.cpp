// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/assimp/guarded_files.h"

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/file_names.h"
#include "render/loaders/limits.h"

namespace lenticule::render {
namespace {

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

}  // namespace

namespace {

std::filesystem::path found(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::exists(file, error)) return file;
  return named_file(file.parent_path(), file.filename().string());
}

}  // namespace

bool GuardedFiles::Exists(const char* file) const {
  std::error_code error;
  return std::filesystem::is_regular_file(found(file), error);
}

Assimp::IOStream* GuardedFiles::Open(const char* file, const char* mode) {
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

void GuardedFiles::Close(Assimp::IOStream* stream) {
  const std::unique_ptr<Assimp::IOStream> closed(stream);
}

}  // namespace lenticule::render
