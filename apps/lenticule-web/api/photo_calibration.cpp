// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/photo_calibration.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/text.h"
#include "base/unique_fd.h"
#include "frames/charts/charts.h"
#include "optics/eye_simulator.h"
#include "optics/model.h"
#include "optics/rig_file.h"

namespace lenticule::web {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr auto kDrawTime = seconds(50);
constexpr auto kJudgeTime = seconds(50);
constexpr size_t kMaxLine = 400, kMaxMessage = 2000;
constexpr int kPictureWidth = 960;
constexpr int kPictureQuality = 85;

/// Returns the extension of a picture file by its first bytes, as the command expects it.
const char* extension_of(const fs::path& file) {
  const UniqueFd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  unsigned char begin[4] = {};
  if (fd && ::read(fd.get(), begin, sizeof begin) == static_cast<ssize_t>(sizeof begin)) {
    if (std::memcmp(begin, "\x89PNG", 4) == 0) return ".png";
    if (std::memcmp(begin, "II*\0", 4) == 0 || std::memcmp(begin, "MM\0*", 4) == 0) return ".tif";
  }
  return ".jpg";
}

double number_at(const ordered_json& list, size_t k) {
  return list.is_array() && list.size() > k && list[k].is_number() ? list[k].get<double>() : NAN;
}

/// Returns the part of the report that the page shows.
ordered_json result_of(const ordered_json& report) {
  ordered_json result;
  for (const char* key : {"verdict", "reasons", "warnings", "advice", "parameters"})
    result[key] = report.value(key, ordered_json());
  const ordered_json viewpoints = report.value("viewpoints", ordered_json::array());
  const ordered_json place =
      viewpoints.is_array() && !viewpoints.empty() ? viewpoints[0] : ordered_json::object();
  for (const char* key : {"eye_mm", "covered", "rms_lenses", "max_lenses", "residual_lenses"})
    result[key] = place.value(key, ordered_json());
  return result;
}

}  // namespace

Claim::Claim(std::atomic<bool>& claimed) : claimed_(&claimed) {
  if (!claimed.exchange(true)) return;
  claimed_ = nullptr;
  throw HttpError(409, "a photograph is being judged, or sent", "try again in some seconds");
}

CalibrationOutput parse_calibration_output(const std::string& output) {
  CalibrationOutput parsed;
  size_t begin = output.starts_with("{\n") ? 0 : output.find("\n{\n");
  if (begin != std::string::npos)
    parsed.report = ordered_json::parse(output.substr(begin), nullptr, false);
  if (!parsed.report.is_object()) {
    parsed.report = nullptr;
    begin = output.size();
  }
  const std::string_view before = std::string_view(output).substr(0, begin);
  for (size_t at = 0; at < before.size() && parsed.message.size() < kMaxMessage;) {
    const size_t end = std::min(before.find('\n', at), before.size());
    // A line that is written again and again, as progress is, ends with its last state.
    std::string_view line = before.substr(at, end - at);
    line.remove_prefix(std::min(line.size(), line.rfind('\r') + 1));
    if (!line.empty())
      parsed.message +=
          (parsed.message.empty() ? "" : "\n") + shortened(escaped(std::string(line)), kMaxLine);
    at = end + 1;
  }
  return parsed;
}

/// Photograph writes a body to a file, which is then judged.
class Photograph final : public BodySink {
 public:
  Photograph(PhotoCalibration& owner, Claim claim, fs::path file, std::optional<double> distance_mm)
      : owner_(owner),
        claim_(std::move(claim)),
        path_(std::move(file)),
        file_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600)),
        distance_mm_(distance_mm) {
    if (!file_) fail();
  }
  ~Photograph() override { (void)::unlink(path_.c_str()); }

  void take(std::span<const uint8_t> bytes) override {
    while (!bytes.empty()) {
      const ssize_t written = ::write(file_.get(), bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail();
      bytes = bytes.subspan(static_cast<size_t>(written));
    }
  }
  Response finish() override {
    file_ = UniqueFd();
    fs::path named = path_;
    named.replace_extension(extension_of(path_));
    fs::rename(path_, named);
    path_ = named;
    owner_.judge(path_, distance_mm_);
    return json_response(owner_.state());
  }

 private:
  [[noreturn]] static void fail() {
    throw HttpError(errno == ENOSPC || errno == EDQUOT ? 507 : 500,
                    fmt::format("photograph: cannot be written: {}", std::strerror(errno)));
  }

  PhotoCalibration& owner_;
  const Claim claim_;
  fs::path path_;
  UniqueFd file_;
  const std::optional<double> distance_mm_;
};

