// SPDX-License-Identifier: Apache-2.0
#include "player/session/start_history.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <span>
#include <string_view>

#include "base/file.h"
#include "base/numbers.h"

namespace lenticule::player {
namespace {

constexpr const char* kFileName = "starts";
constexpr uint64_t kMaxFileBytes = 64 * 1024;
constexpr size_t kMaxReasonBytes = 400;
constexpr size_t kMaxStarts = 100;

std::string one_line(std::string_view text) {
  std::string line(text.substr(0, kMaxReasonBytes));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return line;
}

}  // namespace

StartHistory::StartHistory(const std::filesystem::path& folder, std::chrono::seconds now)
    : file_(folder.empty() ? folder : folder / kFileName), this_{.at = now, .reason = {}} {
  if (file_.empty()) return;
  try {
    read(now);
  } catch (const std::exception&) {
    before_.clear();  // no file yet, or not readable
  }
  failed({});
}

/// Parses "SECONDS REASON" per line; skips lines that are malformed, too old or in the future.
void StartHistory::read(std::chrono::seconds now) {
  const std::vector<uint8_t> bytes = read_whole_file(file_, kMaxFileBytes);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  while (!text.empty() && before_.size() < kMaxStarts) {
    std::string_view reason = take_until(text, '\n');
    const auto at = take_number<int64_t>(reason);
    const std::chrono::seconds when(at.value_or(0));
    if (!at || when > now || when < now - kStartsRemembered) continue;
    reason.remove_prefix(std::min(reason.find_first_not_of(' '), reason.size()));
    before_.push_back({when, one_line(reason)});
  }
}

std::string StartHistory::last_reason() const {
  return before_.empty() ? std::string() : before_.back().reason;
}

void StartHistory::ended_well() noexcept {
  write(before_);
}

void StartHistory::failed(const std::string& reason) noexcept {
  try {
    this_.reason = one_line(reason);
    std::vector<Start> starts = before_;
    starts.push_back(this_);
    write(starts);
  } catch (const std::exception&) {
    return;  // no memory to record the reason
  }
}

void StartHistory::write(const std::vector<Start>& starts) const noexcept {
  if (file_.empty()) return;
  try {
    std::string text;
    for (const Start& start : starts)
      text += fmt::format("{} {}\n", start.at.count(), start.reason);
    write_file_atomically(file_,
                          std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()));
  } catch (const std::exception&) {
    return;  // a full or read-only disk must not prevent playing
  }
}

std::chrono::seconds time_since_boot() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::chrono::seconds(time.tv_sec);
}

}  // namespace lenticule::player
