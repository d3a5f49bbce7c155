// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/photo_calibration.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
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
/// A chart for a pitch that is further off has fringes of which many cannot be measured.
constexpr double kFarPitch = 0.01;
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
  result["photographs"] = viewpoints.size();
  return result;
}

/// Returns the files in the order of their places.
template <class Photos>
auto list_of(const Photos& photos) {
  std::vector<typename Photos::value_type::value_type> list;
  for (const auto& photo : photos)
    if (photo) list.push_back(*photo);
  return list;
}

/// Returns a message of the command without the folder before names of files.
std::string without_folder(std::string message, const fs::path& folder) {
  for (const std::string& prefix :
       {(folder / "incoming").string() + "/", folder.string() + "/", std::string("lenticule: ")})
    for (size_t at = 0; (at = message.find(prefix, at)) != std::string::npos;)
      message.erase(at, prefix.size());
  return message;
}

/// Returns the rig whose comb is white for the eye: that of a rig is white for an eye straight
/// ahead, at its viewing line.
optics::Rig white_for(optics::Rig rig, const optics::Eye& eye) {
  constexpr int kGreen = 1;
  rig.viewing = {Millimetres(eye.y), Millimetres(eye.z_mm)};
  const optics::OpticalModel model(rig);
  const double x = 0.5 * rig.panel.width_px, y = 0.5 * rig.panel.height_px;
  const optics::Eye ahead{.x = 0.0, .y = eye.y, .z_mm = eye.z_mm};
  rig.sheet.offset =
      rig.sheet.offset + Lenses(model.phase(x, y, kGreen, eye) - model.phase(x, y, kGreen, ahead));
  return rig;
}

/// Adds the channels: through a fine lens an eye sees one subpixel, of one colour, at each place.
optics::RgbPicture without_colour(optics::RgbPicture picture) {
  for (size_t k = 0; k + 2 < picture.pixels.size(); k += 3) {
    const int sum = picture.pixels[k] + picture.pixels[k + 1] + picture.pixels[k + 2];
    std::fill_n(picture.pixels.begin() + static_cast<ptrdiff_t>(k), 3,
                static_cast<uint8_t>(std::min(sum, 255)));
  }
  return picture;
}

/// Returns the first reason of a report.
std::string first_reason(const ordered_json& report) {
  const ordered_json reasons = report.value("reasons", ordered_json::array());
  return reasons.is_array() && !reasons.empty() && reasons[0].is_string()
             ? reasons[0].get<std::string>()
             : std::string();
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
  Photograph(PhotoCalibration& owner, Claim claim, size_t place, std::optional<double> distance_mm)
      : owner_(owner),
        claim_(std::move(claim)),
        place_(place),
        path_(owner.options_.folder / "incoming" / kPhotoPlaces[place].name),
        distance_mm_(distance_mm) {
    fs::create_directories(path_.parent_path());
    file_ = UniqueFd(
        ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600));
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
    owner_.judge(place_, {.file = path_, .distance_mm = distance_mm_});
    return json_response(owner_.state());
  }

 private:
  [[noreturn]] static void fail() {
    throw HttpError(errno == ENOSPC || errno == EDQUOT ? 507 : 500,
                    fmt::format("photograph: cannot be written: {}", std::strerror(errno)));
  }

  PhotoCalibration& owner_;
  const Claim claim_;
  const size_t place_;
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
  ordered_json state = {{"stage", stage_}, {"message", message_}, {"result", result_}};
  state.update(session_.to_json());
  state["history"] = history_.to_json();
  return state;
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
  clear_photos();
  clear_folder();
  set_stage("idle", "", nullptr, std::nullopt);
  const std::string toml = pictures_.rig_toml();
  write_text_file(options_.folder / "before.toml", toml);
  write_text_file(start(), toml);
  draw_chart(start(), chart());
  shown_instead_.show_chart(chart());
  planned_again_ = false;
  set_stage("chart", "", nullptr, std::nullopt);
}

/// Removes all photographs, and what is known about them.
void PhotoCalibration::clear_photos() {
  for (const Photo& photo : list_of(photos_)) fs::remove(photo.file);
  photos_ = {};
  single_ = {};
  single_number_ = 0;
  const std::lock_guard lock(mutex_);
  session_ = {};
}

