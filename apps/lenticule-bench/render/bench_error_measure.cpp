// SPDX-License-Identifier: Apache-2.0
// The measurement of `lenticule bench error`: its methods and scenes, what eyes at three places see
// of two frames, the scenarios that are rendered frame by frame with every method, and the pictures
// of the worst places.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <optional>

#include "apps/lenticule-bench/harness/bench.h"
#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-bench/render/bench_error.h"
#include "base/error.h"
#include "frames/compare.h"
#include "frames/image_io.h"
#include "frames/weave.h"
#include "lab/judges/gltf_writer.h"
#include "optics/model.h"
#include "player/process/interrupt.h"
#include "render/loaders/load_scene.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"

namespace lenticule::bench {

namespace {

constexpr std::string_view kGltf = "gltf:";
constexpr std::string_view kBuiltIn = "builtin:";
constexpr const char* kReference = "full";
/// The method that has a tolerated error.
constexpr const char* kTolerant = "adaptive";

ErrorEntrant entrant(const std::string& method, std::optional<double> tolerated,
                     const std::vector<std::string>& known) {
  return {.name = tolerated ? fmt::format("{} {:g}", method, *tolerated) : method,
          .method = method,
          .tolerated = tolerated,
          .proven_rmse = 0.0,
          .exists = std::ranges::find(known, method) != known.end()};
}

render::SceneDescription read_as_gltf(const render::SceneDescription& scene,
                                      const std::string& file) {
  std::ofstream out(file, std::ios::binary);
  out << lab::write_gltf(scene).json;
  out.close();
  if (!out) throw Error(ErrorKind::Failed, fmt::format("{}: cannot write", file));
  return render::at_time(render::load_scene(file), 0.0);
}

const char* name_of(ErrorScenario scenario) {
  return kErrorScenarios[static_cast<size_t>(scenario)];
}

/// Swing is the way of the objects of a scene. Lengths are in sizes of the scene.
struct Swing {
  static constexpr double kReach = 0.03, kPeriod = 24.0;  // frames
  static constexpr double kGolden = 2.399963;             // radians: no two objects swing alike
  static constexpr size_t kEvery = 3;
  static constexpr double kSmall = 0.5;

  Box bounds;
  double size;
  uint64_t frames;

