// SPDX-License-Identifier: Apache-2.0
// A video decoder in "hardware" that programs see when this library is preloaded (LD_PRELOAD): a
// stateful V4L2 device from memory to memory, /dev/video42, that accepts H.264. It decodes nothing:
// packet k gives a grey picture of brightness brightness_of_fake_picture(k), with the packet's time
// stamp.
//
// /dev/null carries the device: each open and each request is also made on /dev/null, so that the
// filter of system calls and Landlock have their say. Memory is static, because a confined process
// cannot make any other.
//
// LENTICULE_FAKE_DECODER has words that make the device odd:
//   absent             there is no device
//   camera             the device is not from memory to memory
//   short-buffers      the buffers of pictures have no room for chroma
//   nv12               pictures are NV12 instead of YUV 4:2:0 in three planes
//   whole-blocks       the height is a multiple of 16, as the device reports before picture 0
//   small              at most 32 x 32 pixels
//   refuses-format     no format can be set
//   refuses-packet=N   packet N is refused
//   eats               takes packets and gives no picture
//   hangs-at=N         gives no answer from packet N on
//   crashes-at=N       the process crashes at picture N
//   error-at=N         picture N is damaged
//   grows-at=N         from picture N on, pictures are twice as high
//   opens=N            cannot be opened for decoding more than N times
#include <dirent.h>
#include <dlfcn.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/types.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

#include "tests/support/fakes/fake_v4l2_pictures.h"

namespace {

using lenticule::test::brightness_of_fake_picture;
using lenticule::test::kFakeBlue;
using lenticule::test::kFakeRed;

constexpr std::string_view kNode = "/dev/video42";
constexpr const char* kEntry = "video42";
constexpr const char* kCarrier = "/dev/null";
constexpr uint32_t kMostBuffers = 32;
constexpr uint32_t kBufferBytes = 64 * 1024;
constexpr uint32_t kBlock = 16;
constexpr uint32_t kStrideUnit = 32;
constexpr uint32_t kNever = UINT32_MAX;

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

/// Properties of the device, from the environment.
struct Oddities {
  bool absent = false;
  bool camera = false;
  bool short_buffers = false;
  bool nv12 = false;
  bool whole_blocks = false;
  bool small = false;
  bool refuses_format = false;
  bool eats = false;
  uint32_t refuses_packet = kNever;
  uint32_t hangs_at = kNever;
  uint32_t crashes_at = kNever;
  uint32_t error_at = kNever;
  uint32_t grows_at = kNever;
  uint32_t opens = kNever;

  Oddities() {
    const char* const text = std::getenv("LENTICULE_FAKE_DECODER");
    std::string_view words = text != nullptr ? text : "";
    while (!words.empty()) {
      const size_t end = std::min(words.find(' '), words.size());
      take(words.substr(0, end));
      words.remove_prefix(std::min(end + 1, words.size()));
    }
  }

 private:
  void take(std::string_view word) {
    absent |= word == "absent";
    camera |= word == "camera";
    short_buffers |= word == "short-buffers";
    nv12 |= word == "nv12";
    whole_blocks |= word == "whole-blocks";
    small |= word == "small";
    refuses_format |= word == "refuses-format";
    eats |= word == "eats";
    take_number(word, "refuses-packet=", refuses_packet);
    take_number(word, "hangs-at=", hangs_at);
    take_number(word, "crashes-at=", crashes_at);
    take_number(word, "error-at=", error_at);
    take_number(word, "grows-at=", grows_at);
    take_number(word, "opens=", opens);
  }
  static void take_number(std::string_view word, std::string_view name, uint32_t& number) {
    if (word.starts_with(name))
      number = static_cast<uint32_t>(std::atoi(std::string(word.substr(name.size())).c_str()));
  }
};

const Oddities& oddities() {
  static const Oddities all;
  return all;
}

/// A queue of at most kMostBuffers numbers.
class Numbers {
 public:
  void push(uint32_t number) { items_[(first_ + size_++) % kMostBuffers] = number; }
  uint32_t pop() {
    const uint32_t number = items_[first_];
    first_ = (first_ + 1) % kMostBuffers;
    --size_;
    return number;
  }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  void clear() { size_ = 0; }

