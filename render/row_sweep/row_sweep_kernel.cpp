// SPDX-License-Identifier: Apache-2.0
// Processes sixteen rays through neighbouring lenses at a time. All instruction sets give the same
// bits.
#include "render/row_sweep/row_sweep_kernel.h"

#include "base/lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lanes;
using namespace sweep_kernel;

using Eight = Vector<float, kBlock>;
using NativeFloats = Vector<float, kWidth>;
using NativeInts = Vector<int32_t, kWidth>;

inline Unaligned<NativeFloats>& native(float* at) { return vector_at<NativeFloats>(at); }
inline const Unaligned<NativeInts>& native(const int32_t* at) { return vector_at<NativeInts>(at); }
inline Unaligned<NativeInts>& native(int32_t* at) { return vector_at<NativeInts>(at); }

alignas(64) constexpr int32_t kCount[kLanes] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                8, 9, 10, 11, 12, 13, 14, 15};

// --- rays

/// Sixteen columns that start with a given colour.
struct alignas(64) Pattern {
  double phase[3][kLanes];
  float bend[3][kLanes];
  float x0[kLanes];
};

void set_pattern(const RowPiece& p, int first_colour, Pattern& out) {
  for (int l = 0; l < kLanes; ++l) {
    const int colour = p.colours_alike ? 0 : (first_colour + l) % kColours;
    for (int n = 0; n < 3; ++n) {
      out.phase[n][l] = p.phase[colour][n];
      out.bend[n][l] = p.bend[colour][n];
    }
    out.x0[l] = p.x0[colour];
  }
}

/// Computes the lenses of sixteen columns, beginning with the given one, and the distances of their
/// phases from them.
inline Floats off_of(const Pattern& t, int column, int32_t* lens) {
  using Numbers = Vector<int32_t, kDoubles>;
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: additions round to integers
  return narrowed([&](int first) {
    const auto term = [&](int n) -> const auto& { return vector_at<Doubles>(&t.phase[n][first]); };
    const Numbers number = vector_at<Numbers>(kCount + first).v + column;
    const Doubles c = __builtin_convertvector(number, Doubles);
    const Doubles phase = term(0).v + c * (term(1).v + c * term(2).v);
    const Doubles nearest = (phase + kShift) - kShift;
    vector_at<Numbers>(lens + first).v = __builtin_convertvector(nearest, Numbers);
    return phase - nearest;
  });
}

template <int kCoefficients>
inline void ray_of(const RowPiece& p, const Pattern& t, int column, const Floats& off, Floats& x,
                   Floats& tan) {
  const Floats c = to_floats(masks_at(kCount) + column);
  const Floats y = (floats_at(t.bend[0]) + c * (floats_at(t.bend[1]) + c * floats_at(t.bend[2]))) -
                   p.lens_step * off;
  tan = Floats::of(p.tangent[kCoefficients - 1]);
#pragma GCC unroll 8
  for (int n = kCoefficients - 2; n >= 0; --n) tan = tan * y + p.tangent[n];
  Floats shift = Floats::of(p.shift[kShiftCoefficients - 1]);
#pragma GCC unroll 8
  for (int n = kShiftCoefficients - 2; n >= 0; --n) shift = shift * y + p.shift[n];
  x = floats_at(t.x0) + (shift + p.x_step * c);
}

template <int kCoefficients>
bool make_columns(const RowPiece& p, int count, float* x, float* tan, int32_t* lens) {
  Pattern patterns[kColours];
  const int different = p.colours_alike ? 1 : kColours;
  for (int n = 0; n < different; ++n) set_pattern(p, n * kLanes % kColours, patterns[n]);
  Masks bad{};
  for (int c = 0, n = 0; c < count; c += kLanes, n = n + 1 < different ? n + 1 : 0) {
    const Floats off = off_of(patterns[n], c, lens + c);
    bad = bad | (off * off > p.safe * p.safe);
    Floats x16, tan16;
    ray_of<kCoefficients>(p, patterns[n], c, off, x16, tan16);
    store(x16, x + c);
    store(tan16, tan + c);
  }
  return any(bad);
}

bool make_rays(const RowPiece& p, int count, float* x, float* tan, int32_t* lens) {
  return with_constant<2, kMostCoefficients>(p.coefficients, [&](auto coefficients) {
    return make_columns<coefficients>(p, count, x, tan, lens);
  });
}

bool uncertain(const RowPiece& p, int column) {
  Pattern t;
  set_pattern(p, column % kColours, t);
  int32_t lens[kLanes];
  const Floats off = off_of(t, column, lens);
  return off[0] * off[0] > p.safe * p.safe;
}

