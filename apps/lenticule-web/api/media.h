// SPDX-License-Identifier: Apache-2.0
// Media is the folder of the files that can be played: their upload in parts, checks, replacement,
// deletion.
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
#include "base/file.h"

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
  /// Returns {"files": [{"name", "bytes", "received", "earlier", "check"}], "free_bytes"};
  /// `received` is the size of an upload that is not complete, `earlier` that of the file which the
  /// present one replaced.
  [[nodiscard]] nlohmann::ordered_json list() const;
  /// Returns one of them. Throws HttpError 404.
  [[nodiscard]] nlohmann::ordered_json info(const std::string& name) const;
  /// Returns the sink of an upload: of a whole file of `length` bytes, or of the part `range` that
  /// follows what was received. A file that exists is replaced if `replaces`, when the new one has
  /// passed the check. Throws HttpError 409 with the number of received bytes for another part, a
  /// second sender or a file that exists, 413 and 507 without room.
  [[nodiscard]] std::unique_ptr<BodySink> upload(const std::string& name,
                                                 std::optional<ByteRange> range,
                                                 std::optional<uint64_t> length, bool replaces);
  /// Exchanges a file and the one that it replaced. Throws HttpError 404, and 422 with the reason
  /// if the earlier one does not play on this panel.
  void restore(const std::string& name);
  /// Removes a file with its earlier one, and an upload that is not complete. Throws HttpError 404,
  /// and 409 if a list of the folder names the file.
  void remove(const std::string& name);
  /// Checks the file: {"plays", "problems", "figures", "duration"...}; the result of an earlier
  /// check is enough unless `again`. Waits for other checks, but not for ever. Throws HttpError.
  [[nodiscard]] nlohmann::ordered_json check(const std::string& name, bool again);

 private:
  friend class Upload;
  [[nodiscard]] std::filesystem::path hidden(const char* prefix, const std::string& name) const;
  void finish_replacements() const;
  [[nodiscard]] std::unique_lock<std::timed_mutex> wait_for_checks();
  void put_in_place(const std::filesystem::path& from, const std::string& name);
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
  std::timed_mutex one_check_;  ///< a check reads as fast as it can: one at a time
};

}  // namespace lenticule::web
