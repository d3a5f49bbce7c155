// SPDX-License-Identifier: Apache-2.0
#include "display/kms/scanout/kms_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_handles.h"

namespace lenticule::display {
namespace {

constexpr int kModesetAttempts = 20;
constexpr Nanoseconds kModesetPause = std::chrono::milliseconds(50);
constexpr uint32_t kTestOnly = DRM_MODE_ATOMIC_TEST_ONLY;
constexpr uint32_t kAllowModeset = DRM_MODE_ATOMIC_ALLOW_MODESET;
constexpr uint32_t kFlipFlags = DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT;

/// Adds the facts that are not in the report yet.
void add_report(ExactnessReport& to, const ExactnessReport& from) {
  const auto add = [](std::vector<std::string>& list, const std::vector<std::string>& more) {
    for (const std::string& text : more)
      if (std::ranges::find(list, text) == list.end()) list.push_back(text);
  };
  add(to.verified, from.verified);
  add(to.reasons, from.reasons);
  add(to.unseen, from.unseen);
  add(to.remarks, from.remarks);
  add(to.remedies, from.remedies);
  to.rows.insert(to.rows.end(), from.rows.begin(), from.rows.end());
  to.conclude();
}

const char* hint_for(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
      return "another program draws on this card: stop the desktop session or plymouth";
    case ENOSPC:
      return "the link or the card lacks the bandwidth: use a better cable or port, or a lower "
             "refresh rate; the size is never reduced";
    case ERANGE:
      return "the driver would have to scale";
    default:
      return "'lenticule doctor' tests this output";
  }
}

}  // namespace

KmsOutput::KmsOutput(DrmDevice device, std::vector<Pipe> pipes,
                     std::shared_ptr<KmsPlatform> platform)
    : device_(std::move(device)) {
  LENTICULE_CHECK(!pipes.empty());
  for (Pipe& pipe : pipes)
    pipes_.push_back(std::make_unique<OutputPipe>(device_, std::move(pipe), platform));
}

std::optional<size_t> KmsOutput::pipe_of_crtc(uint32_t crtc) const noexcept {
  for (size_t n = 0; n < pipes_.size(); ++n)
    if (pipes_[n]->pipe().crtc == crtc) return n;
  return std::nullopt;
}

std::vector<uint32_t> KmsOutput::connectors() const {
  std::vector<uint32_t> ids;
  for (const auto& pipe : pipes_) ids.push_back(pipe->pipe().connector.id);
  return ids;
}

std::string KmsOutput::name() const {
  std::vector<std::string> names;
  for (const auto& pipe : pipes_) names.push_back(pipe->pipe().connector.name);
  return fmt::format("{}", fmt::join(names, " and "));
}

void KmsOutput::foresee() {
  for (const auto& pipe : pipes_) pipe->foresee();
}

std::vector<PropertySetting> KmsOutput::unlink_settings() const {
  std::vector<uint32_t> own;
  for (const auto& pipe : pipes_) {
    own.push_back(pipe->pipe().plane);
    own.push_back(pipe->pipe().connector.id);
  }
  std::vector<PropertySetting> settings;
  for (const auto& pipe : pipes_) append(settings, pipe->unlink_settings(own));
  return settings;
}

std::vector<PropertySetting> KmsOutput::everything(uint32_t framebuffer) const {
  std::vector<PropertySetting> settings = unlink_settings();
  for (const auto& pipe : pipes_) {
    append(settings, pipe->mode_settings());
    append(settings, pipe->plane_settings(framebuffer));
    append(settings, pipe->audit().settings());
  }
  return settings;
}

int KmsOutput::commit(const std::vector<PropertySetting>& settings, uint32_t flags) const {
  AtomicRequest request;
  request.set(settings);
  return request.commit(device_.fd(), flags);
}

void KmsOutput::remember(uint32_t framebuffer) {
  for (const auto& pipe : pipes_) pipe->remember(framebuffer);
}

bool KmsOutput::take_over(uint32_t framebuffer) {
  std::vector<PropertySetting> settings = unlink_settings();
  for (const auto& pipe : pipes_) {
    if (!pipe->runs_in_mode()) return false;
    append(settings, pipe->plane_settings(framebuffer));
    append(settings, pipe->audit().settings());
  }
  if (commit(settings, kTestOnly) != 0) return false;
  remember(framebuffer);
  took_over_ = commit(settings, 0) == 0;
  if (took_over_) settle();
  return took_over_;
}

void KmsOutput::activate(uint32_t framebuffer, Clock& clock, RunningMode running) {
  if (running == RunningMode::TakeOver && take_over(framebuffer)) return;
  remember(framebuffer);
  int error = test(framebuffer);
  if (error != 0) fail(-error);

  error = commit(everything(framebuffer), kAllowModeset);
  for (int i = 1; error == -EBUSY && i < kModesetAttempts; ++i) {
    (void)clock.wait_until(clock.now() + kModesetPause, -1);
    error = commit(everything(framebuffer), kAllowModeset);
  }
  if (error != 0) fail(-error);
  settle();
}

