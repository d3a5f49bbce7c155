/* SPDX-License-Identifier: Apache-2.0 */
/* Pushes views, which the player weaves: push_views SOCKET [FRAMES]
 *   lenticule play 'ring:SOCKET?size=3360x3360' --grid 8x6 --rig RIG.toml --display kms
 *   cc push_views.c $(pkg-config --cflags --libs lenticule) -o push_views
 * Byte x of row y of view k of frame n is x + 3 y + 40 k + 7 n, modulo 256. A renderer would render
 * view k here from camera k, counted from the left; with --depth, place 0 has the colours of one
 * view and place 1 its depth. */
#include <lenticule.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void paint(uint8_t* pixels, const lenticule_ring* ring, long frame) {
  int view, x, y;
  lenticule_rect place;
  memset(pixels, 0, lenticule_ring_frame_bytes(ring)); /* between and beside the tiles */
  for (view = 0; lenticule_ring_view(ring, view, &place) == LENTICULE_OK; ++view)
    for (y = 0; y < place.height; ++y) {
      uint8_t* row = pixels + (place.y + y) * lenticule_ring_stride(ring) + 3 * place.x;
      for (x = 0; x < 3 * place.width; ++x) row[x] = (uint8_t)(x + 3 * y + 40 * view + 7 * frame);
    }
}

int main(int argc, char** argv) {
  lenticule_hello hello = LENTICULE_HELLO_INIT;
  lenticule_ring* ring = NULL;
  lenticule_status status;
  uint8_t* pixels;
  long frame = 0;
  if (argc < 2) {
    fprintf(stderr, "usage: %s SOCKET [FRAMES]\n", argv[0]);
    return 2;
  }
  hello.name = "push_views";
  hello.pushes_views = 1;
  hello.frame_count = argc > 2 ? atol(argv[2]) : 600;
  hello.rate_numerator = 60;
  hello.rate_denominator = 1;

  status = lenticule_ring_connect(argv[1], &hello, 5000, &ring);
  while (status == LENTICULE_OK && frame < hello.frame_count) {
    status = lenticule_ring_acquire(ring, (uint64_t)frame, 1000, &pixels);
    if (status == LENTICULE_TIMED_OUT) status = LENTICULE_OK; /* a paused player frees no slot */
    if (status != LENTICULE_OK || !pixels) continue;
    paint(pixels, ring, frame++);
    status = lenticule_ring_publish(ring);
  }
  if (status == LENTICULE_OK) status = lenticule_ring_finish(ring);
  if (status != LENTICULE_OK) fprintf(stderr, "%s: %s\n", argv[1], lenticule_last_error());
  lenticule_ring_close(ring);
  return status == LENTICULE_OK ? 0 : 1;
}
