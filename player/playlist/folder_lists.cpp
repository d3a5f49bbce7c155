// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/folder_lists.h"

#include <fmt/format.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <functional>
#include <system_error>
#include <thread>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kEvents = IN_CREATE | IN_MODIFY | IN_CLOSE_WRITE | IN_MOVED_TO | IN_ONLYDIR;

bool is_picture_name(const std::string& extension) {
  constexpr std::array kNames = {".png", ".jpg",  ".jpeg", ".jps", ".pns", ".mpo",
                                 ".tif", ".tiff", ".exr",  ".ppm", ".bmp", ".webp"};
  return std::find(kNames.begin(), kNames.end(), extension) != kNames.end();
}

/// Returns how long ago the file was written, by the clock of its file system.
std::chrono::seconds age_of(const FileMark& mark) {
  return std::chrono::seconds(std::max<int64_t>(0, ::time(nullptr) - mark.written_s));
}

FileMark mark_of_names(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += name + '/';
  return {.there = true,
          .inode = std::hash<std::string>()(all),
          .size = static_cast<int64_t>(names.size())};
}

/// Returns the mark of a list's file together with the names of the files in its folders.
FileMark with_names(FileMark list, const std::vector<std::string>& names) {
  const FileMark files = mark_of_names(names);
  list.inode ^= files.inode;
  list.size += files.size;
  return list;
}

}  // namespace

bool may_be_content(const std::string& file_name) {
  // rsync and web uploads write hidden files, browsers and cp -b add endings.
  if (file_name.empty() || file_name.front() == '.') return false;
  const std::string extension = lower_case(fs::path(file_name).extension().string());
  if (extension == ".part") return false;
  return is_picture_name(extension) || kind_of_file(file_name) != SourceKind::Pictures;
}

// --- FolderWatch ----------------------------------------------------------------------------

FolderWatch::FolderWatch(std::string folder, Time now) : folder_(std::move(folder)) {
  if (!fs::is_directory(folder_))
    throw Error(ErrorKind::Input, folder_ + ": no such folder", "create it, or correct its name");
  watch_folder();
  list(now);
  for (auto& [name, file] : files_)
    if (file.mark.there)
      file.quiet_since = now - std::min<std::chrono::seconds>(kQuiet, age_of(file.mark));
}

/// Watches the folder that has this name now: after a stick was mounted it is another one.
void FolderWatch::watch_folder() {
  const FileMark mark = mark_of(folder_);
  if (inotify_ && mark.device == watched_.device && mark.inode == watched_.inode) return;
  watched_ = mark;
  inotify_ = UniqueFd(mark.there ? inotify_init1(IN_CLOEXEC | IN_NONBLOCK) : -1);
  if (inotify_ && inotify_add_watch(inotify_.get(), folder_.c_str(), kEvents) < 0)
    inotify_ = UniqueFd();
}

void FolderWatch::take_events() {
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

void FolderWatch::list(Time now) {
  for (auto& [name, file] : files_) file.seen = false;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code gone;
    if (!may_be_content(name) || !entry->is_regular_file(gone)) continue;
    const FileMark mark = mark_of(entry->path());
    File& file = files_[name];
    file.seen = mark.there;
    if (file.mark == mark) continue;
    file.mark = mark;
    file.quiet_since = now;
  }
  std::erase_if(files_, [](const auto& entry) { return !entry.second.seen; });
}

bool FolderWatch::is_whole(const File& file, Time now) {
  const auto needed = file.closed ? std::chrono::seconds(0) : file.is_written ? kAbandoned : kQuiet;
  return file.mark.size > 0 && now - file.quiet_since >= needed;
}

std::vector<std::string> FolderWatch::whole_files(Time now) {
  watch_folder();
  take_events();
  list(listed_ = now);
  std::vector<std::string> names;
  for (const auto& [name, file] : files_)
    if (is_whole(file, now)) names.push_back(name);
  return names;
}

std::vector<std::string> FolderWatch::unfinished_files() const {
  std::vector<std::string> names;
  for (const auto& [name, file] : files_)
    if (!is_whole(file, listed_)) names.push_back(name);
  return names;
}

// --- FolderLists ----------------------------------------------------------------------------

std::vector<std::string> FolderLists::whole_files(const std::string& folder) {
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

std::vector<std::string> FolderLists::unfinished_files() {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> files;
  for (const auto& [folder, watch] : watches_)
    for (const std::string& name : watch.unfinished_files()) files.push_back(folder + name);
  return files;
}

std::vector<std::string> FolderLists::whole_files_if_there(const std::string& folder) {
  // A folder that was there once is watched, also while it is away.
  try {
    return whole_files(folder);
  } catch (const Error&) {
    return {};
  }
}

Playlist FolderLists::read(const SourceSpec& source) {
  const std::string& folder = source.text;
  const std::vector<std::string> names = whole_files(folder);
  if (names.size() > kMaxPlaylistItems)
    throw Error(ErrorKind::Input,
                fmt::format("{}: {} files, but a list has at most {} items", folder, names.size(),
                            kMaxPlaylistItems),
                "move some of them away");
  Playlist list{.name = folder,
                .items = {},
                .standby = {},
                .rounds = kForever,
                .file = mark_of_names(names),
                .awaits_files = true};
  ContentFlags content;
  content.reweave = source.content.reweave;
  for (const std::string& name : names)
    list.items.push_back(
        {.source = parse_source(folder + name, content), .still_s = kStillSeconds});
  return list;
}

Playlist FolderLists::with_files(Playlist list) {
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
    }
  }
  if (items.size() > kMaxPlaylistItems)
    throw Error(ErrorKind::Input,
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

FileMark FolderLists::mark(const std::string& name) {
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

}  // namespace lenticule::player
