// SPDX-License-Identifier: Apache-2.0
// FrameMemory and list_json() are what answers of the control socket contain: the displayed frame,
// and a playlist.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/error_kinds.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/frame.h"
#include "frames/rational.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// FrameMemory shares a copy of the displayed frame with clients of the control socket. All clients
/// share one memory, so that no number of requests takes more.
/// Layout: a serial number (8 bytes, in the order of this machine), then at offset 64 the pixels,
/// then the text. The serial number is 0 while the content changes.
///
/// Thread safety: one thread.
class FrameMemory {
 public:
  static constexpr size_t kPixelsAt = 64;
  static constexpr size_t kMaxText = size_t{8} << 20;

  /// Throws Error(Failed) if there is no memory.
  explicit FrameMemory(const frames::FrameGeometry& geometry) : pixels_(geometry.frame_bytes()) {
    UniqueFd fd(::memfd_create("lenticule-frame", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    const size_t bytes = kPixelsAt + pixels_ + kMaxText;  // pages without content take no memory
    if (!fd || ::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) fail("no shared memory");
    void* const mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
    if (mapped == MAP_FAILED) fail("no shared memory");
    bytes_ = static_cast<uint8_t*>(mapped);
    constexpr int kSeals = F_SEAL_FUTURE_WRITE | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
    if (::fcntl(fd.get(), F_ADD_SEALS, kSeals) != 0) {
      const int error = errno;
      ::munmap(bytes_, bytes);
      errno = error;
      fail("cannot seal shared memory");
    }
    fd_ = std::make_shared<const UniqueFd>(std::move(fd));
  }
  ~FrameMemory() { ::munmap(bytes_, kPixelsAt + pixels_ + kMaxText); }
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  /// Replaces the content and returns its serial number. Throws Error(Failed) for a text longer
  /// than kMaxText.
  uint64_t write(const frames::WovenFrame& frame, std::string_view text) {
    LENTICULE_CHECK(frame.bytes().size() == pixels_);
    if (text.size() > kMaxText)
      throw Error(ErrorKind::Failed, "frame: the rig is too large to be sent");
    auto& shared = *reinterpret_cast<uint64_t*>(bytes_);
    std::atomic_ref<uint64_t> serial(shared);
    serial.store(0);
    std::atomic_thread_fence(std::memory_order_seq_cst);
    std::memcpy(bytes_ + kPixelsAt, frame.bytes().data(), pixels_);
    std::memcpy(bytes_ + kPixelsAt + pixels_, text.data(), text.size());
    serial.store(++serial_);
    return serial_;
  }
  /// Returns the descriptor to pass on. Others can map it for reading only.
  [[nodiscard]] const std::shared_ptr<const UniqueFd>& descriptor() const { return fd_; }

 private:
  [[noreturn]] static void fail(const char* cause) {
    throw failed_error("frame: {}: {}", cause, std::strerror(errno));
  }
  std::shared_ptr<const UniqueFd> fd_;
  uint8_t* bytes_ = nullptr;
  size_t pixels_ = 0;
  uint64_t serial_ = 0;
};

inline nlohmann::ordered_json loops_json(uint64_t loops) {
  return loops == kForever ? nlohmann::ordered_json("forever") : nlohmann::ordered_json(loops);
}

inline std::string clock_text(int minute) {
  return fmt::format("{:02}:{:02}", minute / 60, minute % 60);
}

inline nlohmann::ordered_json dates_json(const std::vector<DateSpan>& dates) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const DateSpan& span : dates) json.push_back(to_string(span));
  return json;
}

inline nlohmann::ordered_json schedule_json(const Schedule& schedule) {
  nlohmann::ordered_json days = nlohmann::ordered_json::array();
  for (size_t day = 0; day < kWeekdays.size(); ++day)
    if ((schedule.days >> day & 1u) != 0) days.push_back(kWeekdays.at(day));
  nlohmann::ordered_json json = {{"days", days},
                                 {"from", clock_text(schedule.from_minute)},
                                 {"to", clock_text(schedule.to_minute)}};
  if (!schedule.dates.empty()) json["dates"] = dates_json(schedule.dates);
  if (!schedule.except.empty()) json["except"] = dates_json(schedule.except);
  return json;
}