  [[nodiscard]] bool is_small(const Box& box) const {
    return !box.empty() && largest_size(box.high - box.low) < kSmall * size;
  }
  [[nodiscard]] Vec3 of(size_t object) const {
    const double way = kGolden * static_cast<double>(object);
    const double now =
        std::sin(2.0 * std::numbers::pi * static_cast<double>(frames) / kPeriod + way);
    return Vec3{std::cos(way), 0.5, std::sin(way)} * (kReach * size * now);
  }
};

/// Returns a box by whose size an object counts as small.
Box rough_box(const render::SceneDescription& scene, const render::TriangleMesh& mesh) {
  Box box;
  for (const Vec3& p : scene.shape_of(mesh).positions)
    box.extend(mesh.shape < 0 ? p : mesh.place.point(p));
  return box;
}
Box rough_box(const render::SceneDescription& /*scene*/, const render::Sphere& sphere) {
  const Vec3 half{sphere.radius, sphere.radius, sphere.radius};
  return {sphere.centre - half, sphere.centre + half};
}
Box rough_box(const render::SceneDescription& /*scene*/, const render::Cone& cone) {
  Box box;
  box.extend(cone.base);
  box.extend(cone.apex);
  return box;
}

void move(render::TriangleMesh& mesh, Vec3 by) {
  mesh.place.origin = mesh.place.origin + by;
  for (Vec3& p : mesh.positions) p = p + by;
}
void move(render::Sphere& sphere, Vec3 by) { sphere.centre = sphere.centre + by; }
void move(render::Cone& cone, Vec3 by) {
  cone.base = cone.base + by;
  cone.apex = cone.apex + by;
}

/// Moves a light round the vertical through the centre.
void go_round(render::Light& light, Vec3 centre, uint64_t frames) {
  constexpr double kTurn = 3.0 * std::numbers::pi / 180.0;
  const double cosine = std::cos(kTurn * static_cast<double>(frames));
  const double sine = std::sin(kTurn * static_cast<double>(frames));
  const auto turned = [&](Vec3 v) {
    return Vec3{cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x};
  };
  light.position = centre + turned(light.position - centre);
  light.direction = turned(light.direction);
}

}  // namespace

render::SceneDescription with_moving_objects(render::SceneDescription scene, uint64_t frames) {
  const Box bounds = render::scene_bounds(scene);
  const Swing swing{bounds, largest_size(bounds.high - bounds.low), frames};
  const auto each_object = [&](const auto& visit) {
    for (render::TriangleMesh& mesh : scene.meshes) visit(mesh);
    for (render::Sphere& sphere : scene.spheres) visit(sphere);
    for (render::Cone& cone : scene.cones) visit(cone);
  };
  size_t small = 0;
  each_object([&](auto& object) { small += swing.is_small(rough_box(scene, object)) ? 1 : 0; });
  size_t number = 0;
  each_object([&](auto& object) {
    if (small > 0 && !swing.is_small(rough_box(scene, object))) return;
    if (number++ % Swing::kEvery == 0) move(object, swing.of(number));
  });
  const Vec3 centre = (bounds.low + bounds.high) * 0.5;
  if (scene.lights.empty())
    scene.lights.push_back({.position = centre + Vec3{1.0, 2.0, 1.5} * swing.size});
  go_round(scene.lights.front(), centre, frames);
  return scene;
}

std::vector<ErrorEntrant> error_entrants(const std::vector<std::string>& methods,
                                         const std::vector<double>& errors,
                                         const std::vector<double>& psnrs,
                                         const std::vector<std::string>& known) {
  for (const double error : errors)
    if (!(error >= 0.0 && error <= 255.0))
      throw Error(ErrorKind::Usage,
                  fmt::format("--errors {}: not in 0 ... 255 code values", error));
  std::vector<ErrorEntrant> entrants = {entrant(kReference, {}, known)};
  for (const std::string& method : methods) {
    if (method == kReference) continue;
    if (method != kTolerant) {
      entrants.push_back(entrant(method, {}, known));
      continue;
    }
    for (const double error : errors) entrants.push_back(entrant(method, error, known));
    for (const double psnr : psnrs) {
      render::RenderOptions options;
      render::promise_psnr(psnr, options);
      ErrorEntrant& added = entrants.emplace_back(entrant(method, options.tolerated_error, known));
      added.name = fmt::format("{} {:g} dB", method, psnr);
      added.proven_rmse = options.proven_rmse;
    }
  }
  return entrants;
}

ErrorScene::ErrorScene(const std::string& name, frames::Rate rate)
    : name_(name), as_gltf_(name.starts_with(kGltf)) {
  const std::string source = as_gltf_ ? name.substr(kGltf.size()) : name;
  sequence_ = std::make_unique<tools::SceneSequence>(bench_scene_name(source), rate);
}

render::SceneDescription ErrorScene::after(uint64_t frames) const {
  render::SceneDescription scene = sequence_->at(sequence_->reference_frame() + frames);
  return as_gltf_ ? read_as_gltf(scene, folder_.file("scene.gltf")) : scene;
}

std::optional<std::string> ErrorScene::name_for_peers() const {
  std::string built_in = bench_scene_name(name_);
  if (as_gltf_ || !built_in.starts_with(kBuiltIn)) return std::nullopt;
  return built_in;
}

double seen_pixels_per_degree(const optics::Rig& rig) {
  const double distance_mm = rig.viewing.distance.value;
  if (std::isinf(distance_mm)) return lab::kFlipPixelsPerDegree;
  const double width_mm = rig.panel.width_px * rig.panel.pixel_width.value;
  const double pixel_mm = width_mm / frames::decoded_geometry(rig).width;
  return std::clamp(distance_mm / pixel_mm * std::numbers::pi / 180.0, 1.0, 1000.0);
}

ErrorEyes::ErrorEyes(const optics::OpticalModel& model, WorkerThreads& workers)
    : model_(model), workers_(workers), pixels_per_degree_(seen_pixels_per_degree(model.rig())) {}

frames::WovenFrame ErrorEyes::seen(const frames::FrameView& woven, int eye) const {
  return frames::decode_view(woven, model_, eye, kErrorEyes);
}

void ErrorEyes::set_reference(const frames::FrameView& woven) {
  std::array<std::optional<lab::FlipPicture>, kErrorEyes> flip;
  workers_.run(kErrorEyes, [&](int eye, int) {
    const auto e = static_cast<size_t>(eye);
    reference_[e] = seen(woven, eye);
    flip[e].emplace(reference_[e].view(), pixels_per_degree_);
  });
  reference_flip_.clear();
  for (auto& picture : flip) reference_flip_.push_back(std::move(*picture));
}

nlohmann::json ErrorEyes::compare(const frames::FrameView& woven, EyeFlicker& flicker) {
  std::array<nlohmann::json, kErrorEyes> figures;
  workers_.run(kErrorEyes, [&](int eye, int) {
    const auto e = static_cast<size_t>(eye);
    test_[e] = seen(woven, eye);
    const frames::FrameView a = reference_[e].view();
    const frames::FrameView b = test_[e].view();
    const lab::FlipFigures flip = lab::flip_figures(
        lab::flip_map(reference_flip_[e], lab::FlipPicture(b, pixels_per_degree_)));
    const lab::Flicker change = flicker[e].add(a, b);
    figures[e] = {{"ssim", nullptr},
                  {"flip_mean", flip.mean},
                  {"flip_p99", flip.percentile_99},
                  {"flicker_mean", change.mean},
                  {"flicker_largest", change.largest}};
    if (const auto ssim = frames::structural_similarity(a, b)) figures[e]["ssim"] = *ssim;
  });
  return figures;
}

// Renders a scenario with every method, frame by frame, and compares each with the reference.

namespace {

/// A method in one run; it may keep data of its last frame. Each has its own scene, because results
/// of culling are stored in the scene.
struct Racer {
  std::unique_ptr<render::Method> method;
  render::SceneKeeper keeper;
  const render::Scene* scene = nullptr;  ///< null until it is committed for the current frame
};

/// One method in all runs.
struct Contestant {
  const ErrorEntrant* entrant = nullptr;
  std::vector<Racer> racers;
  std::vector<double> wall_s, cpu_s,
      build_s;  ///< times of the current frame, one number for each run
  render::RenderStatistics statistics;
  EyeFlicker flicker;
  WorstPlaces worst;
  nlohmann::json frames = nlohmann::json::array();
};

class ScenarioRun {
 public:
  ScenarioRun(const ErrorSetup& setup, const ErrorScene& scene, std::function<void()> done)
      : setup_(setup),
        scene_(scene),
        done_(std::move(done)),
        model_(setup.rig),
        workers_(setup.threads),
        eyes_(model_, workers_),
        stages_(scene.after(0), render::canvas_of(model_), {},
                setup.scenario == ErrorScenario::Turning ? 360.0 : 0.0,
                scene.still() && setup.scenario != ErrorScenario::Objects),
        reference_(geometry()),
        frame_(geometry()) {
    for (const ErrorEntrant& entrant : setup.entrants)
      if (entrant.exists) add_contestant(entrant);
  }

