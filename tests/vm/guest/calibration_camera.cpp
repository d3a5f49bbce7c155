// SPDX-License-Identifier: Apache-2.0
// Runs in the guest as root: simulates a lens sheet on the panel that a card drives, and the camera
// in front of the sheet.
//   vm_calibration_camera start RIG                  writes the rig that a calibration starts from
//   vm_calibration_camera look CARD OUTPUT INPUT     is the camera until its standard input ends
//   vm_calibration_camera judge RIG X Y Z            prints a rig's errors against the ground
//                                                    truth as JSON; the first viewpoint was
//                                                    found at X Y Z mm
//   vm_calibration_camera rehearse                   runs the same calibration without any driver
// `look` reads the picture that CARD scans out, computes the simulated camera's picture, and sends
// it through vivid's OUTPUT to its INPUT. Lines "move N" move the camera to viewpoint N; it answers
// "at N" when the picture from there has been sent.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "lab/panel/trial.h"
#include "optics/model.h"
#include "optics/rig_file.h"
#include "scanned_out.h"
#include "video_node.h"

namespace lenticule::vm {
namespace {

using calib::CameraPicture;
using lab::SimulatedBench;
using lab::Trial;

constexpr int panel_width = 960, panel_height = 540;
// The smallest of vivid's HDMI timings that resolves enough of the panel.
constexpr int camera_width = 640, camera_height = 480;

// Six rays per pixel give a fast and noisy picture; 1 % of noise is a usual webcam's.
Trial the_trial() {
  Trial trial = lab::plain_trial(panel_width, panel_height, camera_width, camera_height);
  trial.sheet.deformation_lenses = 0.05;
  trial.camera.focal_px =
      0.85 * camera_width * 700.0 / 597.8;  // the panel nearly fills the picture
  trial.camera.samples = 6;
  trial.camera.read_noise = trial.camera.shot_noise = 0.007;
  return trial;
}

SimulatedBench bench_of(const Trial& trial) {
  return SimulatedBench(trial.panel, trial.sheet, trial.link, trial.camera, trial.seed);
}

// ---- looking ------------------------------------------------------------------------------------

uint8_t srgb_code(float light) {
  const double linear = std::clamp(static_cast<double>(light), 0.0, 1.0);
  const double encoded =
      linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(255.0 * encoded));
}

// A table of the codes of 65536 lights: one power per sample would take an emulated machine
// seconds.
class SrgbCodes {
 public:
  SrgbCodes() {
    for (size_t i = 0; i < steps; ++i)
      codes_.push_back(srgb_code(static_cast<float>(i) / static_cast<float>(steps - 1)));
  }
  uint8_t of(float light) const {
    const float step = std::clamp(light, 0.0F, 1.0F) * static_cast<float>(steps - 1);
    return codes_[static_cast<size_t>(std::lround(step))];
  }

 private:
  static constexpr size_t steps = 65536;
  std::vector<uint8_t> codes_;
};

// Returns the driver's timings of the camera's size; throws if there are none.
v4l2_dv_timings camera_timings(VideoNode& node) {
  v4l2_enum_dv_timings offered{};
  do {
    node.call(VIDIOC_ENUM_DV_TIMINGS, &offered, "no timings of 640x480");
    ++offered.index;
  } while (offered.timings.bt.width != camera_width || offered.timings.bt.height != camera_height ||
           offered.timings.bt.interlaced != V4L2_DV_PROGRESSIVE);
  return offered.timings;
}

class PictureSender {
 public:
  PictureSender(const std::string& output, const std::string& input)
      : output_(output, V4L2_BUF_TYPE_VIDEO_OUTPUT), bytes_(frame_bytes) {
    VideoNode loop(input, V4L2_BUF_TYPE_VIDEO_CAPTURE);
    loop.set_loop(true);
    loop.set_control("OSD Text Mode", 2);  // no text
    v4l2_dv_timings timings = camera_timings(output_);
    // The input does not follow the output's timings, and shows noise if they differ.
    loop.call(VIDIOC_S_DV_TIMINGS, &timings, "timings of the input");
    output_.call(VIDIOC_S_DV_TIMINGS, &timings, "timings of the output");
    choose_format();
    output_.map_buffers();
    output_.start(bytes_);
  }

