/* SPDX-License-Identifier: Apache-2.0 */
/* Pushes a moving grey ramp into a player: push_frames SOCKET [FRAMES [RIG_FINGERPRINT]]
 *   cc push_frames.c $(pkg-config --cflags --libs lenticule) -o push_frames */
#include <lenticule.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void paint(uint8_t* pixels, const lenticule_ring* ring, uint64_t number) {
  const int width = lenticule_ring_width(ring);
  const int height = lenticule_ring_height(ring);
  const size_t stride = lenticule_ring_stride(ring);
  int i, j;
  for (i = 0; i < width; ++i) memset(pixels + 3 * i, (int)((i + 4 * number) % 256), 3);
  for (j = 1; j < height; ++j) memcpy(pixels + j * stride, pixels, stride);
}

/* Pushes all frames. Returns LENTICULE_OK when all of them are published. */
static lenticule_status push(lenticule_ring* ring, long frames) {
  long number = 0;
  while (number < frames) {
    uint8_t* pixels;
    lenticule_status status = lenticule_ring_acquire(ring, (uint64_t)number, 1000, &pixels);
    if (status == LENTICULE_TIMED_OUT) continue; /* not an error: a paused player frees no slot */
    if (status != LENTICULE_OK) return status;
    paint(pixels, ring, (uint64_t)number);
    status = lenticule_ring_publish(ring);
    if (status != LENTICULE_OK) return status;
    ++number;
  }
  return lenticule_ring_finish(ring);
}

int main(int argc, char** argv) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  lenticule_ring* ring = NULL;
  lenticule_status status;
  if (argc < 2) {
    fprintf(stderr, "usage: %s SOCKET [FRAMES [RIG_FINGERPRINT]]\n", argv[0]);
    return 2;
  }
  hello.name = "push_frames";
  hello.frame_count = argc > 2 ? atol(argv[2]) : 600;
  hello.rig_fingerprint = argc > 3 ? argv[3] : NULL;
  hello.rate_numerator = 60;
  hello.rate_denominator = 1;

  status = lenticule_ring_connect(argv[1], &hello, 5000, &ring);
  if (status == LENTICULE_OK) status = push(ring, (long)hello.frame_count);
  if (status != LENTICULE_OK) fprintf(stderr, "%s: %s\n", argv[1], lenticule_last_error());
  lenticule_ring_close(ring);
  return status == LENTICULE_OK ? 0 : 1;
}
