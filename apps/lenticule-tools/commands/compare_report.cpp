// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/commands/compare_report.h"

#include <fmt/format.h>

#include <array>
#include <string>

#include "base/print.h"
#include "frames/decoded_view.h"
#include "frames/image_io.h"
#include "frames/measures/flip.h"
#include "frames/similarity.h"

namespace lenticule::tools {
namespace {

using nlohmann::json;

constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};
constexpr std::array<int, 3> kLevels = {1, 8, 32};

json number_or_null(std::optional<double> number) {
  return number ? json(*number) : json(nullptr);
}

json figures_of(const frames::Difference& difference) {
  json figures = {{"samples", difference.samples()},
                  {"mse", difference.mse()},
                  {"rmse", difference.rmse()},
                  {"psnr_db", number_or_null(difference.psnr_db())},
                  {"max", difference.max()}};
  for (const int level : kLevels) {
    figures[fmt::format("over_{}", level)] = difference.count_over(level);
    figures[fmt::format("share_over_{}", level)] = difference.share_over(level);
  }
  return figures;
}

json figures_of(const frames::PictureDifference& difference) {
  json figures = {{"total", figures_of(difference.total)}};
  for (size_t c = 0; c < kChannelNames.size(); ++c)
    figures["channels"][kChannelNames[c]] = figures_of(difference.channels[c]);
  return figures;
}

// ---- table

constexpr int kLabelWidth = 14;

std::string text_of(const json& figures, const char* name, const char* format) {
  if (!figures.contains(name)) return "";
  if (figures[name].is_null()) return "-";
  return fmt::format(fmt::runtime(format), figures[name].get<double>());
}

std::string psnr_text(const json& figures) {
  const json& psnr = figures["psnr_db"];
  return psnr.is_null() ? "equal" : fmt::format("{:.2f} dB", psnr.get<double>());
}

std::string share_text(const json& figures, int level) {
  return fmt::format("{:.3f} %",
                     100.0 * figures[fmt::format("share_over_{}", level)].get<double>());
}

void print_heading() {
  print_out("{:<{}} {:>11} {:>9} {:>10} {:>4} {:>10} {:>10} {:>10} {:>7}\n", "", kLabelWidth,
            "PSNR", "RMSE", "MSE", "max", "over 1", "over 8", "over 32", "SSIM");
}

void print_line(const std::string& label, const json& d, const std::string& ssim = "") {
  print_out("{:<{}} {:>11} {:>9.4f} {:>10.4f} {:>4} {:>10} {:>10} {:>10} {:>7}\n", label,
            kLabelWidth, psnr_text(d), d["rmse"].get<double>(), d["mse"].get<double>(),
            d["max"].get<int>(), share_text(d, 1), share_text(d, 8), share_text(d, 32), ssim);
}

void print_channels(const json& figures, const std::string& prefix = "") {
  for (const char* channel : kChannelNames)
    print_line(prefix + channel, figures["channels"][channel]);
  print_line(prefix + "total", figures["total"]);
}

void print_flip(const json& flip) {
  print_out("FLIP: mean {:.4f}, 99 % of the pixels at most {:.4f} ({:g} pixels per degree)\n",
            flip["mean"].get<double>(), flip["percentile_99"].get<double>(),
            flip["pixels_per_degree"].get<double>());
}

void print_views(const json& frame) {
  print_out("subpixels of each view, and the picture that an eye there sees\n");
  for (size_t n = 0; n < frame["views"].size(); ++n) {
    const json& view = frame["views"][n];
    print_line(fmt::format("view {}", n), view);
    print_line("  seen", view["seen"]["total"], text_of(view["seen"], "ssim", "{:.4f}"));
  }
  print_out("worst view: {}\n", frame["worst_view"].get<int>());
}

void print_means(const json& report) {
  print_out("over {} frames (MSE pooled; SSIM the mean over frames)\n", report["frames"].size());
  print_channels(report["means"], "all ");
  print_out("means of frames: RMSE {:.4f}, PSNR {}\n", report["means"]["mean_rmse"].get<double>(),
            report["means"]["mean_psnr_db"].is_null()
                ? "equal"
                : fmt::format("{:.2f} dB", report["means"]["mean_psnr_db"].get<double>()));
  if (report["means"].contains("flip"))
    print_out("mean of frames: FLIP {:.4f}\n", report["means"]["flip"].get<double>());
  if (!report["means"].contains("views")) return;
  for (size_t n = 0; n < report["means"]["views"].size(); ++n) {
    const json& view = report["means"]["views"][n];
    print_line(fmt::format("view {} seen", n), view["total"], text_of(view, "ssim", "{:.4f}"));
  }
}

/// Prints both readings of the figures, because a published table of "RMSE" beside PSNR was found
/// to contain mean squared errors.
void print_readings(const json& whole) {
  const json& total = whole["total"];
  if (total["psnr_db"].is_null()) return;
  print_out(
      "compare a published \"RMSE\" with {:.4f}, or with {:.4f} if its PSNR shows that it is a "
      "mean square\n",
      total["rmse"].get<double>(), total["mse"].get<double>());
}

void print_sequence(const json& report) {
  const json& frames = report["frames"];
  print_heading();
  for (size_t n = 0; n < frames.size(); ++n)
    print_line(fmt::format("frame {}", n), frames[n]["total"]);
  print_means(report);
  print_out("worst frame: {} ({}, {})\n", report["worst_frame"].get<size_t>(),
            report["worst"]["test"].get<std::string>(), psnr_text(report["worst"]["total"]));
  if (report.contains("worst_view")) {
    const json& worst = report["worst_view"];
    print_out("worst view: {} of frame {} (seen {}, SSIM {})\n", worst["view"].get<int>(),
              worst["frame"].get<size_t>(), psnr_text(worst["seen"]["total"]),
              text_of(worst["seen"], "ssim", "{:.4f}"));
  }
  print_readings(report["means"]);
}

}  // namespace

