// SPDX-License-Identifier: Apache-2.0
// Receives hotplug events from udev. Every "change" of a card counts: events from the kernel,
// `udevadm trigger` and sysfs differ only in details that are probed afterwards anyway.
#include <libudev.h>

#include <memory>

#include "display/kms/device/platform.h"

namespace lenticule::display {
namespace {

template <auto Release>
struct UdevUnref {
  template <typename Object>
  void operator()(Object* object) const noexcept {
    Release(object);
  }
};
using Udev = std::unique_ptr<udev, UdevUnref<udev_unref>>;
using UdevMonitor = std::unique_ptr<udev_monitor, UdevUnref<udev_monitor_unref>>;
using UdevDevice = std::unique_ptr<udev_device, UdevUnref<udev_device_unref>>;

class UdevHotplug final : public HotplugMonitor {
 public:
  UdevHotplug() : udev_(udev_new()) {
    if (!udev_) return;
    monitor_.reset(udev_monitor_new_from_netlink(udev_.get(), "udev"));
    if (!monitor_) return;
    if (udev_monitor_filter_add_match_subsystem_devtype(monitor_.get(), "drm", nullptr) < 0 ||
        udev_monitor_enable_receiving(monitor_.get()) < 0)
      monitor_.reset();
  }

  [[nodiscard]] int fd() const noexcept override {
    return monitor_ ? udev_monitor_get_fd(monitor_.get()) : -1;
  }

  [[nodiscard]] bool drain() noexcept override {
    bool any = false;
    while (monitor_) {
      const UdevDevice device(udev_monitor_receive_device(monitor_.get()));
      if (!device) break;
      any = true;
    }
    return any;
  }

 private:
  Udev udev_;
  UdevMonitor monitor_;
};

}  // namespace

std::unique_ptr<HotplugMonitor> make_udev_monitor() {
  return std::make_unique<UdevHotplug>();
}

}  // namespace lenticule::display
