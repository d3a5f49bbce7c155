// SPDX-License-Identifier: Apache-2.0
#include "render/accel/embree.h"

#include <fmt/format.h>

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <utility>

#include "base/error.h"

namespace lenticule::render {

namespace {

/// Shared by all devices, since they run on the same instruction set.
std::atomic<int> widest{16};

int widest_packet_of(RTCDevice device) {
  const auto supports = [&](RTCDeviceProperty width) {
    return rtcGetDeviceProperty(device, width) != 0;
  };
  if (supports(RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  return supports(RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8 : 4;
}

}  // namespace

int widest_packet() { return widest.load(std::memory_order_relaxed); }

/// Embree may call back from any of its threads.
struct EmbreeDevice::Report {
  std::mutex mutex;
  std::string first;

  static void on_error(void* user, RTCError code, const char* text) {
    auto* report = static_cast<Report*>(user);
    const std::lock_guard lock(report->mutex);
    if (report->first.empty())
      report->first = fmt::format("{} (code {})", text ? text : "unknown error", int{code});
  }
};

EmbreeDevice::EmbreeDevice(int threads) : report_(std::make_unique<Report>()) {
  std::string configuration = "ignore_config_files=1";
  // Embree limits all of oneTBB to the threads that it is told, and to the number of cores.
  if (threads > 0 && threads <= static_cast<int>(std::thread::hardware_concurrency()))
    configuration += fmt::format(",threads={}", threads);
  // At a common edge of two triangles, kernels of different instruction sets may choose another
  // one.
  if (const char* isa = std::getenv("LENTICULE_EMBREE_ISA"); isa && *isa)
    configuration += fmt::format(",isa={}", isa);
  device_.reset(rtcNewDevice(configuration.c_str()));
  if (!device_)
    throw Error(ErrorKind::Failed,
                fmt::format("embree: cannot start (code {})", int{rtcGetDeviceError(nullptr)}));
  rtcSetDeviceErrorFunction(device_.get(), &Report::on_error, report_.get());
  widest.store(widest_packet_of(device_.get()), std::memory_order_relaxed);
}

EmbreeDevice::~EmbreeDevice() = default;

void EmbreeDevice::check(const std::string& doing) const {
  std::string text;
  {
    const std::lock_guard lock(report_->mutex);
    text = std::exchange(report_->first, {});
  }
  if (!text.empty()) throw Error(ErrorKind::Failed, fmt::format("{}: embree: {}", doing, text));
}

}  // namespace lenticule::render
