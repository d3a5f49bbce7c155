// SPDX-License-Identifier: Apache-2.0
// lenticule-video does all work with FFmpeg for lenticule in a separate process, which may crash.

#include <CLI/CLI.hpp>
#include <functional>
#include <map>

#include "apps/lenticule-video/subcommands.h"
#include "base/exit_code.h"
#include "base/main_function.h"

namespace {

using namespace lenticule::video;
using lenticule::ExitCode;
using Run = std::function<int()>;

constexpr lenticule::ErrorStyle kStyle{.program = "lenticule-video"};

Run declare_probe(CLI::App& app) {
  const auto file = std::make_shared<std::string>();
  app.add_option("FILE", *file, "video file")->required();
  return [file] { return run_probe(*file); };
}

Run declare_decode(CLI::App& app) {
  const auto request = std::make_shared<DecodeRequest>();
  app.add_option("FILE", request->file, "video file")->required();
  app.add_option("--ring", request->ring, "socket of the player's ring")->required();
  app.add_option("--rig-fingerprint", request->rig_fingerprint,
                 "fingerprint of the rig, for a ring that checks it");
  app.add_option("--stream", request->stream,
                 "index of the stream; default: the first with pictures");
  app.add_option_function<std::string>(
      "--rate",
      [request](const std::string& rate) { request->rate = lenticule::frames::parse_rate(rate); },
      "number frames by their time stamps at this rate; default: in turn");
  app.add_option("--begin", request->begin, "first frame to use");
  app.add_option("--end", request->end, "frame after the last one to use");
  app.add_option("--from", request->from, "frame to start with");
  app.add_option("--position", request->position, "number of the start frame in the ring");
  app.add_option("--known-frame", request->known_frame,
                 "frame of the file whose time stamp is --known-time, for seeking");
  app.add_option("--known-time", request->known_time, "time stamp of --known-frame");
  app.add_flag("--loop", request->loop, "repeat until the player ends");
  app.add_flag("--before-weaving", request->before_weaving,
               "accept chroma of lower resolution, because the frames are not woven yet");
  app.add_option("--orientation", request->orientation,
                 "rotation of the frames, numbered as in EXIF")
      ->check(CLI::Range(1, 8));
  app.add_option("--threads", request->threads, "default: the number of cores, at most 4")
      ->check(CLI::Range(0, 64));
  const std::map<std::string, Decoder> decoders = {
      {"auto", Decoder::Auto}, {"software", Decoder::Software}, {"hardware", Decoder::Hardware}};
  app.add_option("--decoder", request->decoder,
                 "auto: hardware if the machine has it for this stream; software; hardware")
      ->transform(CLI::CheckedTransformer(decoders))
      ->default_str("auto");
  app.add_option("--parent", request->parent, "exit when this process ends");
  return [request] { return run_decode(*request); };
}

Run declare_sound(CLI::App& app) {
  const auto request = std::make_shared<SoundRequest>();
  app.add_option("FILE", request->file, "file with sound")->required();
  app.add_option("--ring-fd", request->ring_fd, "descriptor of the player's ring")->required();
  app.add_option("--stream", request->stream, "index of the stream")->required();
  app.add_option_function<std::string>(
      "--fps",
      [request](const std::string& rate) { request->fps = lenticule::frames::parse_rate(rate); },
      "rate of the pictures; default: the sound is that of a still picture");
  app.add_option("--frames", request->frames, "pictures of a round; default: those of the file");
  app.add_option("--begin", request->begin, "first picture to use");
  app.add_option("--from", request->from, "picture of the first round to start with");
  app.add_option("--parent", request->parent, "exit when this process ends");
  return [request] { return run_sound(*request); };
}

Run declare_encode(CLI::App& app) {
  const auto request = std::make_shared<EncodeRequest>();
  app.add_option("--width", request->width, "pixels")->required();
  app.add_option("--height", request->height, "pixels")->required();
  app.add_option("--rate", request->rate, "frames per second")->capture_default_str();
  app.add_option("--codec", request->codec, "codec; both are lossless")
      ->check(CLI::IsMember({"ffv1", "x264rgb"}))
      ->capture_default_str();
  app.add_option("--parent", request->parent, "exit when this process ends");
  return [request] { return run_encode(*request); };
}

}  // namespace

int main(int argc, char** argv) {
  if (const int code = lenticule::prepare_program(kStyle); code != ExitCode::kOk) return code;
  av_log_set_level(AV_LOG_QUIET);  // errors are reported by this program from FFmpeg's error codes
  CLI::App app{"Reads and writes video files for lenticule, in a process of its own."};
  app.name("lenticule-video");
  app.set_version_flag("--version", std::string("lenticule-video ") + LENTICULE_VERSION);
  std::string player;
  app.add_option("--for", player, "version of the program that starts this one")
      ->check([](const std::string& version) -> std::string {
        if (version == LENTICULE_VERSION) return {};
        return "this is version " LENTICULE_VERSION " of the decoders, and version " + version +
               " of the player runs: restart the player";
      });
  app.require_subcommand(1);
  std::map<const CLI::App*, Run> runs;
  CLI::App* const probe = app.add_subcommand("probe", "print the contents of a file as JSON");
  CLI::App* const decode = app.add_subcommand("decode", "decode a file into a player's ring");
  CLI::App* const sound = app.add_subcommand("sound", "decode sound into a player's memory");
  CLI::App* const encode = app.add_subcommand(
      "encode", "encode raw frames from standard input to a file, standard output");
  runs[probe] = declare_probe(*probe);
  runs[decode] = declare_decode(*decode);
  runs[sound] = declare_sound(*sound);
  runs[encode] = declare_encode(*encode);
  if (const auto code = lenticule::parse_arguments<CLI::ParseError>(app, argc, argv, kStyle))
    return *code;
  return lenticule::run_reporting_errors(runs.at(app.get_subcommands().front()), kStyle);
}