std::unique_ptr<BodySink> PhotoCalibration::photograph(const PhotoRequest& request) {
  Claim claim(working_);
  if (!fs::exists(chart())) throw HttpError(409, "no chart is shown", "show the chart first");
  size_t place = 0;
  {
    const std::lock_guard lock(mutex_);
    place = request.place ? PhotoSession::place_of(*request.place) : session_.next().value_or(0);
  }
  return std::make_unique<Photograph>(*this, std::move(claim), place, request.distance_mm);
}

/// Lets the command fit the photographs: one for its place, several for every eye.
PhotoCalibration::Fit PhotoCalibration::fit(const std::vector<Photo>& photos,
                                            Deadline deadline) const {
  const fs::path output = options_.folder / "found.toml";
  fs::remove(output);
  std::vector<std::string> words = {options_.program.string(), "calibrate", "photos"};
  for (const Photo& photo : photos) words.push_back(photo.file.string());
  words.insert(words.end(),
               {"--rig", start().string(), "-o", output.string(), "--json", "--confined"});
  if (photos.size() > 1)
    words.insert(words.end(), {"--largest-error", std::to_string(PhotoSession::kUsableLenses)});
  else if (photos.front().distance_mm)
    words.insert(words.end(), {"--distance", fmt::format("{:.1f}", *photos.front().distance_mm)});
  const auto left =
      std::chrono::duration_cast<seconds>(deadline - std::chrono::steady_clock::now());
  const ProgramRun run = run_and_capture(words, std::max(left, seconds(1)), options_.stops);
  CalibrationOutput printed = parse_calibration_output(run.output);
  Fit fit{.report = std::move(printed.report), .message = std::move(printed.message), .found = {}};
  if (run.timed_out) fit.message = "judging the photographs took too long";
  if (fit.report.is_null()) return fit;
  fit.message = first_reason(fit.report);
  if (run.exit_code != 0) return fit;
  const ordered_json eye = result_of(fit.report)["eye_mm"];
  fit.found =
      Found{.before = optics::load_rig(options_.folder / "before.toml"),
            .after = optics::load_rig(output),
            .eye = {.x = number_at(eye, 0), .y = number_at(eye, 1), .z_mm = number_at(eye, 2)},
            .photographs = photos.size()};
  return fit;
}

/// Returns why a new photograph is refused; empty if it is used.
std::string PhotoCalibration::refusal_of(const Fit& fit, size_t place, size_t photographs) const {
  if (fit.report.is_null()) return without_folder(fit.message, options_.folder);
  if (fit.found) return {};
  if (photographs == 1) return fit.message;
  if (std::string refusal = PhotoSession::refusal(fit.report, place); !refusal.empty())
    return refusal;
  const auto best = found();
  return best && best->photographs > 1 ? "with it the stated error would be too large" : "";
}

void PhotoCalibration::judge(size_t place, const Photo& photo) {
  const Deadline deadline = std::chrono::steady_clock::now() + kJudgeTime;
  Photos photos = photos_;
  photos[place] = photo;
  const std::vector<Photo> list = list_of(photos);
  Fit fit = this->fit(list, deadline);
  if (std::string refusal = refusal_of(fit, place, list.size()); !refusal.empty()) {
    const std::lock_guard lock(mutex_);
    session_.refuse(place, std::move(refusal));
    if (!found_) stage_ = "refused";
    return;
  }
  if (photos_[place]) fs::remove(photos_[place]->file);
  Photo kept{.file = options_.folder / photo.file.filename(),
             .distance_mm = photo.distance_mm,
             .number = ++newest_};
  fs::rename(photo.file, kept.file);
  photos_[place] = std::move(kept);
  {
    const std::lock_guard lock(mutex_);
    session_.accept(place);
  }
  settle(std::move(fit), deadline);
}