  /// Returns false if interrupted.
  [[nodiscard]] bool run() {
    const bool moving = setup_.scenario != ErrorScenario::Still;
    const int frames = moving ? setup_.frames : 2;
    for (int n = 0; n < frames && !player::interrupted(); ++n) {
      if (moving || n == 0)
        set_scene(static_cast<uint64_t>(setup_.first + n), static_cast<double>(n) / frames);
      frame(n);
    }
    return !player::interrupted();
  }

  [[nodiscard]] nlohmann::json result() {
    nlohmann::json pictures = nlohmann::json::array();
    nlohmann::json methods = nlohmann::json::array();
    for (const ErrorEntrant& entrant : setup_.entrants) {
      methods.push_back({{"name", entrant.name},
                         {"method", entrant.method},
                         {"tolerated_error", nullptr},
                         {"missing", !entrant.exists}});
      if (entrant.tolerated) methods.back()["tolerated_error"] = *entrant.tolerated;
      if (!entrant.exists) continue;
      Contestant& one = contestant_of(entrant);
      methods.back()["frames"] = std::move(one.frames);
      if (!setup_.pictures.empty())
        for (nlohmann::json& picture : one.worst.write(setup_.pictures, stem_of(entrant)))
          pictures.push_back(std::move(picture));
    }
    return {{"scene", scene_.name()},
            {"rig", setup_.rig.name},
            {"course", name_of(setup_.scenario)},
            {"subpixels", geometry().frame_bytes()},
            {"copy_s", std::ranges::min(copy_s_)},
            {"pictures", std::move(pictures)},
            {"methods", std::move(methods)}};
  }

