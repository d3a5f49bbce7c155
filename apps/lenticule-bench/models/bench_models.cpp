// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/bench_models.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>

#include "apps/lenticule-bench/harness/bench.h"
#include "base/error.h"
#include "base/file.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/charts/charts.h"
#include "frames/image_io.h"
#include "frames/srgb.h"
#include "frames/text.h"
#include "lab/flip.h"
#include "lab/judges/judge.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/loaders/load_scene.h"
#include "render/loaders/viewer_choices.h"
#include "render/methods/method.h"
#include "render/scene/scene.h"

namespace lenticule::bench {

namespace {

constexpr int kGap = 8;
constexpr int kTextScale = 2;
constexpr int kCaption = kTextScale * frames::kCellHeight + 6;
constexpr uint8_t kPaper = 48;
constexpr frames::Colour kInk{230, 230, 230};

/// Colours of the map at equal distances from 0 to 1.
constexpr std::array<frames::Colour, 5> kMapColours{
    {{0, 0, 4}, {81, 18, 124}, {183, 55, 121}, {252, 137, 97}, {252, 253, 191}}};

void put(const frames::WovenFrame& pane, int x, int y, frames::WovenFrame& sheet) {
  for (int j = 0; j < pane.height(); ++j)
    std::copy_n(pane.row(j), pane.geometry().row_bytes(), sheet.row(y + j) + 3 * x);
}

}  // namespace

frames::WovenFrame averaged(const frames::FrameView& picture, int factor) {
  if (factor < 1 || picture.geometry.width < factor || picture.geometry.height < factor)
    throw Error(ErrorKind::Usage, "a picture cannot be averaged over larger squares");
  const auto& light = frames::linear_of_codes();
  frames::WovenFrame result(
      {.width = picture.geometry.width / factor, .height = picture.geometry.height / factor});
  for (int j = 0; j < result.height(); ++j)
    for (int i = 0; i < result.width(); ++i)
      for (int c = 0; c < 3; ++c) {
        double sum = 0.0;
        for (int n = 0; n < factor; ++n)
          for (int m = 0; m < factor; ++m)
            sum += light[picture.row(factor * j + n)[3 * (factor * i + m) + c]];
        result.row(j)[3 * i + c] = frames::code_from_linear(sum / (factor * factor));
      }
  return result;
}

namespace {

/// Returns the values 0 to 1 of a map as colours from black over purple and orange to light yellow.
frames::WovenFrame flip_picture(const std::vector<float>& map, int width, int height) {
  LENTICULE_CHECK(map.size() == static_cast<size_t>(width) * static_cast<size_t>(height));
  frames::WovenFrame picture({.width = width, .height = height});
  constexpr int kSteps = static_cast<int>(kMapColours.size()) - 1;
  for (size_t n = 0; n < map.size(); ++n) {
    const double place = std::clamp(double{map[n]}, 0.0, 1.0) * kSteps;
    const int below = std::min(static_cast<int>(place), kSteps - 1);
    const frames::Colour& a = kMapColours[static_cast<size_t>(below)];
    const frames::Colour& b = kMapColours[static_cast<size_t>(below) + 1];
    for (size_t c = 0; c < 3; ++c)
      picture.bytes()[3 * n + c] =
          static_cast<uint8_t>(std::lround(a[c] + (place - below) * (b[c] - a[c])));
  }
  return picture;
}

/// ContactEntry is one model of a sheet.
struct ContactEntry {
  std::string caption{};
  /// Squares of `pane_px`; an empty frame leaves its place grey.
  frames::WovenFrame ours{}, theirs{}, flip{};
};

/// Number of models on one sheet.
inline constexpr int kSheetColumns = 3;
inline constexpr int kSheetRows = 6;

/// Returns the entries from left to right and from top to bottom, each as ours | theirs | FLIP
/// below its caption.
frames::WovenFrame contact_sheet(const std::vector<ContactEntry>& entries, int pane_px) {
  const int columns = std::min(static_cast<int>(entries.size()), kSheetColumns);
  const int rows = (static_cast<int>(entries.size()) + kSheetColumns - 1) / kSheetColumns;
  const int entry_width = 3 * pane_px + 2 * kGap;
  frames::WovenFrame sheet({.width = columns * (entry_width + 3 * kGap) - 3 * kGap,
                            .height = rows * (pane_px + kCaption + kGap)});
  std::ranges::fill(sheet.bytes(), kPaper);
  for (size_t n = 0; n < entries.size(); ++n) {
    const int x = static_cast<int>(n) % kSheetColumns * (entry_width + 3 * kGap);
    const int y = static_cast<int>(n) / kSheetColumns * (pane_px + kCaption + kGap);
    const size_t room = static_cast<size_t>(entry_width / (kTextScale * frames::kCellWidth));
    frames::draw_text(sheet, x + 2, y + 3, kTextScale, entries[n].caption.substr(0, room), kInk);
    int left = x;
    for (const frames::WovenFrame* pane :
         {&entries[n].ours, &entries[n].theirs, &entries[n].flip}) {
      frames::fill_box(sheet, {left, y + kCaption, pane_px, pane_px}, {96, 96, 96});
      if (pane->width() == pane_px && pane->height() == pane_px)
        put(*pane, left, y + kCaption, sheet);
      left += pane_px + kGap;
    }
  }
  return sheet;
}

namespace fs = std::filesystem;

struct ModelFile {
  std::filesystem::path file;
  std::string name;  ///< path below the folder it was found in, or its last two parts; no extension
  std::string stem;  ///< begins the names of its pictures: different for every model
};

/// Lists the formats that the judge of scripts/ also reads.
constexpr std::string_view kExtensions = ".glb .gltf .obj .dae .fbx .3ds .ply .stl ";

bool is_model(const fs::path& file) {
  const std::string extension = lower_case(file.extension().string());
  return !extension.empty() && kExtensions.find(extension + ' ') != std::string_view::npos;
}

bool is_gltf(const fs::path& file) {
  return lower_case(file.extension().string()).starts_with(".gl");
}

/// Leaves colours, textures, alpha and shapes to be compared. Highlights, layers and lights of
/// other formats than glTF have no common units.
void make_matt(render::SceneDescription& scene) {
  for (render::Material& material : scene.materials) {
    render::PbrMaterial matt = *material.pbr;
    matt.metallic = matt.specular = matt.transmission = matt.clearcoat = 0.0;
    matt.sheen_colour = {};
    material.pbr = std::make_shared<const render::PbrMaterial>(matt);
  }
  scene.lights.clear();
  scene.ambient = Vec3{};
}

/// Returns letters, digits, dots and dashes only: a file name that is valid on any system.
std::string plain_name(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.') c = '-';
  return text;
}

void add(const fs::path& file, const fs::path& name, std::vector<ModelFile>& models) {
  const std::string text =
      is_gltf(name) ? fs::path(name).replace_extension().string() : name.string();
  models.push_back({.file = file,
                    .name = text,
                    .stem = fmt::format("{:03}-{}", models.size() + 1, plain_name(text))});
}

/// Returns the models among `places`: files, and folders with all their sub-folders,
/// each folder's files sorted by name. Throws Error(Input) for a place that does not exist, and if
/// there is no model at all.
std::vector<ModelFile> find_models(const std::vector<std::string>& places) {
  std::vector<ModelFile> models;
  for (const std::string& place : places) {
    if (!fs::is_directory(place)) {
      if (!fs::exists(place))
        throw Error(ErrorKind::Input, fmt::format("{}: no such file or folder", place));
      const fs::path file = fs::absolute(place);
      add(place, file.parent_path().filename() / file.filename(), models);
      continue;
    }
    std::vector<fs::path> files;
    for (const auto& entry :
         fs::recursive_directory_iterator(place, fs::directory_options::follow_directory_symlink))
      if (entry.is_regular_file() && is_model(entry.path())) files.push_back(entry.path());
    std::ranges::sort(files);
    for (const fs::path& file : files) add(file, fs::relative(file, place), models);
  }
  if (models.empty())
    throw Error(ErrorKind::Input,
                fmt::format("{}: no model; expected {}files", places.front(), kExtensions));
  return models;
}

// lenticule bench models renders models as a plain camera sees them, lets a judge (another
// renderer) draw the same pictures, and measures the differences with FLIP.

using nlohmann::json;

constexpr int kStudioWidth = 512;
/// Panes of contact sheets are pictures averaged to this size or somewhat above.
constexpr int kPanePx = 256;

struct ModelsFlags {
  std::vector<std::string> places;
  std::string output;
  std::string judge;
  std::string environment;
  int size_px = 512;
  int supersample = 2;
  double pixels_per_degree = lab::kFlipPixelsPerDegree;
  int limit_s = 120;
  int threads = 0;
  bool json = false;
};

/// ModelRow holds the pictures and figures of one model so far; failures are empty if there is
/// none.
struct ModelRow {
  ModelFile model;
  lab::JudgeJob job{};
  std::string ours_failure{};
  std::string theirs_failure{};
  double seconds = 0.0;
  ContactEntry entry{};
  std::optional<lab::FlipFigures> flip{};
};

class ModelsRun {
 public:
  explicit ModelsRun(const ModelsFlags& flags)
      : flags_(flags),
        folder_(flags.output),
        environment_(flags.environment),
        model_(lab::plain_camera_rig(flags.size_px * flags.supersample, lab::kModelFovDegrees)) {
    for (ModelFile& file : find_models(flags.places)) rows_.push_back({.model = std::move(file)});
    fs::create_directories(folder_);
    if (environment_.empty()) {
      environment_ = (folder_ / "studio.hdr").string();
      lab::write_studio(environment_, kStudioWidth, kStudioWidth / 2);
    }
  }

