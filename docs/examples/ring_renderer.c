/* SPDX-License-Identifier: Apache-2.0 */
/* A renderer that implements docs/content/ring.md by itself, without lenticule.h:
 *   cc -std=c11 ring_renderer.c -o ring_renderer
 *   ./ring_renderer SOCKET FRAMES FINGERPRINT     `lenticule rig show` prints the fingerprint
 * Byte x of row y of frame n is x + 3 y + 7 n, modulo 256. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { kHello = 1, kAccept = 2, kRefuse = 3, kWanted = 4, kGoodbye = 6 };
enum { kFree = 1, kWriting = 2, kReady = 3 };

struct prefix {
  uint32_t magic, version, kind, bytes;
};
struct hello {
  struct prefix prefix;
  char name[64], rig[128];
  int64_t rate_numerator, rate_denominator;
  uint64_t frame_count;
  uint32_t has_frame_count, zero;
};
struct answer { /* accept or refuse */
  struct prefix prefix;
  union {
    struct {
      uint64_t memory_bytes;
      uint32_t epoch, zero;
    } accept;
    struct {
      uint32_t reason, zero;
      char text[232];
    } refuse;
  } is;
};
struct header {
  char magic[8];
  uint32_t abi_version, endian_tag, slots, format, width, height;
  uint64_t row_bytes, frame_bytes, table_offset, entry_bytes, slots_offset, slot_stride,
      memory_bytes;
};
struct entry {
  _Atomic uint32_t word;
  uint32_t zero;
  _Atomic uint64_t frame_number, order;
  uint8_t unused[40];
};
_Static_assert(sizeof(struct hello) == 240 && sizeof(struct answer) == 256,
               "see docs/content/ring.md");
_Static_assert(sizeof(struct header) == 88 && sizeof(struct entry) == 64,
               "see docs/content/ring.md");

static int player = -1, memory = -1, published = -1;

static void fail(const char* what) {
  fprintf(stderr, "ring_renderer: %s%s%s\n", what, errno ? ": " : "", errno ? strerror(errno) : "");
  exit(1);
}

static struct prefix prefix_of(uint32_t kind, uint32_t bytes) {
  return (struct prefix){.magic = 0x474e524c, .version = 1, .kind = kind, .bytes = bytes};
}

static void connect_to(const char* path) {
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  if (strlen(path) >= sizeof address.sun_path) fail("the socket's path is too long");
  strcpy(address.sun_path, path);
  player = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (player < 0 || connect(player, (struct sockaddr*)&address, sizeof address) != 0) fail(path);
}

/* Sends hello. The answer has the descriptors of the memory and of the eventfd. */
static struct answer introduce(const char* fingerprint, uint64_t frames) {
  struct hello hello = {.prefix = prefix_of(kHello, sizeof hello),
                        .rate_numerator = 60,
                        .rate_denominator = 1,
                        .frame_count = frames,
                        .has_frame_count = 1};
  struct answer answer = {0};
  union {
    struct cmsghdr first;
    char bytes[CMSG_SPACE(2 * sizeof(int))];
  } control;
  struct iovec buffer = {&answer, sizeof answer};
  struct msghdr message = {.msg_iov = &buffer,
                           .msg_iovlen = 1,
                           .msg_control = &control,
                           .msg_controllen = sizeof control};
  const struct cmsghdr* passed;
  snprintf(hello.name, sizeof hello.name, "ring_renderer.c");
  snprintf(hello.rig, sizeof hello.rig, "%s", fingerprint);
  if (send(player, &hello, sizeof hello, MSG_NOSIGNAL) != sizeof hello) fail("hello");
  if (recvmsg(player, &message, MSG_CMSG_CLOEXEC) < (ssize_t)sizeof answer.prefix) fail("answer");
  errno = 0;
  if (answer.prefix.kind == kRefuse) fail(answer.is.refuse.text);
  passed = CMSG_FIRSTHDR(&message);
  if (answer.prefix.kind != kAccept || passed == NULL || passed->cmsg_type != SCM_RIGHTS ||
      passed->cmsg_len != CMSG_LEN(2 * sizeof(int)))
    fail("the peer is not a lenticule player");
  memcpy(&memory, CMSG_DATA(passed), sizeof memory);
  memcpy(&published, CMSG_DATA(passed) + sizeof memory, sizeof published);
  return answer;
}

