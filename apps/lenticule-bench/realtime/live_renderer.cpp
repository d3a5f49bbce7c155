// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/realtime/live_renderer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <new>
#include <thread>

#include "apps/lenticule-bench/harness/bench_scene.h"
#include "apps/lenticule-tools/offline/film_renderer.h"
#include "base/large_memory.h"
#include "frames/compare.h"
#include "frames/ring/ring_renderer.h"
#include "optics/model.h"
#include "player/playback/play_statistics.h"
#include "player/process/interrupt.h"
#include "render/methods/method.h"

namespace lenticule::bench {

namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using Clock = std::chrono::steady_clock;

/// Longest delay until an interruption is noticed during a wait.
constexpr milliseconds kWaitSlice{50};
constexpr milliseconds kConnectTimeout{10'000};
/// Longest wait for the player to free a slot, and to show its last frames.
constexpr milliseconds kPlayerTimeout{30'000};
constexpr milliseconds kSilence{600'000};
/// Longest wait for messages after an interruption.
constexpr milliseconds kLastWords{10'000};

int64_t now_ns() {
  return std::chrono::duration_cast<nanoseconds>(Clock::now().time_since_epoch()).count();
}

/// LiveRun is the renderer's work, in the renderer's process.
class LiveRun {
 public:
  LiveRun(const LiveSetup& setup, const std::filesystem::path& socket, RunLog& log)
      : setup_(setup),
        log_(log),
        scene_(setup.scene, setup.fps),
        model_(setup.rig),
        stages_(scene_.after(0), render::canvas_of(model_), {}),
        frame_(geometry()),
        ring_(frames::RingRenderer::connect(
            socket,
            {.name = "bench realtime", .rig_fingerprint = {}, .rate = {}, .frame_count = {}},
            kConnectTimeout)),
        keeper_({}, setup.threads) {
    render::RenderOptions options = options_of_reference();
    options.copy_unchanged = true;  // as `lenticule render` does
    options.tolerated_error = setup.entrant.tolerated.value_or(options.tolerated_error);
    options.proven_rmse = setup.entrant.proven_rmse;
    method_ = render::make_method(setup.entrant.method, model_, options);
    if (setup.adapt_rate) adapt(*setup.adapt_rate);
    for (int n = 0; n < setup.samples; ++n)
      samples_.push_back({.pixels = frames::WovenFrame(geometry())});
  }

  /// Renders until the time is over, the player is gone, or the process is interrupted.
  void run() {
    log_.prefault();
    FrameRecord unmeasured;  // takes the memory that every frame needs
    if (!render(1, unmeasured)) return;
    const double cpu_s = process_cpu_seconds();
    start_ns_ = now_ns();
    int64_t free_ns = start_ns_;
    for (uint64_t next = 0; next < log_.capacity();) {
      FrameRecord record;
      record.free_ns = free_ns;
      record.number = std::max(next, frame_at(free_ns));
      record.due_ns = due_ns(record.number);
      if (record.number >= log_.capacity() || !wait_until(record.due_ns)) break;
      record.begun_ns = now_ns();
      if (!render(record.number, record) || !deliver(record)) break;
      next = record.number + 1;
      keep_if_sample(record);
      if (controller_) controller_->add_frame(work_seconds(record));
      free_ns = now_ns();
    }
    log_.state().cpu_s = process_cpu_seconds() - cpu_s;
    ring_->finish();
  }

  /// Compares the samples with method full, and passes a message about each to `send`.
  void compare(const std::function<void(const nlohmann::json&)>& send) {
    const Clock::time_point deadline = Clock::now() + kPlayerTimeout;
    while (!log_.state().player_finished && !stops() && Clock::now() < deadline)
      std::this_thread::sleep_for(milliseconds(10));
    method_ = render::make_method("full", model_, options_of_reference());
    controller_.reset();
    for (const Sample& sample : samples_) {
      if (!sample.taken) continue;
      FrameRecord unused;
      if (!render(sample.record.number, unused)) return;
      const frames::Difference difference =
          frames::compare_pictures(frame_.view(), sample.pixels.view()).total;
      send({{"sample",
             {{"frame", sample.frame},
              {"number", sample.record.number},
              {"tolerated_error", sample.record.tolerated_error},
              {"mse", difference.mse()},
              {"max", difference.max()}}}});
    }
  }

 private:
  struct Sample {
    frames::WovenFrame pixels;
    FrameRecord record{};
    uint64_t frame = 0;  ///< index among the published frames
    bool taken = false;
  };

  [[nodiscard]] bool stops() const { return player::interrupted() || log_.state().stop; }

  [[nodiscard]] frames::FrameGeometry geometry() const {
    return {setup_.rig.panel.width_px, setup_.rig.panel.height_px, frames::PixelFormat::Rgb8};
  }

  [[nodiscard]] render::RenderOptions options_of_reference() const {
    render::RenderOptions options;
    options.threads = setup_.threads;
    options.max_depth = setup_.depth;
    options.cancelled = [this] { return stops(); };
    return options;
  }

  void adapt(double frames_per_s) {
    controller_.emplace(frames_per_s);
    if (!method_->set_tolerated_error(controller_->error()))
      throw Error(ErrorKind::Usage,
                  fmt::format("--adapt-error: method {} tolerates no error on this rig",
                              setup_.entrant.method),
                  "leave out --adapt-error");
  }
  /// Returns the time of a frame without the wait for a slot.
  [[nodiscard]] static double work_seconds(const FrameRecord& record) {
    const int64_t ns =
        record.published_ns - record.begun_ns - (record.acquired_ns - record.rendered_ns);
    return static_cast<double>(ns) * 1e-9;
  }

  [[nodiscard]] int64_t due_ns(uint64_t number) const {
    return start_ns_ + static_cast<int64_t>(static_cast<double>(number) * 1e9 / setup_.fps.hertz());
  }
  /// Returns the last frame of the scene that is due at a time.
  [[nodiscard]] uint64_t frame_at(int64_t ns) const {
    return static_cast<uint64_t>(static_cast<double>(ns - start_ns_) * 1e-9 * setup_.fps.hertz());
  }

  /// Returns false if interrupted.
  [[nodiscard]] bool wait_until(int64_t ns) const {
    while (!stops()) {
      const nanoseconds left(ns - now_ns());
      if (left.count() <= 0) return true;
      std::this_thread::sleep_for(std::min<nanoseconds>(left, kWaitSlice));
    }
    return false;
  }

  /// Returns false if interrupted.
  [[nodiscard]] bool render(uint64_t number, FrameRecord& record) {
    if (!committed_ || !scene_.still()) {
      const auto description =
          std::make_shared<const render::SceneDescription>(scene_.after(number));
      stage_ = stages_.at(*description);
      committed_ = &keeper_.commit(description, stage_);
    }
    record.committed_ns = now_ns();
    record.tolerated_error = setup_.entrant.tolerated.value_or(0.0);
    if (controller_) {
      record.tolerated_error = controller_->error();
      LENTICULE_CHECK(method_->set_tolerated_error(record.tolerated_error));
    }
    method_->set_frame(number);
    const render::RenderStatistics statistics = method_->render(*committed_, stage_, frame_);
    record.rendered_ns = now_ns();
    record.audited_rmse = statistics.audited_rmse;
    return statistics.completed;
  }

  /// Returns false if interrupted or if the player is gone.
  [[nodiscard]] bool deliver(FrameRecord& record) {
    std::span<uint8_t> slot;
    frames::RingStatus status = frames::RingStatus::TimedOut;
    const Clock::time_point deadline = Clock::now() + kPlayerTimeout;
    while (status == frames::RingStatus::TimedOut && !stops() && Clock::now() < deadline)
      status = ring_->acquire(record.number, kWaitSlice, slot);
    if (status != frames::RingStatus::Ok) return false;
    record.acquired_ns = now_ns();
    const std::span<const uint8_t> pixels = frame_.view().bytes;
    std::memcpy(slot.data(), pixels.data(), std::min(slot.size(), pixels.size()));
    // The record is complete before the player can show the frame.
    record.memory_bytes = player::read_resident_memory().anonymous;
    const struct mallinfo2 heap = mallinfo2();
    record.in_use_bytes = heap.uordblks + heap.hblkhd;
    record.published_ns = now_ns();
    log_.add(record);
    const bool published = ring_->publish() == frames::RingStatus::Ok;
    if (log_.frames().size() % kFramesPerReturn == 0) return_free_memory();
    return published;
  }

  /// Keeps the first frame of each of equal parts of the run.
  void keep_if_sample(const FrameRecord& record) {
    if (next_sample_ >= samples_.size()) return;
    const double part = static_cast<double>(record.number) / static_cast<double>(log_.capacity());
    const double parts = static_cast<double>(samples_.size());
    if (part * parts < static_cast<double>(next_sample_)) return;
    Sample& sample = samples_[next_sample_];
    std::ranges::copy(frame_.view().bytes, sample.pixels.bytes().begin());
    sample.record = record;
    sample.frame = log_.frames().size() - 1;
    sample.taken = true;
    next_sample_ = static_cast<size_t>(part * parts) + 1;
  }

  const LiveSetup& setup_;
  RunLog& log_;
  ErrorScene scene_;
  optics::OpticalModel model_;
  tools::StageSequence stages_;
  frames::WovenFrame frame_;
  std::unique_ptr<frames::RingRenderer> ring_;
  std::unique_ptr<render::Method> method_;
  std::optional<tools::ErrorController> controller_;
  render::Stage stage_;
  render::SceneKeeper keeper_;
  const render::Scene* committed_ = nullptr;
  std::vector<Sample> samples_;
  size_t next_sample_ = 0;
  int64_t start_ns_ = 0;
};

/// Writes a message and a line end. A reader that is gone ends the process.
void send_line(int fd, const nlohmann::json& message) noexcept {
  const std::string line =
      message.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
  for (size_t done = 0; done < line.size();) {
    const ssize_t written = write(fd, line.data() + done, line.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) _exit(1);
    done += static_cast<size_t>(written);
  }
}

[[noreturn]] void run_renderer(const LiveSetup& setup, const std::filesystem::path& socket,
                               RunLog& log, int fd) noexcept {
  const auto fail = [fd](const char* what, const std::string& hint, ErrorKind kind) {
    send_line(fd, {{"failed", what}, {"hint", hint}, {"kind", static_cast<int>(kind)}});
    _exit(1);
  };
  try {
    LiveRun run(setup, socket, log);
    run.run();
    run.compare([fd](const nlohmann::json& message) { send_line(fd, message); });
    send_line(fd, {{"finished", true}});
  } catch (const Error& error) {
    fail(error.what(), error.hint(), error.kind());
  } catch (const std::exception& error) {
    fail(error.what(), {}, ErrorKind::Failed);
  }
  _exit(0);
}

}  // namespace

RunLog::RunLog(uint64_t capacity) : capacity_(capacity) {
  constexpr size_t kStateBytes = 64;
  static_assert(sizeof(State) <= kStateBytes && kStateBytes % alignof(FrameRecord) == 0);
  bytes_ = kStateBytes + capacity * sizeof(FrameRecord);
  memory_ = mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory_ == MAP_FAILED)
    throw Error(ErrorKind::Failed, "bench realtime: no memory for the records of all frames",
                "measure fewer --seconds");
  state_ = new (memory_) State;
  records_ = reinterpret_cast<FrameRecord*>(static_cast<char*>(memory_) + kStateBytes);
}

uint64_t most_frames(const LiveSetup& setup) {
  return static_cast<uint64_t>(std::max(1.0, std::ceil(setup.seconds * setup.fps.hertz() - 1e-6)));
}

RendererProcess::RendererProcess(const LiveSetup& setup, const std::filesystem::path& socket,
                                 RunLog& log) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw Error(ErrorKind::Failed, fmt::format("bench realtime: no pipe: {}", strerror(errno)));
  messages_ = UniqueFd(ends[0]);
  const UniqueFd writer(ends[1]);
  pid_ = fork();
  if (pid_ < 0)
    throw Error(
        ErrorKind::Failed,
        fmt::format("bench realtime: cannot start a renderer process: {}", strerror(errno)));
  if (pid_ == 0) {
    messages_.reset();
    run_renderer(setup, socket, log, writer.get());
  }
}

RendererProcess::~RendererProcess() {
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

std::optional<nlohmann::json> RendererProcess::next_message() {
  Clock::time_point deadline = Clock::now() + kSilence;
  bool hurried = false;
  for (;;) {
    if (const size_t end = unread_.find('\n'); end != std::string::npos) {
      const auto message = nlohmann::json::parse(unread_.substr(0, end));
      unread_.erase(0, end + 1);
      return message;
    }
    if (player::interrupted() && !hurried) deadline = std::min(deadline, Clock::now() + kLastWords);
    hurried = hurried || player::interrupted();
    if (Clock::now() >= deadline) return std::nullopt;
    pollfd query = {.fd = messages_.get(), .events = POLLIN, .revents = 0};
    if (poll(&query, 1, static_cast<int>(kWaitSlice.count())) <= 0) continue;
    char text[4096];
    const ssize_t length = read(messages_.get(), text, sizeof text);
    if (length < 0 && errno == EINTR) continue;
    if (length <= 0) return std::nullopt;
    unread_.append(text, static_cast<size_t>(length));
  }
}
}  // namespace lenticule::bench
