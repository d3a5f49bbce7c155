// SPDX-License-Identifier: Apache-2.0
// Implements the fake driver's queries: capabilities, formats, controls.
#include <algorithm>
#include <cstring>

#include "tests/support/fakes/fake_v4l2.h"

namespace lenticule::test {
namespace {

template <typename Argument>
Argument& as(void* argument) {
  return *static_cast<Argument*>(argument);
}

template <size_t N, typename Character>
void put_text(Character (&room)[N], const std::string& text) {
  std::memcpy(room, text.c_str(), std::min(N - 1, text.size() + 1));
}

}  // namespace

int FakeCamera::perform(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP:
      return query_capabilities(as<v4l2_capability>(argument));
    case VIDIOC_QUERY_DV_TIMINGS:
      as<v4l2_dv_timings>(argument).bt = timings;
      return signal_error;
    case VIDIOC_G_INPUT:
      as<int>(argument) = 0;
      return 0;
    case VIDIOC_ENUMINPUT:
      as<v4l2_input>(argument).status = input_status;
      return 0;
    case VIDIOC_ENUM_FRAMEINTERVALS:
      return enumerate_interval(as<v4l2_frmivalenum>(argument));
    case VIDIOC_SUBSCRIBE_EVENT:
      return 0;
    case VIDIOC_DQEVENT:
      if (events.empty()) return ENOENT;
      as<v4l2_event>(argument).type = events.front();
      events.pop_front();
      return 0;
    case VIDIOC_S_DV_TIMINGS:
      log.emplace_back("S_DV_TIMINGS");
      return 0;
    case VIDIOC_ENUM_FMT:
      return enumerate_format(as<v4l2_fmtdesc>(argument));
    case VIDIOC_ENUM_FRAMESIZES:
      return enumerate_size(as<v4l2_frmsizeenum>(argument));
    case VIDIOC_TRY_FMT:
      return set_format(as<v4l2_format>(argument), false);
    case VIDIOC_S_FMT:
      return set_format(as<v4l2_format>(argument), true);
    case VIDIOC_S_PARM:
      return set_rate(as<v4l2_streamparm>(argument));
    case VIDIOC_QUERY_EXT_CTRL:
      return query_control(as<v4l2_query_ext_ctrl>(argument));
    case VIDIOC_G_EXT_CTRLS:
      return get_controls(as<v4l2_ext_controls>(argument));
    case VIDIOC_S_EXT_CTRLS:
      return set_controls(as<v4l2_ext_controls>(argument));
    case VIDIOC_REQBUFS:
      return request_buffers(as<v4l2_requestbuffers>(argument));
    case VIDIOC_QUERYBUF:
      return query_buffer(as<v4l2_buffer>(argument));
    case VIDIOC_QBUF:
      return queue(as<v4l2_buffer>(argument));
    case VIDIOC_DQBUF:
      return dequeue(as<v4l2_buffer>(argument));
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
      streaming = request == VIDIOC_STREAMON;
      log.emplace_back(streaming ? "STREAMON" : "STREAMOFF");
      return 0;
    default:
      return ENOTTY;
  }
}

int FakeCamera::query_capabilities(v4l2_capability& capability) {
  put_text(capability.card, card);
  put_text(capability.bus_info, "usb-1.2");
  capability.device_caps = device_caps;
  // Capabilities of the whole device, including the other node's.
  capability.capabilities =
      V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_META_CAPTURE;
  return 0;
}

int FakeCamera::enumerate_format(v4l2_fmtdesc& description) {
  if (description.index >= formats.size()) return EINVAL;
  description.pixelformat = formats[description.index].fourcc;
  return 0;
}