void make_ray(const RowPiece& p, int column, float off, float* x, float* tan) {
  RowPiece all = p;
  for (int n = p.coefficients; n < kMostCoefficients; ++n) all.tangent[n] = 0.0F;
  Pattern t;
  set_pattern(p, column % kColours, t);
  Floats x16, tan16;
  ray_of<kMostCoefficients>(all, t, column, Floats::of(off), x16, tan16);
  *x = x16[0];
  *tan = tan16[0];
}

// --- cells

/// Transposes a square of kBlock times kBlock elements.
inline void transpose(Eight (&v)[kBlock]) {
  Eight a[kBlock];
  for (int n = 0; n < 4; ++n) {
    a[2 * n] = __builtin_shufflevector(v[n], v[n + 4], 0, 8, 1, 9, 2, 10, 3, 11);
    a[2 * n + 1] = __builtin_shufflevector(v[n], v[n + 4], 4, 12, 5, 13, 6, 14, 7, 15);
  }
  Eight b[kBlock];
  for (int n = 0; n < 4; ++n) {
    b[2 * n] = __builtin_shufflevector(a[n], a[n + 4], 0, 8, 1, 9, 2, 10, 3, 11);
    b[2 * n + 1] = __builtin_shufflevector(a[n], a[n + 4], 4, 12, 5, 13, 6, 14, 7, 15);
  }
  for (int n = 0; n < 4; ++n) {
    v[2 * n] = __builtin_shufflevector(b[n], b[n + 4], 0, 8, 1, 9, 2, 10, 3, 11);
    v[2 * n + 1] = __builtin_shufflevector(b[n], b[n + 4], 4, 12, 5, 13, 6, 14, 7, 15);
  }
}

inline void square_to_cells(const float* rays, const int32_t* first, int place, int stride,
                            float* cells) {
  Eight v[kBlock];
  for (int k = 0; k < kBlock; ++k) v[k] = vector_at<Eight>(rays + first[k] + place).v;
  transpose(v);
  for (int n = 0; n < kBlock; ++n) vector_at<Eight>(cells + n * stride).v = v[n];
}

inline float lowest(const NativeFloats& v) {
  float least = v[0];
  for (int l = 1; l < kWidth; ++l) least = v[l] < least ? v[l] : least;
  return least;
}

/// Sets NaN in lenses without this place, and computes the spread of the others.
void close_place(const int32_t* first, int place, const Cells& cells, const Spread& spread) {
  const float nan = __builtin_nanf(""), far = 3e38F;
  NativeFloats x_low = NativeFloats{} + far, x_high = -x_low, tan_low = x_low, tan_high = -x_low;
  float* x_row = cells.x + place * cells.stride;
  float* tan_row = cells.tan + place * cells.stride;
  for (int k = 0; k < cells.stride; k += kWidth) {
    const NativeInts there = native(first + k + 1).v - native(first + k).v > place;
    const NativeFloats lens = __builtin_convertvector(native(kCount).v + k, NativeFloats);
    const NativeFloats x = there ? native(x_row + k).v : NativeFloats{} + nan;
    const NativeFloats tan = there ? native(tan_row + k).v : NativeFloats{} + nan;
    native(x_row + k).v = x;
    native(tan_row + k).v = tan;
    const NativeFloats x_off = x - spread.x_step * lens;
    const NativeFloats tan_off = tan - spread.tan_step * lens;
    x_low = x_off < x_low ? x_off : x_low;
    x_high = x_off > x_high ? x_off : x_high;
    tan_low = tan_off < tan_low ? tan_off : tan_low;
    tan_high = tan_off > tan_high ? tan_off : tan_high;
  }
  spread.x_low[place] = lowest(x_low);
  spread.x_high[place] = -lowest(-x_high);
  spread.tan_low[place] = lowest(tan_low);
  spread.tan_high[place] = -lowest(-tan_high);
}

void see_nothing(const Cells& cells) {
  const int count = cells.places * cells.stride;
  for (int k = 0; k < count; k += kWidth) {
    native(cells.z + k).v = NativeFloats{} - __builtin_inff();
    native(cells.cut + k).v = NativeInts{} - 1;
  }
}

