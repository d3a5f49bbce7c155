// SPDX-License-Identifier: Apache-2.0
#include "player/sources/capture_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "base/error_kinds.h"
#include "base/text.h"
#include "base/unique_fd.h"

namespace lenticule::player {
namespace {

using namespace frames::capture;

using std::chrono::milliseconds;
using std::chrono::seconds;

/// Largest distance of pictures of one moment when the cameras do not state a rate.
constexpr Nanoseconds kUsualApart = milliseconds(20);
/// Time without a picture after which a camera counts as silent. Some take seconds to start.
constexpr Nanoseconds kSilence = seconds(3), kSilenceAtStart = seconds(10);
constexpr Nanoseconds kLongestWait = milliseconds(100);
/// A larger gap in the driver's numbers is a wrong number.
constexpr uint64_t kMostLost = 1000;
/// Larger pictures are converted by several threads.
constexpr int64_t kPixelsOfThread = int64_t{1} << 20;
constexpr int kMostThreads = 4;
constexpr int kMostAcquired = 4;

/// CaptureFeed captures on a thread and keeps the newest picture. Thread safety: any thread.
class CaptureFeed {
 public:
  struct Picture {
    frames::WovenFrame frame;
    uint64_t number = 0;  ///< counts from 1
    Nanoseconds captured{0};
  };

  CaptureFeed(const CaptureSpec& spec, const frames::FrameGeometry& panel, V4l2System& system)
      : cameras_(std::make_unique<LiveCameras>(spec, panel, system, *statistics_)),
        geometry_(cameras_->geometry()),
        rate_(cameras_->rate()) {
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }

  [[nodiscard]] frames::FrameGeometry geometry() const { return geometry_; }
  [[nodiscard]] std::optional<frames::Rate> rate() const { return rate_; }
  [[nodiscard]] const std::shared_ptr<CaptureStatistics>& statistics() const { return statistics_; }
  /// Returns the newest picture if it is newer than that; null otherwise.
  [[nodiscard]] std::shared_ptr<const Picture> newer_than(uint64_t number) {
    const std::lock_guard lock(mutex_);
    if (!newest_ || newest_->number <= number) return nullptr;
    used_ = true;
    return newest_;
  }
  void give_back(std::shared_ptr<const Picture>& picture) {
    const std::lock_guard lock(mutex_);
    picture.reset();
  }
  [[nodiscard]] std::string failure() const {
    const std::lock_guard lock(mutex_);
    return failure_;
  }
  /// Signals `wake` at each picture and at a failure, until forget().
  void listen(WakeFd& wake) {
    const std::lock_guard lock(mutex_);
    listeners_.push_back(&wake);
  }
  void forget(WakeFd& wake) {
    const std::lock_guard lock(mutex_);
    std::erase(listeners_, &wake);
  }

 private:
  void run(const std::stop_token& stop) noexcept {
    std::string failure;
    try {
      while (!stop.stop_requested()) {
        const std::shared_ptr<Picture> picture = unused_picture();
        const GrabStatus status = cameras_->next(picture->frame, picture->captured, kLongestWait);
        if (status == GrabStatus::Gone) throw Error(ErrorKind::Device, cameras_->failure());
        if (status == GrabStatus::Ready) publish(picture);
      }
      return;
    } catch (const std::exception& error) {
      failure = error.what();
    }
    cameras_.reset();  // another attempt may open the devices at once
    const std::lock_guard lock(mutex_);
    failure_ = std::move(failure);
    for (WakeFd* const wake : listeners_) wake->signal();
  }
  /// Returns a picture that no other thread refers to. The sources limit their number.
  [[nodiscard]] std::shared_ptr<Picture> unused_picture() {
    const std::lock_guard lock(mutex_);
    for (const auto& picture : pool_)
      if (picture.use_count() == 1) return picture;
    pool_.push_back(std::make_shared<Picture>());
    pool_.back()->frame = frames::WovenFrame(geometry_);
    return pool_.back();
  }
  void publish(const std::shared_ptr<Picture>& picture) {
    const std::lock_guard lock(mutex_);
    if (newest_ && !used_) statistics_->superseded.add();
    picture->number = ++published_;
    newest_ = picture;
    used_ = false;
    for (WakeFd* const wake : listeners_) wake->signal();
  }

