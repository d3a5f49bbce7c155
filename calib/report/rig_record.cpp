// SPDX-License-Identifier: Apache-2.0
#include "calib/report/rig_record.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/numbers.h"
#include "base/text.h"
#include "calib/report/report_text.h"
#include "optics/rig_file.h"

namespace lenticule::calib {
namespace {

using Entries = std::vector<std::pair<std::string, std::string>>;

// Limits of the rig file (optics/rig.h, validate_rig).
constexpr size_t kMaxEntries = 256;
constexpr size_t kMaxTextBytes = 4096;
constexpr std::string_view kHistory = "history_";
constexpr std::string_view kDropped = "history_dropped";

/// Returns the number of an entry "history_NUMBER". At most nine digits are accepted, so that a
/// larger number, written by hand, cannot cause an overflow.
std::optional<uint64_t> history_number(std::string_view key) {
  if (!key.starts_with(kHistory)) return std::nullopt;
  const std::string_view digits = key.substr(kHistory.size());
  return digits.size() <= 9 ? number_from<uint64_t>(digits) : std::nullopt;
}

void add(Entries& entries, std::string key, const std::string& text) {
  if (!text.empty()) entries.emplace_back(std::move(key), shortened(escaped(text), kMaxTextBytes));
}

std::string joined(const std::vector<std::string>& texts) {
  std::string out;
  for (const std::string& text : texts) out += (out.empty() ? "" : "; ") + text;
  return out;
}

std::string panel_text(const optics::Rig& rig) {
  const optics::PanelIdentity& id = rig.identity;
  std::string out = fmt::format("{} x {} pixels", rig.panel.width_px, rig.panel.height_px);
  if (!id.manufacturer.empty()) out += ", manufacturer " + id.manufacturer;
  if (id.product) out += fmt::format(", product {}", *id.product);
  if (!id.serial.empty()) out += ", serial " + id.serial;
  if (!id.edid_sha256.empty()) out += ", EDID " + id.edid_sha256;
  return out;
}

std::string viewpoints_text(const Calibration& calibration) {
  std::vector<std::string> places;
  for (const Viewpoint& v : calibration.viewpoints)
    places.push_back(fmt::format("{} ({:.1f}, {:.1f}, {:.1f}){}", v.name, v.eye_mm.x, v.eye_mm.y,
                                 v.eye_mm.z, v.held_out ? " kept aside" : ""));
  return joined(places);
}

std::string errors_text(const Calibration& calibration) {
  std::vector<std::string> errors;
  for (const Parameter& p : calibration.parameters)
    errors.push_back(fmt::format("{} {:.3g}", p.name, p.estimate.sigma));
  return joined(errors);
}

/// Returns the validity for readers of the file and for programs that must not use the rig
/// elsewhere.
std::string validity_text(const Calibration& calibration) {
  if (calibration.verdict == Verdict::Intrinsic) return "every eye";
  if (calibration.verdict == Verdict::Refused) return "refused: not to be used";
  std::string out = "effective: holds only at the eye it was measured from";
  for (const Viewpoint& v : calibration.viewpoints)
    if (!v.held_out)
      return out + fmt::format(", ({:.1f}, {:.1f}, {:.1f}) mm", v.eye_mm.x, v.eye_mm.y, v.eye_mm.z);
  return out;
}

void add_number(Entries& entries, std::string key, double value) {
  if (std::isfinite(value)) add(entries, std::move(key), fmt::format("{:.5g}", value));
}

void add_quality(Entries& entries, const Calibration& calibration) {
  add(entries, "verdict", to_string(calibration.verdict));
  add(entries, "valid_for", validity_text(calibration));
  add(entries, "reasons", joined(calibration.reasons));
  add(entries, "viewpoints_mm", viewpoints_text(calibration));
  const ResidualSummary used = residual_summary(calibration, false);
  add_number(entries, "residual_rms_lenses", used.rms_lenses);
  add_number(entries, "residual_max_lenses", used.max_lenses);
  add_number(entries, "held_out_max_lenses", residual_summary(calibration, true).max_lenses);
  add(entries, "standard_errors", errors_text(calibration));
}

Entries new_entries(const Calibration& calibration, const RecordDetails& details) {
  Entries entries;
  add(entries, "date", iso_utc(details.when));
  add(entries, "tool", std::string("lenticule ") + LENTICULE_VERSION);
  add(entries, "method", details.method);
  add(entries, "camera", details.camera.name);
  add(entries, "camera_identity", details.camera.identity);
  add(entries, "camera_pixel_format", details.camera.pixel_format);
  if (details.temperature_celsius)
    add_number(entries, "temperature_celsius", *details.temperature_celsius);
  add(entries, "panel", panel_text(calibration.rig));
  add_quality(entries, calibration);
  return entries;
}

/// History holds the earlier provenance, newest first; numbers increase with time.
struct History {
  std::vector<std::pair<uint64_t, std::string>> states;
  uint64_t dropped = 0;
};

History history_of(const Entries& provenance) {
  History history;
  std::string last;
  uint64_t newest = 0;
  for (const auto& [key, text] : provenance) {
    if (key == kDropped) {
      history.dropped = number_from<uint64_t>(text).value_or(0);
    } else if (const auto number = history_number(key)) {
      history.states.emplace_back(*number, text);
      newest = std::max(newest, *number);
    } else {
      last += fmt::format("{}{}: {}", last.empty() ? "" : " | ", key, text);
    }
  }
  if (!last.empty())
    history.states.emplace_back(newest + 1, shortened(escaped(last), kMaxTextBytes));
  std::sort(history.states.begin(), history.states.end(), std::greater<>());
  return history;
}

void add_history(Entries& entries, History history) {
  const size_t room = kMaxEntries - entries.size() - 1;  // one for the count
  if (history.states.size() > room) {
    history.dropped += history.states.size() - room;
    history.states.resize(room);
  }
  for (const auto& [number, text] : history.states)
    entries.emplace_back(fmt::format("{}{}", kHistory, number), text);
  if (history.dropped > 0)
    entries.emplace_back(std::string(kDropped), std::to_string(history.dropped));
}

// --- copies of the file --------------------------------------------------------------------------

constexpr size_t kMaxFileBytes = 16U << 20;

/// CopyName holds "rig" and ".toml" of "rig.toml".
struct CopyName {
  std::filesystem::path folder;
  std::string stem;
  std::string extension;