void to_cells(const float* x, const float* tan, const int32_t* first, const Cells& cells,
              const Spread& spread) {
  for (int k = 0; k < cells.lenses; k += kBlock)
    for (int place = 0; place < cells.places; place += kBlock) {
      const int at = place * cells.stride + k;
      square_to_cells(x, first + k, place, cells.stride, cells.x + at);
      square_to_cells(tan, first + k, place, cells.stride, cells.tan + at);
    }
  for (int place = 0; place < cells.places; ++place) close_place(first, place, cells, spread);
  see_nothing(cells);
}

template <class T>
inline void square_to_rays(const T* cells, const int32_t* first, int place, int stride, T* rays) {
  Eight v[kBlock];
  for (int n = 0; n < kBlock; ++n) v[n] = vector_at<Eight>(cells + n * stride).v;
  transpose(v);
  // Goes from left to right, so that elements written past a lens's last place are overwritten by
  // later lenses.
  for (int k = 0; k < kBlock; ++k)
    if (first[k + 1] - first[k] > place) vector_at<Eight>(rays + first[k] + place).v = v[k];
}

void to_rays(const Cells& cells, const int32_t* first, float* z, int32_t* cut) {
  const int last_place = (cells.places - 1) / kBlock * kBlock;
  for (int k = 0; k < cells.lenses; k += kBlock)
    for (int place = last_place; place >= 0; place -= kBlock) {
      const int at = place * cells.stride + k;
      square_to_rays(cells.z + at, first + k, place, cells.stride, z);
      square_to_rays(cells.cut + at, first + k, place, cells.stride, cut);
    }
}

// --- cuts

/// Lenses that can meet a cut, for sixteen places; an empty range has last < first.
struct alignas(64) Range {
  int32_t first[kLanes];
  int32_t last[kLanes];
};

/// Returns a bit mask of the places whose range is not empty.
inline uint32_t places_of(const Range& range) {
  return bits(masks_at(range.first) <= masks_at(range.last));
}

/// Computes the lenses that can meet a cut. The signed distance between a ray and an end of a cut
/// keeps its sign outside its zeros; rays for which both ends have the same sign miss the cut.
__attribute__((always_inline)) inline void range_of(const Cells& cells, const Spread& s,
                                                    const Reach& reach, int place, Range& out) {
  constexpr float kRounding = 4e-7F;  // a few roundings of the largest term
  constexpr float kTouch = 1e-3F;     // lenses
  const Floats tan_low = load(s.tan_low + place), tan_high = load(s.tan_high + place);
  Floats low = Floats::of(3e38F), high = -low;
  for (int e = 0; e < 2; ++e) {
    const float z = reach.z[e];
    const float step = s.x_step + s.tan_step * z;
    if (!(step > 0.0F)) {
      low = Floats{};
      high = Floats::of(static_cast<float>(cells.lenses));
      break;
    }
    const Floats a = tan_low * z, b = tan_high * z;
    const float per = 1.0F / step;
    const float depth = z < 0.0F ? -z : z;
    const float left = reach.x_low[e] < 0.0F ? -reach.x_low[e] : reach.x_low[e];
    const float right = reach.x_high[e] < 0.0F ? -reach.x_high[e] : reach.x_high[e];
    const float slack = kTouch + kRounding * per * (left + right + s.x_far + s.tan_far * depth);
    const Floats from = (reach.x_low[e] - load(s.x_high + place) - max(a, b)) * per - slack;
    const Floats to = (reach.x_high[e] - load(s.x_low + place) - min(a, b)) * per + slack;
    low = min(from, low);
    high = max(to, high);
  }
  const Floats none{}, end = Floats::of(static_cast<float>(cells.lenses));
  masks_at(out.first) = to_integers(min(max(low + 1.0F, none), end));
  masks_at(out.last) = to_integers(max(min(high + 1.0F, end), none)) - 1;
}

__attribute__((always_inline)) inline void segment_at(const Cells& cells, int at, float start,
                                                      const Segment& s, int32_t number) {
  for (const int end = at + kLanes; at < end; at += kWidth) {
    const NativeFloats x = native(cells.x + at).v;
    const NativeFloats tan = native(cells.tan + at).v;
    const NativeFloats f0 = (x + tan * s.z0) - s.x0;
    const NativeFloats f1 = (x + tan * s.z1) - s.x1;
    const NativeFloats z = s.z0 + f0 / (f0 - f1) * (s.z1 - s.z0);
    auto& best = native(cells.z + at);
    auto& cut = native(cells.cut + at);
    const NativeInts met = (f0 * f1 <= 0.0F) & (z > best.v) & (z <= start);
    best.v = met ? z : best.v;
    cut.v = met ? NativeInts{} + number : cut.v;
  }
}