  const std::shared_ptr<CaptureStatistics> statistics_ = std::make_shared<CaptureStatistics>();
  std::unique_ptr<LiveCameras> cameras_;  ///< used by the thread
  const frames::FrameGeometry geometry_;
  const std::optional<frames::Rate> rate_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::vector<std::shared_ptr<Picture>> pool_;
  std::shared_ptr<const Picture> newest_;
  bool used_ = false;  ///< a source has taken the newest picture
  uint64_t published_ = 0;
  std::string failure_;
  std::vector<WakeFd*> listeners_;
  std::jthread thread_;  // last member: the thread uses everything above
};

/// Returns the feed of that name; a driver lends a camera only once, and a list may show it twice
/// in a row.
std::shared_ptr<CaptureFeed> feed_of(const std::string& text, const frames::FrameGeometry& panel,
                                     V4l2System& system) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<CaptureFeed>> feeds;
  const CaptureSpec spec = parse_capture(text);
  const std::lock_guard lock(mutex);
  std::erase_if(feeds, [](const auto& feed) { return feed.second.expired(); });
  const auto known = feeds.find(text);
  if (known != feeds.end())
    if (auto feed = known->second.lock(); feed && feed->failure().empty()) return feed;
  auto feed = std::make_shared<CaptureFeed>(spec, panel, system);
  feeds[text] = feed;
  return feed;
}

class CaptureSource final : public frames::FrameSource {
 public:
  explicit CaptureSource(std::shared_ptr<CaptureFeed> feed) : feed_(std::move(feed)) {
    feed_->listen(wake_);
  }
  ~CaptureSource() override {
    feed_->forget(wake_);
    for (auto& [token, picture] : acquired_) feed_->give_back(picture);
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return feed_->geometry(); }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return feed_->rate(); }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return std::nullopt; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (!feed_->failure().empty()) return frames::PullStatus::Failed;
    auto picture = feed_->newer_than(last_);
    if (!picture) return frames::PullStatus::NotYet;
    last_ = picture->number;
    out = {.frame = picture->frame.view(),
           .number = last_ - 1,
           .token = last_,
           .captured_ns = picture->captured.count()};
    acquired_[last_] = std::move(picture);
    return frames::PullStatus::Ready;
  }
  void release(uint64_t token) override {
    const auto picture = acquired_.find(token);
    LENTICULE_CHECK(picture != acquired_.end());
    feed_->give_back(picture->second);
    acquired_.erase(picture);
  }
  [[nodiscard]] int max_acquired() const override { return kMostAcquired; }
  [[nodiscard]] uint64_t ready_count() const override { return 0; }
  [[nodiscard]] bool saturated() const override { return true; }
  [[nodiscard]] bool rewind() override { return false; }
  [[nodiscard]] int wake_fd() const override { return wake_.fd(); }
  void service() override { wake_.drain(); }
  [[nodiscard]] std::string failure() const override { return feed_->failure(); }
  [[nodiscard]] bool waits_for_others() const override { return true; }

 private:
  WakeFd wake_;
  const std::shared_ptr<CaptureFeed> feed_;
  std::map<uint64_t, std::shared_ptr<const CaptureFeed::Picture>> acquired_;
  uint64_t last_ = 0;  ///< number of the picture pulled last
};

}  // namespace

nlohmann::ordered_json to_json(const CaptureStatistics& statistics) {
  return {{"device", statistics.device},
          {"pictures", statistics.pictures.get()},
          {"lost", statistics.lost.get()},
          {"damaged", statistics.damaged.get()},
          {"unpaired", statistics.unpaired.get()},
          {"superseded", statistics.superseded.get() + statistics.woven_superseded.get()},
          {"arrival_us", latency_json(statistics.arrival.summary())},
          {"conversion_us", latency_json(statistics.conversion.summary())},
          {"weaving_us", latency_json(statistics.weaving.summary())},
          {"apart_us", latency_json(statistics.apart.summary())}};
}

// --- pictures of one moment -----------------------------------------------------------------

/// Camera is one open camera. Members are destroyed from the last to the first: the stream before
/// its device.
struct LiveCameras::Camera {
  Camera(std::string name, const FormatRequest& request, V4l2System& system)
      : path(std::move(name)),
        device(open_camera(system, path, facts)),
        agreed(agree_on_format(*device, system, path, request)),
        converter(agreed.raw, path),
        stream(*device, system, path) {
    stream.follow_source_changes();
    stream.start(system, path);
  }

  std::string path;
  NodeFacts facts;
  std::unique_ptr<V4l2Device> device;
  AgreedFormat agreed;
  CodeConverter converter;
  CaptureStream stream;
  ExposureClock clock{std::nullopt, Nanoseconds{0}};
  struct Held {
    CapturedBuffer buffer;
    Nanoseconds time;
  };
  std::vector<Held> held{};          ///< not used yet, oldest first
  Nanoseconds time{0};               ///< stamp of the last picture
  std::optional<uint64_t> number{};  ///< driver's number of the last picture
  Nanoseconds waited{0};             ///< without a picture
};