PhotoCalibration::PhotoCalibration(ControlLink& link, PictureMaker& pictures,
                                   ShownInstead& shown_instead, PhotoCalibrationOptions options,
                                   Clock& clock)
    : link_(link),
      clock_(clock),
      pictures_(pictures),
      shown_instead_(shown_instead),
      options_(std::move(options)),
      history_(options_.history) {
  clear_folder();
}

void PhotoCalibration::clear_folder() const {
  fs::remove_all(options_.folder);
  fs::create_directories(options_.folder);
}

ordered_json PhotoCalibration::state() const {
  const std::lock_guard lock(mutex_);
  return {{"stage", stage_},
          {"message", message_},
          {"result", result_},
          {"history", history_.to_json()}};
}

void PhotoCalibration::set_stage(const char* stage, std::string message, ordered_json result,
                                 std::optional<Found> found) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  message_ = std::move(message);
  result_ = std::move(result);
  found_ = std::move(found);
}

std::optional<PhotoCalibration::Found> PhotoCalibration::found() const {
  const std::lock_guard lock(mutex_);
  return found_;
}

/// Throws HttpError 422 with the command's message.
void PhotoCalibration::draw_chart(const fs::path& rig, const fs::path& output) const {
  const ProgramRun run =
      run_and_capture({options_.program.string(), "calibrate", "show", "photo-chart", "--rig",
                       rig.string(), "-o", output.string()},
                      kDrawTime, options_.stops);
  if (run.exit_code != 0)
    throw HttpError(422, run.timed_out ? "drawing the chart took too long"
                                       : parse_calibration_output(run.output).message);
}

std::string PhotoCalibration::obstacle() {
  const std::string toml = pictures_.rig_toml();
  const std::lock_guard lock(trying_);
  if (toml == tried_rig_) return obstacle_;
  const TemporaryFolder folder(options_.history.parent_path());
  write_text_file(folder.path() / "rig.toml", toml);
  try {
    draw_chart(folder.path() / "rig.toml", folder.path() / "chart.png");
    obstacle_.clear();
  } catch (const HttpError& error) {
    const std::string message = error.what();  // its other lines are a remedy for a terminal
    obstacle_ = message.substr(0, message.find('\n'));
    constexpr std::string_view kProgram = "lenticule: ";
    if (obstacle_.starts_with(kProgram)) obstacle_.erase(0, kProgram.size());
  }
  tried_rig_ = toml;
  return obstacle_;
}

void PhotoCalibration::begin() {
  const Claim claim(working_);
  clear_folder();
  set_stage("idle", "", nullptr, std::nullopt);
  const fs::path rig = options_.folder / "rig.toml";
  write_text_file(rig, pictures_.rig_toml());
  draw_chart(rig, chart());
  shown_instead_.show_chart(chart());
  set_stage("chart", "", nullptr, std::nullopt);
}

std::unique_ptr<BodySink> PhotoCalibration::photograph(std::optional<double> distance_mm) {
  Claim claim(working_);
  if (!fs::exists(chart())) throw HttpError(409, "no chart is shown", "show the chart first");
  return std::make_unique<Photograph>(*this, std::move(claim), options_.folder / "photo.part",
                                      distance_mm);
}