  ExitCode run() {
    render_all();
    if (player::interrupted()) return player::interrupt_exit_code();
    draw_all();
    if (player::interrupted()) return player::interrupt_exit_code();
    for (ModelRow& row : rows_) compare(row);
    std::ranges::stable_sort(rows_, std::greater<>(), badness);
    write_sheets();
    const std::string table = markdown();
    write_text_file(folder_ / "models.md", table);
    write_text_file(folder_ / "models.json", report().dump(1) + '\n');
    if (flags_.json)
      print_json(report());
    else
      print_out("{}", Verbatim{table});
    if (!judge_failure_.empty())
      throw Error(ErrorKind::Failed, fmt::format("{}: {}", flags_.judge, judge_failure_));
    return kOk;
  }

 private:
  /// Returns a number by which rows are sorted: models that could not be compared come first.
  static double badness(const ModelRow& row) { return row.flip ? row.flip->mean : 2.0; }

  [[nodiscard]] std::string picture_file(const ModelRow& row, const char* kind) const {
    return (folder_ / fmt::format("{}.{}.png", row.model.stem, kind)).string();
  }

  // ---- ours

  void render_all() {
    player::Progress progress("models", "models", rows_.size());
    for (size_t n = 0; n < rows_.size() && !player::interrupted(); ++n) {
      ModelRow& row = rows_[n];
      row.job = {.model = fs::absolute(row.model.file).string(),
                 .picture = fs::absolute(picture_file(row, "judge-large")).string(),
                 .side_px = model_.rig().panel.width_px,
                 .environment = fs::absolute(environment_).string(),
                 .environment_ahead = lab::environment_ahead()};
      try {
        render(row);
      } catch (const Error& error) {
        row.ours_failure = error.what();
      }
      progress.update(n + 1, row.model.name);
    }
    progress.finish();
  }