 private:
  [[nodiscard]] frames::FrameGeometry geometry() const {
    return {setup_.rig.panel.width_px, setup_.rig.panel.height_px, frames::PixelFormat::Rgb8};
  }
  [[nodiscard]] std::string stem_of(const ErrorEntrant& entrant) const {
    return fmt::format("{}-{}x{}-{}-{}", scene_.name(), geometry().width, geometry().height,
                       name_of(setup_.scenario), entrant.name);
  }

  void add_contestant(const ErrorEntrant& entrant) {
    render::RenderOptions options;
    options.threads = setup_.threads;
    options.max_depth = setup_.depth;
    options.soft = setup_.soft;
    options.cancelled = [] { return player::interrupted(); };
    if (entrant.tolerated) options.tolerated_error = *entrant.tolerated;
    options.proven_rmse = entrant.proven_rmse;
    Contestant& one = contestants_.emplace_back();
    one.entrant = &entrant;
    for (int run = 0; run < setup_.runs; ++run)
      one.racers.push_back({render::make_method(entrant.method, model_, options),
                            render::SceneKeeper({}, setup_.threads)});
  }

  Contestant& contestant_of(const ErrorEntrant& entrant) {
    return *std::ranges::find(contestants_, &entrant, &Contestant::entrant);
  }

  void set_scene(uint64_t frame, double progress) {
    const double begin = seconds_now();
    if (setup_.scenario == ErrorScenario::Objects) {
      if (!first_) first_.emplace(scene_.after(static_cast<uint64_t>(setup_.first)));
      description_ = std::make_shared<const render::SceneDescription>(
          with_moving_objects(*first_, frame - static_cast<uint64_t>(setup_.first)));
    } else if (!description_ || !scene_.still()) {
      description_ = std::make_shared<const render::SceneDescription>(scene_.after(frame));
    }
    stage_ = stages_.at(*description_, progress);
    set_scene_s_ = seconds_now() - begin;
    for (Contestant& one : contestants_)
      for (Racer& racer : one.racers) racer.scene = nullptr;
  }

  /// Measures a frame. The reference is first in the first run, because the others are compared
  /// with it; after that the runs are interleaved, every second one in reverse order.
  void frame(int number) {
    for (Contestant& one : contestants_) one.wall_s = one.cpu_s = one.build_s = {};
    for (int run = 0; run < setup_.runs; ++run) {
      time_copies();
      for (size_t i = 0; i < contestants_.size(); ++i) {
        const size_t turn = run % 2 == 0 ? i : contestants_.size() - 1 - i;
        if (!race(contestants_[turn], run, number)) return;
        if (run == 0) measure(contestants_[turn], number);
        if (run == 0) done_();
      }
    }
    for (Contestant& one : contestants_) {
      one.frames.back()["wall_s"] = median(one.wall_s);
      one.frames.back()["cpu_s"] = median(one.cpu_s);
      one.frames.back()["build_s"] = median(one.build_s);
    }
  }

  /// Renders one frame. A still scene is committed once, a moving one for each frame; neither is
  /// timed.
  [[nodiscard]] bool race(Contestant& one, int run, int number) {
    Racer& racer = one.racers[static_cast<size_t>(run)];
    const double begin = seconds_now();
    const bool is_new = racer.scene == nullptr;
    if (is_new) racer.scene = &racer.keeper.commit(description_, stage_);
    one.build_s.push_back(is_new ? set_scene_s_ + seconds_now() - begin : 0.0);
    racer.method->set_frame(static_cast<uint64_t>(setup_.first + number));
    const double cpu = process_cpu_seconds();
    const double start = seconds_now();
    one.statistics = racer.method->render(*racer.scene, stage_, frame_);
    one.wall_s.push_back(seconds_now() - start);
    one.cpu_s.push_back(process_cpu_seconds() - cpu);
    return one.statistics.completed;
  }

  /// Measures the time to copy a frame with as many threads, a lower bound for writing one. The
  /// fastest copy counts.
  void time_copies() {
    constexpr int kTimes = 5;
    for (int n = 0; n < kTimes; ++n) time_copy();
  }

  void time_copy() {
    const auto bands = static_cast<size_t>(workers_.count());
    const size_t bytes = reference_.bytes().size();
    const double start = seconds_now();
    workers_.run(workers_.count(), [&](int band, int) {
      const size_t begin = bytes * static_cast<size_t>(band) / bands;
      const size_t end = bytes * static_cast<size_t>(band + 1) / bands;
      std::memcpy(frame_.bytes().data() + begin, reference_.bytes().data() + begin, end - begin);
    });
    copy_s_.push_back(seconds_now() - start);
  }

