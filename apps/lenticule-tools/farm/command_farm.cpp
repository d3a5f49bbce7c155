// SPDX-License-Identifier: Apache-2.0
// lenticule farm renders a film on many machines, with a scheduler that the user has already.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <memory>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/option.h"

namespace lenticule::tools {
namespace {

/// Adds an action on a work folder that is there. CLI11 runs the callback of the subcommand that
/// was given.
CLI::App* add_action(CLI::App& app, FarmFlags& flags, const char* name,
                     ExitCode (*action)(const FarmFlags&), const char* summary,
                     const char* example) {
  CLI::App* sub = app.add_subcommand(name, summary);
  sub->footer(fmt::format("Example:\n  {}", example));
  sub->add_flag("--json", flags.json, "print JSON");
  sub->add_option("DIR", flags.folder, "work folder that farm plan has made")->required();
  sub->callback([&flags, action] { flags.action = action; });
  return sub;
}

void add_threads(CLI::App& sub, FarmFlags& flags) {
  cli::add_option(sub, "--threads", flags.threads, "0 means all cores")->check(CLI::Range(0, 1024));
}

void add_program(CLI::App& sub, FarmFlags& flags) {
  cli::add_option(sub, "--program FILE", flags.program,
                  "lenticule as the other machines call it, if it is elsewhere there");
}

bool is_file(const CLI::Option& option) {
  for (const char* name : {"--rig", "--wall", "--camera", "--environment"})
    if (option.check_name(name)) return true;
  return false;
}

std::string absolute(const std::string& file) {
  return std::filesystem::absolute(file).lexically_normal().string();
}

/// Returns the scene and the flags of `render` that were given, with absolute names of files. The
/// number of threads and the frames are not among them.
std::vector<std::string> given_arguments(const std::vector<const CLI::Option*>& options) {
  std::vector<std::string> arguments;
  for (const CLI::Option* option : options) {
    if (option->count() == 0 || option->check_name("--frames") || option->check_name("--threads") ||
        option->check_name("--help"))
      continue;
    if (!option->nonpositional()) {
      const std::string& scene = option->results().front();
      arguments.push_back(scene.starts_with("builtin:") ? scene : absolute(scene));
      continue;
    }
    const std::string name = "--" + option->get_lnames().front();
    if (option->get_expected_max() == 0) {
      arguments.push_back(name);
      continue;
    }
    for (const std::string& value : option->results())
      arguments.push_back(fmt::format("{}={}", name, is_file(*option) ? absolute(value) : value));
  }
  return arguments;
}

/// Returns the function that completes the flags of `render` if the action was given.
std::function<void()> declare_plan(CLI::App& app, FarmFlags& flags) {
  CLI::App* sub = app.add_subcommand(
      "plan", "divide a film into chunks, and write a work folder with the command of each");
  sub->footer(
      "Example:\n  lenticule farm plan model.glb --frames 0:750 -o film.lts --work /shared/film");
  const std::function<void()> complete = declare_render_flags(*sub, flags.render);
  const CLI::App& parsed = *sub;
  const std::vector<const CLI::Option*> render_options =
      parsed.get_options([](const CLI::Option*) { return true; });
  cli::add_option(*sub, "--chunk N|auto", flags.chunk_frames,
                  "frames in a chunk; auto: as many as take two minutes or more");
  cli::add_option(*sub, "--timed-frames", flags.timed_frames,
                  "frames to render now, to measure their time")
      ->check(CLI::Range(0, 100));
  cli::add_option(*sub, "-o,--output FILE.lts", flags.output, "film to make")->required();
  cli::add_option(*sub, "--work DIR", flags.folder, "work folder, which all machines share")
      ->required();
  add_program(*sub, flags);
  sub->add_flag("--overwrite", flags.overwrite, kOverwriteHelp);
  sub->add_flag("--json", flags.json, "print JSON");
  const CLI::Option* const rig = sub->get_option("--rig");
  sub->callback([&flags] { flags.action = farm_plan; });
  return [&flags, complete, render_options, rig] {
    if (flags.action != farm_plan) return;
    complete();
    flags.arguments = given_arguments(render_options);
    if (rig->count() == 0 && flags.render.wall.empty())
      flags.arguments.push_back("--rig=" + absolute(flags.render.rig));
  };
}

void declare_submit(CLI::App& app, FarmFlags& flags) {
  CLI::App* sub = add_action(app, flags, "submit", farm_submit,
                             "give the chunks that are not done to a scheduler",
                             "lenticule farm submit /shared/film --slurm --array-limit 100");
  sub->add_flag("--slurm", flags.slurm, "submit an array job and a job that merges to Slurm");
  sub->add_flag("--dry-run", flags.dry_run, "print the scripts instead");
  cli::add_option(*sub, "--partition NAME", flags.options.partition, "Slurm's partition");
  cli::add_option(*sub, "--time TIME", flags.options.time,
                  "time limit of a chunk as sbatch takes it")
      ->default_str("from the timed frames");
  cli::add_option(*sub, "--mem SIZE", flags.options.memory, "memory of a chunk as sbatch takes it")
      ->default_str("from the timed frames");
  sub->add_option("--cpus", flags.options.cpus, "processors of a chunk")
      ->default_str("as many as timed the frames")
      ->check(CLI::Range(1, 1024));
  sub->add_option("--array-limit", flags.options.array_limit, "chunks that run at the same time")
      ->check(CLI::Range(1, 1'000'000));
  cli::add_option(*sub, "--sbatch ARGUMENT", flags.options.more,
                  "a further argument of sbatch: --sbatch=--account=film; may be repeated")
      ->allow_extra_args(false);
  add_program(*sub, flags);
}

void declare_render_chunk(CLI::App& app, FarmFlags& flags) {
  CLI::App* sub = add_action(app, flags, "render", farm_render,
                             "render one chunk: what the lines of commands.txt do",
                             "lenticule farm render /shared/film 17");
  sub->add_option("CHUNK", flags.chunk, "number of the chunk")->required();
  add_threads(*sub, flags);
}

void declare_looks(CLI::App& app, FarmFlags& flags) {
  CLI::App* show = add_action(app, flags, "status", farm_status,
                              "show what is done, runs, failed and is missing, and the time left",
                              "lenticule farm status /shared/film --watch");
  show->add_flag("--watch", flags.watch, "show it every two seconds until all chunks are done");

  CLI::App* check =
      add_action(app, flags, "verify", farm_verify,
                 "render some frames again and compare them, to find a node that is faulty",
                 "lenticule farm verify /shared/film --sample 20");
  cli::add_option(*check, "--sample", flags.sample, "number of frames, chosen at random");
  check->add_option("--seed", flags.seed, "of the random choice, to make it again (0: another)");
  add_threads(*check, flags);
}

void declare_results(CLI::App& app, FarmFlags& flags) {
  CLI::App* join =
      add_action(app, flags, "merge", farm_merge, "check the chunks and join them to the film",
                 "lenticule farm merge /shared/film");
  cli::add_option(*join, "-o,--output FILE.lts", flags.output,
                  "another name of the film than the planned one");
  join->add_flag("--partial", flags.partial, "join the frames before the first missing chunk");
  cli::add_option(*join, "--wait SECONDS", flags.wait_seconds,
                  "how long to wait for chunks that a network file system shows late")
      ->check(CLI::Range(0, 86400));
  join->add_flag("--overwrite", flags.overwrite, kOverwriteHelp);

  CLI::App* play = add_action(app, flags, "feed", farm_feed,
                              "pass frames to a waiting player in their order while they are made",
                              "lenticule farm feed /shared/film ring:/tmp/lenticule.sock");
  play->add_option("RING", flags.output, "ring:SOCKET of the player")->required();
  cli::add_option(*play, "--ring-timeout SECONDS", flags.ring_timeout,
                  "how long to wait for a player, including one that restarts")
      ->check(CLI::Range(0.0, 86400.0));
}

}  // namespace

cli::Run declare_farm(CLI::App& app) {
  const auto flags = std::make_shared<FarmFlags>();
  app.require_subcommand(1);
  const std::function<void()> complete = declare_plan(app, *flags);
  declare_submit(app, *flags);
  declare_looks(app, *flags);
  declare_results(app, *flags);
  declare_render_chunk(app, *flags);
  return [flags, complete]() -> ExitCode {
    complete();
    return flags->action(*flags);
  };
}

}  // namespace lenticule::tools
