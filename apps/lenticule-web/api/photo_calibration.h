// SPDX-License-Identifier: Apache-2.0
// PhotoCalibration calibrates the lens sheet from one to six photographs: it shows the chart, lets
// `lenticule calibrate photos` fit all of them together whenever one arrives, in a process of its
// own, and saves nothing before keep().
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/photo_session.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/control_link.h"
#include "base/error.h"
#include "base/file.h"
#include "base/subprocess.h"
#include "base/temporary.h"
#include "base/unique_fd.h"
#include "optics/model.h"
#include "optics/rig.h"
#include "optics/rig_file.h"

namespace lenticule::web {

/// CalibrationFolder names the files of a calibration.
struct CalibrationFolder {
  std::filesystem::path path;

  [[nodiscard]] std::filesystem::path chart() const { return path / "chart.png"; }
  /// Returns the file of the rig of before the calibration.
  [[nodiscard]] std::filesystem::path before() const { return path / "before.toml"; }
  /// Returns the file of the rig for which the chart was drawn.
  [[nodiscard]] std::filesystem::path start() const { return path / "rig.toml"; }
  /// Returns the file of the rig that the command found.
  [[nodiscard]] std::filesystem::path found() const { return path / "found.toml"; }
  /// Returns the folder of photographs that are not accepted yet.
  [[nodiscard]] std::filesystem::path incoming() const { return path / "incoming"; }
};

/// PhotoFile is a photograph in a file.
struct PhotoFile {
  std::filesystem::path file;
  std::optional<double> distance_mm;  ///< from the panel to the camera
  uint64_t number = 0;                ///< another one for each photograph
};

struct FoundSheet {
  optics::Rig before;
  optics::Rig after;
  optics::Eye eye;  ///< place of the first photograph's camera
  size_t photographs = 0;
};

/// CalibrationFit is what the command found in some photographs. Its message is the reason why
/// there is no report, or why the rig is refused.
struct CalibrationFit : CalibrationOutput {
  std::optional<FoundSheet> found{};  ///< none if the rig is refused
};

struct PhotoCalibrationOptions {
  std::filesystem::path folder;   ///< no other object uses it; the player reads the chart from it
  std::filesystem::path program;  ///< lenticule
  std::function<bool()> stops;    ///< returns true when the server ends
  std::filesystem::path history;  ///< file of the rigs that were kept
};

/// Keeps the photographs that are used in its folder, at most one for each place, until the rig is
/// kept or the calibration is discarded or begun again.
///
/// Thread safety: any thread. One photograph is judged at a time.
class PhotoCalibration {
 public:
  PhotoCalibration(ControlLink& link, PictureMaker& pictures, PhotoCalibrationOptions options,
                   Clock& clock = machine_clock())
      : link_(link),
        clock_(clock),
        pictures_(pictures),
        options_(std::move(options)),
        folder_{options_.folder},
        history_(options_.history) {
    clear_folder();
  }

  static constexpr uint64_t kLargestPhoto = uint64_t{64} << 20;

