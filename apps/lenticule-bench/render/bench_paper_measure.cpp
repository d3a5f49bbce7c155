// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_timing.h"
#include "apps/lenticule-bench/render/bench_paper.h"
#include "apps/lenticule-tools/offline/built_in_scene.h"
#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "frames/compare.h"
#include "optics/model.h"
#include "player/process/interrupt.h"
#include "render/make_method.h"
#include "render/scene/scene.h"

namespace lenticule::bench {
namespace {

/// One method in one run; it may keep data of its last frame.
struct Contestant {
  std::unique_ptr<render::Method> method;
  frames::WovenFrame frame;
};

/// The measurements of all runs of one method for one frame.
struct Taken {
  std::vector<double> wall_s, cpu_s, build_s;
  render::RenderStatistics statistics;
};

class SpanRun {
 public:
  SpanRun(const PaperSetup& setup, const PaperSpan& span)
      : setup_(setup),
        model_(setup.rig),
        scene_(scenes::find_scene(span.scene)),
        stages_(tools::describe_built_in(scene_), model_, {}) {
    const frames::FrameGeometry geometry{setup.rig.panel.width_px, setup.rig.panel.height_px,
                                         frames::PixelFormat::Rgb8};
    render::RenderOptions options;
    options.threads = setup.threads;
    options.max_depth = setup.depth;
    options.cancelled = [] { return player::interrupted(); };
    for (int run = 0; run < setup.runs; ++run)
      for (const std::string& name : setup.methods) {
        const PaperMethod one{name};
        options.reuse = one.literal() ? render::literal_reuse() : render::ReuseOptions{};
        contestants_.push_back(
            {render::make_method(one.method(), model_, options), frames::WovenFrame(geometry)});
      }
  }

  nlohmann::json frame(int number) {
    const render::SceneDescription description = tools::describe_built_in(scene_, {}, number);
    const render::Stage stage = stages_.at(description);
    std::vector<Taken> taken(setup_.methods.size());
    const size_t rounds = contestants_.size();
    for (size_t turn = 0; turn < rounds && !player::interrupted(); ++turn) {
      // Each frame starts with another method, because later ones find warmer caches.
      const size_t i = (turn + static_cast<size_t>(number)) % rounds;
      contestants_[i].method->set_frame(static_cast<uint64_t>(number));
      race(contestants_[i], description, stage, taken[i % setup_.methods.size()]);
    }
    nlohmann::json methods;
    for (size_t m = 0; m < setup_.methods.size(); ++m)
      methods[setup_.methods[m]] = figures(taken[m], m);
    return {{"frame", number}, {"methods", std::move(methods)}};
  }

 private:
  /// Renders one frame. Each method has its own scene, because results of culling are stored in the
  /// scene.
  void race(Contestant& one, const render::SceneDescription& description,
            const render::Stage& stage, Taken& taken) const {
    const double start = seconds_now();
    const render::Scene scene(description, stage, {}, setup_.threads);
    taken.build_s.push_back(seconds_now() - start);
    const double cpu = process_cpu_seconds();
    const double begin = seconds_now();
    taken.statistics = one.method->render(scene, stage, one.frame);
    taken.wall_s.push_back(seconds_now() - begin);
    taken.cpu_s.push_back(process_cpu_seconds() - cpu);
  }

  nlohmann::json figures(const Taken& taken, size_t m) const {
    const render::RenderStatistics& s = taken.statistics;
    nlohmann::json out = {
        {"wall_s", median(taken.wall_s)},     {"cpu_s", median(taken.cpu_s)},
        {"build_s", median(taken.build_s)},   {"rays", all_rays(s)},
        {"subpixels", s.subpixels},           {"traced", s.traced_subpixels},
        {"projected", s.projected_subpixels}, {"interpolated", s.interpolated_subpixels},
        {"missing", s.missing_subpixels}};
    if (m != 0) add_errors(contestants_[m].frame, out);
    return out;
  }

  void add_errors(const frames::WovenFrame& frame, nlohmann::json& out) const {
    const frames::FrameView reference = contestants_.front().frame.view();
    const frames::PictureDifference off = frames::compare_pictures(reference, frame.view());
    const std::vector<frames::Difference> views = frames::compare_views(
        reference, frame.view(), model_, frames::native_view_count(setup_.rig));
    out["mse"] = {off.channels[0].mse(), off.channels[1].mse(), off.channels[2].mse()};
    out["max"] = off.total.max();
    out["share_over_8"] = off.total.share_over(8);
    out["share_over_32"] = off.total.share_over(32);
    out["worst_view_mse"] = views[static_cast<size_t>(frames::worst_view(views))].mse();
  }