/// Returns the name of the source for a reader with another working folder.
inline std::string whole_name(const SourceSpec& source) {
  const SourceSpec whole = source.in_folder(std::filesystem::current_path());
  return whole == source ? source.text
                         : std::filesystem::path(whole.text).lexically_normal().string();
}

inline nlohmann::ordered_json item_json(const PlaylistItem& item) {
  nlohmann::ordered_json json = {{"source", whole_name(item.source)}};
  if (item.duration_s)
    json["duration_s"] = *item.duration_s;
  else if (!item.still_s || item.loops != 1)
    json["loops"] = loops_json(item.loops);
  if (item.rate) json["fps"] = frames::to_string(*item.rate);
  if (item.frames) json["frames"] = fmt::format("{}:{}", item.frames->begin, item.frames->end);
  if (item.waits_until_primed) json["cut"] = "primed";
  if (item.wait_s != PlaylistItem{}.wait_s) json["wait_s"] = item.wait_s;
  if (item.transition)
    json["transition"] = kTransitionNames.at(static_cast<size_t>(*item.transition));
  if (item.transition_s) json["transition_seconds"] = *item.transition_s;
  if (item.weight != 1) json["weight"] = item.weight;
  if (!item.fit.empty()) json["fit"] = item.fit;
  if (!item.sound.empty()) json["sound"] = item.sound;
  if (item.volume_db != 0.0) json["volume"] = item.volume_db;
  const ContentFlags& content = item.source.content;
  for (const auto& [key, member] : kLayoutTexts)
    if (!(content.*member).empty()) json[std::string(key)] = content.*member;
  for (const auto& [key, member] : kLayoutSwitches)
    if (content.*member) json[std::string(key)] = true;
  if (content.views != 0) json["views"] = content.views;
  if (content.aspect) json["aspect"] = *content.aspect;
  if (content.depth_budget) json["depth_budget"] = *content.depth_budget;
  const auto own = std::span(item.overlays).subspan(item.overlays_of_list);
  if (!own.empty()) json["overlay"] = overlays_json(own);
  if (item.schedule) json["schedule"] = schedule_json(*item.schedule);
  return json;
}

/// Describes a playlist to clients of the control socket, with the keys of its file: returns
/// {"file", "loop", "default", "count", "first", "items"}: the items from `first` on, at
/// least one if there is one, and more as long as their text is shorter than `most_bytes`.
[[nodiscard]] inline nlohmann::ordered_json list_json(const Playlist& list, size_t first,
                                                      size_t most_bytes = size_t{32} << 10) {
  nlohmann::ordered_json json;
  json["file"] = nullptr;
  if (list.file) json["file"] = std::filesystem::absolute(list.name).lexically_normal().string();
  json["loop"] = loops_json(list.rounds);
  if (list.shuffle) json["shuffle"] = *list.shuffle;
  json["transition"] = kTransitionNames.at(static_cast<size_t>(list.transition));
  json["transition_seconds"] = list.transition_s;
  if (!list.bed.file.empty()) json["sound"] = list.bed.file;
  if (list.bed.volume_db != 0.0) json["sound_volume"] = list.bed.volume_db;
  if (!list.overlays.empty()) json["overlay"] = overlays_json(list.overlays);
  json["default"] = list.standby ? item_json(*list.standby) : nlohmann::ordered_json(nullptr);
  json["count"] = list.items.size();
  json["first"] = first;
  json["items"] = nlohmann::ordered_json::array();
  size_t bytes = 0;
  for (size_t k = first; k < list.items.size() && bytes < most_bytes; ++k) {
    json["items"].push_back(item_json(list.items[k]));
    bytes += json_text(json["items"].back()).size();
  }
  return json;
}

}  // namespace lenticule::player