  explicit CopyName(const std::filesystem::path& file)
      : folder(file.has_parent_path() ? file.parent_path() : std::filesystem::path(".")),
        stem(file.stem().string()),
        extension(file.extension().string()) {}

  [[nodiscard]] std::filesystem::path numbered(uint64_t number) const {
    return folder / fmt::format("{}.{}{}", stem, number, extension);
  }
  /// Returns the number in `name`, 0 if it is not a numbered copy.
  [[nodiscard]] uint64_t number_of(const std::string& name) const {
    const size_t around = stem.size() + 1 + extension.size();
    if (name.size() <= around || name.size() > around + 9) return 0;
    if (!name.starts_with(stem + ".") || !name.ends_with(extension)) return 0;
    return number_from<uint64_t>(
               std::string_view(name).substr(stem.size() + 1, name.size() - around))
        .value_or(0);
  }
};

uint64_t highest_number(const CopyName& name) {
  uint64_t highest = 0;
  std::error_code error;  // if the folder cannot be listed, the next step finds free numbers
  std::filesystem::directory_iterator entry(name.folder, error);
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error))
    highest = std::max(highest, name.number_of(entry->path().filename().string()));
  return highest;
}

/// Renames only if the new name does not exist. Returns 0 or errno.
int rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno == EEXIST) return EEXIST;
  // File systems without this flag, mostly network ones, support links.
  if (::link(from.c_str(), to.c_str()) != 0) return errno;
  ::unlink(from.c_str());
  return 0;
}

class RemovedAtEnd {
 public:
  explicit RemovedAtEnd(std::filesystem::path path) : path_(std::move(path)) {}
  ~RemovedAtEnd() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }
  RemovedAtEnd(const RemovedAtEnd&) = delete;
  RemovedAtEnd& operator=(const RemovedAtEnd&) = delete;
  void keep() { path_.clear(); }

 private:
  std::filesystem::path path_;
};

std::filesystem::path copy_beside(const std::filesystem::path& file) {
  const std::string text = read_text_file(file, kMaxFileBytes);
  const CopyName name(file);
  // The copy is written under a temporary name first, so that a numbered copy is always complete.
  static std::atomic<uint64_t> counter{0};
  const auto working =
      name.folder / fmt::format(".{}.copy-{}-{}", name.stem, ::getpid(), counter++);
  RemovedAtEnd removed(working);
  write_text_file(working, text);
  constexpr int kTries = 1000;  // other programs may take numbers too, but not forever
  uint64_t number = highest_number(name);
  for (int i = 0; i < kTries; ++i) {
    const std::filesystem::path copy = name.numbered(++number);
    const int error = rename_to_new(working, copy);
    if (error == 0) return copy;
    if (error != EEXIST)
      throw Error(ErrorKind::Failed, fmt::format("{}: cannot copy the old rig: {}", copy.string(),
                                                 std::generic_category().message(error)));
  }
  throw Error(ErrorKind::Failed, file.string() + ": no free number for a copy of the old rig",
              "move its old copies to another folder");
}

}  // namespace

std::string iso_utc(std::chrono::system_clock::time_point when) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(when);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(seconds)));
}

optics::Rig with_record(const Calibration& calibration, const RecordDetails& details) {
  optics::Rig rig = calibration.rig;
  Entries entries = new_entries(calibration, details);
  add_history(entries, history_of(rig.provenance));
  rig.provenance = std::move(entries);
  return rig;
}

std::filesystem::path save_with_history(const optics::Rig& rig, const std::filesystem::path& file) {
  optics::validate_rig(rig, file.string());
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::status_known(status))
    throw Error(ErrorKind::Failed, fmt::format("{}: {}", file.string(), error.message()));
  if (!std::filesystem::exists(status)) {
    optics::save_rig(rig, file);
    return {};
  }
  const std::filesystem::path copy = copy_beside(file);
  RemovedAtEnd removed(copy);  // removes the copy if the file was not replaced
  optics::save_rig(rig, file);
  removed.keep();
  return copy;
}

}  // namespace lenticule::calib