  /// Returns {"stage", "message", "result", "photographs", "fit", "next", "history"}: stage "idle",
  /// "chart", "refused", "found" or "kept". "result" describes the rig that can be kept, "fit" the
  /// fit of all photographs, which may state too large an error.
  [[nodiscard]] nlohmann::ordered_json state() const {
    const std::lock_guard lock(mutex_);
    ordered_json state = {{"stage", stage_}, {"message", message_}, {"result", result_}};
    state.update(session_.to_json());
    state["history"] = history_.to_json();
    return state;
  }
  /// Returns the reason why the chart cannot be shown with the player's present rig; empty if it
  /// can be. Draws the chart once for each rig.
  [[nodiscard]] std::string obstacle() {
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
  /// Draws the chart for the player's present rig, and shows it. Throws HttpError 422 with the
  /// command's message.
  void begin() {
    const Claim claim(working_);
    clear_photos();
    clear_folder();
    set_stage("idle", "", nullptr, std::nullopt);
    const std::string toml = pictures_.rig_toml();
    write_text_file(folder_.before(), toml);
    write_text_file(folder_.start(), toml);
    draw_chart(folder_.start(), folder_.chart());
    interrupt_with(link_, folder_.chart().string());
    planned_again_ = false;
    set_stage("chart", "", nullptr, std::nullopt);
  }
  /// Returns the sink of the photograph, whose finish() answers with state(). A refused photograph
  /// changes nothing about the others and their result. `name` is that of a place in kPhotoPlaces,
  /// else the next one; `distance_mm` is from the panel to the camera. Throws HttpError 409 if no
  /// chart is shown, 400 for an unknown place.
  [[nodiscard]] std::unique_ptr<BodySink> photograph(const std::optional<std::string>& name,
                                                     std::optional<double> distance_mm = {}) {
    Claim claim(working_);
    if (!std::filesystem::exists(folder_.chart()))
      throw HttpError(409, "no chart is shown", "show the chart first");
    size_t place = 0;
    {
      const std::lock_guard lock(mutex_);
      place = name ? PhotoSession::place_of(*name) : session_.next().value_or(0);
    }
    return std::make_unique<PhotoUpload>(
        // The command knows a picture's format by its content.
        std::move(claim), folder_.incoming() / fmt::format("{}.jpg", kPhotoPlaces[place].name),
        [this, place, distance_mm](const std::filesystem::path& file) {
          judge(place, {.file = file, .distance_mm = distance_mm});
          return json_response(state());
        });
  }
  /// Removes a photograph and fits the others again. Throws HttpError 400 or 404.
  void remove(const std::string& name) {
    const Claim claim(working_);
    const size_t place = PhotoSession::place_of(name);
    if (!photos_[place]) throw HttpError(404, "there is no photograph of that place");
    std::filesystem::remove(photos_[place]->file);
    photos_[place].reset();
    {
      const std::lock_guard lock(mutex_);
      session_.remove(place);
    }
    const std::vector<PhotoFile> list = list_of(photos_);
    if (list.empty()) return set_stage("chart", "", nullptr, std::nullopt);
    const Deadline deadline = std::chrono::steady_clock::now() + kJudgeTime;
    settle(fit_photos(list, deadline), deadline);
  }
  /// Returns a picture, as JPEG, that is white for the camera of the first photograph only, drawn
  /// with the rig of before or with the found one, as that camera would see it. Throws HttpError
  /// 404 if no rig was found.
  [[nodiscard]] std::string picture(bool after) {
    const auto found = this->found();
    if (!found) throw HttpError(404, "no lens sheet was found yet");
    const std::lock_guard lock(drawing_);
    return PictureMaker::comb_picture(after ? found->after : found->before, found->after,
                                      found->eye);
  }
  /// Returns the found rig's file. Throws HttpError 404.
  [[nodiscard]] std::string rig_toml() const {
    const auto found = this->found();
    if (!found) throw HttpError(404, "no lens sheet was found yet");
    return optics::rig_to_toml(found->after);
  }
  /// Lets the player replace its rig file, and adds the rig to the history. Throws HttpError 409 if
  /// no rig was found, and the player's Error.
  void keep(const std::string& who) {
    const Claim claim(working_);
    const auto found = this->found();
    if (!found) throw HttpError(409, "no lens sheet was found yet", "send a photograph first");
    replace_rig(optics::rig_to_toml(found->after), who,
                found->photographs == 1 ? "one photograph"
                                        : fmt::format("{} photographs", found->photographs));
    clear_photos();
  }
  /// Lets the player replace its rig file by one of the history. Throws HttpError 404 if there is
  /// none of that number, and the player's Error.
  void restore(uint64_t number, const std::string& who) {
    const Claim claim(working_);
    const auto entry = history_.find(number);
    if (!entry) throw HttpError(404, "there is no rig of that number");
    replace_rig(entry->toml, who, fmt::format("back to rig {}", number));
  }
  /// Forgets the photographs and the found rig, and shows the content again.
  void discard() {
    const Claim claim(working_);
    clear_photos();
    set_stage("idle", "", nullptr, std::nullopt);
    show(link_, "content");
    clear_folder();
  }

 private:
  using ordered_json = nlohmann::ordered_json;
  using seconds = std::chrono::seconds;
  static constexpr auto kJudgeTime = seconds(50), kDrawTime = seconds(50);
  /// A chart for a pitch that is further off has fringes of which many cannot be measured.
  static constexpr double kFarPitch = 0.01;

  /// Returns the files in the order of their places.
  static std::vector<PhotoFile> list_of(const auto& photos) {
    std::vector<PhotoFile> list;
    for (const auto& photo : photos)
      if (photo) list.push_back(*photo);
    return list;
  }

  /// Returns a message of the command without the folder before names of files.
  static std::string without_folder(std::string message, const CalibrationFolder& folder) {
    for (const std::string& prefix :
         {folder.incoming().string() + "/", folder.path.string() + "/", std::string("lenticule: ")})
      for (size_t at = 0; (at = message.find(prefix, at)) != std::string::npos;)
        message.erase(at, prefix.size());
    return message;
  }

  /// Claim marks work that only one thread may do at a time.
  class Claim {
   public:
    /// Throws HttpError 409 if another thread does it.
    explicit Claim(std::atomic<bool>& claimed) : claimed_(&claimed) {
      if (!claimed.exchange(true)) return;
      claimed_ = nullptr;
      throw HttpError(409, "a photograph is being judged, or sent", "try again in some seconds");
    }
    Claim(Claim&& other) noexcept : claimed_(std::exchange(other.claimed_, nullptr)) {}
    Claim& operator=(Claim&&) = delete;
    ~Claim() {
      if (claimed_ != nullptr) claimed_->store(false);
    }

   private:
    std::atomic<bool>* claimed_;
  };

  /// PhotoUpload writes a photograph that arrives to a file, which is then judged. It keeps its
  /// claim until it is destroyed, and then removes its file, unless `judge` moved the file
  /// elsewhere.
  class PhotoUpload final : public BodySink {
   public:
    /// Takes the whole photograph, and returns the answer.
    using Judge = std::function<Response(const std::filesystem::path& file)>;

    /// Makes the folder of `path`. Throws HttpError 500 or 507 if the file cannot be written.
    PhotoUpload(Claim claim, std::filesystem::path path, Judge judge)
        : claim_(std::move(claim)), path_(std::move(path)), judge_(std::move(judge)) {
      std::filesystem::create_directories(path_.parent_path());
      constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW;
      file_ = UniqueFd(::open(path_.c_str(), kFlags, 0600));
      if (!file_) fail_to_write("photograph");
    }
    ~PhotoUpload() override { (void)::unlink(path_.c_str()); }

    void take(std::span<const uint8_t> bytes) override {
      write_all(file_.get(), bytes, "photograph");
    }
    Response finish() override {
      file_ = UniqueFd();
      return judge_(path_);
    }

   private:
    const Claim claim_;
    const std::filesystem::path path_;
    UniqueFd file_;
    const Judge judge_;
  };
  using Photos = std::array<std::optional<PhotoFile>, kPhotoPlaces.size()>;
  using Deadline = std::chrono::steady_clock::time_point;
  /// Throws HttpError 422 with the command's message.
  void draw_chart(const std::filesystem::path& rig, const std::filesystem::path& output) const {
    const ProgramRun run =
        run_and_capture({options_.program.string(), "calibrate", "show", "photo-chart", "--rig",
                         rig.string(), "-o", output.string()},
                        AnswerTime::at_most(kDrawTime), options_.stops);
    if (run.exit_code != 0)
      throw HttpError(422, run.timed_out ? "drawing the chart took too long"
                                         : parse_calibration_output(run.output).message);
  }
  /// Fits the photographs, at least one: one for its place, several for every eye.
  [[nodiscard]] CalibrationFit fit_photos(const std::vector<PhotoFile>& photos,
                                          Deadline deadline) const {
    const std::filesystem::path output = folder_.found();
    std::filesystem::remove(output);
    std::vector<std::string> words = {options_.program.string(), "calibrate", "photos"};
    for (const PhotoFile& photo : photos) words.push_back(photo.file.string());
    words.insert(words.end(), {"--rig", folder_.start().string(), "-o", output.string(), "--json"});
    if (photos.size() > 1)
      words.insert(words.end(), {"--largest-error", std::to_string(PhotoSession::kUsableLenses)});
    else if (photos.front().distance_mm)
      words.insert(words.end(), {"--distance", fmt::format("{:.1f}", *photos.front().distance_mm)});
    const auto left =
        std::chrono::duration_cast<seconds>(deadline - std::chrono::steady_clock::now());
    const ProgramRun run =
        run_and_capture(words, AnswerTime::at_most(std::max(left, seconds(1))), options_.stops);
    CalibrationFit fit{parse_calibration_output(run.output)};
    if (run.timed_out) fit.message = "judging the photographs took too long";
    if (fit.report.is_null()) return fit;
    fit.message = first_reason(fit.report);
    if (run.exit_code != 0) return fit;
    const ordered_json eye = shown_part(fit.report)["eye_mm"];
    const auto at = [&](size_t k) {
      return eye.is_array() && eye.size() > k ? number_of(eye[k]).value_or(NAN) : NAN;
    };
    fit.found = FoundSheet{.before = optics::load_rig(folder_.before()),
                           .after = optics::load_rig(output),
                           .eye = {.x = at(0), .y = at(1), .z_mm = at(2)},
                           .photographs = list_in(member(fit.report, "viewpoints")).size()};
    return fit;
  }
  void judge(size_t place, const PhotoFile& photo) {
    const Deadline deadline = std::chrono::steady_clock::now() + kJudgeTime;
    Photos photos = photos_;
    photos[place] = photo;
    CalibrationFit fit = fit_photos(list_of(photos), deadline);
    std::string refusal = fit.report.is_null() ? without_folder(fit.message, folder_)
                                               : PhotoSession::refusal(fit.report, place);
    if (!refusal.empty()) {
      const std::lock_guard lock(mutex_);
      session_.refuse(place, std::move(refusal));
      if (!found_) stage_ = "refused";
      return;
    }
    if (photos_[place]) std::filesystem::remove(photos_[place]->file);
    PhotoFile kept{.file = folder_.path / photo.file.filename(),
                   .distance_mm = photo.distance_mm,
                   .number = ++newest_};
    std::filesystem::rename(photo.file, kept.file);
    photos_[place] = std::move(kept);
    {
      const std::lock_guard lock(mutex_);
      session_.accept(place);
    }
    settle(std::move(fit), deadline);
  }
  /// Takes over the fit of all photographs. If several state too large an error, the first of them
  /// that is not set aside gives the result alone.
  void settle(CalibrationFit fit, Deadline deadline) {
    const std::vector<PhotoFile> list = list_of(photos_);
    if (list.size() > 1 && !fit.report.is_null()) {
      const std::lock_guard lock(mutex_);
      session_.take_report(fit.report);
    }
    if (list.size() == 1) {
      single_ = fit;
      single_number_ = list.front().number;
    } else if (!fit.found) {
      size_t place = 0;
      while (place + 1 < photos_.size() && !(photos_[place] && session_.used(place))) ++place;
      const PhotoFile& first = photos_[place] ? *photos_[place] : list.front();
      if (single_number_ != first.number) single_ = fit_photos({first}, deadline);
      single_number_ = first.number;
      fit = single_;
    }
    const ordered_json result = fit.report.is_null() ? ordered_json() : shown_part(fit.report);
    const bool found = fit.found.has_value();
    const size_t photographs = list.size();
    set_stage(found ? "found" : "refused", found ? "" : fit.message, result, std::move(fit.found));
    if (found && photographs == 1 && plan_again())
      set_stage(
          "found",
          "The pitch of the sheet is far from that of the present rig, so the chart was drawn "
          "again. For a better result, take the photograph from the middle again.",
          result, this->found());
  }
  /// Draws and shows the chart for the pitch that the photograph showed if the present one is far
  /// off, and forgets the photograph, which shows another chart.
  [[nodiscard]] bool plan_again() {
    optics::Rig rig = optics::load_rig(folder_.start());
    const optics::LensSheet sheet = found()->after.sheet;
    if (planned_again_ || std::abs(sheet.pitch.value / rig.sheet.pitch.value - 1.0) <= kFarPitch)
      return false;
    rig.sheet.pitch = sheet.pitch;
    rig.sheet.slant = sheet.slant;
    const std::filesystem::path better = folder_.path / "better.toml",
                                drawn = folder_.path / "better.png";
    optics::save_rig(rig, better);
    draw_chart(better, drawn);
    std::filesystem::rename(better, folder_.start());
    std::filesystem::rename(drawn, folder_.chart());
    interrupt_with(link_, folder_.chart().string());
    planned_again_ = true;
    clear_photos();
    return true;
  }
  /// Removes all photographs, and what is known about them.
  void clear_photos() {
    for (const PhotoFile& photo : list_of(photos_)) std::filesystem::remove(photo.file);
    photos_ = {};
    single_ = {};
    single_number_ = 0;
    const std::lock_guard lock(mutex_);
    session_ = {};
  }
  void set_stage(const char* stage, std::string message, nlohmann::ordered_json result,
                 std::optional<FoundSheet> found) {
    const std::lock_guard lock(mutex_);
    stage_ = stage;
    message_ = std::move(message);
    result_ = std::move(result);
    found_ = std::move(found);
  }
  [[nodiscard]] std::optional<FoundSheet> found() const {
    const std::lock_guard lock(mutex_);
    return found_;
  }
  void clear_folder() const {
    std::filesystem::remove_all(folder_.path);
    std::filesystem::create_directories(folder_.path);
  }
  /// Lets the player replace its rig, adds both rigs to the history, and shows the content again.
  void replace_rig(const std::string& toml, const std::string& who, const std::string& what) {
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
      show(link_, "content");
    } catch (const Error& error) {
      message += std::string(" The content is not shown again: ") + error.what() + ".";
    }
    set_stage("kept", message, nullptr, std::nullopt);
  }

  ControlLink& link_;
  Clock& clock_;
  PictureMaker& pictures_;
  const PhotoCalibrationOptions options_;
  const CalibrationFolder folder_;
  std::atomic<bool> working_{false};  ///< true while an action uses the folder
  // These four belong to the action that uses the folder.
  Photos photos_;
  uint64_t newest_ = 0;         ///< number of the newest photograph
  uint64_t single_number_ = 0;  ///< number of the photograph of single_
  CalibrationFit single_;       ///< fit of the first photograph alone
  bool planned_again_ = false;
  std::mutex drawing_;        ///< a chart takes memory and time: one picture at a time
  mutable std::mutex mutex_;  ///< guards the members below
  std::string stage_ = "idle";
  std::string message_;
  nlohmann::ordered_json result_;
  std::optional<FoundSheet> found_;
  PhotoSession session_;
  std::mutex trying_;      ///< guards the next two members
  std::string tried_rig_;  ///< text of the rig for which the chart was drawn
  std::string obstacle_{};
  RigHistory history_;
};

}  // namespace lenticule::web
