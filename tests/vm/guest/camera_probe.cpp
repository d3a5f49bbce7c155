// SPDX-License-Identifier: Apache-2.0
// Runs in the guest: captures from a camera as a calibration does, or sends pictures to it.
//   vm_camera_probe list                      paths and names of the cameras
//   vm_camera_probe set DEVICE NAME VALUE     sets a control, or presses a button
//   vm_camera_probe loop INPUT 0|1            connects vivid's HDMI input to its output, or not
//   vm_camera_probe send OUTPUT FORMAT        sends eight patches of colour, 1280x720, until killed
//   vm_camera_probe watch DEVICE FORMAT WIDTH HEIGHT RATE COUNT
// `watch` grabs COUNT pictures and prints a report. If the camera is lost, it is reopened once.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <thread>

#include "base/error.h"
#include "calib/cameras/v4l2_camera.h"
#include "video_node.h"

namespace lenticule::vm {
namespace {

using calib::Camera;
using calib::CameraPicture;
using calib::GrabStatus;
using std::chrono::seconds;

constexpr int output_width = 1280, output_height = 720;
constexpr int patch_count = 8;  // vertical bars, as in vivid's own colour bars

// R'G'B' in percent.
struct Colour {
  int red, green, blue;
};
constexpr Colour patches[] = {{100, 100, 100}, {100, 100, 0}, {0, 100, 100}, {0, 100, 0},
                              {100, 0, 100},   {100, 0, 0},   {0, 0, 100},   {50, 50, 50}};

// ---- sending ------------------------------------------------------------------------------------

uint8_t code(double value) { return static_cast<uint8_t>(std::lround(value)); }

double luma_of(const Colour& colour) {
  return (0.2126 * colour.red + 0.7152 * colour.green + 0.0722 * colour.blue) / 100.0;
}

// BT.709 with the numbers of the standard.
struct Codes {
  Codes(const Colour& colour, bool full) {
    const double luma = luma_of(colour);
    const double black = full ? 0.0 : 16.0, span = full ? 255.0 : 219.0;
    const double chroma_span = full ? 255.0 : 224.0;
    y = code(black + span * luma);
    cb = code(128.0 + chroma_span * (colour.blue / 100.0 - luma) / 1.8556);
    cr = code(128.0 + chroma_span * (colour.red / 100.0 - luma) / 1.5748);
    red = code(black + span * colour.red / 100.0);
    green = code(black + span * colour.green / 100.0);
    blue = code(black + span * colour.blue / 100.0);
  }
  uint8_t y, cb, cr, red, green, blue;
};

bool is_ycbcr(uint32_t format) {
  return format == V4L2_PIX_FMT_YUYV || format == V4L2_PIX_FMT_NV12;
}

// Returns the range that the driver reports, which may differ from the requested one.
bool is_full_range(const v4l2_pix_format& format) {
  if (format.quantization == V4L2_QUANTIZATION_DEFAULT) return !is_ycbcr(format.pixelformat);
  return format.quantization == V4L2_QUANTIZATION_FULL_RANGE;
}

const Colour& patch_at(int x) { return patches[x * patch_count / output_width]; }

// Writes one pixel's bytes; in 4:2:2 and NV12 only every second pixel sets the chroma.
void put_pixel(std::vector<uint8_t>& bytes, const v4l2_pix_format& format, int x, int y) {
  const Codes codes(patch_at(x), is_full_range(format));
  uint8_t* const row = &bytes[static_cast<size_t>(y) * format.bytesperline];
  switch (format.pixelformat) {
    case V4L2_PIX_FMT_RGB24:
      row[3 * x] = codes.red;
      row[3 * x + 1] = codes.green;
      row[3 * x + 2] = codes.blue;
      break;
    case V4L2_PIX_FMT_YUYV:
      row[2 * x] = codes.y;
      row[2 * x + 1] = x % 2 == 0 ? codes.cb : codes.cr;
      break;
    case V4L2_PIX_FMT_NV12: {
      row[x] = codes.y;
      const int below = (output_height + y / 2) * static_cast<int>(format.bytesperline);
      bytes[static_cast<size_t>(below + x)] = x % 2 == 0 ? codes.cb : codes.cr;
      break;
    }
    case V4L2_PIX_FMT_GREY:
      row[x] = codes.y;
      break;
    default:
      throw std::runtime_error("cannot send this format");
  }
}

uint32_t fourcc(const std::string& name) {
  if (name.size() != 4) throw std::runtime_error("a format has four letters");
  return v4l2_fourcc(static_cast<uint32_t>(name[0]), static_cast<uint32_t>(name[1]),
                     static_cast<uint32_t>(name[2]), static_cast<uint32_t>(name[3]));
}

int send(const std::string& path, const std::string& format_name) {
  VideoNode output(path, V4L2_BUF_TYPE_VIDEO_OUTPUT);
  v4l2_pix_format wanted{};
  wanted.width = output_width;
  wanted.height = output_height;
  wanted.pixelformat = fourcc(format_name);
  wanted.field = V4L2_FIELD_NONE;
  wanted.colorspace = V4L2_COLORSPACE_REC709;
  wanted.ycbcr_enc = V4L2_YCBCR_ENC_709;
  wanted.xfer_func = V4L2_XFER_FUNC_709;
  wanted.priv = V4L2_PIX_FMT_PRIV_MAGIC;  // the driver ignores these fields otherwise
  const v4l2_pix_format got = output.choose(wanted);
  std::vector<uint8_t> picture(got.sizeimage);
  for (int y = 0; y < output_height; ++y)
    for (int x = 0; x < output_width; ++x) put_pixel(picture, got, x, y);
  output.map_buffers();
  output.start(picture);
  std::printf("sending\n");
  std::fflush(stdout);
  while (true) output.next();
}

// ---- watching -----------------------------------------------------------------------------------

struct Tally {
  std::map<GrabStatus, int> grabs;
  uint64_t first_sequence = 0;
  uint64_t last_sequence = 0;
  calib::Nanoseconds last_time{0};
  int disorders = 0;

