// SPDX-License-Identifier: Apache-2.0
// PhotoCalibration calibrates the lens sheet from one to four photographs: it shows the chart, lets
// `lenticule calibrate photos` judge the photographs, in a process of its own, and saves nothing
// before keep().
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/photo_session.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/control_link.h"
#include "optics/model.h"
#include "optics/rig.h"

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

/// CalibrationFit is what the command found in some photographs.
struct CalibrationFit {
  nlohmann::ordered_json report;    ///< null if the command failed
  std::string message;              ///< reason why there is no report, or why the rig is refused
  std::optional<FoundSheet> found;  ///< none if the rig is refused
};

struct PhotoCalibrationOptions {
  std::filesystem::path folder;   ///< no other object uses it; the player reads the chart from it
  std::filesystem::path program;  ///< lenticule
  std::function<bool()> stops;    ///< returns true when the server ends
  std::filesystem::path history;  ///< file of the rigs that were kept
};

/// PhotoRequest describes a photograph that arrives.
struct PhotoRequest {
  std::optional<std::string> place;   ///< name in kPhotoPlaces; else the next one
  std::optional<double> distance_mm;  ///< from the panel to the camera
};

/// Keeps the photographs that are used in its folder, at most one for each place, until the rig is
/// kept or the calibration is discarded or begun again.
///
/// Thread safety: any thread. One photograph is judged at a time.
class PhotoCalibration {
 public:
  PhotoCalibration(ControlLink& link, PictureMaker& pictures, PhotoCalibrationOptions options,
                   Clock& clock = machine_clock());

  static constexpr uint64_t kLargestPhoto = uint64_t{64} << 20;

  /// Returns {"stage", "message", "result", "photographs", "fit", "next", "history"}: stage "idle",
  /// "chart", "refused", "found" or "kept". "result" describes the rig that can be kept, "fit" the
  /// fit of all photographs, which may state too large an error.
  [[nodiscard]] nlohmann::ordered_json state() const;
  /// Returns the reason why the chart cannot be shown with the player's present rig; empty if it
  /// can be. Draws the chart once for each rig.
  [[nodiscard]] std::string obstacle();
  /// Draws the chart for the player's present rig, and shows it. Throws HttpError 422 with the
  /// command's message.
  void begin();
  /// Returns the sink of the photograph, whose finish() answers with state(). A refused photograph
  /// changes nothing about the others and their result. Throws HttpError 409 if no chart is shown,
  /// 400 for an unknown place.
  [[nodiscard]] std::unique_ptr<BodySink> photograph(const PhotoRequest& request);
  /// Removes a photograph and fits the others again. Throws HttpError 400 or 404.
  void remove(const std::string& place);
  /// Returns a picture, as JPEG, that is white for the camera of the first photograph only, drawn
  /// with the rig of before or with the found one, as that camera would see it. Throws HttpError
  /// 404 if no rig was found.
  [[nodiscard]] std::string picture(bool after);
  /// Returns the found rig's file. Throws HttpError 404.
  [[nodiscard]] std::string rig_toml() const;
  /// Lets the player replace its rig file, and adds the rig to the history. Throws HttpError 409 if
  /// no rig was found, and the player's Error.
  void keep(const std::string& who);
  /// Lets the player replace its rig file by one of the history. Throws HttpError 404 if there is
  /// none of that number, and the player's Error.
  void restore(uint64_t number, const std::string& who);
  /// Forgets the photographs and the found rig, and shows the content again.
  void discard();

 private:
  using Photos = std::array<std::optional<PhotoFile>, kPhotoPlaces.size()>;
  using Deadline = std::chrono::steady_clock::time_point;
  void draw_chart(const std::filesystem::path& rig, const std::filesystem::path& output) const;
  [[nodiscard]] CalibrationFit fit_photos(const std::vector<PhotoFile>& photos,
                                          Deadline deadline) const;
  void judge(size_t place, const PhotoFile& photo);
  [[nodiscard]] std::string refusal_of(const CalibrationFit& fit, size_t place,
                                       size_t photographs) const;
  void settle(CalibrationFit fit, Deadline deadline);
  [[nodiscard]] bool plan_again();
  void clear_photos();
  void set_stage(const char* stage, std::string message, nlohmann::ordered_json result,
                 std::optional<FoundSheet> found);
  [[nodiscard]] std::optional<FoundSheet> found() const;
  void clear_folder() const;
  void replace_rig(const std::string& toml, const std::string& who, const std::string& what);

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