void CompareReport::Pooled::add(const frames::PictureDifference& frame,
                                std::optional<double> ssim) {
  for (size_t c = 0; c < frame.channels.size(); ++c) difference.channels[c].add(frame.channels[c]);
  difference.total.add(frame.total);
  rmse_sum += frame.total.rmse();
  if (const auto psnr = frame.total.psnr_db()) {
    psnr_sum += *psnr;
    ++psnr_count;
  }
  if (ssim) {
    ssim_sum += *ssim;
    ++ssim_count;
  }
  ++frames;
}

nlohmann::json CompareReport::Pooled::figures() const {
  nlohmann::json figures = figures_of(difference);
  figures["mean_rmse"] = frames == 0 ? 0.0 : rmse_sum / static_cast<double>(frames);
  figures["mean_psnr_db"] = nullptr;
  if (psnr_count > 0) figures["mean_psnr_db"] = psnr_sum / static_cast<double>(psnr_count);
  if (ssim_count > 0) figures["ssim"] = ssim_sum / static_cast<double>(ssim_count);
  return figures;
}

CompareReport::CompareReport(const optics::OpticalModel* model, int views,
                             std::optional<double> flip_pixels_per_degree)
    : model_(model),
      views_(views),
      flip_pixels_per_degree_(flip_pixels_per_degree),
      seen_(model ? static_cast<size_t>(views) : 0) {}

nlohmann::json CompareReport::measure_flip(const frames::FrameView& reference,
                                           const frames::FrameView& test) {
  const frames::FlipFigures flip = frames::flip_figures(
      frames::flip_map({reference, *flip_pixels_per_degree_}, {test, *flip_pixels_per_degree_}));
  flip_sum_ += flip.mean;
  return {{"mean", flip.mean},
          {"percentile_99", flip.percentile_99},
          {"pixels_per_degree", *flip_pixels_per_degree_}};
}

nlohmann::json CompareReport::measure_view(const frames::FrameView& reference,
                                           const frames::FrameView& test,
                                           const frames::Difference& subpixels, int view) {
  const frames::WovenFrame a = frames::decode_view(reference, *model_, view, views_);
  const frames::WovenFrame b = frames::decode_view(test, *model_, view, views_);
  const auto difference = frames::compare_pictures(a.view(), b.view());
  const auto ssim = frames::structural_similarity(a.view(), b.view());
  seen_[static_cast<size_t>(view)].add(difference, ssim);
  nlohmann::json figures = figures_of(subpixels);
  figures["seen"] = figures_of(difference);
  figures["seen"]["ssim"] = number_or_null(ssim);
  return figures;
}

void CompareReport::note_worst_view(const nlohmann::json& views) {
  const auto mse = [](const nlohmann::json& view) {
    return view["seen"]["total"]["mse"].get<double>();
  };
  for (size_t view = 0; view < views.size(); ++view) {
    if (!worst_view_.is_null() && mse(views[view]) <= mse(worst_view_)) continue;
    worst_view_ = views[view];
    worst_view_["view"] = view;
    worst_view_["frame"] = frames_.size();
  }
}

void CompareReport::add(const PicturePair& files) {
  const frames::WovenFrame reference = frames::read_woven(files.reference);
  frames::WovenFrame test(reference.geometry());
  frames::read_woven_into(files.test, test);

  const auto difference = frames::compare_pictures(reference.view(), test.view());
  nlohmann::json frame = figures_of(difference);
  frame["reference"] = files.reference.string();
  frame["test"] = files.test.string();
  if (flip_pixels_per_degree_) frame["flip"] = measure_flip(reference.view(), test.view());
  if (model_) {
    const auto by_view = frames::compare_views(reference.view(), test.view(), *model_, views_);
    for (int view = 0; view < views_; ++view)
      frame["views"].push_back(
          measure_view(reference.view(), test.view(), by_view[static_cast<size_t>(view)], view));
    frame["worst_view"] = frames::worst_view(by_view);
    note_worst_view(frame["views"]);
  }
  whole_.add(difference, std::nullopt);
  const auto mse = [](const nlohmann::json& one) { return one["total"]["mse"].get<double>(); };
  if (!frames_.empty() && mse(frame) > mse(frames_[worst_frame_])) worst_frame_ = frames_.size();
  frames_.push_back(std::move(frame));
}

nlohmann::json CompareReport::json() const {
  nlohmann::json report = {{"frames", frames_},
                           {"worst_frame", worst_frame_},
                           {"worst", frames_.at(worst_frame_)},
                           {"means", whole_.figures()}};
  if (flip_pixels_per_degree_)
    report["means"]["flip"] = flip_sum_ / static_cast<double>(frames_.size());
  for (const Pooled& view : seen_) report["means"]["views"].push_back(view.figures());
  if (!worst_view_.is_null()) report["worst_view"] = worst_view_;
  return report;
}

void print_compare_report(const json& report) {
  const json& frames = report["frames"];
  if (frames.size() != 1) return print_sequence(report);
  print_heading();
  print_channels(frames[0]);
  if (frames[0].contains("flip")) print_flip(frames[0]["flip"]);
  if (frames[0].contains("views")) print_views(frames[0]);
  print_readings(frames[0]);
}

}  // namespace lenticule::tools