LiveCameras::LiveCameras(const CaptureSpec& spec, const frames::FrameGeometry& panel,
                         V4l2System& system, CaptureStatistics& statistics)
    : statistics_(statistics) {
  FormatRequest request = spec.request;
  request.display = {panel.width / static_cast<int>(spec.devices.size()), panel.height};
  for (const std::string& path : spec.devices) {
    cameras_.push_back(std::make_unique<Camera>(path, request, system));
    const Camera &first = *cameras_.front(), &added = *cameras_.back();
    const RawFormat &size = added.converter.format(), &others = first.converter.format();
    if (size.width != others.width || size.height != others.height)
      throw device_error("{}: pictures of {}x{}, but {} has {}x{}", path, size.width, size.height,
                         first.path, others.width, others.height)
          .remedy("ask for one size: add ?size=1280x720");
    statistics.device +=
        fmt::format("{}{} ({}): {}x{} {}, {:g} frames/s", cameras_.size() > 1 ? "; " : "", path,
                    escaped(added.facts.name), size.width, size.height, fourcc_name(size.fourcc),
                    added.agreed.frames_per_second);
  }
}

LiveCameras::~LiveCameras() = default;

frames::FrameGeometry LiveCameras::geometry() const {
  const RawFormat& one = cameras_.front()->converter.format();
  return {.width = one.width * static_cast<int>(cameras_.size()), .height = one.height};
}

std::optional<frames::Rate> LiveCameras::rate() const {
  double rate = cameras_.front()->agreed.frames_per_second;
  for (const auto& camera : cameras_) rate = std::min(rate, camera->agreed.frames_per_second);
  if (!(rate > 0.0)) return std::nullopt;
  return frames::Rate{std::max<int64_t>(std::llround(rate * 1000.0), 1), 1000};
}

/// Waits for the camera whose last picture is the oldest, again and again: then the pictures that
/// belong together are the newest ones, whichever camera is ahead.
GrabStatus LiveCameras::next(frames::WovenFrame& to, Nanoseconds& captured, Nanoseconds timeout) {
  const V4l2Device& clock = *cameras_.front()->device;
  const Nanoseconds deadline = clock.now() + timeout;
  do {
    Camera& oldest =
        **std::ranges::min_element(cameras_, {}, [](const auto& camera) { return camera->time; });
    const GrabStatus status = fetch(oldest, std::max(deadline - clock.now(), Nanoseconds{0}));
    if (status != GrabStatus::Ready) return status;
    if (found_moment())
      return convert(to, captured) ? GrabStatus::Ready
             : failure_.empty()    ? GrabStatus::Corrupt
                                   : GrabStatus::Gone;
  } while (clock.now() < deadline);
  return GrabStatus::TimedOut;
}

/// Takes the newest picture that the driver has, and gives older ones back.
GrabStatus LiveCameras::fetch(Camera& camera, Nanoseconds timeout) {
  const Nanoseconds begin = camera.device->now();
  bool found = false;
  Nanoseconds wait = timeout;
  for (uint32_t taken = 0; taken < kMostBuffers; ++taken, wait = Nanoseconds{0}) {
    CapturedBuffer buffer;
    const GrabStatus status = camera.stream.acquire(buffer, camera.device->now() + wait);
    if (status == GrabStatus::Gone) return gone(camera, camera.stream.failure());
    if (status == GrabStatus::TimedOut) break;
    if (status == GrabStatus::Corrupt) {
      statistics_.damaged.add();
      break;
    }
    const Nanoseconds now = camera.device->now();
    const Nanoseconds time = camera.clock.exposed_at(buffer.stamp, now);
    const uint64_t number = camera.clock.count(buffer.stamp.sequence);
    const uint64_t gap = number - camera.number.value_or(number - 1) - 1;
    camera.number = number;
    if (gap <= kMostLost) statistics_.lost.add(gap);
    if (buffer.damaged) {
      statistics_.damaged.add();
      if (!camera.stream.give_back(buffer.index)) return gone(camera, camera.stream.failure());
      continue;
    }
    statistics_.arrival.record(now - time);
    camera.held.push_back({buffer, time});
    camera.time = time;
    // With two of each camera, that of the same moment is among them, whichever camera is ahead.
    // A buffer stays with the driver, which may have given only two.
    const bool pairs = cameras_.size() > 1;
    if (camera.held.size() > (pairs && camera.stream.buffers() > 2 ? 2 : 1)) {
      (pairs ? statistics_.unpaired : statistics_.superseded).add();
      if (!give_back_before(camera, 1)) return gone(camera, camera.stream.failure());
    }
    found = true;
  }
  if (!found) return silent(camera, camera.device->now() - begin);
  camera.waited = Nanoseconds{0};
  return GrabStatus::Ready;
}