/// Calls cell(first element) for each group of sixteen cells that may meet content inside `reach`.
template <class Visit>
__attribute__((always_inline)) inline void visit(const Cells& cells, const Spread& spread,
                                                 const Reach& reach, int lanes, const Visit& cell) {
  for (int place = 0; place < cells.places; place += kLanes) {
    Range range;
    range_of(cells, spread, reach, place, range);
    uint32_t left = places_of(range);
    if (cells.places - place < kLanes) left &= (1U << (cells.places - place)) - 1U;
    for (; left != 0; left &= left - 1) {
      const int n = __builtin_ctz(left);
      const int row = (place + n) * cells.stride;
      // Starts at a whole vector: then the loads and stores of neighbouring cuts use the same
      // memory and do not touch a second cache line.
      for (int k = range.first[n] & -lanes; k <= range.last[n]; k += lanes) cell(row + k);
    }
  }
}

void segments(const Cells& cells, const Spread& spread, float start, const Segment* list, int count,
              int32_t number) {
  const Cells own = cells;  // a copy, which stores cannot alias
  for (int n = 0; n < count; ++n) {
    const Segment segment = list[n];
    const int32_t its = number + n;
    visit(
        own, spread, segment.reach, kLanes, [&](int at) __attribute__((always_inline)) {
          segment_at(own, at, start, segment, its);
        });
  }
}

/// Returns the nearer of the valid roots, -infinity if there is none. A ray meets the form at
/// (xc + v + tan t, zc + t) where a t^2 + 2 b t + c = 0.
inline Doubles conic_z(const Conic& q, double start, const Doubles& x, const Doubles& tan) {
  const PlaneForm& form = q.form;
  const Doubles v = (x + tan * form.zc) - form.xc;
  const Doubles a = form.C + tan * (2.0 * form.B + tan * form.A);
  const Doubles b = (form.gz + form.gx * tan) + v * (form.B + form.A * tan);
  const Doubles c = form.f + v * (2.0 * form.gx + v * form.A);
  const Doubles square = b * b - a * c;
  const Doubles half = root(square > 0.0 ? square : Doubles{});
  // Both terms have the same sign, so nothing cancels.
  const Doubles sum = -(b + (b < 0.0 ? -half : half));
  const Doubles t0 = sum / a, t1 = c / sum;
  const Doubles s_panel = q.s + q.s_x * v;
  const Doubles s_step = q.s_z + q.s_x * tan;
  const Doubles s_0 = s_panel + t0 * s_step, s_1 = s_panel + t1 * s_step;
  const Doubles z0 = t0 + form.zc, z1 = t1 + form.zc;
  const Doubles none = Doubles{} - __builtin_inf();
  const DoubleMasks real = square >= 0.0;
  const Doubles first = (real & (s_0 >= 0.0) & (s_0 <= q.height) & (z0 <= start)) ? z0 : none;
  const Doubles second = (real & (s_1 >= 0.0) & (s_1 <= q.height) & (z1 <= start)) ? z1 : none;
  return first > second ? first : second;
}

inline void conic_at(const Cells& cells, int at, double start, const Conic& q, int32_t number) {
  using Part = Vector<float, kDoubles>;
  using PartInts = Vector<int32_t, kDoubles>;
  for (const int end = at + kBlock; at < end; at += kDoubles) {
    const Doubles x = __builtin_convertvector(vector_at<Part>(cells.x + at).v, Doubles);
    const Doubles tan = __builtin_convertvector(vector_at<Part>(cells.tan + at).v, Doubles);
    const Part z = __builtin_convertvector(conic_z(q, start, x, tan), Part);
    auto& best = vector_at<Part>(cells.z + at);
    auto& cut = vector_at<PartInts>(cells.cut + at);
    const PartInts met = z > best.v;
    best.v = met ? z : best.v;
    cut.v = met ? PartInts{} + number : cut.v;
  }
}

void conics(const Cells& cells, const Spread& spread, float start, const Conic* list, int count,
            int32_t number) {
  for (int n = 0; n < count; ++n)
    visit(
        cells, spread, list[n].reach, kBlock, [&](int at) __attribute__((always_inline)) {
          conic_at(cells, at, start, list[n], number + n);
        });
}

}  // namespace

extern const sweep_kernel::Kernel kSweepKernel;
const sweep_kernel::Kernel kSweepKernel{.make_rays = make_rays,
                                        .uncertain = uncertain,
                                        .make_ray = make_ray,
                                        .to_cells = to_cells,
                                        .segments = segments,
                                        .conics = conics,
                                        .to_rays = to_rays};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
