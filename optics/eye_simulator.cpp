// SPDX-License-Identifier: Apache-2.0
// For each point on the lens sheet the simulator finds the lens at the point, finds the panel
// position that the lens shows to the eye, and sums the subpixels around that position.
#include "optics/eye_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error_kinds.h"
#include "optics/row_rays.h"

namespace lenticule::optics {
namespace {

double linear_of_srgb(double v) {
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}
double srgb_of_linear(double v) {
  return v <= 0.0031308 ? v * 12.92 : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055;
}

/// Transfer converts between sRGB codes and linear light. 2^16 steps of linear light are 20 per
/// code where codes are closest, so every code survives the round trip.
class Transfer {
 public:
  Transfer() {
    for (size_t code = 0; code < linear_.size(); ++code)
      linear_[code] = static_cast<float>(linear_of_srgb(static_cast<double>(code) / 255.0));
    for (size_t step = 0; step < code_.size(); ++step) {
      const double linear = static_cast<double>(step) / static_cast<double>(code_.size() - 1);
      code_[step] = static_cast<uint8_t>(std::lround(255.0 * srgb_of_linear(linear)));
    }
  }
  [[nodiscard]] float linear(uint8_t code) const { return linear_[code]; }
  [[nodiscard]] uint8_t code(double linear) const {
    const double step = std::clamp(linear, 0.0, 1.0) * (static_cast<double>(code_.size()) - 1.0);
    return code_[static_cast<size_t>(step + 0.5)];
  }

 private:
  std::array<float, 256> linear_{};
  std::vector<uint8_t> code_ = std::vector<uint8_t>(1u << 16);
};

/// PhaseRows holds the phases of the few panel rows that one row of the picture uses.
class PhaseRows {
 public:
  PhaseRows(const OpticalModel& model, const Eye& eye)
      : width_px_(model.rig().panel.width_px), evaluator_(model, eye) {}

  const std::vector<double>& row(int j) {
    Kept& kept = kept_[static_cast<size_t>(j) % kept_.size()];
    if (kept.row != j) {
      evaluator_.evaluate(j, 0, width_px_, kept.phase);
      kept.row = j;
    }
    return kept.phase;
  }

 private:
  struct Kept {
    int row = -1;
    std::vector<double> phase;
  };
  int width_px_;
  RowPhaseEvaluator evaluator_;
  std::array<Kept, 8> kept_;
};

/// Returns the number of columns to either side in which a subpixel may be the nearest or may have
/// a weight.
int window_columns(const OpticalModel& model, double sigma) {
  const bool is_table = model.rig().panel.layout.name() == "cells";
  const double reach_px = 4.0 * sigma * model.rig().sheet.pitch.value / 3.0;
  return 1 + (is_table ? 4 : 0) + static_cast<int>(std::ceil(reach_px));
}

/// LensSpot computes the linear light of one channel that a lens shows: the subpixels of one row
/// around `column`, weighted by the distance of their phase from the lens.
class LensSpot {
 public:
  LensSpot(const OpticalModel& model, double sigma, const Transfer& transfer)
      : window_(window_columns(model, sigma)),
        inverse_variance_(sigma > 0.0 ? 0.5 / (sigma * sigma) : std::numeric_limits<double>::max()),
        transfer_(transfer) {}

  [[nodiscard]] double light(const uint8_t* pixels, const std::vector<double>& phase, int column,
                             int channel, double lens) const {
    const int width = static_cast<int>(phase.size() / 3);
    const int begin = std::max(0, column - window_), end = std::min(width, column + window_ + 1);
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = begin; i < end; ++i)
      nearest = std::min(nearest, square_distance(phase, i, channel, lens));
    double sum = 0.0, weights = 0.0;
    for (int i = begin; i < end; ++i) {
      // Weights are relative to the nearest subpixel: even a subpixel far out in the tail may be
      // the only visible one.
      const double exponent =
          (square_distance(phase, i, channel, lens) - nearest) * inverse_variance_;
      if (!(exponent < 16.0)) continue;
      const double weight = std::exp(-exponent);
      sum += weight * static_cast<double>(transfer_.linear(pixels[3 * i + channel]));
      weights += weight;
    }
    return weights > 0.0 ? sum / weights : 0.0;
  }

 private:
  static double square_distance(const std::vector<double>& phase, int i, int channel, double lens) {
    const double d = phase[static_cast<size_t>(3 * i + channel)] - lens;
    return d * d;
  }