  void send(const CameraPicture& picture) {
    std::transform(picture.light.begin(), picture.light.end(), bytes_.begin(),
                   [this](float light) { return codes_.of(light); });
    output_.send(bytes_);
  }

 private:
  static constexpr size_t frame_bytes = size_t{camera_width} * camera_height * 3;

  void choose_format() {
    v4l2_pix_format wanted{};
    wanted.width = camera_width;
    wanted.height = camera_height;
    wanted.pixelformat = V4L2_PIX_FMT_RGB24;
    wanted.field = V4L2_FIELD_NONE;
    wanted.colorspace = V4L2_COLORSPACE_SRGB;
    wanted.xfer_func = V4L2_XFER_FUNC_SRGB;
    wanted.quantization = V4L2_QUANTIZATION_FULL_RANGE;
    wanted.priv = V4L2_PIX_FMT_PRIV_MAGIC;  // the driver ignores these fields otherwise
    const v4l2_pix_format got = output_.choose(wanted);
    if (got.sizeimage != frame_bytes || got.quantization == V4L2_QUANTIZATION_LIM_RANGE)
      throw std::runtime_error("the output takes other bytes than full-range RGB");
  }

  VideoNode output_;
  std::vector<uint8_t> bytes_;
  SrgbCodes codes_;
};

class LookingCamera {
 public:
  LookingCamera(const std::string& card, const std::string& output, const std::string& input)
      : bench_(bench_of(trial_)), screen_(card), sender_(output, input) {
    move_to(0);
  }

  void run() {
    while (take_orders()) {
      std::optional<frames::WovenFrame> frame = screen_.read();
      if (frame && frame->geometry() == bench_.sink().geometry()) look_at(std::move(*frame));
    }
  }

 private:
  // Waits a little for orders; returns false at their end.
  bool take_orders() {
    pollfd waiting{STDIN_FILENO, POLLIN, 0};
    if (poll(&waiting, 1, 20) <= 0) return true;
    char bytes[256];
    const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
    if (count <= 0) return false;
    for (const char byte : std::string(bytes, static_cast<size_t>(count))) {
      order_ += byte;
      if (byte == '\n') obey(std::exchange(order_, {}));
    }
    return true;
  }

  void obey(const std::string& order) {
    unsigned viewpoint = 0;
    if (std::sscanf(order.c_str(), "move %u", &viewpoint) != 1 ||
        viewpoint >= trial_.viewpoints.size())
      throw std::runtime_error("cannot obey: " + order);
    move_to(viewpoint);
  }

  void move_to(size_t viewpoint) {
    const lab::TrialViewpoint& place = trial_.viewpoints[viewpoint];
    bench_.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    viewpoint_ = viewpoint;
    arrived_ = false;
  }

  // Returns a picture whose exposure began after the panel had changed.
  CameraPicture photograph() {
    const auto exposure = std::chrono::milliseconds{18};
    CameraPicture picture;
    if (bench_.camera().grab(picture, std::chrono::seconds{1}, bench_.camera().now() + exposure) !=
        calib::GrabStatus::Ready)
      throw std::runtime_error("the simulated camera gives no picture");
    return picture;
  }

  void look_at(frames::WovenFrame frame) {
    if (arrived_ && frame == seen_) return;
    const auto begin = std::chrono::steady_clock::now();
    if (bench_.sink().show(frame.view(), std::chrono::seconds{1}) != frames::ShowResult::Shown)
      throw std::runtime_error("the simulated panel shows nothing");
    sender_.send(photograph());
    seen_ = std::move(frame);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    std::printf("picture %d took %.2f s\n", ++pictures_, taken.count());
    if (!arrived_) std::printf("at %zu\n", viewpoint_);
    arrived_ = true;
    std::fflush(stdout);
  }

