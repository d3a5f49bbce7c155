// SPDX-License-Identifier: Apache-2.0
// lenticule compare: how far one picture, or one sequence, is from another.
#include <fmt/format.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "frames/compare.h"
#include "frames/image_io.h"
#include "frames/quilt.h"
#include "optics/rig_file.h"
#include "player/command.h"
#include "player/interrupt.h"
#include "player/progress.h"

namespace lenticule::player {
namespace {

constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};
constexpr std::array<int, 3> kLevels = {1, 8, 32};

struct CompareFlags {
  std::string reference;
  std::string test;
  std::string rig;
  int views = 0;
  std::optional<double> limit_psnr_db;
  bool json = false;
};

using FilePair = std::pair<std::filesystem::path, std::filesystem::path>;

/// Two files, or two patterns with the same numbers on both sides.
std::vector<FilePair> file_pairs(const CompareFlags& flags) {
  const bool pattern = frames::FilePattern::looks_like_pattern(flags.reference);
  if (pattern != frames::FilePattern::looks_like_pattern(flags.test))
    throw Error(ErrorKind::Usage, "compare: a pattern on one side only",
                "give two files, or two patterns like a/%05d.png b/%05d.png");
  if (!pattern) return {{flags.reference, flags.test}};

  const frames::FilePattern reference(flags.reference), test(flags.test);
  const std::vector<uint64_t> numbers = reference.existing();
  if (numbers.empty())
    throw Error(ErrorKind::Input, fmt::format("{}: no such files", flags.reference));
  const std::vector<uint64_t> others = test.existing();
  if (others.size() > numbers.size())
    throw Error(ErrorKind::Input, fmt::format("{}: {} files, the reference has {}", flags.test,
                                              others.size(), numbers.size()));
  std::vector<FilePair> pairs;
  for (const uint64_t number : numbers)
    pairs.emplace_back(reference.path(number), test.path(number));
  return pairs;
}

nlohmann::json to_json(const frames::Difference& difference) {
  nlohmann::json json = {{"samples", difference.samples()},
                         {"mse", difference.mse()},
                         {"rmse", difference.rmse()},
                         {"psnr_db", nullptr},
                         {"max", difference.max()}};
  if (const auto psnr = difference.psnr_db()) json["psnr_db"] = *psnr;
  for (const int level : kLevels)
    json[fmt::format("over_{}", level)] = difference.count_over(level);
  return json;
}

/// Measures one pair; `model` is null without a rig.
nlohmann::json compare_pair(const FilePair& files, const optics::OpticalModel* model, int views) {
  const frames::WovenFrame reference = frames::read_woven(files.first);
  frames::WovenFrame test(reference.geometry());
  frames::read_woven_into(files.second, test);

  const auto difference = frames::compare_pictures(reference.view(), test.view());
  nlohmann::json json = {{"reference", files.first.string()},
                         {"test", files.second.string()},
                         {"total", to_json(difference.total)}};
  for (size_t c = 0; c < kChannelNames.size(); ++c)
    json["channels"][kChannelNames[c]] = to_json(difference.channels[c]);
  if (!model) return json;

  const auto by_view = frames::compare_views(reference.view(), test.view(), *model, views);
  for (const frames::Difference& view : by_view) json["views"].push_back(to_json(view));
  json["worst_view"] = frames::worst_view(by_view);
  return json;
}

std::string psnr_text(const nlohmann::json& difference) {
  const nlohmann::json& psnr = difference["psnr_db"];
  return psnr.is_null() ? "equal" : fmt::format("{:.2f} dB", psnr.get<double>());
}

void print_line(const std::string& label, const nlohmann::json& d) {
  fmt::print("{:<10} {:>11} {:>9.4f} {:>4} {:>10} {:>10} {:>10}\n", label, psnr_text(d),
             d["rmse"].get<double>(), d["max"].get<int>(), d["over_1"].get<uint64_t>(),
             d["over_8"].get<uint64_t>(), d["over_32"].get<uint64_t>());
}

void print_heading() {
  fmt::print("{:<10} {:>11} {:>9} {:>4} {:>10} {:>10} {:>10}\n", "", "PSNR", "RMSE", "max",
             "over 1", "over 8", "over 32");
}

void print_pair(const nlohmann::json& pair) {
  print_heading();
  for (const char* channel : kChannelNames) print_line(channel, pair["channels"][channel]);
  print_line("total", pair["total"]);
  if (!pair.contains("views")) return;
  for (size_t view = 0; view < pair["views"].size(); ++view)
    print_line(fmt::format("view {}", view), pair["views"][view]);
  fmt::print("worst view: {}\n", pair["worst_view"].get<int>());
}

void print_report(const nlohmann::json& report) {
  const auto& frames = report["frames"];
  if (frames.size() == 1) return print_pair(frames[0]);
  print_heading();
  for (size_t n = 0; n < frames.size(); ++n)
    print_line(fmt::format("frame {}", n), frames[n]["total"]);
  fmt::print("worst frame: {} ({}, {})\n", report["worst_frame"].get<size_t>(),
             report["worst"]["test"].get<std::string>(), psnr_text(report["worst"]["total"]));
}

void check_limit(const CompareFlags& flags, const nlohmann::json& worst) {
  const nlohmann::json& psnr = worst["total"]["psnr_db"];
  if (!flags.limit_psnr_db || psnr.is_null() || psnr.get<double>() >= *flags.limit_psnr_db) return;
  throw Error(ErrorKind::Quality, fmt::format("{}: {:.2f} dB, below the limit of {} dB",
                                              worst["test"].get<std::string>(), psnr.get<double>(),
                                              *flags.limit_psnr_db));
}

ExitCode run_compare(const CompareFlags& flags) {
  if (flags.views != 0 && flags.rig.empty())
    throw Error(ErrorKind::Usage, "--views: needs --rig to know which subpixel belongs to which");
  std::optional<optics::OpticalModel> model;
  if (!flags.rig.empty()) model.emplace(optics::load_rig(flags.rig));
  int views = flags.views;
  if (model && views == 0) views = frames::native_view_count(model->rig());

  const std::vector<FilePair> pairs = file_pairs(flags);
  nlohmann::json report = {{"frames", nlohmann::json::array()}};
  size_t worst = 0;
  Progress progress("compare", "frames", pairs.size());
  for (size_t n = 0; n < pairs.size(); ++n) {
    if (interrupted()) return interrupt_exit_code();
    report["frames"].push_back(compare_pair(pairs[n], model ? &*model : nullptr, views));
    const auto mse_of = [&](size_t frame) {
      return report["frames"][frame]["total"]["mse"].get<double>();
    };
    if (mse_of(n) > mse_of(worst)) worst = n;
    progress.update(n + 1);
  }
  progress.finish();
  report["worst_frame"] = worst;
  report["worst"] = report["frames"][worst];
  if (flags.json)
    print_json(report);
  else
    print_report(report);
  check_limit(flags, report["worst"]);
  return kOk;
}

}  // namespace

Run declare_compare(CLI::App& app) {
  const auto flags = std::make_shared<CompareFlags>();
  app.add_option("reference", flags->reference, "picture, or pattern of pictures")->required();
  app.add_option("test", flags->test, "the same to be measured against it")->required();
  app.add_option("--rig", flags->rig, "rig file: adds figures per view");
  app.add_option("--views", flags->views, "number of views (as many as subpixels under a lens)")
      ->check(CLI::Range(1, frames::kMaxViews));
  app.add_option("--limit-psnr", flags->limit_psnr_db,
                 "exit code 5 if the worst frame's total PSNR is below this, in dB");
  app.add_flag("--json", flags->json, "print the figures as JSON; psnr_db is null where equal");
  return [flags] { return run_compare(*flags); };
}

}  // namespace lenticule::player