 private:
  std::array<uint32_t, kMostBuffers> items_{};
  uint32_t first_ = 0;
  uint32_t size_ = 0;
};

struct Buffer {
  timeval time{};
  uint32_t flags = 0;
  uint32_t bytes = 0;
};

struct Queue {
  v4l2_pix_format_mplane format{};
  uint32_t count = 0;
  bool streams = false;
  std::array<Buffer, kMostBuffers> buffers{};
  Numbers waiting;   ///< buffers that the device may use
  Numbers finished;  ///< buffers that the program may take back
  void stop() {
    streams = false;
    waiting.clear();
    finished.clear();
  }
};

alignas(4096) std::array<std::array<std::array<uint8_t, kBufferBytes>, kMostBuffers>, 2> g_memory;

int refuse(int error) {
  errno = error;
  return -1;
}

/// The device as one open descriptor sees it.
class Device {
 public:
  void open(int fd) {
    *this = Device();
    fd_ = fd;
  }
  void close() { fd_ = -1; }
  [[nodiscard]] int fd() const { return fd_; }

  int request(unsigned long number, void* argument);
  [[nodiscard]] short ready(short wanted);

 private:
  [[nodiscard]] static bool is_coded(uint32_t type) {
    return type == V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE;
  }
  [[nodiscard]] Queue& queue(uint32_t type) { return is_coded(type) ? coded_ : raw_; }

  static int describe(v4l2_capability& about);
  static int list(v4l2_fmtdesc& description);
  static int limit(v4l2_frmsizeenum& size);
  int adjust(v4l2_format& format, bool keep);
  int allocate(v4l2_requestbuffers& request);
  int locate(v4l2_buffer& buffer);
  int give(v4l2_buffer& buffer);
  int take(v4l2_buffer& buffer);
  int report(v4l2_event& event);
  int stream(uint32_t type, bool on);
  void shape_pictures(uint32_t height);
  void decode();
  bool changes_size();
  void draw(uint32_t picture, uint32_t buffer);

