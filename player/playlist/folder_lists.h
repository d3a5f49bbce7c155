// SPDX-License-Identifier: Apache-2.0
// FolderLists turns folders into playlists of the files in them that are completely written.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// Returns true for the name of a folder that is played as a list: it ends with a slash.
[[nodiscard]] inline bool names_folder(const std::string& source) {
  return source.ends_with('/');
}

/// Returns true if a file of that name can be content. Hidden files, unfinished files of programs
/// that copy (rsync, browsers, lenticule) and files of other kinds cannot.
[[nodiscard]] bool may_be_content(const std::string& file_name);

/// Follows the files of one folder and decides which of them are whole. A file is whole when its
/// writer has closed it or moved it into the folder, which inotify reports. Without that report
/// (another machine writes into a network folder, or the file was there before) it is whole when it
/// has not changed for kQuiet; a file that was seen being written, and not closed, when it has not
/// changed for kAbandoned.
///
/// Thread safety: one thread.
class FolderWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr auto kQuiet = std::chrono::seconds(2);
  static constexpr auto kAbandoned = std::chrono::seconds(30);

  /// Lists the folder for the first time. Throws Error(Input) if there is no such folder.
  FolderWatch(std::string folder, Time now);

  /// Returns the names of the whole files, sorted. A folder that is gone, for example with its USB
  /// stick, has none, until it is back.
  [[nodiscard]] std::vector<std::string> whole_files(Time now);
  /// Returns the names of the files that were not whole at the last call of whole_files().
  [[nodiscard]] std::vector<std::string> unfinished_files() const;

 private:
  struct File {
    FileMark mark{};
    Time quiet_since{};
    bool closed = false;
    bool is_written = false;
    bool seen = false;  ///< in the present listing
  };
  void watch_folder();
  void take_events();
  void list(Time now);
  [[nodiscard]] static bool is_whole(const File& file, Time now);

  Time listed_{};
  const std::string folder_;
  UniqueFd inotify_;    ///< invalid where the kernel cannot watch the folder
  FileMark watched_{};  ///< the folder that inotify_ watches
  std::map<std::string, File, NaturalOrder> files_;
};

/// The folders that a player reads as lists. Thread safety: any thread.
class FolderLists {
 public:
  /// `first_wait` is the longest wait at the first call for a folder until all its files are whole.
  explicit FolderLists(std::chrono::milliseconds first_wait = {}) : first_wait_(first_wait) {}
  /// Returns a list of the whole files, in the order of their names, repeated forever; without a
  /// file it shows black. Throws Error(Input) if there is no such folder at the first call, or if
  /// it has more files than a list may have. Films of other rigs are woven again if the source asks
  /// for that.
  [[nodiscard]] Playlist read(const SourceSpec& source);
  /// Replaces each item that is a folder by items for its whole files, with the same settings. A
  /// missing folder has no file. Throws Error(Input) if that makes more items than a list may have.
  [[nodiscard]] Playlist with_files(Playlist list);
  /// Returns a mark of a folder, or of the file of a list that with_files() has returned. It
  /// changes when the file of the list is replaced, or a file in a folder becomes whole or is
  /// removed.
  [[nodiscard]] FileMark mark(const std::string& name);
  /// Returns the files in the folders that are not whole, and therefore in no list.
  [[nodiscard]] std::vector<std::string> unfinished_files();

 private:
  [[nodiscard]] std::vector<std::string> whole_files(const std::string& folder);
  [[nodiscard]] std::vector<std::string> whole_files_if_there(const std::string& folder);

  const std::chrono::milliseconds first_wait_;
  std::mutex mutex_;  ///< guards the members below
  std::map<std::string, FolderWatch> watches_;
  std::map<std::string, std::vector<std::string>> folders_of_;  ///< folders in lists, by list
};

}  // namespace lenticule::player
