// SPDX-License-Identifier: Apache-2.0
// lenticule farm renders a film on many machines, with a scheduler that the user has already.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <utility>

#include "apps/lenticule-tools/farm/actions.h"
#include "apps/lenticule-tools/offline/frame_output.h"
#include "apps/lenticule/cli/command.h"
#include "base/error.h"

namespace lenticule::tools {
namespace {

struct FarmFlags {
  FarmPlanFlags plan;
  FarmRenderFlags render;
  FarmSubmitFlags submit;
  FarmStatusFlags status;
  FarmMergeFlags merge;
  FarmVerifyFlags verify;
  FarmFeedFlags feed;
};

using Actions = std::vector<std::pair<const CLI::App*, cli::Run>>;

CLI::App* add_action(CLI::App& app, const char* name, const char* summary, const char* example,
                     bool& as_json) {
  CLI::App* sub = app.add_subcommand(name, summary);
  sub->footer(fmt::format("Example:\n  {}", example));
  sub->add_flag("--json", as_json, "print JSON");
  return sub;
}

void add_folder(CLI::App& sub, std::string& folder) {
  sub.add_option("DIR", folder, "work folder that farm plan has made")->required();
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

void declare_plan(CLI::App& app, const std::shared_ptr<FarmFlags>& flags, Actions& actions) {
  CLI::App* sub = app.add_subcommand(
      "plan", "divide a film into chunks, and write a work folder with the command of each");
  sub->footer(
      "Example:\n  lenticule farm plan model.glb --frames 0:750 -o film.lts --work /shared/film");
  FarmPlanFlags& plan = flags->plan;
  const std::function<void()> complete = declare_render_flags(*sub, plan.render);
  const CLI::App& parsed = *sub;
  const std::vector<const CLI::Option*> render_options =
      parsed.get_options([](const CLI::Option*) { return true; });
  sub->add_option("--chunk", plan.chunk,
                  "frames in a chunk; auto: as many as take two minutes or more")
      ->capture_default_str()
      ->type_name("N|auto");
  sub->add_option("--timed-frames", plan.timed_frames,
                  "frames to render now, to measure their time")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  sub->add_option("-o,--output", plan.output, "film to make")->type_name("FILE.lts")->required();
  sub->add_option("--work", plan.work, "work folder, which all machines share")
      ->type_name("DIR")
      ->required();
  sub->add_option("--program", plan.program,
                  "lenticule as the other machines call it, if it is elsewhere there")
      ->type_name("FILE");
  sub->add_flag("--overwrite", plan.overwrite, kOverwriteHelp);
  sub->add_flag("--json", plan.json, "print JSON");
  const CLI::Option* const rig = sub->get_option("--rig");
  actions.emplace_back(sub, [flags, complete, render_options, rig] {
    complete();
    flags->plan.arguments = given_arguments(render_options);
    if (rig->count() == 0 && flags->plan.render.wall.empty())
      flags->plan.arguments.push_back("--rig=" + absolute(flags->plan.render.rig));
    return farm_plan(flags->plan);
  });
}

void declare_submit(CLI::App& app, const std::shared_ptr<FarmFlags>& flags, Actions& actions) {
  FarmSubmitFlags& submit = flags->submit;
  CLI::App* sub =
      add_action(app, "submit", "give the chunks that are not done to a scheduler",
                 "lenticule farm submit /shared/film --slurm --array-limit 100", submit.json);
  add_folder(*sub, submit.folder);
  sub->add_flag("--slurm", submit.slurm, "submit an array job and a job that merges to Slurm");
  sub->add_flag("--dry-run", submit.dry_run, "print the scripts instead");
  sub->add_option("--partition", submit.options.partition, "Slurm's partition")->type_name("NAME");
  sub->add_option("--time", submit.options.time, "time limit of a chunk as sbatch takes it")
      ->type_name("TIME")
      ->default_str("from the timed frames");
  sub->add_option("--mem", submit.options.memory, "memory of a chunk as sbatch takes it")
      ->type_name("SIZE")
      ->default_str("from the timed frames");
  sub->add_option("--cpus", submit.options.cpus, "processors of a chunk")
      ->default_str("as many as timed the frames")
      ->check(CLI::Range(1, 1024));
  sub->add_option("--array-limit", submit.options.array_limit, "chunks that run at the same time")
      ->check(CLI::Range(1, 1'000'000));
  sub->add_option("--sbatch", submit.options.more,
                  "a further argument of sbatch: --sbatch=--account=film; may be repeated")
      ->type_name("ARGUMENT")
      ->allow_extra_args(false);
  sub->add_option("--program", submit.program,
                  "lenticule as the other machines call it, if it is elsewhere there")
      ->type_name("FILE");
  actions.emplace_back(sub, [flags] { return farm_submit(flags->submit); });
}

void declare_render_chunk(CLI::App& app, const std::shared_ptr<FarmFlags>& flags,
                          Actions& actions) {
  FarmRenderFlags& render = flags->render;
  CLI::App* sub = add_action(app, "render", "render one chunk: what the lines of commands.txt do",
                             "lenticule farm render /shared/film 17", render.json);
  add_folder(*sub, render.folder);
  sub->add_option("CHUNK", render.chunk, "number of the chunk")->required();
  sub->add_option("--threads", render.threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  actions.emplace_back(sub, [flags] { return farm_render(flags->render); });
}

void declare_looks(CLI::App& app, const std::shared_ptr<FarmFlags>& flags, Actions& actions) {
  FarmStatusFlags& status = flags->status;
  CLI::App* show =
      add_action(app, "status", "show what is done, runs, failed and is missing, and the time left",
                 "lenticule farm status /shared/film --watch", status.json);
  add_folder(*show, status.folder);
  show->add_flag("--watch", status.watch, "show it every two seconds until all chunks are done");
  actions.emplace_back(show, [flags] { return farm_status(flags->status); });

  FarmVerifyFlags& verify = flags->verify;
  CLI::App* check = add_action(
      app, "verify", "render some frames again and compare them, to find a node that is faulty",
      "lenticule farm verify /shared/film --sample 20", verify.json);
  add_folder(*check, verify.folder);
  check->add_option("--sample", verify.sample, "number of frames, chosen at random")
      ->capture_default_str();
  check->add_option("--seed", verify.seed, "of the random choice, to make it again (0: another)");
  check->add_option("--threads", verify.threads, "0 means all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  actions.emplace_back(check, [flags] { return farm_verify(flags->verify); });
}

void declare_results(CLI::App& app, const std::shared_ptr<FarmFlags>& flags, Actions& actions) {
  FarmMergeFlags& merge = flags->merge;
  CLI::App* join = add_action(app, "merge", "check the chunks and join them to the film",
                              "lenticule farm merge /shared/film", merge.json);
  add_folder(*join, merge.folder);
  join->add_option("-o,--output", merge.output, "another name of the film than the planned one")
      ->type_name("FILE.lts");
  join->add_flag("--partial", merge.partial, "join the frames before the first missing chunk");
  join->add_option("--wait", merge.wait_seconds,
                   "how long to wait for chunks that a network file system shows late")
      ->type_name("SECONDS")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  join->add_flag("--overwrite", merge.overwrite, kOverwriteHelp);
  actions.emplace_back(join, [flags] { return farm_merge(flags->merge); });

  FarmFeedFlags& feed = flags->feed;
  CLI::App* play =
      add_action(app, "feed", "pass frames to a waiting player in their order while they are made",
                 "lenticule farm feed /shared/film ring:/tmp/lenticule.sock", feed.json);
  add_folder(*play, feed.folder);
  play->add_option("RING", feed.output, "ring:SOCKET of the player")->required();
  play->add_option("--ring-timeout", feed.ring_timeout,
                   "how long to wait for a player, including one that restarts")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  actions.emplace_back(play, [flags] { return farm_feed(flags->feed); });
}

}  // namespace

cli::Run declare_farm(CLI::App& app) {
  auto flags = std::make_shared<FarmFlags>();
  app.require_subcommand(1);
  Actions actions;
  declare_plan(app, flags, actions);
  declare_submit(app, flags, actions);
  declare_looks(app, flags, actions);
  declare_results(app, flags, actions);
  declare_render_chunk(app, flags, actions);
  return [actions]() -> ExitCode {
    for (const auto& [sub, run] : actions)
      if (sub->parsed()) return run();
    throw Error(ErrorKind::Usage, "farm: no action", "see lenticule farm --help");
  };
}

}  // namespace lenticule::tools