int KmsOutput::rehearse(uint32_t framebuffer) {
  const int error = test(framebuffer);
  foresee();
  return error;
}

int KmsOutput::test(uint32_t framebuffer) {
  const int error = commit(everything(framebuffer), kTestOnly | kAllowModeset);
  if (error != -EINVAL) return error;
  find_refused_settings(framebuffer);
  return commit(everything(framebuffer), kTestOnly | kAllowModeset);
}

/// Finds the settings that the driver refuses. A driver refuses a request as a whole, so each
/// setting is tested on top of the accepted ones.
void KmsOutput::find_refused_settings(uint32_t framebuffer) {
  for (const auto& pipe : pipes_)
    for (size_t i = 0; i < pipe->audit().count(); ++i) pipe->audit().set_refused(i, true);
  for (const auto& pipe : pipes_)
    for (size_t i = 0; i < pipe->audit().count(); ++i) {
      pipe->audit().set_refused(i, false);
      if (commit(everything(framebuffer), kTestOnly | kAllowModeset) != 0)
        pipe->audit().set_refused(i, true);
    }
}

void KmsOutput::fail(int error) const {
  throw Error(ErrorKind::Device,
              fmt::format("{} on {}: cannot show {}: {}", name(), device_.path(),
                          to_string(pipe().mode), std::strerror(error)),
              hint_for(error));
}

int KmsOutput::commit_framebuffer(std::span<const std::unique_ptr<OutputPipe>> pipes,
                                  uint32_t framebuffer, uint32_t flags, uint64_t id) noexcept {
  flip_request_.clear();
  for (const auto& pipe : pipes) flip_request_.set(pipe->framebuffer_setting(framebuffer));
  return flip_request_.commit(device_.fd(), flags, id);
}

int KmsOutput::flip(uint32_t framebuffer, uint64_t id) noexcept {
  if (!flips_jointly()) return flip_one_by_one(framebuffer, id);
  const int error = commit_framebuffer(pipes_, framebuffer, kFlipFlags, id);
  if (error != -EINVAL || pipes_.size() == 1) return error;
  if (flip_one_by_one(framebuffer, id) != 0) return error;
  joint_.store(false, std::memory_order_relaxed);
  return 0;
}

int KmsOutput::flip_one_by_one(uint32_t framebuffer, uint64_t id) noexcept {
  for (const auto& pipe : pipes_)
    if (const int error = commit_framebuffer({&pipe, 1}, framebuffer, kFlipFlags, id); error != 0)
      return error;
  return 0;
}

int KmsOutput::show(uint32_t framebuffer) noexcept {
  return commit_framebuffer(pipes_, framebuffer, 0, 0);
}

int KmsOutput::set_mode(uint32_t framebuffer) noexcept {
  try {
    const int error = commit(everything(framebuffer), kAllowModeset);
    if (error == 0) {
      settle();
      joint_.store(true, std::memory_order_relaxed);
    }
    return error;
  } catch (...) {
    return -ENOMEM;
  }
}

int KmsOutput::blank() noexcept {
  try {
    std::vector<PropertySetting> off;
    for (const auto& pipe : pipes_) off.push_back(pipe->off_setting());
    return commit(off, kAllowModeset);
  } catch (...) {
    return -ENOMEM;
  }
}

bool KmsOutput::restore() noexcept {
  bool restored = true;
  for (const auto& pipe : pipes_) restored = pipe->restore() && restored;
  return restored;
}

int KmsOutput::read_sequence(uint64_t& sequence, Nanoseconds& time) const noexcept {
  uint64_t nanoseconds = 0;
  if (drmCrtcGetSequence(device_.fd(), pipe().crtc, &sequence, &nanoseconds) != 0) return -errno;
  time = Nanoseconds(static_cast<int64_t>(nanoseconds));
  return 0;
}

int KmsOutput::queue_sequence(uint64_t sequence, uint64_t id) const noexcept {
  uint64_t queued = 0;
  const int result = drmCrtcQueueSequence(device_.fd(), pipe().crtc, DRM_CRTC_SEQUENCE_NEXT_ON_MISS,
                                          sequence, &queued, id);
  return result == 0 ? 0 : -errno;
}

void KmsOutput::settle() {
  for (const auto& pipe : pipes_) pipe->settle();
}

void KmsOutput::update_connector(size_t n, ConnectorInfo connector) {
  pipes_[n]->update_connector(std::move(connector));
}

bool KmsOutput::audit_again(AuditDepth depth) {
  bool lost = false;
  for (const auto& pipe : pipes_) lost = pipe->audit_again(depth) || lost;
  return lost;
}

ExactnessReport KmsOutput::report() const {
  ExactnessReport report = pipes_.front()->report();
  for (size_t n = 1; n < pipes_.size(); ++n) add_report(report, pipes_[n]->report());
  return report;
}

}  // namespace lenticule::display
