// SPDX-License-Identifier: Apache-2.0
// FolderLists turns folders into playlists of the files in them that are completely written.
#pragma once

#include <fmt/format.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "base/error_kinds.h"
#include "base/file.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// Returns true for the name of a folder that is played as a list: it ends with a slash.
[[nodiscard]] inline bool names_folder(const std::string& source) { return source.ends_with('/'); }

/// Returns the list in the folder, as the folders of a Looking Glass Studio have one; empty: none.
[[nodiscard]] inline std::string list_in_folder(const std::string& folder) {
  for (const char* name :
       {"playlist.toml", "playlist.json", "currentlyPlaying.json", "playlist.m3u", "playlist.m3u8"})
    if (mark_of(folder + name).there) return folder + name;
  return {};
}

/// Returns true if a file of that name can be content. Hidden files, unfinished files of programs
/// that copy (rsync, browsers, lenticule) and files of other kinds cannot.
[[nodiscard]] inline bool may_be_content(const std::string& file_name) {
  // rsync and web uploads write hidden files, browsers and cp -b add endings.
  if (file_name.empty() || file_name.front() == '.') return false;
  const std::string extension = lower_case(std::filesystem::path(file_name).extension().string());
  if (extension == ".part") return false;
  constexpr std::array kPictures = {".png",  ".jpg",  ".jpeg", ".jps",  ".pns", ".mpo",
                                    ".tif",  ".tiff", ".exr",  ".ppm",  ".bmp", ".webp",
                                    ".heic", ".heif", ".hif",  ".avif", ".gif"};
  return std::ranges::count(kPictures, extension) > 0 ||
         kind_of_file(file_name) != SourceKind::Pictures;
}

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
  FolderWatch(std::string folder, Time now) : folder_(std::move(folder)) {
    if (!std::filesystem::is_directory(folder_))
      throw input_error("{}: no such folder", folder_).remedy("create it, or correct its name");
    watch_folder();
    list(now);
    for (auto& [name, file] : files_)
      if (file.mark.there)
        file.quiet_since = now - std::min<std::chrono::seconds>(kQuiet, age_of(file.mark));
  }

  /// Returns the names of the whole files, sorted. A folder that is gone, for example with its USB
  /// stick, has none, until it is back.
  [[nodiscard]] std::vector<std::string> whole_files(Time now) {
    watch_folder();
    take_events();
    list(listed_ = now);
    std::vector<std::string> names;
    for (const auto& [name, file] : files_)
      if (is_whole(file, now)) names.push_back(name);
    return names;
  }
  /// Returns the names of the files that were not whole at the last call of whole_files().
  [[nodiscard]] std::vector<std::string> unfinished_files() const {
    std::vector<std::string> names;
    for (const auto& [name, file] : files_)
      if (!is_whole(file, listed_)) names.push_back(name);
    return names;
  }

 private:
  static constexpr uint32_t kEvents =
      IN_CREATE | IN_MODIFY | IN_CLOSE_WRITE | IN_MOVED_TO | IN_ONLYDIR;

  /// Returns how long ago the file was written, by the clock of its file system.
  static std::chrono::seconds age_of(const FileMark& mark) {
    return std::chrono::seconds(std::max<int64_t>(0, ::time(nullptr) - mark.written_s));
  }
  struct File {
    FileMark mark{};
    Time quiet_since{};
    bool closed = false;
    bool is_written = false;
    bool seen = false;  ///< in the present listing
  };
  /// Watches the folder that has this name now: after a stick was mounted it is another one.
  void watch_folder() {
    const FileMark mark = mark_of(folder_);
    if (inotify_ && mark.device == watched_.device && mark.inode == watched_.inode) return;
    watched_ = mark;
    inotify_ = UniqueFd(mark.there ? inotify_init1(IN_CLOEXEC | IN_NONBLOCK) : -1);
    if (inotify_ && inotify_add_watch(inotify_.get(), folder_.c_str(), kEvents) < 0)
      inotify_ = UniqueFd();
  }
  void take_events() {
    alignas(inotify_event) std::array<char, 16384> bytes{};
    while (inotify_) {
      const ssize_t size = ::read(inotify_.get(), bytes.data(), bytes.size());
      if (size <= 0) return;
      for (ssize_t at = 0; at < size;) {
        inotify_event event{};
        std::memcpy(&event, bytes.data() + at, sizeof event);
        const char* const name = bytes.data() + at + sizeof event;
        at += static_cast<ssize_t>(sizeof event + event.len);
        if (event.len == 0) continue;
        File& file = files_[name];
        file.closed = (event.mask & (IN_CLOSE_WRITE | IN_MOVED_TO)) != 0;
        file.is_written = !file.closed;
      }
    }
  }
  void list(Time now) {
    for (auto& [name, file] : files_) file.seen = false;
    for (const std::filesystem::path& entry : entries_of(folder_)) {
      const std::string name = entry.filename().string();
      std::error_code gone;
      if (!may_be_content(name) || !std::filesystem::is_regular_file(entry, gone)) continue;
      const FileMark mark = mark_of(entry);
      File& file = files_[name];
      file.seen = mark.there;
      if (file.mark == mark) continue;
      file.mark = mark;
      file.quiet_since = now;
    }
    std::erase_if(files_, [](const auto& entry) { return !entry.second.seen; });
  }
  [[nodiscard]] static bool is_whole(const File& file, Time now) {
    const auto needed = file.closed       ? std::chrono::seconds(0)
                        : file.is_written ? kAbandoned
                                          : kQuiet;
    return file.mark.size > 0 && now - file.quiet_since >= needed;
  }

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
  /// it has more files than a list may have.
  [[nodiscard]] Playlist read(const std::string& folder) {
    const std::vector<std::string> names = whole_files(folder);
    if (names.size() > kMaxPlaylistItems)
      throw input_error("{}: {} files, but a list has at most {} items", folder, names.size(),
                        kMaxPlaylistItems)
          .remedy("move some of them away");
    Playlist list{.name = folder,
                  .items = {},
                  .standby = {},
                  .rounds = kForever,
                  .file = mark_of_names(names),
                  .awaits_files = true};
    for (const std::string& name : names) {
      list.items.push_back({.source = parse_source(folder + name)});
      list.items.back().still_s = still_seconds(list.items.back().source);
    }
    return list;
  }
  /// Replaces each item that is a folder by items for its whole files, with the same settings. A
  /// missing folder has no file. Throws Error(Input) if that makes more items than a list may have.
  [[nodiscard]] Playlist with_files(Playlist list) {
    const auto is_folder = [](const PlaylistItem& item) { return names_folder(item.source.text); };
    if (std::none_of(list.items.begin(), list.items.end(), is_folder)) {
      const std::lock_guard lock(mutex_);
      folders_of_.erase(list.name);
      return list;
    }
    std::vector<PlaylistItem> items;
    std::vector<std::string> folders, files;
    for (const PlaylistItem& item : list.items) {
      if (!is_folder(item)) {
        items.push_back(item);
        continue;
      }
      folders.push_back(item.source.text);
      for (const std::string& name : whole_files_if_there(item.source.text)) {
        files.push_back(item.source.text + name);
        items.push_back(item);
        items.back().source = parse_source(files.back());
        if (item.still_s) items.back().still_s = still_seconds(items.back().source);
      }
    }
    if (items.size() > kMaxPlaylistItems)
      throw Error(
          ErrorKind::Input,
          fmt::format("{}: {} items with the files of its folders, but a list has at most {}",
                      list.name, items.size(), kMaxPlaylistItems),
          "move some of the files away");
    list.items = std::move(items);
    // Such a list waits for files instead of failing because of its only one.
    list.awaits_files = list.items.size() <= 1;
    if (list.file) list.file = with_names(*list.file, files);
    const std::lock_guard lock(mutex_);
    folders_of_[list.name] = std::move(folders);
    return list;
  }
  /// Returns a mark of a folder, or of the file of a list that with_files() has returned. It
  /// changes when the file of the list is replaced, or a file in a folder becomes whole or is
  /// removed.
  [[nodiscard]] FileMark mark(const std::string& name) {
    if (names_folder(name)) return mark_of_names(whole_files(name));
    std::vector<std::string> folders, files;
    {
      const std::lock_guard lock(mutex_);
      const auto found = folders_of_.find(name);
      if (found == folders_of_.end()) return mark_of(name);
      folders = found->second;
    }
    for (const std::string& folder : folders)
      for (const std::string& file : whole_files_if_there(folder)) files.push_back(folder + file);
    return with_names(mark_of(name), files);
  }
  /// Returns the files in the folders that are not whole, and therefore in no list.
  [[nodiscard]] std::vector<std::string> unfinished_files() {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> files;
    for (const auto& [folder, watch] : watches_)
      for (const std::string& name : watch.unfinished_files()) files.push_back(folder + name);
    return files;
  }

 private:
  static FileMark mark_of_names(const std::vector<std::string>& names) {
    std::string all;
    for (const std::string& name : names) all += name + '/';
    return {.there = true,
            .inode = std::hash<std::string>()(all),
            .size = static_cast<int64_t>(names.size())};
  }
  /// Returns the mark of a list's file together with the names of the files in its folders.
  static FileMark with_names(FileMark list, const std::vector<std::string>& names) {
    const FileMark files = mark_of_names(names);
    list.inode ^= files.inode;
    list.size += files.size;
    return list;
  }
  [[nodiscard]] std::vector<std::string> whole_files(const std::string& folder) {
    auto now = std::chrono::steady_clock::now();
    const std::lock_guard lock(mutex_);
    const auto [entry, is_first] = watches_.try_emplace(folder, folder, now);
    FolderWatch& watch = entry->second;
    const auto deadline = now + (is_first ? first_wait_ : first_wait_.zero());
    std::vector<std::string> names = watch.whole_files(now);
    for (; !watch.unfinished_files().empty() && now < deadline; names = watch.whole_files(now)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      now = std::chrono::steady_clock::now();
    }
    return names;
  }
  [[nodiscard]] std::vector<std::string> whole_files_if_there(const std::string& folder) {
    // A folder that was there once is watched, also while it is away.
    try {
      return whole_files(folder);
    } catch (const Error&) {
      return {};
    }
  }

  const std::chrono::milliseconds first_wait_;
  std::mutex mutex_;  ///< guards the members below
  std::map<std::string, FolderWatch> watches_;
  std::map<std::string, std::vector<std::string>> folders_of_;  ///< folders in lists, by list
};

}  // namespace lenticule::player
