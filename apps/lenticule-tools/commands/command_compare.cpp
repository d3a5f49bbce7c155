// SPDX-License-Identifier: Apache-2.0
// lenticule compare measures the difference between two pictures or sequences: it pairs the files,
// gathers the figures of each pair as JSON, and prints the JSON or a table made from it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"
#include "base/error_kinds.h"
#include "base/file.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/compare.h"
#include "frames/image_format.h"
#include "frames/image_io.h"
#include "frames/quilt.h"
#include "frames/weave.h"
#include "optics/model.h"
#include "optics/trim.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "player/process/rig_choice.h"

namespace lenticule::tools {
namespace {

struct PicturePair {
  std::filesystem::path reference;
  std::filesystem::path test;
};

std::vector<PicturePair> pairs_by_number(const std::string& reference_text,
                                         const std::string& test_text) {
  const frames::FilePattern reference(reference_text), test(test_text);
  const std::vector<uint64_t> numbers = reference.existing_or_throw();
  const std::vector<uint64_t> others = test.existing();
  if (others.size() > numbers.size())
    throw input_error("{}: {} files, the reference has {}", test_text, others.size(),
                      numbers.size())
        .remedy("remove those that have no counterpart");
  std::vector<PicturePair> pairs;
  for (const uint64_t number : numbers)
    pairs.push_back({reference.path(number), test.path(number)});
  return pairs;
}

/// Returns names in natural order, without hidden files and files that are not pictures.
std::vector<std::string> picture_names(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const std::filesystem::path& entry : entries_of(folder, &error)) {
    const std::string name = entry.filename().string();
    const std::string extension = entry.extension().string();
    if (!name.starts_with('.') &&
        frames::format_of_extension(extension) != frames::ImageFormat::Unknown)
      names.push_back(name);
  }
  if (error) throw input_error("{}: {}", folder.string(), error.message());
  if (names.empty())
    throw input_error("{}: no pictures", folder.string())
        .remedy("name a folder of PNG, TIFF, EXR or PPM files");
  return names;
}

std::vector<PicturePair> pairs_by_name(const std::filesystem::path& reference,
                                       const std::filesystem::path& test) {
  const std::vector<std::string> names = picture_names(reference);
  const std::vector<std::string> others = picture_names(test);
  const auto [name, other] = std::ranges::mismatch(names, others);
  if (name != names.end() || other != others.end()) {
    const bool in_test =
        other == others.end() || (name != names.end() && NaturalOrder()(*name, *other));
    const std::filesystem::path missing = in_test ? test / *name : reference / *other;
    throw input_error("{}: no such picture", missing.string())
        .remedy("both folders need pictures with the same names");
  }
  std::vector<PicturePair> pairs;
  for (const std::string& one : names) pairs.push_back({reference / one, test / one});
  return pairs;
}

/// Pairs two files; or the files of two patterns by number; or the pictures of two folders by name,
/// sorted by name. Throws Error(Usage) if the two are of different kinds, Error(Input) if there are
/// no files, the test has files that the reference lacks, or a folder lacks a picture of the other.
std::vector<PicturePair> picture_pairs(const std::string& reference, const std::string& test) {
  const auto both_are = [&](const char* what, const auto& is) {
    const bool one = is(reference);
    if (one == is(test)) return one;
    throw usage_error("compare: only one side is a {}", what)
        .remedy("give two files, two folders, or two patterns like a/%05d.png b/%05d.png");
  };
  if (both_are("pattern", frames::FilePattern::looks_like_pattern))
    return pairs_by_number(reference, test);
  if (both_are("folder", [](const std::filesystem::path& path) { return is_directory(path); }))
    return pairs_by_name(reference, test);
  return {{reference, test}};
}

/// Reads two pictures of one size. Throws the errors of reading them.
std::pair<frames::WovenFrame, frames::WovenFrame> read_pair(const PicturePair& files) {
  frames::WovenFrame reference = frames::read_woven(files.reference);
  frames::WovenFrame test(reference.geometry());
  frames::read_woven_into(files.test, test);
  return {std::move(reference), std::move(test)};
}

using nlohmann::json;

constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};
constexpr std::array<int, 3> kLevels = {1, 8, 32};

json number_or_null(std::optional<double> number) { return number ? json(*number) : json(nullptr); }

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