  void measure(Contestant& one, int number) {
    const render::RenderStatistics& s = one.statistics;
    nlohmann::json figures = {{"rays", all_rays(s)},
                              {"traced", s.traced_subpixels},
                              {"missing", s.missing_subpixels},
                              {"subpixels", s.subpixels}};
    if (s.audited_subpixels > 0)
      figures.update({{"audited", s.audited_subpixels},
                      {"audited_beyond", s.audited_beyond},
                      {"bound", s.beyond_bound},
                      {"rmse_bound", s.rmse_bound}});
    if (&one == contestants_.data()) {
      std::swap(reference_, frame_);
      if (setup_.eyes) eyes_.set_reference(reference_.view());
    } else {
      add_errors(one, figures);
      if (setup_.eyes) figures["eyes"] = eyes_.compare(frame_.view(), one.flicker);
      if (!setup_.pictures.empty())
        one.worst.add(number, reference_.view(), frame_.view(), eyes_.reference(), eyes_.test());
    }
    one.frames.push_back(std::move(figures));
  }

  void add_errors(const Contestant& one, nlohmann::json& figures) {
    const std::vector<frames::Difference> views = frames::compare_views(
        reference_.view(), frame_.view(), model_, frames::native_view_count(setup_.rig));
    const frames::PictureDifference off =
        frames::compare_pictures(reference_.view(), frame_.view());
    const frames::Difference& total = off.total;
    figures["mse"] = total.mse();
    for (const frames::Difference& channel : off.channels)
      figures["channel_mses"].push_back(channel.mse());
    figures["max"] = total.max();
    figures["share_over_8"] = total.share_over(8);
    figures["share_over_32"] = total.share_over(32);
    // Codes are integers, so "more than E" equals "more than E rounded down".
    if (one.entrant->tolerated)
      figures["share_over_e"] = total.share_over(static_cast<int>(*one.entrant->tolerated));
    figures["worst_view_mse"] = views[static_cast<size_t>(frames::worst_view(views))].mse();
  }