  int window_;
  double inverse_variance_;
  const Transfer& transfer_;
};

/// Look is the lens above a point of the sheet, and the panel pixel that the lens shows to the eye.
struct Look {
  double lens;
  int column;
  int row;
  bool on_panel;
};

Look look_through(const OpticalModel& model, const Eye& eye, double x_px, double y_px) {
  constexpr int kGreen = 1;  // the other channels' offsets are relative to green
  const Panel& panel = model.rig().panel;
  const LensPlace place = split_phase(model.lens_coordinate(x_px, y_px, kGreen));
  const double apex_px = x_px - place.place * model.rig().sheet.pitch.value / 3.0;
  const Vec2 apex{panel.x_mm(apex_px), panel.y_mm(y_px)};
  const Vec2 seen = apex - model.refraction_shift_mm(apex, eye);
  const double column = std::floor(panel.x_px(seen.x)), row = std::floor(panel.y_px(seen.y));
  if (!(column >= 0 && column < panel.width_px && row >= 0 && row < panel.height_px))
    return {0.0, 0, 0, false};
  return {static_cast<double>(place.lens), static_cast<int>(column), static_cast<int>(row), true};
}

void check_eye(const Eye& eye) {
  const bool in_front = eye.z_mm > 0.0;  // true for infinity, false for NaN
  if (in_front && std::isfinite(eye.x) && std::isfinite(eye.y)) return;
  throw input_error("eye at {}, {}, {} mm: not in front of the panel", eye.x, eye.y, eye.z_mm)
      .remedy("z is the distance from the panel, in millimetres, and must be greater than 0");
}

void check_frame(const Panel& panel, const RgbView& woven) {
  if (woven.width != panel.width_px || woven.height != panel.height_px) {
    throw input_error("woven frame: {}x{} pixels, but the rig's panel has {}x{}", woven.width,
                      woven.height, panel.width_px, panel.height_px)
        .remedy("use the rig that the frame was woven for");
  }
  LENTICULE_CHECK(woven.pixels != nullptr &&
                  woven.stride_bytes >= 3 * static_cast<size_t>(woven.width));
}

int output_side(int requested, int panel_side) {
  if (requested < 0 || requested > kMaxPanelPixels) {
    throw usage_error("eye picture: size {} pixels is out of range", requested)
        .remedy(fmt::format("use 1 to {}, or 0 for half the panel", kMaxPanelPixels));
  }
  return requested > 0 ? requested : (panel_side + 1) / 2;
}

}  // namespace

RgbPicture simulate_eye(const OpticalModel& model, RgbView woven, const Eye& eye,
                        const EyeOptions& options) {
  const Rig& rig = model.rig();
  const Panel& panel = rig.panel;
  check_frame(panel, woven);
  check_eye(eye);
  const double sigma = rig.sheet.spot_sigma.value;
  const Transfer transfer;
  const LensSpot spot(model, std::min(sigma, 1.0), transfer);
  PhaseRows phases(model, eye);

  RgbPicture picture{.width = output_side(options.width, panel.width_px),
                     .height = output_side(options.height, panel.height_px),
                     .pixels = {}};
  picture.pixels.resize(3 * static_cast<size_t>(picture.width) *
                        static_cast<size_t>(picture.height));
  uint8_t* out = picture.pixels.data();
  for (int v = 0; v < picture.height; ++v) {
    const double y_px = (v + 0.5) * panel.height_px / picture.height;
    for (int u = 0; u < picture.width; ++u, out += 3) {
      const double x_px = (u + 0.5) * panel.width_px / picture.width;
      const Look look = look_through(model, eye, x_px, y_px);
      if (!look.on_panel) continue;  // black beyond the edge of the panel
      const uint8_t* pixels = woven.pixels + static_cast<size_t>(look.row) * woven.stride_bytes;
      const std::vector<double>& phase = phases.row(look.row);
      for (int c = 0; c < 3; ++c)
        out[c] = transfer.code(spot.light(pixels, phase, look.column, c, look.lens));
    }
  }
  return picture;
}

double largest_phase_difference(const Rig& a, const Eye& eye_a, const Rig& b, const Eye& eye_b) {
  constexpr int kSteps = 16, kGreen = 1;
  const OpticalModel model_a(a), model_b(b);
  double largest = 0.0;
  for (int row = 0; row <= kSteps; ++row)
    for (int column = 0; column <= kSteps; ++column) {
      const double x = static_cast<double>(a.panel.width_px) * column / kSteps;
      const double y = static_cast<double>(a.panel.height_px) * row / kSteps;
      const double off = model_a.phase(x, y, kGreen, eye_a) - model_b.phase(x, y, kGreen, eye_b);
      largest = std::max(largest, std::abs(off - std::round(off)));
    }
  return largest;
}

}  // namespace lenticule::optics