GrabStatus LiveCameras::silent(Camera& camera, Nanoseconds waited) {
  camera.waited += waited;
  const Nanoseconds limit = camera.number ? kSilence : kSilenceAtStart;
  if (camera.waited < limit) return GrabStatus::TimedOut;
  const std::string problem = signal_problem(*camera.device);
  return gone(camera,
              problem.empty() ? fmt::format("no picture for {} s", limit / seconds(1)) : problem);
}

/// Gives the oldest pictures back.
bool LiveCameras::give_back_before(Camera& camera, size_t end) {
  bool done = true;
  for (size_t k = 0; k < end; ++k)
    done = camera.stream.give_back(camera.held[k].buffer.index) && done;
  camera.held.erase(camera.held.begin(), camera.held.begin() + static_cast<ptrdiff_t>(end));
  return done;
}

/// Finds the newest pictures of one moment: gives back those before them, so that they are the
/// first ones. Returns false if there are none.
bool LiveCameras::found_moment() {
  const auto stated = rate();
  const Nanoseconds limit =
      stated ? Nanoseconds(static_cast<int64_t>(0.5e9 / stated->hertz())) : kUsualApart;
  const std::vector<Camera::Held>& candidates = cameras_.front()->held;
  for (size_t at = candidates.size(); at-- > 0;) {
    const Nanoseconds middle = candidates[at].time;
    std::vector<size_t> nearest;
    Nanoseconds first = middle, last = middle;
    for (const auto& camera : cameras_) {
      const auto best = std::ranges::min_element(camera->held, {}, [&](const Camera::Held& one) {
        return std::chrono::abs(one.time - middle);
      });
      if (best == camera->held.end()) return false;
      nearest.push_back(static_cast<size_t>(best - camera->held.begin()));
      first = std::min(first, best->time);
      last = std::max(last, best->time);
    }
    if (last - first > limit) continue;
    for (size_t k = 0; k < cameras_.size(); ++k) {
      if (cameras_.size() > 1) statistics_.unpaired.add(nearest[k]);
      if (!give_back_before(*cameras_[k], nearest[k])) return false;
    }
    return true;
  }
  return false;
}

bool LiveCameras::convert(frames::WovenFrame& to, Nanoseconds& captured) {
  const Nanoseconds begin = cameras_.front()->device->now();
  Nanoseconds earliest = Nanoseconds::max(), latest{0};
  const RawFormat& size = cameras_.front()->converter.format();
  const int64_t pixels = int64_t{size.width} * size.height;
  const int threads =
      static_cast<int>(std::clamp<int64_t>(pixels / kPixelsOfThread, 1, kMostThreads));
  uint8_t* pixels_of = to.bytes().data();
  bool whole = true;
  for (const auto& camera : cameras_) {
    const auto [buffer, time] = camera->held.front();
    whole =
        camera->converter.convert(
            buffer.bytes, {.pixels = pixels_of, .stride = to.geometry().row_bytes()}, threads) &&
        whole;
    pixels_of += static_cast<size_t>(size.width) * 3;
    earliest = std::min(earliest, time);
    latest = std::max(latest, time);
    if (!give_back_before(*camera, 1)) {
      (void)gone(*camera, camera->stream.failure());
      return false;
    }
  }
  captured = earliest;
  if (!whole) {
    statistics_.damaged.add();
    return false;
  }
  statistics_.conversion.record(cameras_.front()->device->now() - begin);
  if (cameras_.size() > 1) statistics_.apart.record(latest - earliest);
  statistics_.pictures.add();
  return true;
}

GrabStatus LiveCameras::gone(const Camera& camera, const std::string& why) {
  failure_ = fmt::format("{}: {}", camera.path, why);
  return GrabStatus::Gone;
}

// --- a thread that captures, and the sources that show its pictures ---------------------------

OpenedCapture open_capture(const std::string& text, const frames::FrameGeometry& panel,
                           V4l2System& system) {
  std::shared_ptr<CaptureFeed> feed = feed_of(text, panel, system);
  std::shared_ptr<CaptureStatistics> statistics = feed->statistics();
  return {std::make_unique<CaptureSource>(std::move(feed)), std::move(statistics)};
}

nlohmann::ordered_json capture_offers(const std::string& text, V4l2System& system) {
  const CaptureSpec spec = parse_capture(text);
  auto rows = nlohmann::ordered_json::array();
  for (const CameraListing& camera : list_cameras(system)) {
    const auto named = [&](const std::string& name) {
      return name == camera.path || name == camera.stable_path;
    };
    if (std::ranges::none_of(spec.devices, named)) continue;
    for (const FormatOffer& format : camera.formats)
      rows.push_back({{"device", camera.path},
                      {"format", format.pixel_format()},
                      {"sizes", format.size_names()}});
  }
  return rows;
}

}  // namespace lenticule::player