  Trial trial_ = the_trial();
  SimulatedBench bench_;
  ScannedOut screen_;
  PictureSender sender_;
  frames::WovenFrame seen_;
  std::string order_;
  size_t viewpoint_ = 0;
  bool arrived_ = false;
  int pictures_ = 0;
};

// ---- judging ------------------------------------------------------------------------------------

// Returns the pitch of the line nearest to the phases that the camera sees over the panel, as a
// calibration defines it.
double true_effective_pitch(const SimulatedBench& bench, const Trial& trial, const Vec3& eye) {
  constexpr int columns = 17, rows = 9;
  double slope = 0.0, squares = 0.0;
  for (int n = 0; n < columns * rows; ++n) {
    const double across = 2.0 * (n % columns) / (columns - 1) - 1.0;  // -1 to 1
    const double down = 2.0 * (n / columns) / (rows - 1) - 1.0;
    slope += across * bench.ground_truth_phase(0.5 * trial.panel.width_px * (1.0 + across),
                                               0.5 * trial.panel.height_px * (1.0 + down), 1, eye);
    squares += across * across;
  }
  return 1.5 * trial.panel.width_px * squares / slope;
}

// Returns the largest difference over the panel between the phase that the rig gives for an eye and
// the phase for the true eye. A single viewpoint determines its distance badly, but its phases
// well.
double worst_lenses_at(const optics::OpticalModel& model, const Vec3& found_eye,
                       const SimulatedBench& bench, const Vec3& true_eye) {
  const optics::Panel& panel = model.rig().panel;
  double worst = 0.0;
  for (int n = 0; n < 17 * 9; ++n) {
    const double x = panel.width_px * (n % 17) / 16.0, y = panel.height_px * (n / 17) / 8.0;
    const double off = model.phase(x, y, 1, {found_eye.x, found_eye.y, found_eye.z}) -
                       bench.ground_truth_phase(x, y, 1, true_eye, lab::LightMiddle::Centroid);
    worst = std::max(worst, std::abs(off - std::round(off)));
  }
  return worst;
}

void print_numbers(const char* name, const std::vector<double>& numbers) {
  std::printf(", \"%s\": [", name);
  for (size_t i = 0; i < numbers.size(); ++i) std::printf("%s%.9g", i == 0 ? "" : ", ", numbers[i]);
  std::printf("]");
}

void print_errors(const lab::TrialErrors& errors) {
  std::printf(
      "\"worst_lenses\": %.6f, \"rms_lenses\": %.6f, \"pitch\": "
      "%.3e, \"slant\": %.3e, "
      "\"gap\": %.3e, \"map_rms_lenses\": %.6f",
      errors.worst_lenses, errors.rms_lenses, errors.pitch, errors.slant, errors.gap,
      errors.map_rms_lenses);
}

int evaluate(const std::string& file, const Vec3& found_eye) {
  const Trial trial = the_trial();
  const SimulatedBench bench = bench_of(trial);
  const optics::Rig rig = optics::load_rig(file);
  std::vector<double> pitches;
  for (const lab::TrialViewpoint& place : trial.viewpoints)
    pitches.push_back(true_effective_pitch(bench, trial, place.position_mm));
  std::printf("{");
  print_errors(lab::errors_of(rig, bench, trial));
  print_numbers("effective_pitch_subpx", pitches);
  print_numbers("worst_lenses_at_first", {worst_lenses_at(optics::OpticalModel(rig), found_eye,
                                                          bench, trial.viewpoints[0].position_mm)});
  std::printf("}\n");
  return 0;
}

int rehearse() {
  const lab::TrialResult result = lab::run_trial(the_trial());
  std::printf("{\"verdict\": \"%s\", \"failure\": \"%s\", ", to_string(result.calibration.verdict),
              result.failure.c_str());
  print_errors(result.errors);
  print_numbers("effective_pitch_errors", result.errors.effective_pitch);
  std::printf(", \"seconds\": %.1f}\n", result.wall_seconds);
  for (const std::string& reason : result.calibration.reasons) std::printf("%s\n", reason.c_str());
  return result.failure.empty() ? 0 : 1;
}

int run(const std::vector<std::string>& words) {
  if (words.size() == 2 && words[0] == "start") {
    optics::save_rig(the_trial().start, words[1]);
    return 0;
  }
  if (words.size() == 4 && words[0] == "look") {
    LookingCamera(words[1], words[2], words[3]).run();
    return 0;
  }
  if (words.size() == 5 && words[0] == "judge")
    return evaluate(words[1], {std::stod(words[2]), std::stod(words[3]), std::stod(words[4])});
  if (words.size() == 1 && words[0] == "rehearse") return rehearse();
  std::fprintf(stderr, "vm_calibration_camera start|look|judge|rehearse ...\n");
  return 2;
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  try {
    return lenticule::vm::run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_calibration_camera: %s\n", error.what());
    return 1;
  }
}