  const ErrorSetup& setup_;
  const ErrorScene& scene_;
  std::function<void()> done_;
  optics::OpticalModel model_;
  WorkerThreads workers_;
  ErrorEyes eyes_;
  tools::StageSequence stages_;
  std::optional<render::SceneDescription> first_;  ///< scene of the first frame, to be moved
  std::shared_ptr<const render::SceneDescription> description_;
  render::Stage stage_;
  double set_scene_s_ = 0.0;  ///< time to evaluate the description and the stage
  frames::WovenFrame reference_;
  frames::WovenFrame frame_;  ///< the frame rendered last, by any method
  std::vector<double> copy_s_;
  std::vector<Contestant> contestants_;
};

}  // namespace

nlohmann::json measure_error(const ErrorSetup& setup, const ErrorScene& scene,
                             const std::function<void()>& done) {
  ScenarioRun scenario(setup, scene, done);
  if (!scenario.run()) return {};
  return scenario.result();
}

namespace {

constexpr int kTileSide = 96;
constexpr size_t kPlaces = 3;
constexpr int kPaneSide = 384;
constexpr int kGap = 8;
constexpr uint8_t kGapGrey = 96;

/// A part of a picture, in fractions of its size.
struct Part {
  double left, top, width, height;
};

Part part_of(const lab::Tile& tile, const frames::FrameGeometry& picture) {
  return {.left = static_cast<double>(tile.x) / picture.width,
          .top = static_cast<double>(tile.y) / picture.height,
          .width = static_cast<double>(tile.width) / picture.width,
          .height = static_cast<double>(tile.height) / picture.height};
}

/// Returns a part, magnified so that pixels stay squares with sharp edges.
frames::WovenFrame magnified(const frames::FrameView& picture, const Part& part, int width,
                             int height) {
  const auto place = [](double begin, double size, int index, int count, int pixels) {
    const double at = (begin + size * (index + 0.5) / count) * pixels;
    return std::clamp(static_cast<int>(at), 0, pixels - 1);
  };
  frames::WovenFrame pane({.width = width, .height = height});
  for (int j = 0; j < height; ++j) {
    const uint8_t* const row =
        picture.row(place(part.top, part.height, j, height, picture.geometry.height));
    for (int i = 0; i < width; ++i)
      std::copy_n(row + 3 * place(part.left, part.width, i, width, picture.geometry.width), 3,
                  pane.row(j) + 3 * i);
  }
  return pane;
}

void put(const frames::WovenFrame& pane, int x, int y, frames::WovenFrame& sheet) {
  for (int j = 0; j < pane.height(); ++j)
    std::copy_n(pane.row(j), pane.geometry().row_bytes(), sheet.row(y + j) + 3 * x);
}

void put_row(const frames::FrameView& reference, const frames::FrameView& test, const Part& part,
             int width, int height, int y, frames::WovenFrame& sheet) {
  const frames::WovenFrame a = magnified(reference, part, width, height);
  const frames::WovenFrame b = magnified(test, part, width, height);
  put(a, 0, y, sheet);
  put(b, width + kGap, y, sheet);
  put(frames::error_picture(a.view(), b.view()), 2 * (width + kGap), y, sheet);
}

/// Returns the eye for which the tile differs most.
int eye_of(const lab::Tile& tile, const frames::FrameGeometry& panel, const SeenPictures& reference,
           const SeenPictures& test) {
  const Part part = part_of(tile, panel);
  double worst = -1.0;
  int eye = 0;
  for (size_t e = 0; e < reference.size(); ++e) {
    const auto pane = [&](const frames::WovenFrame& seen) {
      return magnified(seen.view(), part, tile.width, tile.height);
    };
    const double mse =
        frames::compare_pictures(pane(reference[e]).view(), pane(test[e]).view()).total.mse();
    if (mse <= worst) continue;
    worst = mse;
    eye = static_cast<int>(e);
  }
  return eye;
}

/// Returns letters, digits, dots and dashes only: a file name that is valid on any system.
std::string file_name(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '-';
  return text;
}

}  // namespace

frames::WovenFrame tile_sheet(const frames::FrameView& reference, const frames::FrameView& test,
                              const frames::FrameView& seen_reference,
                              const frames::FrameView& seen_test, const lab::Tile& tile) {
  const int scale = std::max(1, kPaneSide / std::max(tile.width, tile.height));
  const int width = scale * tile.width;
  const int height = scale * tile.height;
  frames::WovenFrame sheet({.width = 3 * width + 2 * kGap, .height = 2 * height + kGap});
  std::ranges::fill(sheet.bytes(), kGapGrey);
  const Part part = part_of(tile, reference.geometry);
  put_row(reference, test, part, width, height, 0, sheet);
  put_row(seen_reference, seen_test, part, width, height, height + kGap, sheet);
  return sheet;
}

void WorstPlaces::add(int frame, const frames::FrameView& reference, const frames::FrameView& test,
                      const SeenPictures& seen_reference, const SeenPictures& seen_test) {
  for (const lab::Tile& tile :
       lab::worst_tiles(reference, test, kTileSide, static_cast<int>(kPlaces))) {
    const auto here = [&](const Place& place) { return place.tile.overlaps(tile); };
    if (std::ranges::any_of(
            places_, [&](const Place& place) { return here(place) && place.tile.mse >= tile.mse; }))
      continue;
    std::erase_if(places_, here);
    const int eye = eye_of(tile, reference.geometry, seen_reference, seen_test);
    const auto e = static_cast<size_t>(eye);
    places_.push_back(
        {tile, frame, eye,
         tile_sheet(reference, test, seen_reference[e].view(), seen_test[e].view(), tile)});
  }
  std::ranges::stable_sort(places_, std::ranges::greater(),
                           [](const Place& place) { return place.tile.mse; });
  if (places_.size() > kPlaces) places_.erase(places_.begin() + kPlaces, places_.end());
}

nlohmann::json WorstPlaces::write(const std::string& folder, const std::string& stem) const {
  nlohmann::json written = nlohmann::json::array();
  if (!places_.empty()) std::filesystem::create_directories(folder);
  for (size_t n = 0; n < places_.size(); ++n) {
    const Place& place = places_[n];
    const std::filesystem::path file =
        std::filesystem::path(folder) / fmt::format("{}-{}.png", file_name(stem), n + 1);
    frames::write_woven(place.sheet.view(), file);
    written.push_back({{"file", file.string()},
                       {"frame", place.frame},
                       {"x", place.tile.x},
                       {"y", place.tile.y},
                       {"width", place.tile.width},
                       {"height", place.tile.height},
                       {"mse", place.tile.mse},
                       {"eye", place.eye}});
  }
  return written;
}
}  // namespace lenticule::bench