  void count(GrabStatus status, const CameraPicture& picture) {
    ++grabs[status];
    if (status != GrabStatus::Ready) return;
    if (grabs[status] == 1) {
      first_sequence = picture.sequence;
    } else if (picture.sequence <= last_sequence || picture.time <= last_time) {
      ++disorders;
    }
    last_sequence = picture.sequence;
    last_time = picture.time;
  }
};

void print_patches(const CameraPicture& picture) {
  for (int i = 0; i < patch_count; ++i) {
    const int x = (2 * i + 1) * picture.width / (2 * patch_count);
    const int y = picture.height / 2;
    std::printf("patch");
    for (int channel = 0; channel < picture.channels; ++channel) {
      const int place = (y * picture.width + x) * picture.channels + channel;
      std::printf(" %.4f", static_cast<double>(picture.light[static_cast<size_t>(place)]));
    }
    std::printf("\n");
  }
}

void print_lines(const char* word, const std::vector<std::string>& lines) {
  for (const std::string& line : lines) std::printf("%s %s\n", word, line.c_str());
}

void print_facts(const calib::CameraFacts& facts) {
  std::printf("facts %s %dx%d, %d channels, %.2f Hz, %s\n", facts.pixel_format.c_str(), facts.width,
              facts.height, facts.channels, facts.frames_per_second, facts.identity.c_str());
}

void print_tally(Tally& tally) {
  std::printf("ready %d, corrupt %d, timed out %d\n", tally.grabs[GrabStatus::Ready],
              tally.grabs[GrabStatus::Corrupt], tally.grabs[GrabStatus::TimedOut]);
  std::printf("disorders %d\n", tally.disorders);
  std::printf("span %llu\n",
              static_cast<unsigned long long>(tally.last_sequence - tally.first_sequence));
}

// Returns false if the camera was lost.
bool grab_all(Camera& camera, int count, Tally& tally) {
  CameraPicture picture;
  for (int i = 0; i < count; ++i) {
    const GrabStatus status = camera.grab(picture, seconds{20});
    if (status == GrabStatus::Gone) return false;
    tally.count(status, picture);
    if (i == 0) std::printf("streaming\n");
    std::fflush(stdout);
  }
  print_patches(picture);
  return true;
}

// Tries to open the camera for half a minute at most, until the driver is back.
std::unique_ptr<Camera> open_again(const calib::V4l2Options& options) {
  for (int tries = 0; tries < 150; ++tries) {
    try {
      return calib::open_v4l2_camera(options);
    } catch (const Error&) {
      std::this_thread::sleep_for(std::chrono::milliseconds{200});
    }
  }
  throw std::runtime_error("it did not come back");
}

int watch(const calib::V4l2Options& options, int count) {
  std::unique_ptr<Camera> camera = calib::open_v4l2_camera(options);
  print_facts(camera->facts());
  Tally tally;
  if (!grab_all(*camera, count, tally)) {
    std::printf("gone %s\n", camera->failure().c_str());
    std::fflush(stdout);
    camera = open_again(options);
    std::printf("open again\n");
    tally = {};
    if (!grab_all(*camera, 5, tally)) return 1;
  }
  print_tally(tally);
  print_lines("drift", camera->drifted_controls());
  print_lines("unlocked", camera->facts().unlocked);
  return 0;
}

int list() {
  for (const calib::CameraListing& camera : calib::list_cameras()) {
    std::printf("%s %s%s\n", camera.path.c_str(), camera.name.c_str(), camera.problem.c_str());
    for (const calib::FormatOffer& format : camera.formats)
      if (format.usable()) std::printf("  %s\n", format.pixel_format().c_str());
  }
  return 0;
}

int run(const std::vector<std::string>& words) {
  if (words.size() == 1 && words[0] == "list") return list();
  if (words.size() == 3 && words[0] == "send") return send(words[1], words[2]);
  if (words.size() == 4 && words[0] == "set") {
    VideoNode(words[1], V4L2_BUF_TYPE_VIDEO_CAPTURE).set_control(words[2], std::stoi(words[3]));
    return 0;
  }
  if (words.size() == 3 && words[0] == "loop") {
    VideoNode(words[1], V4L2_BUF_TYPE_VIDEO_CAPTURE).set_loop(words[2] == "1");
    return 0;
  }
  if (words.size() == 7 && words[0] == "watch") {
    calib::V4l2Options options;
    options.device = words[1];
    options.pixel_format = words[2];
    options.width = std::stoi(words[3]);
    options.height = std::stoi(words[4]);
    options.frames_per_second = std::stod(words[5]);
    return watch(options, std::stoi(words[6]));
  }
  std::fprintf(stderr, "vm_camera_probe list|set|send|watch ...\n");
  return 2;
}

}  // namespace
}  // namespace lenticule::vm

int main(int argc, char** argv) {
  try {
    return lenticule::vm::run({argv + 1, argv + argc});
  } catch (const lenticule::Error& error) {
    std::fprintf(stderr, "%s\n%s\n", error.what(), error.hint().c_str());
    return static_cast<int>(error.kind());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "vm_camera_probe: %s\n", error.what());
    return 1;
  }
}