json figures_of(const frames::PictureDifference& difference, std::optional<double> over) {
  json figures = {{"total", figures_of(difference.total)}};
  // Differences are whole levels.
  if (over) figures["total"]["share_over"] = difference.total.share_over(static_cast<int>(*over));
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

std::string psnr_text(const json& figures, const char* key = "psnr_db") {
  const json& psnr = figures[key];
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
  const json& means = report["means"];
  print_channels(means, "all ");
  print_out("means of frames: RMSE {:.4f}, PSNR {}\n", means["mean_rmse"].get<double>(),
            psnr_text(means, "mean_psnr_db"));
  if (!means.contains("views")) return;
  for (size_t n = 0; n < means["views"].size(); ++n) {
    const json& view = means["views"][n];
    print_line(fmt::format("view {} seen", n), view["total"], text_of(view, "ssim", "{:.4f}"));
  }
}

/// Prints what the figures mean. Both readings of RMSE are there, because a published table of
/// "RMSE" beside PSNR was found to contain mean squared errors.
void print_readings(const json& whole, std::optional<double> over) {
  const json& total = whole["total"];
  if (over)
    print_out("{:.4f} % of the subpixels differ by more than {:g} levels\n",
              100.0 * total["share_over"].get<double>(), *over);
  if (total["psnr_db"].is_null()) return;
  print_out(
      "RMSE {:.4f}: root mean square over all subpixels, in levels of 0 to 255. A published "
      "\"RMSE\" "
      "whose PSNR is 10 log10(255^2 / RMSE) is a mean square; compare it with MSE {:.4f}\n",
      total["rmse"].get<double>(), total["mse"].get<double>());
}

void print_sequence(const json& report, std::optional<double> over) {
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
  print_readings(report["means"], over);
}

/// CompareReport measures pairs and accumulates the results. Figures of a set of samples are "mse",
/// "rmse", "psnr_db" (null if equal), "max", and "over_N" and "share_over_N": how many differ by
/// more than N levels. Totals have the same share for the given number of levels, "share_over".
class CompareReport {
 public:
  /// `model` may be null; then there are no figures per view. Lifetime: it must outlive the report.
  CompareReport(const optics::OpticalModel* model, int views, std::optional<double> over)
      : model_(model), views_(views), over_(over), seen_(model ? static_cast<size_t>(views) : 0) {}

  /// Adds a pair. Throws the errors of reading and comparing pictures.
  void add(const PicturePair& files) {
    const auto [reference, test] = read_pair(files);
    const auto difference = frames::compare_pictures(reference.view(), test.view());
    nlohmann::json frame = figures_of(difference, over_);
    frame["reference"] = files.reference.string();
    frame["test"] = files.test.string();
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

  /// Returns the added pair with the largest total MSE.
  [[nodiscard]] size_t worst_frame() const { return worst_frame_; }

  /// Returns "frames", "worst_frame", "worst" (a copy of that frame), "means" and, with a rig,
  /// "worst_view" {"frame", "view", ...}: the view with the largest difference in any frame.
  [[nodiscard]] nlohmann::json json() const {
    nlohmann::json report = {{"frames", frames_},
                             {"worst_frame", worst_frame_},
                             {"worst", frames_.at(worst_frame_)},
                             {"means", whole_.figures(over_)}};
    for (const Pooled& view : seen_) report["means"]["views"].push_back(view.figures(over_));
    if (!worst_view_.is_null()) report["worst_view"] = worst_view_;
    return report;
  }

 private:
  /// Figures of a picture in its three channels, pooled over frames.
  struct Pooled {
    frames::PictureDifference difference;
    double psnr_sum = 0.0;
    size_t psnr_count = 0;  ///< number of frames that differ
    double rmse_sum = 0.0;
    double ssim_sum = 0.0;
    size_t ssim_count = 0;
    size_t frames = 0;

    void add(const frames::PictureDifference& frame, std::optional<double> ssim) {
      for (size_t c = 0; c < frame.channels.size(); ++c)
        difference.channels[c].add(frame.channels[c]);
      difference.total.add(frame.total);
      rmse_sum += frame.total.rmse();
      const auto psnr = frame.total.psnr_db();
      psnr_sum += psnr.value_or(0.0);
      psnr_count += psnr ? 1 : 0;
      ssim_sum += ssim.value_or(0.0);
      ssim_count += ssim ? 1 : 0;
      ++frames;
    }
    [[nodiscard]] nlohmann::json figures(std::optional<double> over) const {
      const auto mean = [](double sum, size_t count) { return sum / static_cast<double>(count); };
      nlohmann::json figures = figures_of(difference, over);
      figures["mean_rmse"] = frames == 0 ? 0.0 : mean(rmse_sum, frames);
      figures["mean_psnr_db"] = nullptr;
      if (psnr_count > 0) figures["mean_psnr_db"] = mean(psnr_sum, psnr_count);
      if (ssim_count > 0) figures["ssim"] = mean(ssim_sum, ssim_count);
      return figures;
    }
  };

  nlohmann::json measure_view(const frames::FrameView& reference, const frames::FrameView& test,
                              const frames::Difference& subpixels, int view) {
    const frames::WovenFrame a = frames::decode_view(reference, *model_, view, views_);
    const frames::WovenFrame b = frames::decode_view(test, *model_, view, views_);
    const auto difference = frames::compare_pictures(a.view(), b.view());
    const auto ssim = frames::structural_similarity(a.view(), b.view());
    seen_[static_cast<size_t>(view)].add(difference, ssim);
    nlohmann::json figures = figures_of(subpixels);
    figures["seen"] = figures_of(difference, over_);
    figures["seen"]["ssim"] = number_or_null(ssim);
    return figures;
  }

  void note_worst_view(const nlohmann::json& views) {
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

  const optics::OpticalModel* model_;
  int views_;
  std::optional<double> over_;
  std::vector<nlohmann::json> frames_;
  size_t worst_frame_ = 0;
  Pooled whole_;
  std::vector<Pooled> seen_;  ///< per view, as an eye sees it
  nlohmann::json worst_view_;
};

/// Prints the table for people, made from the JSON.
void print_compare_report(const json& report, std::optional<double> over) {
  const json& frames = report["frames"];
  if (frames.size() != 1) return print_sequence(report, over);
  print_heading();
  print_channels(frames[0]);
  if (frames[0].contains("views")) print_views(frames[0]);
  print_readings(frames[0], over);
}

struct CompareFlags {
  std::string reference;
  std::string test;
  std::string rig;
  int views = 0;
  std::string picture;
  std::optional<double> limit_psnr_db;
  std::optional<double> over;
  bool json = false;
};

void check_limit(const CompareFlags& flags, const nlohmann::json& worst) {
  const nlohmann::json& psnr = worst["total"]["psnr_db"];
  if (!flags.limit_psnr_db || psnr.is_null() || psnr.get<double>() >= *flags.limit_psnr_db) return;
  throw quality_error("{}: {:.2f} dB, below the limit of {} dB", worst["test"].get<std::string>(),
                      psnr.get<double>(), *flags.limit_psnr_db);
}

void write_error_picture(const PicturePair& files, const std::string& output) {
  const auto [reference, test] = read_pair(files);
  frames::write_woven(frames::error_picture(reference.view(), test.view()).view(), output);
}

ExitCode run_compare(const CompareFlags& flags) {
  if (!flags.picture.empty()) frames::check_writable_format(flags.picture);
  std::optional<optics::OpticalModel> model;
  if (!flags.rig.empty()) model.emplace(optics::load_trimmed_rig(flags.rig));
  int views = flags.views;
  if (model && views == 0) views = frames::native_view_count(model->rig());

  const std::vector<PicturePair> pairs = picture_pairs(flags.reference, flags.test);
  CompareReport measured(model ? &*model : nullptr, views, flags.over);
  player::Progress progress("compare", "frames", pairs.size());
  for (size_t n = 0; n < pairs.size(); ++n) {
    if (player::interrupted()) return player::interrupt_exit_code();
    measured.add(pairs[n]);
    progress.update(n + 1);
  }
  progress.finish();
  const nlohmann::json report = measured.json();
  if (!flags.picture.empty()) write_error_picture(pairs[measured.worst_frame()], flags.picture);
  print_result(report, flags.json,
               [&](const json& figures) { print_compare_report(figures, flags.over); });
  check_limit(flags, report["worst"]);
  return kOk;
}

}  // namespace

cli::Run declare_compare(CLI::App& app) {
  const auto flags = std::make_shared<CompareFlags>();
  app.add_option("REFERENCE", flags->reference, "picture, folder or pattern of pictures")
      ->required();
  app.add_option("TEST", flags->test, "picture, folder or pattern to compare with the reference")
      ->required();
  cli::add_option(app, "--rig RIG.toml", flags->rig,
                  "rig file: adds figures per view, and SSIM of what eyes see");
  app.add_option("--views", flags->views, "number of views")
      ->default_str("subpixels under a lens")
      ->check(CLI::Range(1, frames::kMaxViews));
  cli::add_option(app, "--picture FILE", flags->picture,
                  "picture of where the worst frame differs\n"
                  "Black 0, blue 2, green 8, yellow 27, red 83, white 255 levels.");
  cli::add_option(app, "--limit-psnr DB", flags->limit_psnr_db,
                  "exit code 5 if the worst frame's total PSNR is below this");
  cli::add_option(app, "--over LEVELS", flags->over,
                  "also print the share of the subpixels that differ by more; share_over in JSON")
      ->check(CLI::Range(0.0, 255.0));
  app.add_flag("--json", flags->json, "print the figures as JSON; psnr_db is null where equal");
  return [flags] {
    if (flags->views != 0) flags->rig = player::choose_rig({.given = flags->rig}).file;
    return run_compare(*flags);
  };
}
}  // namespace lenticule::tools
