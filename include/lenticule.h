/* SPDX-License-Identifier: Apache-2.0 */
/*
 * lenticule.h lets any program push pictures into a running lenticule player: woven frames, or
 * views that the player weaves.
 *
 *   lenticule_hello hello = LENTICULE_HELLO_INIT;
 *   lenticule_ring* ring = NULL;
 *   hello.name = "my renderer";
 *   if (lenticule_ring_connect("/run/lenticule/ring", &hello, 5000, &ring) != LENTICULE_OK)
 *     fprintf(stderr, "%s\n", lenticule_last_error());
 *   while (more frames && lenticule_ring_acquire(ring, number, 1000, &pixels) == LENTICULE_OK) {
 *     ... write lenticule_ring_frame_bytes(ring) bytes to pixels ...
 *     lenticule_ring_publish(ring);
 *   }
 *   lenticule_ring_finish(ring);
 *   lenticule_ring_close(ring);
 *
 * A frame is woven unless the hello says pushes_views: then the player decides the size of a
 * picture and where its views lie in it; see lenticule_ring_view(). A woven frame holds the exact
 * code values of the panel's pixels, 8-bit R, G, B bytes, rows packed from the top,
 * lenticule_ring_stride() bytes apart.
 *
 * Functions never block longer than their timeout (milliseconds; 0 = do not wait), never throw,
 * never print and never raise SIGPIPE. A child of fork() must not use its parent's rings. Link with
 * pkg-config lenticule or CMake lenticule::capi.
 *
 * Thread safety: one thread at a time may use a ring; different threads may use different rings and
 * lenticule_last_error() at once.
 */
#ifndef LENTICULE_H
#define LENTICULE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define LENTICULE_API __attribute__((visibility("default")))
#define LENTICULE_MUST_USE __attribute__((warn_unused_result))
#else
#define LENTICULE_API
#define LENTICULE_MUST_USE
#endif

#define LENTICULE_VERSION_MAJOR 0
#define LENTICULE_VERSION_MINOR 1
#define LENTICULE_VERSION_PATCH 0

/* Result of a function. The numbers never change; later versions may add new ones. */
typedef enum lenticule_status {
  LENTICULE_OK = 0,
  LENTICULE_TIMED_OUT = 1, /* no slot became free in time: call again */
  LENTICULE_GONE = 2,      /* the player has exited, or the sequence is finished: reconnect */
  LENTICULE_NO_PLAYER = 3, /* no player listens, answers or permits access, or the player is busy */
  LENTICULE_REFUSED = 4,   /* the player refused: frames for another rig, or another version */
  LENTICULE_MISUSE = 5,    /* the call is invalid in this state: a bug of the calling program */
  LENTICULE_FAILED = 6     /* the system refused (memory, descriptors) */
} lenticule_status;

typedef enum lenticule_pixel_format {
  LENTICULE_RGB8 = 1 /* bytes R, G, B */
} lenticule_pixel_format;

/* Description of a renderer. Start from LENTICULE_HELLO_INIT. */
typedef struct lenticule_hello {
  size_t struct_size;          /* sizeof(lenticule_hello): later versions may add members */
  const char* name;            /* for the player's log, fewer than 64 bytes; NULL = "unnamed" */
  const char* rig_fingerprint; /* the rig that the frames are rendered for, as `lenticule rig show`
                                  prints it; NULL = not stated, which a player that checks rigs
                                  refuses */
  int64_t rate_numerator;      /* frames per second as a fraction; 0 and 0 = not stated */
  int64_t rate_denominator;
  int64_t frame_count; /* frames in the sequence; -1 = not known */
  int pushes_views;    /* since 0.1: 1 = views, which need no rig; 0 = woven frames */
} lenticule_hello;

#define LENTICULE_HELLO_INIT \
  { sizeof(lenticule_hello), NULL, NULL, 0, 0, -1, 0 }

/* One connection to one player. */
typedef struct lenticule_ring lenticule_ring;

/* Connects to the player that listens on the Unix socket `socket`. Waits until a player listens and
 * is not busy. On LENTICULE_OK *out is the ring, which the caller closes with
 * lenticule_ring_close(); otherwise *out is NULL and lenticule_last_error() returns the cause.
 * `hello` may be NULL. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_connect(
    const char* socket, const lenticule_hello* hello, int timeout_ms, lenticule_ring** out);

/* Return the frame layout that the player requires and its number of slots. The values are constant
 * for a ring, and 0 if `ring` is NULL. */
LENTICULE_API int lenticule_ring_width(const lenticule_ring* ring);
LENTICULE_API int lenticule_ring_height(const lenticule_ring* ring);
LENTICULE_API lenticule_pixel_format lenticule_ring_format(const lenticule_ring* ring);
LENTICULE_API size_t lenticule_ring_stride(const lenticule_ring* ring);
LENTICULE_API size_t lenticule_ring_frame_bytes(const lenticule_ring* ring);
LENTICULE_API int lenticule_ring_slots(const lenticule_ring* ring);

/* A part of a picture: its left column and top row, and its size in pixels. */
typedef struct lenticule_rect {
  int x, y, width, height;
} lenticule_rect;

/* Return how the player wants the views in each picture, if the hello said pushes_views: their
 * number (0 for woven frames, and if `ring` is NULL), the width of a view divided by its height as
 * it is displayed (0: as its pixels have it), and the place of view `view`, from 0, the leftmost
 * camera's. If lenticule_ring_has_depth() returns 1, place 0 holds the colours of the only view and
 * place 1 its depth, white is near. lenticule_ring_view() returns LENTICULE_MISUSE for a view that
 * is not there.
 */
LENTICULE_API int lenticule_ring_views(const lenticule_ring* ring);
LENTICULE_API int lenticule_ring_has_depth(const lenticule_ring* ring);
LENTICULE_API double lenticule_ring_view_aspect(const lenticule_ring* ring);
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_view(const lenticule_ring* ring,
                                                                      int view,
                                                                      lenticule_rect* out);

/* Waits for a free slot for frame `number`, the position in the sequence, which must increase from
 * frame to frame. On LENTICULE_OK *pixels points to the slot's lenticule_ring_frame_bytes() bytes;
 * the caller writes all of them, because the slot holds an old frame. The pointer is valid until
 * publish, abandon or close. On any other status *pixels is NULL. A ring has one acquired slot at a
 * time. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_acquire(lenticule_ring* ring,
                                                                         uint64_t number,
                                                                         int timeout_ms,
                                                                         uint8_t** pixels);

/* Hands the acquired slot to the player. Frames are shown in the order of publishing. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_publish(lenticule_ring* ring);

/* Releases the acquired slot without publishing a frame. */
LENTICULE_API lenticule_status lenticule_ring_abandon(lenticule_ring* ring);

/* Reports to the player that the sequence is complete. If a renderer disconnects without this call,
 * the player assumes that the renderer died, and waits for another renderer that continues the
 * sequence. After this call only close is allowed. */
LENTICULE_API lenticule_status lenticule_ring_finish(lenticule_ring* ring);

/* Closes the connection and frees `ring` (may be NULL). The player still shows published frames. */
LENTICULE_API void lenticule_ring_close(lenticule_ring* ring);

/* Returns the cause of the last failure in this thread: one line, and a second line with the remedy
 * if a remedy is known. Never NULL; valid until the next function that fails in this thread. */
LENTICULE_API const char* lenticule_last_error(void);

/* Returns the library's version, for example "0.1.0", which may be newer than the header's. */
LENTICULE_API const char* lenticule_version(void);

#ifdef __cplusplus
}
#endif

#endif