  const PaperSetup& setup_;
  optics::OpticalModel model_;
  const scenes::BuiltInScene& scene_;
  tools::StageSequence stages_;
  std::vector<Contestant> contestants_;  ///< run by run, in the order of the methods
};

double mean_of(const nlohmann::json& mse) {
  return (mse[0].get<double>() + mse[1].get<double>() + mse[2].get<double>()) / 3.0;
}

/// Sums of one method over all frames.
struct Sums {
  int frames = 0, differing = 0, max = 0, worst_frame = 0;
  double wall_s = 0, cpu_s = 0, build_s = 0, rays = 0, subpixels = 0, traced = 0, missing = 0;
  double psnr = 0, worst_mse = 0, worst_view_mse = 0, over_8 = 0, over_32 = 0;

  void add(int frame, const nlohmann::json& f) {
    ++frames;
    wall_s += f["wall_s"].get<double>();
    cpu_s += f["cpu_s"].get<double>();
    build_s += f["build_s"].get<double>();
    rays += f["rays"].get<double>();
    subpixels += f["subpixels"].get<double>();
    traced += f["traced"].get<double>();
    missing += f["missing"].get<double>();
    if (f.contains("mse")) add_errors(frame, f);
  }

  void add_errors(int frame, const nlohmann::json& f) {
    const double mse = mean_of(f["mse"]);
    if (mse > 0.0) {
      ++differing;
      psnr += 10.0 * std::log10(255.0 * 255.0 / mse);
    }
    if (mse > worst_mse) {
      worst_mse = mse;
      worst_frame = frame;
    }
    worst_view_mse = std::max(worst_view_mse, f["worst_view_mse"].get<double>());
    max = std::max(max, f["max"].get<int>());
    over_8 += f["share_over_8"].get<double>();
    over_32 += f["share_over_32"].get<double>();
  }
};

nlohmann::json figures_of(const std::string& name, const Sums& s, double reference_s) {
  return {{"name", name},
          {"seconds_per_frame", s.wall_s / s.frames},
          {"cpu_seconds_per_frame", s.cpu_s / s.frames},
          {"build_seconds_per_frame", s.build_s / s.frames},
          {"saved", reference_s > 0.0 ? 1.0 - s.wall_s / reference_s : 0.0},
          {"rays_per_subpixel", s.rays / s.subpixels},
          {"traced", s.traced / s.subpixels},
          {"missing", s.missing / s.subpixels},
          {"psnr_mean_db", s.differing > 0 ? nlohmann::json(s.psnr / s.differing) : nullptr},
          {"psnr_worst_db", psnr_or_null(s.worst_mse)},
          {"worst_frame", s.worst_frame},
          {"worst_view_psnr_db", psnr_or_null(s.worst_view_mse)},
          {"max", s.max},
          {"share_over_8", s.over_8 / s.frames},
          {"share_over_32", s.over_32 / s.frames}};
}

}  // namespace

std::string PaperMethod::method() const {
  return literal() ? name.substr(0, name.size() - kLiteral.size()) : name;
}

const std::vector<std::string>& paper_method_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = render::method_names();
    for (const char* of_the_paper : {"lens-view", "interpolate", "hybrid"})
      all.push_back(std::string(of_the_paper) + std::string(PaperMethod::kLiteral));
    return all;
  }();
  return names;
}

std::vector<PaperSpan> spans_of(const std::string& scene, int frames, int length, int spans) {
  const int most = (frames + length - 1) / length;
  const int count = spans == 0 ? most : std::min(spans, most);
  std::vector<PaperSpan> list;
  for (int i = 0; i < count; ++i) {
    // The middle of each of `count` equal parts.
    const int index = (2 * i + 1) * most / (2 * count);
    list.push_back({scene, index * length, std::min(length, frames - index * length)});
  }
  return list;
}

nlohmann::json measure_span(const PaperSetup& setup, const PaperSpan& span,
                            const std::function<void()>& done) {
  SpanRun run(setup, span);
  nlohmann::json frames = nlohmann::json::array();
  for (int i = 0; i < span.count; ++i) {
    frames.push_back(run.frame(span.first + i));
    if (player::interrupted()) return {};
    done();
  }
  return {{"scene", span.scene}, {"first", span.first}, {"frames", std::move(frames)}};
}

nlohmann::json summarize(const std::string& scene, const std::vector<nlohmann::json>& spans) {
  std::map<std::string, Sums> by_name;
  int frames = 0;
  for (const nlohmann::json& span : spans)
    for (const nlohmann::json& frame : span["frames"]) {
      ++frames;
      for (const auto& [name, figures] : frame["methods"].items())
        by_name[name].add(frame["frame"].get<int>(), figures);
    }
  const auto full = by_name.find("full");
  const double reference_s = full == by_name.end() ? 0.0 : full->second.wall_s;
  nlohmann::json methods = nlohmann::json::array();
  for (const std::string& name : paper_method_names())
    if (const auto found = by_name.find(name); found != by_name.end())
      methods.push_back(figures_of(name, found->second, reference_s));
  return {{"scene", scene},
          {"frames", frames},
          {"frames_of_sequence", scenes::find_scene(scene).frames},
          {"methods", std::move(methods)}};
}

}  // namespace lenticule::bench