int FakeCamera::enumerate_size(v4l2_frmsizeenum& size) {
  for (const frames::capture::FormatOffer& offer : formats) {
    if (offer.fourcc != size.pixel_format || size.index >= offer.sizes.size()) continue;
    size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size.discrete.width = static_cast<uint32_t>(offer.sizes[size.index].width);
    size.discrete.height = static_cast<uint32_t>(offer.sizes[size.index].height);
    return 0;
  }
  return EINVAL;
}

int FakeCamera::enumerate_interval(v4l2_frmivalenum& offer) const {
  if (!fastest || offer.index > 0) return EINVAL;
  offer.type = V4L2_FRMIVAL_TYPE_DISCRETE;
  offer.discrete = {1, static_cast<uint32_t>(fastest(offer.pixel_format, offer.width))};
  return 0;
}

/// Replaces an unsupported size by the first supported one, as many drivers do.
int FakeCamera::set_format(v4l2_format& format, bool really) {
  v4l2_pix_format& pix = format.fmt.pix;
  for (const frames::capture::FormatOffer& offer : formats) {
    if (offer.fourcc != pix.pixelformat || offer.sizes.empty()) continue;
    const auto listed = std::any_of(offer.sizes.begin(), offer.sizes.end(),
                                    [&](const frames::capture::FrameSize& size) {
                                      return static_cast<uint32_t>(size.width) == pix.width &&
                                             static_cast<uint32_t>(size.height) == pix.height;
                                    });
    if (!listed) pix.width = static_cast<uint32_t>(offer.sizes.front().width);
    if (!listed) pix.height = static_cast<uint32_t>(offer.sizes.front().height);
    pix.bytesperline = pix.width * 3;
    pix.sizeimage = pix.bytesperline * pix.height * 2;
    pix.field = V4L2_FIELD_NONE;
    pix.colorspace = V4L2_COLORSPACE_RAW;
    adjust(pix);
    if (!really) return 0;
    current_ = pix;
    log.push_back("S_FMT " + frames::capture::fourcc_name(pix.pixelformat));
    return 0;
  }
  return EINVAL;
}

int FakeCamera::set_rate(v4l2_streamparm& parameters) {
  log.emplace_back("S_PARM");
  parameters.parm.capture.capability = reports_rate ? V4L2_CAP_TIMEPERFRAME : 0;
  parameters.parm.capture.timeperframe = interval;
  return 0;
}

int FakeCamera::query_control(v4l2_query_ext_ctrl& asked) {
  const bool next = (asked.id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0;
  const uint32_t id = asked.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
  const FakeControl* found = nullptr;
  for (const FakeControl& control : controls) {
    const bool wanted = next ? control.id > id : control.id == id;
    if (wanted && (found == nullptr || control.id < found->id)) found = &control;
  }
  FakeControl odd;
  odd.id = id + 1;
  if (found == nullptr && endless_controls && next) found = &odd;
  if (found == nullptr) return EINVAL;
  asked.id = found->id;
  asked.type = found->type;
  asked.flags = found->flags;
  asked.minimum = found->minimum;
  asked.maximum = found->maximum;
  asked.step = static_cast<uint64_t>(found->step);
  put_text(asked.name, found->name);
  return 0;
}

int FakeCamera::get_controls(v4l2_ext_controls& asked) {
  for (const FakeControl& control : controls) {
    if (control.id != asked.controls[0].id) continue;
    asked.controls[0].value = control.value;
    return 0;
  }
  return EINVAL;
}

int FakeCamera::set_controls(v4l2_ext_controls& asked) {
  const v4l2_ext_control& setting = asked.controls[0];
  for (FakeControl& control : controls) {
    if (control.id != setting.id) continue;
    if ((control.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_GRABBED)) != 0) return EBUSY;
    log.push_back("set " + control.name + "=" + std::to_string(setting.value));
    if (setting.value < control.minimum || setting.value > control.maximum) return ERANGE;
    control.value = setting.value;
    if (on_set) on_set(*this, setting.id, setting.value);
    return 0;
  }
  return EINVAL;
}

}  // namespace lenticule::test