  int fd_ = -1;
  Queue coded_;
  Queue raw_;
  uint32_t packets_ = 0;
  uint32_t pictures_ = 0;
  bool event_ = false;
  bool draining_ = false;
  bool ended_ = false;
};

int Device::describe(v4l2_capability& about) {
  about = {};
  std::strcpy(reinterpret_cast<char*>(about.driver), "fake");
  about.device_caps = V4L2_CAP_STREAMING;
  about.device_caps |= oddities().camera ? V4L2_CAP_VIDEO_CAPTURE : V4L2_CAP_VIDEO_M2M_MPLANE;
  about.capabilities = about.device_caps | V4L2_CAP_DEVICE_CAPS;
  return 0;
}

int Device::list(v4l2_fmtdesc& description) {
  if (description.index > 0) return refuse(EINVAL);
  const uint32_t raw = oddities().nv12 ? V4L2_PIX_FMT_NV12 : V4L2_PIX_FMT_YUV420;
  description.pixelformat = is_coded(description.type) ? uint32_t{V4L2_PIX_FMT_H264} : raw;
  return 0;
}

int Device::limit(v4l2_frmsizeenum& size) {
  if (size.index > 0 || size.pixel_format != V4L2_PIX_FMT_H264) return refuse(EINVAL);
  const uint32_t most = oddities().small ? 32 : 192;
  size.type = V4L2_FRMSIZE_TYPE_STEPWISE;
  size.stepwise = {.min_width = 16,
                   .max_width = most,
                   .step_width = 2,
                   .min_height = 16,
                   .max_height = most,
                   .step_height = 2};
  return 0;
}

void Device::shape_pictures(uint32_t height) {
  v4l2_pix_format_mplane& format = raw_.format;
  format.width = coded_.format.width;
  format.height = height;
  format.pixelformat = oddities().nv12 ? V4L2_PIX_FMT_NV12 : V4L2_PIX_FMT_YUV420;
  // The device reports these numbers for every stream, as some drivers do.
  format.colorspace = V4L2_COLORSPACE_SRGB;
  format.quantization = V4L2_QUANTIZATION_LIM_RANGE;
  format.num_planes = 1;
  const uint32_t stride = (format.width + kStrideUnit - 1) / kStrideUnit * kStrideUnit;
  format.plane_fmt[0].bytesperline = stride;
  format.plane_fmt[0].sizeimage = stride * format.height * 3 / 2;
}

/// Adjusts a format to what the device can, and keeps it if wanted.
int Device::adjust(v4l2_format& format, bool keep) {
  if (keep && oddities().refuses_format) return refuse(EINVAL);
  if (is_coded(format.type)) {
    v4l2_pix_format_mplane& wanted = format.fmt.pix_mp;
    wanted.pixelformat = V4L2_PIX_FMT_H264;
    wanted.num_planes = 1;
    wanted.plane_fmt[0].sizeimage = kBufferBytes;
    if (!keep) return 0;
    coded_.format = wanted;
    shape_pictures(wanted.height);
    return 0;
  }
  if (coded_.format.width == 0) return 0;
  format.fmt.pix_mp = raw_.format;
  return 0;
}

int Device::allocate(v4l2_requestbuffers& request) {
  request.count = std::min(request.count, kMostBuffers);
  Queue& wanted = queue(request.type);
  wanted.stop();
  wanted.count = request.count;
  return 0;
}

int Device::locate(v4l2_buffer& buffer) {
  if (buffer.index >= queue(buffer.type).count || buffer.length < 1) return refuse(EINVAL);
  buffer.length = 1;
  const bool cut = oddities().short_buffers && !is_coded(buffer.type);
  const v4l2_pix_format_mplane& raw = raw_.format;
  buffer.m.planes[0].length = cut ? raw.plane_fmt[0].bytesperline * raw.height : kBufferBytes;
  const uint32_t first = is_coded(buffer.type) ? 0 : kMostBuffers;
  buffer.m.planes[0].m.mem_offset = (first + buffer.index) * kBufferBytes;
  return 0;
}

int Device::give(v4l2_buffer& buffer) {
  if (is_coded(buffer.type) && packets_ == oddities().refuses_packet) return refuse(EIO);
  Queue& to = queue(buffer.type);
  to.buffers[buffer.index] = {.time = buffer.timestamp, .flags = 0, .bytes = 0};
  to.waiting.push(buffer.index);
  if (is_coded(buffer.type)) ++packets_;
  decode();
  return 0;
}

/// Returns true once before the first picture of another size; nothing is decoded until the program
/// has made new buffers.
bool Device::changes_size() {
  const uint32_t height = coded_.format.height;
  uint32_t changed = raw_.format.height;
  if (oddities().whole_blocks) changed = (height + kBlock - 1) / kBlock * kBlock;
  if (pictures_ >= oddities().grows_at) changed = 2 * height;
  if (changed == raw_.format.height) return false;
  shape_pictures(changed);
  event_ = true;
  return true;
}

void Device::decode() {
  while (!event_ && coded_.streams && !coded_.waiting.empty()) {
    if (pictures_ >= oddities().hangs_at) return;
    if (oddities().eats) {
      coded_.finished.push(coded_.waiting.pop());
      continue;
    }
    if (!raw_.streams || raw_.waiting.empty() || changes_size()) return;
    if (pictures_ >= oddities().crashes_at) std::abort();
    const uint32_t packet = coded_.waiting.pop();
    const uint32_t picture = raw_.waiting.pop();
    const bool damaged = pictures_ == oddities().error_at;
    draw(pictures_++, picture);
    raw_.buffers[picture] = {.time = coded_.buffers[packet].time,
                             .flags = damaged ? uint32_t{V4L2_BUF_FLAG_ERROR} : 0,
                             .bytes = raw_.format.plane_fmt[0].sizeimage};
    raw_.finished.push(picture);
    coded_.finished.push(packet);
  }
}

void Device::draw(uint32_t picture, uint32_t buffer) {
  const uint32_t stride = raw_.format.plane_fmt[0].bytesperline;
  const uint32_t luma = stride * raw_.format.height;
  uint8_t* const to = g_memory[1][buffer].data();
  std::memset(to, brightness_of_fake_picture(picture), luma);
  for (uint32_t i = 0; i < luma / 2; ++i) {
    const bool blue = oddities().nv12 ? i % 2 == 0 : i < luma / 4;
    to[luma + i] = blue ? kFakeBlue : kFakeRed;
  }
}

int Device::take(v4l2_buffer& buffer) {
  Queue& from = queue(buffer.type);
  const bool raw = !is_coded(buffer.type);
  const bool last = raw && draining_ && from.finished.empty() && coded_.waiting.empty();
  if (last && ended_) return refuse(EPIPE);
  if (from.finished.empty() && !(last && !from.waiting.empty())) return refuse(EAGAIN);
  ended_ |= last;
  buffer.index = last ? from.waiting.pop() : from.finished.pop();
  const Buffer& taken = from.buffers[buffer.index];
  buffer.flags = taken.flags | (last ? uint32_t{V4L2_BUF_FLAG_LAST} : 0);
  buffer.timestamp = taken.time;
  buffer.length = 1;
  buffer.m.planes[0].bytesused = last ? 0 : taken.bytes;
  return 0;
}

int Device::report(v4l2_event& event) {
  if (!event_) return refuse(ENOENT);
  event_ = false;
  event = {};
  event.type = V4L2_EVENT_SOURCE_CHANGE;
  return 0;
}

int Device::stream(uint32_t type, bool on) {
  Queue& which = queue(type);
  if (!on) which.stop();
  which.streams = on;
  decode();
  return 0;
}

int Device::request(unsigned long number, void* argument) {
  switch (number) {
    case VIDIOC_QUERYCAP:
      return describe(*static_cast<v4l2_capability*>(argument));
    case VIDIOC_ENUM_FMT:
      return list(*static_cast<v4l2_fmtdesc*>(argument));
    case VIDIOC_ENUM_FRAMESIZES:
      return limit(*static_cast<v4l2_frmsizeenum*>(argument));
    case VIDIOC_TRY_FMT:
      return adjust(*static_cast<v4l2_format*>(argument), false);
    case VIDIOC_S_FMT:
      return adjust(*static_cast<v4l2_format*>(argument), true);
    case VIDIOC_G_FMT: {
      auto& format = *static_cast<v4l2_format*>(argument);
      format.fmt.pix_mp = queue(format.type).format;
      return 0;
    }
    case VIDIOC_REQBUFS:
      return allocate(*static_cast<v4l2_requestbuffers*>(argument));
    case VIDIOC_QUERYBUF:
      return locate(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_QBUF:
      return give(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_DQBUF:
      return take(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_DQEVENT:
      return report(*static_cast<v4l2_event*>(argument));
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
      return stream(*static_cast<uint32_t*>(argument), number == VIDIOC_STREAMON);
    case VIDIOC_SUBSCRIBE_EVENT:
      return 0;
    case VIDIOC_DECODER_CMD:
      draining_ = static_cast<v4l2_decoder_cmd*>(argument)->cmd == V4L2_DEC_CMD_STOP;
      return 0;
    default:
      return refuse(ENOTTY);
  }
}

short Device::ready(short wanted) {
  decode();
  int found = 0;
  const bool end = draining_ && coded_.waiting.empty();
  if (!raw_.finished.empty() || end) found |= POLLIN | POLLRDNORM;
  if (!coded_.finished.empty()) found |= POLLOUT | POLLWRNORM;
  if (event_) found |= POLLPRI;
  return static_cast<short>(found & wanted);
}

/// The device has a state per descriptor. FFmpeg examines it and then opens it again.
std::array<Device, 4> g_devices;
uint32_t g_opened = 0;

Device* device_of(int fd) {
  const auto found = std::find_if(g_devices.begin(), g_devices.end(),
                                  [fd](const Device& one) { return one.fd() == fd; });
  return fd >= 0 && found != g_devices.end() ? &*found : nullptr;
}

constexpr int kPathOnly = 010000000;  // O_PATH; <fcntl.h> would define open()
/// Each decoding opens the device twice, after it was found by opening it once.
constexpr uint32_t kOpensToFind = 1;
constexpr uint32_t kOpensToDecode = 2;

int open_file(const char* path, int flags, unsigned mode) {
  static auto* const next = real<int(const char*, int, ...)>("open");
  if (path != kNode) return next(path, flags, mode);
  if ((flags & kPathOnly) != 0) return next(kCarrier, flags);
  const uint32_t most =
      oddities().opens == kNever ? kNever : kOpensToFind + kOpensToDecode * oddities().opens;
  if (g_opened >= most) return refuse(EBUSY);
  const int fd = next(kCarrier, flags);
  const auto slot = std::find_if(g_devices.begin(), g_devices.end(),
                                 [](const Device& one) { return one.fd() < 0; });
  if (fd < 0 || slot == g_devices.end()) return fd;
  ++g_opened;
  slot->open(fd);
  return fd;
}

/// Lists the real /dev, except for its video devices, and the fake device at the end.
DIR* g_listed = nullptr;
bool g_listed_fake = false;

template <typename Entry>
Entry* next_entry(DIR* folder, const char* name) {
  static auto* const next = real<Entry*(DIR*)>(name);
  Entry* entry = next(folder);
  if (folder != g_listed) return entry;
  while (entry != nullptr && std::string_view(entry->d_name).starts_with("video"))
    entry = next(folder);
  if (entry != nullptr || g_listed_fake || oddities().absent) return entry;
  static Entry fake;
  std::strcpy(fake.d_name, kEntry);
  g_listed_fake = true;
  return &fake;
}

}  // namespace

// Functions of the C library, under other names than in its headers, whose declarations differ with
// the options of the compiler.
#define FAKE(name) __asm__(name) __attribute__((visibility("default"), used))

extern "C" {
int lenticule_open(const char* path, int flags, unsigned mode) FAKE("open");
int lenticule_open64(const char* path, int flags, unsigned mode) FAKE("open64");
int lenticule_open_2(const char* path, int flags) FAKE("__open_2");
int lenticule_open64_2(const char* path, int flags) FAKE("__open64_2");
int lenticule_close(int fd) FAKE("close");
int lenticule_ioctl(int fd, unsigned long request, void* argument) FAKE("ioctl");
int lenticule_poll(pollfd* entries, nfds_t count, int timeout) FAKE("poll");
void* lenticule_mmap(void* at, size_t bytes, int protection, int flags, int fd, off_t offset)
    FAKE("mmap");
void* lenticule_mmap64(void* at, size_t bytes, int protection, int flags, int fd, off_t offset)
    FAKE("mmap64");
int lenticule_munmap(void* at, size_t bytes) FAKE("munmap");
DIR* lenticule_opendir(const char* name) FAKE("opendir");
dirent* lenticule_readdir(DIR* folder) FAKE("readdir");
dirent64* lenticule_readdir64(DIR* folder) FAKE("readdir64");

int lenticule_open(const char* path, int flags, unsigned mode) {
  return open_file(path, flags, mode);
}
int lenticule_open64(const char* path, int flags, unsigned mode) {
  return open_file(path, flags, mode);
}
int lenticule_open_2(const char* path, int flags) { return open_file(path, flags, 0); }
int lenticule_open64_2(const char* path, int flags) { return open_file(path, flags, 0); }

int lenticule_close(int fd) {
  static auto* const next = real<int(int)>("close");
  if (Device* const device = device_of(fd)) device->close();
  return next(fd);
}

int lenticule_ioctl(int fd, unsigned long request, void* argument) {
  static auto* const next = real<int(int, unsigned long, ...)>("ioctl");
  Device* const device = device_of(fd);
  if (device == nullptr) return next(fd, request, argument);
  // /dev/null knows no request; another error is that of the filter or of Landlock.
  if (next(fd, request, argument) == 0 || errno != ENOTTY) return -1;
  return device->request(request, argument);
}

int lenticule_poll(pollfd* entries, nfds_t count, int timeout) {
  static auto* const next = real<int(pollfd*, nfds_t, int)>("poll");
  Device* const device = count == 1 ? device_of(entries->fd) : nullptr;
  if (device == nullptr) return next(entries, count, timeout);
  entries->revents = device->ready(entries->events);
  if (entries->revents != 0) return 1;
  return next(nullptr, 0, timeout);
}

void* lenticule_mmap(void* at, size_t bytes, int protection, int flags, int fd, off_t offset) {
  static auto* const next = real<void*(void*, size_t, int, int, int, off_t)>("mmap");
  if (device_of(fd) == nullptr) return next(at, bytes, protection, flags, fd, offset);
  return g_memory[0][0].data() + offset;
}
void* lenticule_mmap64(void* at, size_t bytes, int protection, int flags, int fd, off_t offset) {
  return lenticule_mmap(at, bytes, protection, flags, fd, offset);
}

int lenticule_munmap(void* at, size_t bytes) {
  static auto* const next = real<int(void*, size_t)>("munmap");
  const auto* const byte = static_cast<const uint8_t*>(at);
  const uint8_t* const first = g_memory[0][0].data();
  return byte >= first && byte < first + sizeof g_memory ? 0 : next(at, bytes);
}

DIR* lenticule_opendir(const char* name) {
  static auto* const next = real<DIR*(const char*)>("opendir");
  DIR* const folder = next(name);
  const bool lists_devices = std::string_view(name) == "/dev";
  if (lists_devices) g_listed_fake = false;
  if (lists_devices || folder == g_listed) g_listed = lists_devices ? folder : nullptr;
  return folder;
}
dirent* lenticule_readdir(DIR* folder) { return next_entry<dirent>(folder, "readdir"); }
dirent64* lenticule_readdir64(DIR* folder) { return next_entry<dirent64>(folder, "readdir64"); }
}
