// SPDX-License-Identifier: Apache-2.0
// PhotoCalibration calibrates the lens sheet from one to four photographs: it shows the chart, lets
// `lenticule calibrate photos` judge the photographs, and saves nothing before keep().
#pragma once

#include <array>
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/lenticule-web/api/calibrate_command.h"
#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/photo_session.h"
#include "apps/lenticule-web/api/pictures.h"
#include "apps/lenticule-web/api/shown_instead.h"
#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "apps/lenticule-web/link/control_link.h"

namespace lenticule::web {

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
  PhotoCalibration(ControlLink& link, PictureMaker& pictures, ShownInstead& shown_instead,
                   PhotoCalibrationOptions options, Clock& clock = machine_clock());

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
  void judge(size_t place, const PhotoFile& photo);
  [[nodiscard]] std::string refusal_of(const CalibrationFit& fit, size_t place,
                                       size_t photographs) const;
  void settle(CalibrationFit fit, CalibrateCommand::Deadline deadline);
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
  ShownInstead& shown_instead_;
  const CalibrateCommand command_;
  const CalibrationFolder folder_;
  const std::filesystem::path try_folder_;  ///< folder of charts that are drawn as a trial
  std::atomic<bool> working_{false};        ///< true while an action uses the folder
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