/* Checks that the memory cannot shrink, and maps it. */
static uint8_t* map(uint64_t bytes) {
  struct stat status;
  const int seals = fcntl(memory, F_GET_SEALS);
  void* mapped;
  const struct header* header;
  if (seals < 0 || !(seals & F_SEAL_SHRINK)) fail("the memory is not sealed against shrinking");
  if (fstat(memory, &status) != 0 || (uint64_t)status.st_size != bytes)
    fail("the size of the memory differs from the announced one");
  mapped = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
  if (mapped == MAP_FAILED) fail("mmap");
  header = mapped;
  if (memcmp(header->magic, "LNTCRING", 8) != 0 || header->endian_tag != 0x01020304 ||
      header->abi_version != 1 || header->format != 1)
    fail("the ring has another version or pixel format");
  return mapped;
}

/* Takes a free slot and returns its number. Waits until the player frees one. */
static uint32_t acquire(struct entry* table, uint32_t slots, uint32_t epoch) {
  int asked = 0;
  for (;;) {
    struct pollfd wake = {.fd = player, .events = POLLIN};
    uint8_t message[256];
    uint32_t slot;
    for (slot = 0; slot < slots; ++slot) {
      uint32_t expected = epoch << 3 | kFree;
      if (atomic_compare_exchange_strong_explicit(&table[slot].word, &expected,
                                                  epoch << 3 | kWriting, memory_order_acquire,
                                                  memory_order_relaxed))
        return slot;
    }
    if (!asked) {
      const struct prefix wanted = prefix_of(kWanted, sizeof wanted);
      asked = send(player, &wanted, sizeof wanted, MSG_NOSIGNAL | MSG_DONTWAIT) > 0;
    }
    poll(&wake, 1, 100); /* wakes when the player sends "freed" */
    for (;;) {
      const ssize_t got = recv(player, message, sizeof message, MSG_DONTWAIT);
      if (got == 0) fail("the player has ended");
      if (got < 0) break;
    }
  }
}

static void publish(struct entry* entry, uint32_t epoch, uint64_t number) {
  const uint64_t one = 1;
  uint32_t expected = epoch << 3 | kWriting;
  atomic_store_explicit(&entry->frame_number, number, memory_order_relaxed);
  atomic_store_explicit(&entry->order, number, memory_order_relaxed);
  if (!atomic_compare_exchange_strong_explicit(&entry->word, &expected, epoch << 3 | kReady,
                                               memory_order_release, memory_order_relaxed))
    fail("the player has withdrawn the slot");
  if (write(published, &one, sizeof one) < 0 && errno != EAGAIN) fail("eventfd");
}

int main(int argc, char** argv) {
  struct {
    struct prefix prefix;
    uint64_t published;
  } goodbye = {prefix_of(kGoodbye, sizeof goodbye), 0};
  uint64_t frames, number, x, y;
  struct answer answer;
  uint8_t* ring;
  if (argc != 4) {
    fprintf(stderr, "usage: %s SOCKET FRAMES FINGERPRINT\n", argv[0]);
    return 2;
  }
  frames = strtoull(argv[2], NULL, 10);
  connect_to(argv[1]);
  answer = introduce(argv[3], frames);
  ring = map(answer.is.accept.memory_bytes);
  const struct header header = *(const struct header*)ring; /* a copy, so that it cannot change */
  struct entry* const table = (struct entry*)(ring + header.table_offset);
  _Atomic uint32_t* const heartbeat = (_Atomic uint32_t*)(ring + 192);
  for (number = 0; number < frames; ++number) {
    const uint32_t slot = acquire(table, header.slots, answer.is.accept.epoch);
    uint8_t* const pixels = ring + header.slots_offset + slot * header.slot_stride;
    for (y = 0; y < header.height; ++y)
      for (x = 0; x < header.row_bytes; ++x)
        pixels[y * header.row_bytes + x] = (uint8_t)(x + 3 * y + 7 * number);
    publish(&table[slot], answer.is.accept.epoch, number);
    atomic_fetch_add_explicit(heartbeat, 1, memory_order_relaxed);
  }
  goodbye.published = frames;
  if (send(player, &goodbye, sizeof goodbye, MSG_NOSIGNAL) != sizeof goodbye) fail("goodbye");
  return 0;
}
