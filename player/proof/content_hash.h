// SPDX-License-Identifier: Apache-2.0
// Hashes of content for the proof of play: which version of a film was shown.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "player/process/detached_worker.h"
#include "player/sources/source_spec.h"

namespace lenticule::player {

/// Returns the hash of a source's content, beginning with its kind:
/// - "sha256:" for a picture or a video, the SHA-256 of the file, as sha256sum prints it;
/// - "lts-sha256:" for a sequence, the SHA-256 of its header, metadata and band tables, which hold
///   the checksum of each band of each frame. Reads about 0.1 % of the file;
/// - "files-sha256:" for a pattern or several files, the SHA-256 of their sizes and times. Does not
///   read their content.
///
/// Empty for content that is not in files, and when `ending` becomes true. Throws Error(Input) for
/// a file that cannot be read. `most_bytes_per_second` limits reading; 0 = no limit.
[[nodiscard]] std::string content_hash(const SourceSpec& source, const std::atomic<bool>& ending,
                                       uint64_t most_bytes_per_second = 0);

/// ContentHashes computes hashes in the background, slowly, so that the disk and the processor are
/// free for playing. It remembers them until the files change. Thread safety: one thread.
class ContentHashes {
 public:
  ContentHashes();

  /// Begins to compute the source's hash, unless it is known and its files are the same.
  void request(const SourceSpec& source);
  /// Returns the hash of the last request for the source; empty while it is not known.
  [[nodiscard]] std::string of(const SourceSpec& source) const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
  DetachedWorker worker_;
};

}  // namespace lenticule::player
