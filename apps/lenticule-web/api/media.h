// SPDX-License-Identifier: Apache-2.0
// Media is the folder of the files that can be played: their upload in parts, checks, deletion.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/http/parse.h"
#include "base/file_mark.h"

namespace lenticule::web {

struct MediaOptions {
  std::filesystem::path folder;
  uint64_t largest_file = uint64_t{64} << 30;
  uint64_t keeps_free = uint64_t{1} << 30;  ///< bytes of the disk that uploads leave free
};

/// CheckMedia runs the player's own check of a file and returns its JSON. Throws Error.
using CheckMedia = std::function<nlohmann::ordered_json(const std::filesystem::path& file)>;

/// Thread safety: any thread. A file of which a part is being uploaded can have one sender.
class Media {
 public:
  explicit Media(MediaOptions options, CheckMedia check);

  /// Returns the path of a file of that name, which need not exist. Throws HttpError 400.
  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const;
  /// Returns {"files": [{"name", "bytes", "received", "check"}], "free_bytes"}; `received` is less
  /// than `bytes` for an upload that is not complete.
  [[nodiscard]] nlohmann::ordered_json list() const;
  /// Returns one of them. Throws HttpError 404.
  [[nodiscard]] nlohmann::ordered_json info(const std::string& name) const;
  /// Returns the sink of an upload: of a whole file of `length` bytes, or of the part `range` that
  /// follows what was received. Throws HttpError 409 with the number of received bytes for another
  /// part or a second sender, 413 and 507 without room.
  [[nodiscard]] std::unique_ptr<BodySink> upload(const std::string& name,
                                                 std::optional<ByteRange> range,
                                                 std::optional<uint64_t> length);
  /// Removes a file, or an upload that is not complete. Throws HttpError 404.
  void remove(const std::string& name);
  /// Checks the file: {"plays", "problems", "figures", "duration"...}. Throws HttpError.
  [[nodiscard]] nlohmann::ordered_json check(const std::string& name);

 private:
  friend class Upload;
  [[nodiscard]] std::filesystem::path part_of(const std::string& name) const;
  [[nodiscard]] uint64_t free_bytes() const;
  void release(const std::string& name);

  const MediaOptions options_;
  const CheckMedia check_;
  mutable std::mutex mutex_;  ///< guards the two maps
  std::map<std::string, bool> uploading_;
  struct Checked {
    FileMark mark;
    nlohmann::ordered_json result;
  };
  std::map<std::string, Checked> checked_;
  std::mutex one_check_;  ///< a check reads as fast as it can: one at a time
};

}  // namespace lenticule::web