void PhotoCalibration::judge(const fs::path& photo, std::optional<double> distance_mm) {
  const fs::path rig = options_.folder / "rig.toml", output = options_.folder / "found.toml";
  fs::remove(output);
  std::vector<std::string> words = {options_.program.string(),
                                    "calibrate",
                                    "photos",
                                    photo.string(),
                                    "--rig",
                                    rig.string(),
                                    "-o",
                                    output.string(),
                                    "--json",
                                    "--confined"};
  if (distance_mm) {
    words.emplace_back("--distance");
    words.push_back(fmt::format("{:.1f}", *distance_mm));
  }
  const ProgramRun run = run_and_capture(words, kJudgeTime, options_.stops);
  const CalibrationOutput printed = parse_calibration_output(run.output);
  const std::string message =
      run.timed_out ? "judging the photograph took too long" : printed.message;
  if (printed.report.is_null()) return set_stage("refused", message, nullptr, std::nullopt);
  const ordered_json result = result_of(printed.report);
  if (run.exit_code != 0) return set_stage("refused", message, result, std::nullopt);
  Found found{.before = optics::load_rig(rig),
              .after = optics::load_rig(output),
              .eye = {.x = number_at(result["eye_mm"], 0),
                      .y = number_at(result["eye_mm"], 1),
                      .z_mm = number_at(result["eye_mm"], 2)}};
  set_stage("found", message, result, std::move(found));
}

std::string PhotoCalibration::picture(bool after) {
  const auto found = this->found();
  if (!found) throw HttpError(404, "no lens sheet was found yet");
  const std::lock_guard lock(drawing_);
  const frames::WovenFrame chart =
      frames::draw_chart({.pattern = frames::ChartPattern::NumberedViews,
                          .rig = after ? found->after : found->before});
  const int width = std::min(kPictureWidth, chart.width());
  const int height = std::max(1, static_cast<int>(int64_t{chart.height()} * width / chart.width()));
  return jpeg_of(optics::simulate_eye(optics::OpticalModel(found->after),
                                      {.pixels = chart.bytes().data(),
                                       .width = chart.width(),
                                       .height = chart.height(),
                                       .stride_bytes = chart.geometry().row_bytes()},
                                      found->eye, {.width = width, .height = height}),
                 kPictureQuality);
}

std::string PhotoCalibration::rig_toml() const {
  const auto found = this->found();
  if (!found) throw HttpError(404, "no lens sheet was found yet");
  return optics::rig_to_toml(found->after);
}

/// Lets the player replace its rig, adds both rigs to the history, and shows the content again.
void PhotoCalibration::replace_rig(const std::string& toml, const std::string& who,
                                   const std::string& what) {
  const std::string before = pictures_.rig_toml();
  ordered_json kept;
  try {
    kept = link_.ask({{"do", "rig"}, {"toml", toml}}).body;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::Failed) throw;
    throw HttpError(500, error.what(),
                    "the player may not write its rig file: download the rig, and put it there");
  }
  history_.add({.time = clock_.date(), .what = "the rig before", .toml = before});
  history_.add({.time = clock_.date(), .who = who, .what = what, .toml = toml});
  std::string message = "The rig is saved.";
  if (const ordered_json old = kept.value("old_rig_kept_as", ordered_json()); old.is_string())
    message += " The old one is " + old.get<std::string>() + ".";
  // Films that were woven for the old rig are refused from now on.
  try {
    shown_instead_.show("content");
  } catch (const Error& error) {
    message += std::string(" The content is not shown again: ") + error.what() + ".";
  }
  set_stage("kept", message, nullptr, std::nullopt);
}

void PhotoCalibration::keep(const std::string& who) {
  const Claim claim(working_);
  const auto found = this->found();
  if (!found) throw HttpError(409, "no lens sheet was found yet", "send a photograph first");
  replace_rig(optics::rig_to_toml(found->after), who, "one photograph");
}

void PhotoCalibration::restore(uint64_t number, const std::string& who) {
  const Claim claim(working_);
  const auto entry = history_.find(number);
  if (!entry) throw HttpError(404, "there is no rig of that number");
  replace_rig(entry->toml, who, fmt::format("back to rig {}", number));
}

void PhotoCalibration::discard() {
  const Claim claim(working_);
  set_stage("idle", "", nullptr, std::nullopt);
  shown_instead_.show("content");
  clear_folder();
}

}  // namespace lenticule::web
