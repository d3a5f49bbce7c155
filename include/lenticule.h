/* SPDX-License-Identifier: Apache-2.0 */
/*
 * lenticule.h: push woven frames into a running lenticule player from any program.
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
 * A frame is woven: it holds the exact code values of the panel's pixels, 8-bit R, G, B bytes, rows
 * packed from the top, lenticule_ring_stride() bytes apart.
 *
 * Functions never block longer than the timeout that they are given (milliseconds; 0 = do not
 * wait), never throw, never print, never raise SIGPIPE. One ring is for one thread at a time;
 * different rings and lenticule_last_error() may be used by different threads at once. A child of
 * fork() must not use its parent's rings. Link with pkg-config lenticule or CMake lenticule::capi.
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

/* What a function came to. Numbers stay what they are; new ones may be added. */
typedef enum lenticule_status {
  LENTICULE_OK = 0,
  LENTICULE_TIMED_OUT = 1, /* no slot became free in time: ask again */
  LENTICULE_GONE = 2,      /* the player is gone, or the sequence was finished: close and connect */
  LENTICULE_NO_PLAYER = 3, /* no player listens, answers or may be used there, or it is busy */
  LENTICULE_REFUSED = 4,   /* the player refused: made for another rig, or another version */
  LENTICULE_MISUSE = 5,    /* this call makes no sense here: a program error */
  LENTICULE_FAILED = 6     /* the system refused (memory, descriptors) */
} lenticule_status;

typedef enum lenticule_pixel_format {
  LENTICULE_RGB8 = 1 /* bytes R, G, B */
} lenticule_pixel_format;

/* What a renderer says of itself. Start from LENTICULE_HELLO_INIT. */
typedef struct lenticule_hello {
  size_t struct_size;          /* sizeof(lenticule_hello): later versions may add members */
  const char* name;            /* for the player's log, fewer than 64 bytes; NULL = "unnamed" */
  const char* rig_fingerprint; /* of the rig rendered for, as `lenticule rig show` prints it; NULL =
                                  not stated, which a player that checks rigs refuses */
  int64_t rate_numerator;      /* frames per second as a fraction; 0 and 0 = not stated */
  int64_t rate_denominator;
  int64_t frame_count; /* frames in the sequence; -1 = not known */
} lenticule_hello;

#define LENTICULE_HELLO_INIT \
  { sizeof(lenticule_hello), NULL, NULL, 0, 0, -1 }

/* One connection to one player. */
typedef struct lenticule_ring lenticule_ring;

/* Connects to the player that listens on the Unix socket `socket`, waiting until there is one that
 * is not busy. On LENTICULE_OK *out is the ring, to be closed with lenticule_ring_close();
 * otherwise *out is NULL and lenticule_last_error() says what is wrong. `hello` may be NULL. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_connect(
    const char* socket, const lenticule_hello* hello, int timeout_ms, lenticule_ring** out);

/* What the player wants; constant for one ring. 0 if `ring` is NULL. */
LENTICULE_API int lenticule_ring_width(const lenticule_ring* ring);
LENTICULE_API int lenticule_ring_height(const lenticule_ring* ring);
LENTICULE_API lenticule_pixel_format lenticule_ring_format(const lenticule_ring* ring);
LENTICULE_API size_t lenticule_ring_stride(const lenticule_ring* ring);
LENTICULE_API size_t lenticule_ring_frame_bytes(const lenticule_ring* ring);
LENTICULE_API int lenticule_ring_slots(const lenticule_ring* ring);

/* Waits for a free slot for frame `number`: the position in the sequence, which must grow from
 * frame to frame. On LENTICULE_OK *pixels is where to write lenticule_ring_frame_bytes() bytes, all
 * of them, since the slot holds an old frame; it is valid until publish, abandon or close. On any
 * other status *pixels is NULL. One slot at a time. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_acquire(lenticule_ring* ring,
                                                                         uint64_t number,
                                                                         int timeout_ms,
                                                                         uint8_t** pixels);

/* Hands the acquired slot to the player. Frames are shown in the order of publishing. */
LENTICULE_API LENTICULE_MUST_USE lenticule_status lenticule_ring_publish(lenticule_ring* ring);

/* Gives the acquired slot back unwritten. */
LENTICULE_API lenticule_status lenticule_ring_abandon(lenticule_ring* ring);

/* Says that the sequence is complete. Without it the player counts us as dead, and waits for a
 * renderer that goes on. Afterwards only close makes sense. */
LENTICULE_API lenticule_status lenticule_ring_finish(lenticule_ring* ring);

/* Ends the connection and frees `ring` (NULL is fine). Published frames are still shown. */
LENTICULE_API void lenticule_ring_close(lenticule_ring* ring);

/* Why the last function that failed in this thread did: one line, and a second one with the remedy
 * where there is one. Never NULL; valid until the thread's next call of a function that fails. */
LENTICULE_API const char* lenticule_last_error(void);

/* The library's version, which may be newer than the header's: "0.1.0". */
LENTICULE_API const char* lenticule_version(void);

#ifdef __cplusplus
}
#endif

#endif
