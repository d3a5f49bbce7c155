// SPDX-License-Identifier: Apache-2.0
// lenticule farm plan divides a film into chunks and writes the work folder; lenticule farm verify
// renders some of its frames again. PlannedFilm renders frames of a plan and refuses changed
// inputs.
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <thread>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "base/error_kinds.h"
#include "base/installation.h"
#include "base/json_output.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/statistics.h"
#include "farm/sequence_joiner.h"
#include "farm/work_folder.h"
#include "frames/image_io.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_reader.h"
#include "player/process/interrupt.h"
#include "player/process/progress.h"
#include "render/scene/scene_fingerprint.h"

namespace lenticule::tools {

namespace {

constexpr const char* kBuiltIn = "builtin:";

/// Mixes what the loader made of the files: also vertices in buffers and textures beside the scene.
void mix_scene(const render::SceneDescription& scene, render::SceneMixer& mixer) {
  mixer.add(scene.materials, scene.meshes, scene.shapes, scene.spheres, scene.cones, scene.lights,
            scene.background, scene.ambient);
}

std::string digest_of_texture(const render::Texture& texture) {
  const auto bytes_of = [](const auto& values) {
    return std::string_view(reinterpret_cast<const char*>(values.data()),
                            values.size() * sizeof(values[0]));
  };
  return farm::digest_of_text(bytes_of(texture.codes)) +
         farm::digest_of_text(bytes_of(texture.rgba));
}

std::string digest_of_scene(const RenderFlags& flags, const FilmRenderer& renderer) {
  const SceneSequence& scenes = renderer.scenes();
  const render::SceneDescription reference = scenes.at(scenes.reference_frame());
  render::SceneMixer mixer;
  mix_scene(reference, mixer);
  if (!scenes.still() && !frames::FilePattern::looks_like_pattern(flags.scene))
    mix_scene(scenes.at(renderer.film().end - 1), mixer);
  std::string parts = flags.scene.starts_with(kBuiltIn) ? flags.scene : std::string();
  if (parts.empty() && !frames::FilePattern::looks_like_pattern(flags.scene))
    parts = farm::digest_of_file(flags.scene);
  parts += fmt::format(" {:016x}{:016x}", mixer.value().first, mixer.value().second);
  for (const auto& texture : reference.textures) parts += " " + digest_of_texture(*texture);
  return farm::digest_of_text(parts);
}

/// Returns the digest of what a film takes from its wall beside the rig: the place of the panel,
/// and the canvas, which depends on all panels.
std::string digest_of_place(const FilmPanel& panel) {
  const render::Canvas& canvas = panel.canvas;
  std::string text = fmt::format("{} {} {} {} {}", panel.name, canvas.width_mm, canvas.height_mm,
                                 canvas.depth_of_field_mm, canvas.viewing_distance_mm);
  const Affine& place = panel.canvas_from_panel;
  for (const Vec3& v : {place.column_x, place.column_y, place.column_z, place.origin})
    text += fmt::format(" {} {} {}", v.x, v.y, v.z);
  return farm::digest_of_text(text);
}

/// Returns the number of threads for a flag of which 0 means all cores.
int threads_or_all(int threads) {
  return threads > 0 ? threads : static_cast<int>(std::thread::hardware_concurrency());
}

/// Returns digests of everything that the film is made from: scene with textures, camera path,
/// environment picture, rig.
std::map<std::string, std::string> digests_of_inputs(const RenderFlags& flags,
                                                     const FilmRenderer& renderer) {
  std::map<std::string, std::string> digests;
  digests["scene"] = digest_of_scene(flags, renderer);
  digests["rig"] = optics::fingerprint(renderer.rig());
  if (renderer.panel().in_wall()) digests["wall"] = digest_of_place(renderer.panel());
  if (!flags.camera.empty()) digests["camera"] = farm::digest_of_file(flags.camera);
  const std::string& environment = flags.staging.surroundings.environment_file;
  if (!environment.empty()) digests["environment"] = farm::digest_of_file(environment);
  return digests;
}

/// Returns the digest of the numbered scene files of a chunk; empty if all frames have one file.
std::string digest_of_chunk_inputs(const RenderFlags& flags, const farm::Chunk& chunk) {
  if (flags.scene.starts_with(kBuiltIn) || !frames::FilePattern::looks_like_pattern(flags.scene))
    return {};
  const frames::FilePattern pattern(flags.scene);
  std::string parts;
  for (uint64_t frame = chunk.begin; frame < chunk.end; ++frame)
    parts += farm::digest_of_file(pattern.path(frame));
  return farm::digest_of_text(parts);
}

using Clock = std::chrono::steady_clock;

uint64_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

/// Returns the frames to be timed, spread over the film.
std::set<uint64_t> frames_to_time(const player::FrameRange& film, int count) {
  std::set<uint64_t> frames;
  const auto wanted = static_cast<uint64_t>(count);
  for (uint64_t i = 0; i < wanted; ++i)
    frames.insert(film.begin + (2 * i + 1) * film.count() / (2 * wanted));
  return frames;
}

/// Renders some frames. A frame on which others depend is timed with them.
farm::FrameTiming time_frames(FilmRenderer& renderer, const FarmFlags& flags,
                              double start_seconds) {
  farm::FrameTiming timing{.start_seconds = start_seconds};
  const int threads = flags.render.options.threads;
  timing.threads = std::max(1, threads_or_all(threads));
  std::vector<double> seconds;
  frames::WovenFrame frame(renderer.geometry());
  for (const uint64_t number : frames_to_time(renderer.film(), flags.timed_frames)) {
    int rendered = 0;
    const auto count = [&](const render::RenderStatistics&, bool) { ++rendered; };
    const auto begin = Clock::now();
    if (!renderer.render(number, frame, player::interrupted, count)) return timing;
    seconds.push_back(seconds_since(begin) / std::max(1, rendered));
  }
  timing.frames = static_cast<int>(seconds.size());
  timing.frame_seconds = median(seconds);
  timing.slowest_seconds = quantile(seconds, 1.0);
  timing.peak_bytes = peak_resident_bytes();
  return timing;
}

/// Returns the number of frames after which the method begins anew; 1 if every frame is on its own.
uint64_t method_interval(const FilmRenderer& renderer) {
  constexpr uint64_t kLast = frames::kPredictorInterval - 1;
  return renderer.method().first_needed(kLast) < kLast ? frames::kPredictorInterval : 1;
}

uint64_t parse_chunk(const std::string& text) {
  const auto frames = number_from<uint64_t>(text);
  if (!frames || *frames == 0)
    throw usage_error("--chunk '{}': not a number of frames", text)
        .remedy("for example --chunk 32, or --chunk auto");
  return *frames;
}

nlohmann::json plan_result(const FarmFlags& flags, const farm::Plan& plan) {
  return {{"work", flags.folder},
          {"output", plan.output},
          {"frames", plan.end - plan.begin},
          {"chunks", plan.chunks()},
          {"chunk_frames", plan.chunk_frames},
          {"identity", plan.identity()},
          {"commands", (std::filesystem::path(flags.folder) / "commands.txt").string()},
          {"frame_seconds", plan.timing.frame_seconds},
          {"start_seconds", plan.timing.start_seconds}};
}

void print_plan(const farm::Plan& plan, const std::filesystem::path& folder) {
  print_out("{} frames in {} chunks of {} frames\n", plan.end - plan.begin, plan.chunks(),
            plan.chunk_frames);
  if (plan.timing.frames > 0)
    print_out("{:.2f} s per frame with {} threads, {:.1f} s to start, {} MiB\n",
              plan.timing.frame_seconds, plan.timing.threads, plan.timing.start_seconds,
              plan.timing.peak_bytes >> 20U);
  print_out("commands: {}\n", folder / "commands.txt");
}

void require_film_name(const FarmFlags& flags) {
  if (!flags.output.ends_with(".lts"))
    throw usage_error("-o {}: a farm makes films", flags.output)
        .remedy("use a name that ends in .lts; lenticule convert makes pictures and videos of it");
  if (flags.timed_frames == 0 && flags.chunk_frames == "auto")
    throw Error(ErrorKind::Usage, "--chunk auto: needs timed frames",
                "leave out --timed-frames 0, or give a number: --chunk 32");
}

struct DoneChunk {
  farm::ChunkReport report;
  bool differing = false;  ///< another process reported other bytes
};

struct Difference {
  uint64_t frame = 0;
  uint64_t chunk = 0;
  std::string node;
  uint64_t subpixels = 0;  ///< all if the chunk cannot be decoded
};

std::vector<DoneChunk> done_chunks(const farm::WorkFolder& folder) {
  std::vector<DoneChunk> chunks;
  for (uint64_t number = 0; number < folder.plan().chunks(); ++number) {
    if (auto report = folder.done(number)) chunks.push_back({std::move(*report), false});
    if (auto other = folder.differing_report(number)) chunks.push_back({std::move(*other), true});
  }
  return chunks;
}

/// Returns (frame, index of its chunk), in ascending order: `sample` frames at random, and the
/// first frames of chunks that two nodes rendered with different bytes.
std::set<std::pair<uint64_t, size_t>> choose_frames(const std::vector<DoneChunk>& chunks,
                                                    uint64_t sample, uint64_t seed) {
  std::vector<std::pair<uint64_t, size_t>> all;
  std::set<std::pair<uint64_t, size_t>> chosen;
  std::set<uint64_t> disputed;
  for (const DoneChunk& chunk : chunks)
    if (chunk.differing) disputed.insert(chunk.report.chunk);
  for (size_t i = 0; i < chunks.size(); ++i) {
    const farm::ChunkReport& report = chunks[i].report;
    for (uint64_t frame = report.begin; frame < report.end; ++frame) {
      all.emplace_back(frame, i);
      if (disputed.count(report.chunk) > 0) chosen.insert(all.back());
    }
  }
  std::mt19937_64 random(seed);
  std::sample(all.begin(), all.end(), std::inserter(chosen, chosen.end()), sample, random);
  return chosen;
}

/// Compares one frame of a chunk with the same frame rendered here.
std::optional<Difference> compare(const farm::WorkFolder& folder, const DoneChunk& chunk,
                                  uint64_t frame, const frames::WovenFrame& rendered) {
  const frames::SequenceReader reader(folder.chunk_file(chunk.report));
  frames::WovenFrame there(rendered.geometry());
  Difference difference{
      .frame = frame, .chunk = chunk.report.chunk, .node = chunk.report.node, .subpixels = 0};
  const uint64_t index = frame - chunk.report.begin;
  if (reader.geometry() != rendered.geometry() || index >= reader.frame_count() ||
      !reader.make_decoder().decode(index, there.bytes())) {
    difference.subpixels = rendered.bytes().size();
    return difference;
  }
  for (size_t i = 0; i < rendered.bytes().size(); ++i)
    if (rendered.bytes()[i] != there.bytes()[i]) ++difference.subpixels;
  return difference.subpixels > 0 ? std::optional(difference) : std::nullopt;
}

nlohmann::json result_json(uint64_t checked, uint64_t seed,
                           const std::vector<Difference>& differences) {
  nlohmann::json out = {
      {"frames_checked", checked}, {"seed", seed}, {"differences", nlohmann::json::array()}};
  for (const Difference& one : differences)
    out["differences"].push_back({{"frame", one.frame},
                                  {"chunk", one.chunk},
                                  {"node", one.node},
                                  {"subpixels", one.subpixels}});
  return out;
}

}  // namespace

PlannedFilm::PlannedFilm(const farm::Plan& plan, int threads) : plan_(plan) {
  if (plan.program != program_version())
    throw input_error("the plan was made by {}, this is {}", plan.program, program_version())
        .remedy("install the same version on all machines, or make a new plan");
  CLI::App app;
  const std::function<void()> complete = declare_render_flags(app, flags_);
  std::vector<std::string> arguments = plan.arguments;
  arguments.push_back(fmt::format("--frames={}:{}", plan.begin, plan.end));
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes a list
  try {
    app.parse(arguments);
  } catch (const CLI::ParseError& error) {
    throw input_error("plan.json: arguments: {}", error.what());
  }
  complete();
  flags_.options.threads = threads;
  renderer_ = std::make_unique<FilmRenderer>(flags_, player::FrameRange{plan.begin, plan.end});
  for (const auto& [what, digest] : digests_of_inputs(flags_, *renderer_)) {
    const auto planned = plan.inputs.find(what);
    if (planned == plan.inputs.end() || planned->second != digest)
      throw input_error("{}: the {} is not the one of the plan", plan.output, what)
          .remedy("put the planned file back, or make a new plan in a new folder");
  }
}

int PlannedFilm::threads() const { return threads_or_all(flags_.options.threads); }

void PlannedFilm::require_inputs_of(const farm::Chunk& chunk) const {
  if (plan_.chunk_inputs.empty() ||
      plan_.chunk_inputs[chunk.number] == digest_of_chunk_inputs(flags_, chunk))
    return;
  throw input_error("{}: frames {} to {} have changed since the plan was made", flags_.scene,
                    chunk.begin, chunk.end - 1)
      .remedy("put the planned files back, or make a new plan in a new folder");
}

// lenticule farm plan writes the work folder of a film that many processes render.

std::string farm_program(const std::string& given) {
  if (!given.empty()) return given;
  const auto program = find_sibling_program("lenticule");
  return program ? std::filesystem::weakly_canonical(*program).string() : "lenticule";
}

ExitCode farm_plan(const FarmFlags& flags) {
  require_film_name(flags);
  const std::filesystem::path folder = std::filesystem::absolute(flags.folder).lexically_normal();
  const player::FrameRange range = player::parse_frame_range(flags.render.frames);
  const auto begin = Clock::now();
  FilmRenderer renderer(flags.render, range);
  OutputRequest request =
      renderer.output_request(std::filesystem::absolute(flags.output).string(), range);
  request.overwrite = flags.overwrite;
  require_replaceable_film(request);

  farm::Plan plan;
  plan.program = program_version();
  plan.arguments = flags.arguments;
  plan.begin = range.begin;
  plan.end = range.end;
  plan.film = request.film;
  plan.inputs = digests_of_inputs(flags.render, renderer);
  plan.output = request.target;
  const auto there = farm::WorkFolder::plan_in(folder);
  if (there && flags.chunk_frames == "auto") {
    plan.chunk_frames = there->chunk_frames;  // the same plan again
    plan.timing = there->timing;
  } else {
    plan.timing = time_frames(renderer, flags, seconds_since(begin));
    if (player::interrupted()) return player::interrupt_exit_code();
    plan.chunk_frames =
        flags.chunk_frames == "auto"
            ? farm::choose_chunk_frames(plan.timing, range.count(), method_interval(renderer))
            : std::min(parse_chunk(flags.chunk_frames), range.count());
  }
  if (plan.chunks() > farm::kMostChunks)
    throw usage_error("--chunk {}: more than {} chunks", flags.chunk_frames, farm::kMostChunks);
  for (uint64_t chunk = 0; chunk < plan.chunks(); ++chunk) {
    const std::string digest = digest_of_chunk_inputs(flags.render, plan.chunk(chunk));
    if (digest.empty()) break;
    plan.chunk_inputs.push_back(digest);
  }
  if (farm::parse_plan(farm::plan_to_json(plan), "plan").arguments != plan.arguments)
    throw Error(ErrorKind::Usage, "a file's name is not UTF-8, which a plan cannot contain",
                "rename the file");
  farm::WorkFolder::create(folder, plan, farm_program(flags.program));
  print_result(plan_result(flags, plan), flags.json,
               [&](const nlohmann::json&) { print_plan(plan, folder); });
  return kOk;
}

// lenticule farm verify renders some frames again and compares them with the chunks: it finds a
// node whose processor or memory is faulty.

ExitCode farm_verify(const FarmFlags& flags) {
  const farm::WorkFolder folder(flags.folder);
  const std::vector<DoneChunk> chunks = done_chunks(folder);
  if (chunks.empty()) throw input_error("{}: no chunk is done", flags.folder);
  const uint64_t seed = flags.seed != 0 ? flags.seed : std::random_device{}();
  const auto chosen = choose_frames(chunks, flags.sample, seed);
  PlannedFilm film(folder.plan(), flags.threads);
  frames::WovenFrame rendered(film.renderer().geometry());
  std::vector<Difference> differences;
  player::Progress progress("verify", "frames", chosen.size());
  uint64_t checked = 0;
  std::optional<uint64_t> last;
  for (const auto& [frame, index] : chosen) {
    if (frame != last && !film.renderer().render(frame, rendered, player::interrupted))
      return player::interrupt_exit_code();
    last = frame;
    if (const auto difference = compare(folder, chunks[index], frame, rendered))
      differences.push_back(*difference);
    progress.update(++checked);
  }
  progress.finish();
  if (flags.json) {
    print_json(result_json(checked, seed, differences));
  } else {
    for (const Difference& one : differences)
      print_out("frame {}: {} subpixels differ in chunk {}, rendered by {}\n", one.frame,
                one.subpixels, one.chunk, one.node);
    print_out("{} frames rendered again, {} differ (seed {})\n", checked, differences.size(), seed);
  }
  return differences.empty() ? kOk : kQuality;
}
}  // namespace lenticule::tools