  void render(ModelRow& row) {
    const auto start = std::chrono::steady_clock::now();
    render::SceneDescription description = render::at_time(render::load_scene(row.model.file), 0.0);
    const render::Camera camera = lab::framing_camera(description);
    row.job.camera = camera;
    row.job.light_scale = description.light_scale * std::numbers::pi;
    description.cameras = {camera};
    // Only metallic-roughness materials are lit by the whole environment.
    for (render::Material& material : description.materials)
      if (!material.pbr)
        material.pbr = std::make_shared<const render::PbrMaterial>(render::pbr_like(material));
    // A scene that states its ambient light gets no default sun; the environment replaces that
    // light.
    description.ambient = description.ambient.value_or(Vec3{});
    if (!is_gltf(row.model.file)) make_matt(description);
    const render::Stage stage =
        render::make_stage(description, model_, lab::plain_camera_stage(camera, model_.rig()));
    render::Surroundings surroundings;
    surroundings.environment_file = environment_;
    surroundings.tone_map = render::ToneMap::PbrNeutral;  // as jobs_text() asks of the judge
    const render::Scene scene(description, stage, surroundings, flags_.threads);
    render::RenderOptions options{.threads = flags_.threads, .cancelled = player::interrupted};
    frames::WovenFrame frame({.width = row.job.side_px, .height = row.job.side_px});
    render::make_method("full", model_, options)->render(scene, stage, frame);
    row.entry.ours = averaged(frame.view(), flags_.supersample);
    frames::write_woven(row.entry.ours.view(), picture_file(row, "ours"));
    row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  // ---- pictures of the other program

  void draw_all() {
    if (flags_.judge.empty()) return;
    std::vector<lab::JudgeJob> jobs;
    for (const ModelRow& row : rows_) jobs.push_back(row.job);
    const auto limit = std::chrono::seconds(flags_.limit_s) * (jobs.size() + 1);
    judge_failure_ = run_judge(flags_.judge, folder_ / "jobs.json", jobs, limit);
    for (ModelRow& row : rows_) {
      row.theirs_failure = missing_picture(row.job);
      if (!row.theirs_failure.empty()) continue;
      try {
        frames::WovenFrame large({.width = row.job.side_px, .height = row.job.side_px});
        frames::read_woven_into(row.job.picture, large.geometry(), large);
        row.entry.theirs = averaged(large.view(), flags_.supersample);
        frames::write_woven(row.entry.theirs.view(), picture_file(row, "judge"));
      } catch (const Error& error) {
        row.theirs_failure = error.what();
      }
      fs::remove(row.job.picture);
    }
  }

  // ---- comparison

  void compare(ModelRow& row) {
    ContactEntry& entry = row.entry;
    entry.caption = row.model.name;
    if (entry.ours.bytes().empty() || entry.theirs.bytes().empty()) return;
    const std::vector<float> map =
        lab::flip_map(lab::FlipPicture(entry.theirs.view(), flags_.pixels_per_degree),
                      lab::FlipPicture(entry.ours.view(), flags_.pixels_per_degree));
    entry.flip = flip_picture(map, flags_.size_px, flags_.size_px);
    frames::write_woven(entry.flip.view(), picture_file(row, "flip"));
    row.flip = lab::flip_figures(map);
    entry.caption = fmt::format("{:.3f} {}", row.flip->mean, row.model.name);
  }

  /// Returns the mean over the compared models; none if no model was compared.
  [[nodiscard]] std::optional<double> mean_flip() const {
    double sum = 0.0;
    int count = 0;
    for (const ModelRow& row : rows_) {
      if (!row.flip) continue;
      sum += row.flip->mean;
      ++count;
    }
    return count == 0 ? std::nullopt : std::optional(sum / count);
  }

  // ---- results

  void write_sheets() {
    constexpr size_t kEntries = size_t{kSheetColumns} * kSheetRows;
    const int factor = std::max(1, flags_.size_px / kPanePx);
    for (size_t begin = 0; begin < rows_.size(); begin += kEntries) {
      std::vector<ContactEntry> entries;
      for (size_t n = begin; n < std::min(begin + kEntries, rows_.size()); ++n) {
        entries.push_back({.caption = rows_[n].entry.caption});
        entries.back().ours = pane(rows_[n].entry.ours, factor);
        entries.back().theirs = pane(rows_[n].entry.theirs, factor);
        entries.back().flip = pane(rows_[n].entry.flip, factor);
      }
      sheets_.push_back((folder_ / fmt::format("sheet-{}.png", sheets_.size() + 1)).string());
      frames::write_woven(contact_sheet(entries, flags_.size_px / factor).view(), sheets_.back());
    }
  }

  static frames::WovenFrame pane(const frames::WovenFrame& picture, int factor) {
    return picture.bytes().empty() ? frames::WovenFrame() : averaged(picture.view(), factor);
  }

  [[nodiscard]] json report() const {
    json list = json::array();
    for (const ModelRow& row : rows_) {
      json entry = {{"model", row.model.file.string()},
                    {"name", row.model.name},
                    {"seconds", row.seconds},
                    {"flip_mean", row.flip ? json(row.flip->mean) : json()},
                    {"flip_percentile_99", row.flip ? json(row.flip->percentile_99) : json()}};
      if (!row.ours_failure.empty()) entry["ours_failure"] = row.ours_failure;
      if (!row.theirs_failure.empty()) entry["judge_failure"] = row.theirs_failure;
      list.push_back(std::move(entry));
    }
    const std::optional<double> mean = mean_flip();
    return {{"machine", machine_json()},
            {"judge", flags_.judge},
            {"environment", environment_},
            {"size", flags_.size_px},
            {"pixels_per_degree", flags_.pixels_per_degree},
            {"flip_mean", mean ? json(*mean) : json()},
            {"sheets", sheets_},
            {"models", std::move(list)}};
  }

  /// Returns a table of the formats that were compared.
  [[nodiscard]] std::string formats() const {
    std::map<std::string, std::vector<double>> flips;
    for (const ModelRow& row : rows_)
      if (row.flip)
        flips[lower_case(row.model.file.extension().string())].push_back(row.flip->mean);
    std::string text = "| format | compared | mean FLIP | worst |\n|---|---|---|---|\n";
    for (const auto& [extension, of] : flips)
      text += fmt::format("| `{}` | {} | {:.4f} | {:.4f} |\n", extension, of.size(),
                          std::reduce(of.begin(), of.end()) / static_cast<double>(of.size()),
                          std::ranges::max(of));
    return text;
  }

  [[nodiscard]] std::string markdown() const {
    std::string text = "| model | FLIP | 99 % | seconds | failures |\n|---|---|---|---|---|\n";
    for (const ModelRow& row : rows_) {
      std::string failures;
      if (!row.ours_failure.empty()) failures = "ours: " + escaped(row.ours_failure);
      if (!row.theirs_failure.empty())
        failures +=
            fmt::format("{}judge: {}", failures.empty() ? "" : "; ", escaped(row.theirs_failure));
      text += fmt::format("| {} | {} | {} | {:.1f} | {} |\n", escaped(row.model.name),
                          row.flip ? fmt::format("{:.4f}", row.flip->mean) : "-",
                          row.flip ? fmt::format("{:.3f}", row.flip->percentile_99) : "-",
                          row.seconds, failures);
    }
    const auto compared =
        std::ranges::count_if(rows_, [](const ModelRow& row) { return row.flip.has_value(); });
    text += fmt::format("\n{} of {} models compared", compared, rows_.size());
    if (const auto mean = mean_flip())
      text += fmt::format(", mean FLIP {:.4f}\n\n{}", *mean, formats());
    return text + '\n';
  }

  const ModelsFlags& flags_;
  fs::path folder_;
  std::string environment_;
  optics::OpticalModel model_;
  std::vector<ModelRow> rows_;
  std::string judge_failure_;
  std::vector<std::string> sheets_;
};

}  // namespace

cli::Run declare_bench_models(CLI::App& app) {
  auto flags = std::make_shared<ModelsFlags>();
  app.footer(
      "Example:\n"
      "  scripts/fetch-models ~/models\n"
      "  lenticule bench models ~/models/models -o compared "
      "--judge scripts/three-judge/draw-pictures");
  app.add_option("models", flags->places, "models, or folders with models")->required();
  app.add_option("-o,--output", flags->output, "folder for pictures, contact sheets and the table")
      ->required();
  app.add_option("--judge", flags->judge,
                 "program that draws the same pictures: scripts/three-judge/draw-pictures")
      ->check(CLI::ExistingFile);
  app.add_option("--environment", flags->environment,
                 "latitude-longitude picture around the models (a studio, written to the folder)")
      ->check(CLI::ExistingFile);
  app.add_option("--size", flags->size_px, "side of the pictures in pixels")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str();
  app.add_option("--supersample", flags->supersample,
                 "pixels per side that both renderers draw for one pixel")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  app.add_option("--pixels-per-degree", flags->pixels_per_degree, "of the viewer, for FLIP")
      ->check(CLI::Range(1.0, 1000.0))
      ->capture_default_str();
  app.add_option("--limit", flags->limit_s, "seconds that the judge may take per model, on average")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  declare_threads(app, flags->threads);
  app.add_flag("--json", flags->json, "print as JSON");
  return [flags] { return ModelsRun(*flags).run(); };
}
}  // namespace lenticule::bench