void PhotoCalibration::remove(const std::string& name) {
  const Claim claim(working_);
  const size_t place = PhotoSession::place_of(name);
  if (!photos_[place]) throw HttpError(404, "there is no photograph of that place");
  fs::remove(photos_[place]->file);
  photos_[place].reset();
  {
    const std::lock_guard lock(mutex_);
    session_.remove(place);
  }
  const std::vector<Photo> list = list_of(photos_);
  if (list.empty()) return set_stage("chart", "", nullptr, std::nullopt);
  const Deadline deadline = std::chrono::steady_clock::now() + kJudgeTime;
  settle(fit(list, deadline), deadline);
}

/// Takes over the fit of all photographs. If several state too large an error, the first of them
/// alone gives the result.
void PhotoCalibration::settle(Fit fit, Deadline deadline) {
  const std::vector<Photo> list = list_of(photos_);
  if (list.size() > 1 && !fit.report.is_null()) {
    const std::lock_guard lock(mutex_);
    session_.take_report(fit.report);
  }
  if (list.size() == 1) {
    single_ = fit;
    single_number_ = list.front().number;
  } else if (!fit.found) {
    if (single_number_ != list.front().number) single_ = this->fit({list.front()}, deadline);
    single_number_ = list.front().number;
    fit = single_;
  }
  const ordered_json result = fit.report.is_null() ? ordered_json() : result_of(fit.report);
  const bool found = fit.found.has_value();
  const size_t photographs = list.size();
  set_stage(found ? "found" : "refused", found ? "" : fit.message, result, std::move(fit.found));
  if (found && photographs == 1 && plan_again())
    set_stage("found",
              "The pitch of the sheet is far from that of the present rig, so the chart was drawn "
              "again. For a better result, take the photograph from the middle again.",
              result, this->found());
}

/// Draws and shows the chart for the pitch that the photograph showed if the present one is far
/// off, and forgets the photograph, which shows another chart.
bool PhotoCalibration::plan_again() {
  optics::Rig rig = optics::load_rig(start());
  const optics::LensSheet sheet = found()->after.sheet;
  if (planned_again_ || std::abs(sheet.pitch.value / rig.sheet.pitch.value - 1.0) <= kFarPitch)
    return false;
  rig.sheet.pitch = sheet.pitch;
  rig.sheet.slant = sheet.slant;
  const fs::path better = options_.folder / "better.toml", drawn = options_.folder / "better.png";
  optics::save_rig(rig, better);
  draw_chart(better, drawn);
  fs::rename(better, start());
  fs::rename(drawn, chart());
  shown_instead_.show_chart(chart());
  planned_again_ = true;
  clear_photos();
  return true;
}

std::string PhotoCalibration::picture(bool after) {
  const auto found = this->found();
  if (!found) throw HttpError(404, "no lens sheet was found yet");
  const std::lock_guard lock(drawing_);
  const frames::WovenFrame chart =
      frames::draw_chart({.pattern = frames::ChartPattern::Comb,
                          .rig = white_for(after ? found->after : found->before, found->eye)});
  const int width = std::min(kPictureWidth, chart.width());
  const int height = std::max(1, static_cast<int>(int64_t{chart.height()} * width / chart.width()));
  return jpeg_of(
      without_colour(optics::simulate_eye(optics::OpticalModel(found->after),
                                          {.pixels = chart.bytes().data(),
                                           .width = chart.width(),
                                           .height = chart.height(),
                                           .stride_bytes = chart.geometry().row_bytes()},
                                          found->eye, {.width = width, .height = height})),
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
  replace_rig(optics::rig_to_toml(found->after), who,
              found->photographs == 1 ? "one photograph"
                                      : fmt::format("{} photographs", found->photographs));
  clear_photos();
}

void PhotoCalibration::restore(uint64_t number, const std::string& who) {
  const Claim claim(working_);
  const auto entry = history_.find(number);
  if (!entry) throw HttpError(404, "there is no rig of that number");
  replace_rig(entry->toml, who, fmt::format("back to rig {}", number));
}

void PhotoCalibration::discard() {
  const Claim claim(working_);
  clear_photos();
  set_stage("idle", "", nullptr, std::nullopt);
  shown_instead_.show("content");
  clear_folder();
}

}  // namespace lenticule::web
