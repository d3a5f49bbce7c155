// SPDX-License-Identifier: Apache-2.0
// Writes the simulated camera's pictures of white, of fringes and of a lit half as PNG:
// simulated_bench_pictures FOLDER. Prints the processor time of tracing and gathering on one
// thread.
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>

#include "bench_stage.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "lab/panel/simulated_bench.h"

namespace {

using namespace lenticule;

void write_picture(const calib::CameraPicture& picture, const std::filesystem::path& file) {
  frames::WovenFrame frame({picture.width, picture.height, frames::PixelFormat::Rgb8});
  for (size_t i = 0; i < frame.bytes().size(); ++i) {
    const size_t from = picture.channels == 3 ? i : i / 3;
    frame.bytes()[i] = frames::code_from_linear(double{picture.light[from]});
  }
  frames::write_woven(frame.view(), file);
}

/// Prints mean and deviation of the middle of the picture, which show the noise of white.
void print_middle(const calib::CameraPicture& picture) {
  for (int channel = 0; channel < picture.channels; ++channel) {
    double sum = 0.0;
    double squares = 0.0;
    int count = 0;
    for (int row = picture.height * 2 / 5; row < picture.height * 3 / 5; ++row) {
      for (int column = picture.width * 2 / 5; column < picture.width * 3 / 5; ++column, ++count) {
        const double light = double{lab::light_at(picture, column, row, channel)};
        sum += light;
        squares += light * light;
      }
    }
    const double mean = sum / count;
    std::printf("channel %d: mean %.4f, deviation %.4f\n", channel, mean,
                std::sqrt(squares / count - mean * mean));
  }
}

/// A stopwatch of processor time, which other programs do not affect.
class Stopwatch {
 public:
  void report(const char* what) {
    const std::clock_t now = std::clock();
    std::printf("%-28s %6.0f ms\n", what,
                1000.0 * static_cast<double>(now - started_) / CLOCKS_PER_SEC);
    started_ = now;
  }

 private:
  std::clock_t started_ = std::clock();
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  optics::Panel panel;
  panel.width_px = 3840;
  panel.height_px = 2160;
  panel.pixel_width = panel.pixel_height = Millimetres(0.15565);
  lab::SimulatedSheet sheet = lab::focused_sheet(panel, 7.701, 0.2521);
  sheet.deformation_lenses = 0.1;
  sheet.bubbles = 0.02;
  lab::SimulatedCamera camera;
  camera.position_mm = {60, 40, 700};
  camera.roll_degrees = 2.0;
  camera.focal_px = 1500;
  camera.k1 = -0.04;
  camera.shot_noise = 0.01;
  camera.jpeg_quality = 90;
  lab::SimulatedPanelLink link;
  link.response_ms = 8.0;
  lab::SimulatedBench bench(panel, sheet, link, camera, 1);
  bench.set_threads(1);
  const auto white = lab::plain_frame(panel, 255, 255, 255);
  const double seen = 7.701 * (1.0 + lenticule::lab::chief_ray(sheet, 1).gap_mm / 700.0);
  const auto null = lab::fringe_frame(panel, seen, 0.2521, 0.0);
  const auto fringes = lab::fringe_frame(panel, seen * 1.01, 0.2521, 0.0);
  Stopwatch watch;
  calib::CameraPicture picture = lab::look(bench, white);
  watch.report("trace, 4 pictures");
  print_middle(picture);
  write_picture(picture, folder / "white.png");
  watch.report("write");
  picture = lab::look(bench, fringes);
  watch.report("show, gather, 4 pictures");
  if (bench.camera().grab(picture, lab::kLong) != calib::GrabStatus::Ready) return 1;
  watch.report("one more picture");
  write_picture(picture, folder / "fringes.png");
  write_picture(lab::look(bench, null), folder / "null.png");
  return 0;
}
