// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/adaptive_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numbers>

#include "render/rays/primary_rays.h"
#include "render/row_sweep/row_sweep.h"
#include "render/scene/texture.h"

namespace lenticule::render {

GroundRow::GroundRow(const Scene& scene, const RowPlanes& planes)
    : scene_(scene), planes_(planes), corners_mm_(scene.backdrop.ground_shadow->corners()) {
  const Affine panel_from_scene = scene.scene_from_panel.inverse();
  for (Vec3& corner : corners_mm_) corner = panel_from_scene.point(corner);
}

void GroundRow::start(const RowPlane& plane, const Interval& eyes) {
  set_range(plane, eyes);
  if (range_mm_.empty()) return;
  row_.emplace(*scene_.backdrop.ground_shadow, scene_.scene_from_panel, plane.lens_y_mm,
               plane.tan_y);
}

/// The plane cuts the ground in a line, which the eyes see between its ends.
void GroundRow::set_range(const RowPlane& plane, const Interval& eyes) {
  const auto above_plane = [&](Vec3 p) { return p.y - plane.lens_y_mm - plane.tan_y * p.z; };
  range_mm_ = {};
  for (size_t n = 0; n < corners_mm_.size(); ++n) {
    const Vec3 a = corners_mm_[n], b = corners_mm_[(n + 1) % corners_mm_.size()];
    const double from = above_plane(a), to = above_plane(b);
    if ((from > 0.0) == (to > 0.0)) continue;
    const Vec3 at = a + (b - a) * (from / (from - to));
    if (!extend_by_view({at.x, at.z}, planes_.inverse_z(), eyes, range_mm_)) {
      range_mm_ = kEverywhere;
      return;
    }
  }
}

double GroundRow::light(double x_mm, double tan_x, int channel) const {
  return component(scene_.backdrop.colour, channel) * row_->light_left(x_mm, tan_x);
}

namespace {

std::array<Vec3, 8> corners_of(const Bounds& box) {
  std::array<Vec3, 8> corners;
  for (size_t n = 0; n < corners.size(); ++n)
    corners[n] = {(n & 1) != 0 ? box.high.x : box.low.x, (n & 2) != 0 ? box.high.y : box.low.y,
                  (n & 4) != 0 ? box.high.z : box.low.z};
  return corners;
}

Bounds overlap(const Bounds& a, const Bounds& b) {
  return {
      {std::max(a.low.x, b.low.x), std::max(a.low.y, b.low.y), std::max(a.low.z, b.low.z)},
      {std::min(a.high.x, b.high.x), std::min(a.high.y, b.high.y), std::min(a.high.z, b.high.z)}};
}

/// Returns the box extended by `by` to all sides.
Bounds widened(const Bounds& box, double by) {
  const Vec3 all{by, by, by};
  return {box.low - all, box.high + all};
}

bool holds_something(const Bounds& box) {
  return box.low.x <= box.high.x && box.low.y <= box.high.y && box.low.z <= box.high.z;
}

/// Margin for a scene of a few hundred millimetres; larger than rounding errors.
constexpr double kMarginMm = 0.2;

}  // namespace

UnchangedRegions::UnchangedRegions(const RowPlanes& planes, const Interval& eyes,
                                   const Scene& scene, const SoftLight& soft,
                                   const SceneObjects& before, const SceneObjects& now)
    : planes_(planes),
      eyes_(eyes),
      panel_from_scene_(scene.scene_from_panel.inverse()),
      bands_((planes.rows() + kBandRows - 1) / kBandRows) {
  const optics::Panel& panel = planes.model().rig().panel;
  const double pixel_mm = panel.pixel_width.value;
  columns_ = (panel.width_px + kColumnPixels - 1) / kColumnPixels + 2;  // lenses extend beyond
  columns_per_mm_ = 1.0 / (kColumnPixels * pixel_mm);
  x_first_ = -0.5 * columns_ * kColumnPixels * pixel_mm;
  for (int band = 0; band < bands_; ++band) {
    Interval& y_mm = band_y_mm_.emplace_back();
    for (const int row : {band * kBandRows - 1, (band + 1) * kBandRows})
      y_mm.extend(planes.plane_at(row + planes.height_in_row(0)).lens_y_mm);
  }
  lost_.assign(static_cast<size_t>(bands_) * static_cast<size_t>(columns_), 0);
  lost_in_band_.assign(static_cast<size_t>(bands_), 0);
  kept_ = lost_.size();
  if (!differ_in_objects_only(before, now))
    mark_all_changed();
  else if (mark_changes(scene, soft, before, now))
    for (const SceneObjects::Object& object : now.objects)
      if (object.depends_on_view) mark_changed(widened(object.box, kMarginMm));
}

/// Marks the old and new places of all changed objects as changed. Returns true if an object
/// changed.
bool UnchangedRegions::mark_changes(const Scene& scene, const SoftLight& soft,
                                    const SceneObjects& before, const SceneObjects& now) {
  Bounds everything;
  for (const SceneObjects* frame : {&before, &now})
    for (const SceneObjects::Object& object : frame->objects)
      for (const Vec3& corner : corners_of(object.box)) everything.extend(corner);
  const double around = soft.occlusion_samples > 0 ? soft.occlusion_distance_mm : 0.0;
  bool any_changed = false;
  for (size_t n = 0; n < now.objects.size(); ++n) {
    if (now.objects[n].made_of == before.objects[n].made_of) continue;
    any_changed = true;
    if (soft.environment_samples > 0 || !std::isfinite(around)) mark_all_changed();
    for (const SceneObjects* frame : {&before, &now}) {
      if (!any()) return true;
      const Bounds& box = frame->objects[n].box;
      mark_changed(widened(box, around + kMarginMm));
      for (const SceneLight& light : scene.lights)
        mark_shadow_changed(box, light, soft, everything);
    }
  }
  return any_changed;
}

bool UnchangedRegions::at(int row, double x_mm) const {
  const int band = std::clamp(row / kBandRows, 0, bands_ - 1);
  const double column = std::floor((x_mm - x_first_) * columns_per_mm_);
  if (!(column >= 0.0 && column < columns_)) return false;
  return lost_[static_cast<size_t>(band) * static_cast<size_t>(columns_) +
               static_cast<size_t>(column)] == 0;
}

void UnchangedRegions::mark_all_changed() {
  std::fill(lost_.begin(), lost_.end(), uint8_t{1});
  std::fill(lost_in_band_.begin(), lost_in_band_.end(), columns_);
  kept_ = 0;
}

void UnchangedRegions::mark_changed(const Patch& patch) {
  const double first = (patch.x_mm.low - x_first_) * columns_per_mm_;
  const double last = (patch.x_mm.high - x_first_) * columns_per_mm_;
  if (!(first < columns_) || !(last >= 0.0)) return;
  const int begin = first > 0.0 ? static_cast<int>(first) : 0;
  const int end = last < columns_ ? static_cast<int>(last) + 1 : columns_;
  for (int band = 0; band < bands_; ++band) {
    const Interval& y_mm = band_y_mm_[static_cast<size_t>(band)];
    if (y_mm.high < patch.y_mm.low || y_mm.low > patch.y_mm.high) continue;
    for (int column = begin; column < end; ++column) {
      uint8_t& lost = lost_[static_cast<size_t>(band) * static_cast<size_t>(columns_) +
                            static_cast<size_t>(column)];
      if (lost != 0) continue;
      lost = 1;
      ++lost_in_band_[static_cast<size_t>(band)];
      --kept_;
    }
  }
}

/// Returns the region of the panel through which a box is visible. Projection from a point keeps
/// lines straight, so the corners suffice; and the outermost viewing places bound the region for
/// all places between them.
UnchangedRegions::Patch UnchangedRegions::seen_through(const Bounds& box) const {
  // Fraction of the distance to the viewing line beyond which content may be seen anywhere.
  constexpr double kTooNear = 0.9;
  const double inverse_z = planes_.inverse_z();
  Patch patch;
  for (const Vec3& corner : corners_of(box)) {
    const Vec3 p = panel_from_scene_.point(corner);
    const double wider = 1.0 - p.z * inverse_z;
    if (!(wider > 1.0 - kTooNear)) return {kEverywhere, kEverywhere};
    const double depth = inverse_z > 0.0 ? p.z * inverse_z : p.z;
    for (const double eye : {eyes_.low, eyes_.high}) patch.x_mm.extend((p.x - eye * depth) / wider);
    patch.y_mm.extend((p.y - planes_.eye_tan_y() * p.z) / wider);
  }
  return patch;
}

void UnchangedRegions::mark_changed(const Bounds& box) {
  if (holds_something(box)) mark_changed(seen_through(box));
}

/// Marks the region behind a box as seen from a light, in pieces, as far as there is content. For
/// an area light, the region is extended sideways by the penumbra.
void UnchangedRegions::mark_shadow_changed(const Bounds& box, const SceneLight& light,
                                           const SoftLight& soft, const Bounds& within) {
  constexpr int kPieces = 48;
  const double farthest = length(within.high - within.low);
  const bool is_sun = light.kind == Light::Kind::Directional;
  // The end of the shadow is expressed as a multiple of the distance from the light.
  double nearest = 1.0;
  if (!is_sun) {
    const Vec3 beside{std::max({box.low.x - light.position.x, 0.0, light.position.x - box.high.x}),
                      std::max({box.low.y - light.position.y, 0.0, light.position.y - box.high.y}),
                      std::max({box.low.z - light.position.z, 0.0, light.position.z - box.high.z})};
    nearest = length(beside);
  }
  const double size = soft.shadow_samples == 0 ? 0.0
                      : is_sun ? std::tan(soft.sun_radius_degrees * std::numbers::pi / 180.0)
                               : soft.light_radius_mm;
  if (!(nearest > size)) return mark_all_changed();
  const double whole_way = farthest / (nearest - size);
  for (int piece = 0; piece < kPieces; ++piece) {
    Bounds shadow;
    const double ends[] = {whole_way * piece / kPieces, whole_way * (piece + 1) / kPieces};
    for (const double way : ends)
      for (const Vec3& corner : corners_of(box))
        shadow.extend(corner + (is_sun ? light.direction : corner - light.position) * way);
    mark_changed(overlap(widened(shadow, ends[1] * size + kMarginMm), widened(within, kMarginMm)));
  }
}

namespace {

/// Largest share of a band's subpixels that may exceed the tolerated error.
constexpr double kMostBeyond = 0.03;
/// Largest mean square of a band's errors, as a multiple of the frame's: bands with less make up
/// for it.
constexpr double kMostOfBand = 2.0;

}  // namespace

AdaptiveFrame::AdaptiveFrame(const AdaptivePlan& of, const KeyGrid& keys, const Scene& whole,
                             KeySamples& memory, frames::WovenFrame& frame)
    : plan(of),
      grid(keys),
      scene(whole),
      out(frame),
      samples(memory),
      groups(whole),
      sweep(of.planes, whole),
      encoder(whole.colour_managed),
      start_mm(primary_start_mm(scene.near_mm, of.planes.model().rig().viewing.distance.value)),
      beams(whole),
      costs{.subpixels = of.planes.row_subpixels() * size_t{AdaptiveWorker::kBand},
            .has_pbr = whole.pbr != nullptr,
            .is_soft = of.options.soft.any()} {
  for (size_t at = 0; at < backdrop.size(); ++at)
    backdrop[at] = encoder.code(
        static_cast<float>(component(scene.backdrop.colour, static_cast<int>(at % 3))));
  if (scene.backdrop.flat() || scene.backdrop.ground_shadow) eyes = keys.eyes();
  samples.begin(keys);
  const auto parts = [](int whole, int part) {
    return static_cast<size_t>((whole + part - 1) / part);
  };
  bands.resize(parts(of.planes.rows(), AdaptiveWorker::kBand));
  for (auto* blocks : {&taken.coarse, &taken.others})
    blocks->resize(parts(keys.rows(), AdaptiveWorker::kSampleRows));
  taken.bends.resize(static_cast<size_t>(keys.rows()));
}

void AdaptiveFrame::keep(const Kept& what) {
  kept = what;
  samples.watch_changes();
}

AdaptiveWorker::AdaptiveWorker(AdaptiveFrame& frame)
    : frame_(frame),
      colours_(frame.plan.options, frame.plan.tiles),
      sweep_(frame.sweep),
      uncertain_(frame.plan.planes, frame.plan.tiles),
      sampled_(frame.plan.full.packets(), frame.plan.tiles, frame.plan.centre),
      resolver_(frame.samples, frame.grid, frame.plan.tolerances, frame.scene.colour_managed,
                frame.plan.options.soft),
      packet_(1),
      keys_(frame.grid.row_samples()),
      corners_(3 * frame.grid.row_samples()),
      found_row_(frame.plan.planes.row_subpixels()) {
  init_packets(packet_);
  if (frame.scene.backdrop.ground_shadow) ground_.emplace(frame.scene, frame.plan.planes);
  colours_.tracer().integrate_area_lights(true);
  evaluate_exactly(false);
}

void AdaptiveWorker::evaluate_exactly(bool exactly) {
  PacketTracer& tracer = colours_.tracer();
  tracer.multiply_samples(exactly ? kFinerAudit : 1);
  tracer.tolerate(exactly ? 0.0F : frame_.plan.tolerances.noticed(frame_.scene.colour_managed));
}

void AdaptiveWorker::set_sample(int cache_view, size_t lane) {
  const SamplePlace& place = sample_places_[lane];
  if (found_.group[lane] == SurfaceGroups::kNothing)
    return frame_.samples.set_nothing(place.row, cache_view, place.column);
  KeySamples::Sample sample{.group = found_.group[lane],
                            .way = found_.notes.way[lane],
                            .light = {.lit = found_.notes.lit[lane],
                                      .hidden = found_.notes.hidden[lane],
                                      .secondary_way = found_.notes.secondary_way[lane],
                                      .around = found_.notes.around[lane]}};
  if (frame_.plan.options.soft.shadow_samples > 0)
    for (size_t area_light = 0; area_light < sample.light.seen.size(); ++area_light)
      sample.light.seen[area_light] =
          KeySamples::Light::parts_of_area_light(found_.notes.seen[area_light][lane]);
  for (size_t c = 0; c < 3; ++c) {
    sample.value[c] = frame_.encoder.parts(found_.light[c][lane]);
    sample.light.secondary[c] = found_.secondary[c][lane];
  }
  frame_.samples.set(place.row, cache_view, place.column, sample);
}

/// Traces the listed samples; idle lanes repeat the last one.
void AdaptiveWorker::trace_samples(int cache_view) {
  if (listed_ == 0) return;
  std::array<uint32_t, kPacket> seeds{};
  for (size_t lane = 0; lane < kPacket; ++lane) {
    const SamplePlace& place = sample_places_[std::min(lane, listed_ - 1)];
    packet_[0].valid[lane] = lane < listed_ ? -1 : 0;
    if (colours_.tracer().needs_seeds())
      seeds[lane] = sampling::subpixel_seed(place.row, place.column, 1 + cache_view);
    set_panel_ray(frame_.scene, frame_.start_mm,
                  frame_.grid.ray(place.row, cache_view, place.column), packet_[0], lane);
  }
  colours_.tracer().set_seeds(seeds);
  colours_.trace(frame_.scene, frame_.groups,
                 frame_.plan.tolerances.noticed(frame_.scene.colour_managed), packet_[0], found_);
  for (size_t lane = 0; lane < listed_; ++lane) set_sample(cache_view, lane);
  listed_ = 0;
}

void AdaptiveWorker::list_sample(int cache_view, SamplePlace place) {
  if (place.row >= frame_.grid.rows() || place.column >= frame_.grid.columns()) return;
  sample_places_[listed_++] = place;
  if (listed_ == kPacket) trace_samples(cache_view);
}

void AdaptiveWorker::list_if_changed(int cache_view, SamplePlace place, bool was_taken) {
  if (!was_taken || !frame_.kept.at(frame_.grid.panel_row(place.row, cache_view),
                                    frame_.grid.ray(place.row, cache_view, place.column).x_mm))
    list_sample(cache_view, place);
}

void AdaptiveWorker::take_coarse_samples(int first_row, int cache_view) {
  constexpr int kStep = KeySamples::kCoarse;
  const AdaptiveFrame::Taken* before = frame_.kept.taken;
  const bool were_taken =
      before != nullptr && before->coarse[static_cast<size_t>(first_row / kSampleRows)] != 0;
  for (int column = 0; column < frame_.grid.columns(); column += kBlock * kStep)
    for (int n = 0; n < kBlock * kBlock; ++n)
      list_if_changed(cache_view, {first_row + n / kBlock * kStep, column + n % kBlock * kStep},
                      were_taken);
  trace_samples(cache_view);
}

/// Takes the other samples. With sampled light none is interpolated, since more samples average out
/// the noise.
void AdaptiveWorker::take_other_samples(int first_row, int cache_view) {
  constexpr int kStep = KeySamples::kCoarse;
  const bool may_fill = !frame_.plan.options.soft.any();
  const AdaptiveFrame::Taken* before = frame_.kept.taken;
  const bool were_taken =
      before != nullptr && before->others[static_cast<size_t>(first_row / kSampleRows)] != 0;
  const int end = std::min(first_row + kSampleRows, frame_.grid.rows());
  for (int row = first_row; row < end; row += kStep)
    for (int column = 0; column < frame_.grid.columns(); column += kStep) {
      const bool were_traced = were_taken && !frame_.samples.is_filled(row, cache_view, column);
      if (may_fill && frame_.samples.fill(row, cache_view, column, frame_.plan.tolerances))
        continue;
      for (const SamplePlace& place : {SamplePlace{row, column + 1}, SamplePlace{row + 1, column},
                                       SamplePlace{row + 1, column + 1}})
        list_if_changed(cache_view, place, were_traced);
    }
  trace_samples(cache_view);
}

void AdaptiveWorker::render_band(int first_row) {
  band_ = {};
  band_.tried = true;
  uncertain_.clear();
  sampled_.clear();
  const int end = std::min(first_row + kBand, frame_.plan.planes.rows());
  const bool is_unchanged = is_whole_band_unchanged(first_row);
  for (int row = first_row; row < end; ++row)
    is_unchanged ? copy_row(first_row, row) : render_row(first_row, row);
  evaluate_exactly(true);
  const FrameCounts before = colours_.tracer().counts();
  sampled_.trace(frame_.scene, first_row, colours_.tracer());
  const FrameCounts after = colours_.tracer().counts();
  band_.counts.audited = static_cast<uint32_t>(sampled_.subpixels().size());
  band_.counts.rays =
      after.shadow_rays + after.secondary_rays - before.shadow_rays - before.secondary_rays;
  evaluate_exactly(false);
  const bool given_up =
      !is_unchanged && (are_lookups_rejected(first_row) || is_shading_expensive());
  if (given_up) {
    band_.counts.shaded = 0;
  } else {
    uncertain_.shade(frame_.scene, frame_.start_mm, first_row, colours_.tracer());
    write_uncertain(first_row);
  }
  audit_band(first_row, given_up,
             is_unchanged ? (*frame_.kept.bands)[static_cast<size_t>(first_row / kBand)]
                          : AdaptiveFrame::Band{});
}

/// Returns true if the band can be copied: no content that its subpixels see and no sample that
/// they are interpolated from has changed. Retraced bands are not copied, since rendering again
/// would give other bytes.
bool AdaptiveWorker::is_whole_band_unchanged(int first_row) const {
  const int band = first_row / kBand;
  const AdaptiveFrame::Kept& kept = frame_.kept;
  if (kept.parts == nullptr || !kept.parts->whole_band(band)) return false;
  if ((*kept.bands)[static_cast<size_t>(band)].retraced) return false;
  const KeyGrid::Between first = frame_.grid.between(first_row);
  const KeyGrid::Between last =
      frame_.grid.between(std::min(first_row + kBand, frame_.plan.planes.rows()) - 1);
  return !frame_.samples.rows_changed(std::min(first.above[0], first.above[1]),
                                      std::max(last.above[0], last.above[1]) + 1);
}

/// Returns true if a single subpixel can be copied. Subpixels selected by the audit cannot, since
/// the previous frame holds their exact code instead of the interpolated one.
bool AdaptiveWorker::is_unchanged(int row, size_t at, const KeyGrid::Between& between) const {
  if (!frame_.kept.at(row, double{x_mm_[at]})) return false;
  if ((*frame_.kept.bands)[static_cast<size_t>(row / kBand)].retraced) return false;
  const auto n = static_cast<uint32_t>(at);
  const AuditSelection& selection = frame_.plan.selection;
  const SampledPair sampled = selection.pair(static_cast<uint32_t>(row), n / selection.one_in());
  if (n == sampled.retracing || n == sampled.evaluation) return false;
  return resolver_.is_as_before(between, found_row_.places(at));
}

void AdaptiveWorker::render_row(int first_row, int row) {
  const KeyGrid::Between between = frame_.grid.between(row);
  find_cells(between);
  flat_row_ = frame_.scene.backdrop.flat();
  if (ground_) {
    ground_->start(plane_of(row), *frame_.eyes);
    flat_row_ = ground_->range_mm().empty();
  }
  sweep_.sweep(row, swept_, frame_.eyes, ground_ ? ground_->range_mm() : Interval{});
  arrange_rays();
  group_of_cut_.clear();
  for (const SweptCut& cut : swept_.cuts)
    group_of_cut_.push_back(frame_.groups.of(cut.geometry, cut.primitive));
  band_.counts.cuts += static_cast<uint32_t>(swept_.cuts.size());
  group_of_cut_.push_back(SurfaceGroups::kNothing);  // read, but not used, in lanes without a cut
  look_up(between);
  add_sampled(first_row, row, false);
  sort_row(first_row, row, between);
  std::copy_n(found_row_.codes.data(), frame_.plan.planes.row_subpixels(), frame_.out.row(row));
}

void AdaptiveWorker::copy_row(int first_row, int row) {
  const size_t count = frame_.plan.planes.row_subpixels();
  std::copy_n(frame_.kept.frame->row(row), count, frame_.out.row(row));
  counts_.copied_subpixels += count;
  add_sampled(first_row, row, true);
}

/// Finds the cells around a row. The rows of even and of odd views change at different panel rows.
void AdaptiveWorker::find_cells(const KeyGrid::Between& between) {
  for (int cache_view = 0; cache_view < frame_.grid.cache_views(); ++cache_view) {
    const auto odd = static_cast<size_t>(cache_view % 2);
    if (between.above[odd] == keys_row_[odd]) continue;
    const auto first = static_cast<size_t>(cache_view * frame_.grid.stride());
    frame_.samples.find_cells(between.above[odd], cache_view, frame_.plan.tolerances, &keys_[first],
                              &corners_[first]);
  }
  std::copy_n(between.above, 2, keys_row_.begin());
}

/// Arranges the rays by subpixel, if they are ordered by lens.
void AdaptiveWorker::arrange_rays() {
  const PlaneRays& rays = sweep_.rays();
  x_mm_ = rays.x_mm.data();
  tan_x_ = rays.tan_x.data();
  if (rays.subpixel.empty()) return;
  arranged_x_.resize(rays.end + lookup_kernel::kLanes);
  arranged_tan_.resize(rays.end + lookup_kernel::kLanes);
  for (size_t n = 0; n < rays.end; ++n) {
    const auto at = static_cast<size_t>(rays.subpixel[n]);
    arranged_x_[at] = rays.x_mm[n];
    arranged_tan_[at] = rays.tan_x[n];
  }
  x_mm_ = arranged_x_.data();
  tan_x_ = arranged_tan_.data();
}

AdaptiveWorker::FoundRow::FoundRow(size_t subpixels) {
  const size_t room = subpixels + lookup_kernel::kLanes;
  for (auto* bytes : {&codes, &states}) bytes->resize(room);
  for (auto* numbers : {&left, &cell[0], &cell[1]}) numbers->resize(room);
  for (auto* parts : {&of_right, &part[0], &part[1]}) parts->resize(room);
}

lookup_kernel::Found AdaptiveWorker::FoundRow::arrays() {
  return {.codes = codes.data(),
          .states = states.data(),
          .left = left.data(),
          .of_right = of_right.data(),
          .cell = {cell[0].data(), cell[1].data()},
          .part = {part[0].data(), part[1].data()}};
}

std::array<LightResolver::Place, 2> AdaptiveWorker::FoundRow::places(size_t at) const {
  const auto odd = static_cast<size_t>(left[at] & 1);
  return {LightResolver::Place{cell[0][at], part[0][at], 1.0F - of_right[at], odd},
          LightResolver::Place{cell[1][at], part[1][at], of_right[at], 1 - odd}};
}

void AdaptiveWorker::look_up(const KeyGrid::Between& between) {
  const size_t count = frame_.plan.planes.row_subpixels();
  const lookup_kernel::SampleRows interval{.key = keys_.data(),
                                           .corners = corners_.data(),
                                           .plane = static_cast<int>(frame_.samples.row_samples()),
                                           .part = {between.part[0], between.part[1]}};
  const lookup_kernel::Row row{.x = x_mm_,
                               .tan = tan_x_,
                               .z = swept_.z_mm.data(),
                               .cut = swept_.cut.data(),
                               .group = group_of_cut_.data(),
                               .count = static_cast<int>(count),
                               .most_apart = frame_.plan.tolerances.apart};
  frame_.plan.kernel.look_up(frame_.grid.lookup(), interval, row, found_row_.arrays());
}

RowPlane AdaptiveWorker::plane_of(int row) const {
  const RowPlanes& planes = frame_.plan.planes;
  return planes.plane_at(row + planes.height_in_row(0));
}

/// Returns the code of a subpixel that meets nothing. Rays that were not made see no shadow.
uint8_t AdaptiveWorker::backdrop_code(int row, size_t at) const {
  if (flat_row_ || (ground_ && !is_made(at, at + 1))) return frame_.backdrop[at % 3];
  const auto channel = static_cast<int>(at % 3);
  const double x = double{x_mm_[at]}, tan = double{tan_x_[at]};
  if (ground_) return frame_.encoder.code(static_cast<float>(ground_->light(x, tan, channel)));
  const Scene& scene = frame_.scene;
  const RowPlane plane = plane_of(row);
  const Vec3 from = scene.scene_from_panel.point({x, plane.lens_y_mm, 0.0});
  const Vec3 way = scene.scene_from_panel.vector({-tan, -plane.tan_y, -1.0});
  return frame_.encoder.code(static_cast<float>(light_beyond(scene.backdrop, from, way, channel)));
}

/// Returns true if any of the subpixels [begin, end) has a ray.
bool AdaptiveWorker::is_made(size_t begin, size_t end) const {
  const PlaneRays& rays = sweep_.rays();
  return !rays.subpixel.empty() || (end > rays.first && begin < rays.end);
}

void AdaptiveWorker::add_sampled(int first_row, int row, bool copied) {
  const auto count = static_cast<uint32_t>(frame_.plan.planes.row_subpixels());
  const auto add = [&](uint32_t at, Draw draw) {
    if (at < count)
      sampled_.add({.at = static_cast<int32_t>(at),
                    .row = static_cast<uint16_t>(row - first_row),
                    .draw = draw,
                    .is_shaded = !copied && found_row_.states[at] == lookup_kernel::kUnknown});
  };
  const AuditSelection& selection = frame_.plan.selection;
  for (uint32_t stretch = 0; stretch * selection.one_in() < count; ++stretch) {
    const SampledPair sampled = selection.pair(static_cast<uint32_t>(row), stretch);
    add(sampled.retracing, Draw::Retracing);
    add(sampled.evaluation, Draw::Evaluation);
  }
}

void AdaptiveWorker::add_uncertain(int first_row, int row, size_t at,
                                   const KeyGrid::Between& between) {
  const auto cut_number = static_cast<size_t>(swept_.cut[at]);
  const SweptCut& cut = swept_.cuts[cut_number];
  const uint32_t group = group_of_cut_[cut_number];
  UncertainSubpixels::Subpixel& added = uncertain_.add();
  added.at = static_cast<int32_t>(at);
  added.row = static_cast<uint16_t>(row - first_row);
  added.x_mm = x_mm_[at];
  added.tan_x = tan_x_[at];
  added.z_mm = swept_.z_mm[at];
  added.geometry = cut.geometry;
  added.primitive = cut.primitive;
  added.group = group;
  resolver_.resolve({.rows = between,
                     .places = found_row_.places(at),
                     .group = group,
                     .channel = static_cast<int>(at % 3)},
                    added.resolved, uncertain_.area_lights());
}

/// Writes the colours of subpixels that see nothing, and lists the unresolved ones.
void AdaptiveWorker::sort_row(int first_row, int row, const KeyGrid::Between& between) {
  static_assert(lookup_kernel::kFound == 0 && lookup_kernel::kNothing == 1);
  constexpr uint64_t kAllNothing = 0x0101010101010101;
  const bool may_keep = frame_.kept.parts != nullptr;
  const size_t count = frame_.plan.planes.row_subpixels();
  uint64_t unknown = 0, copied = 0, nothing = 0;
  for (size_t first = 0; first < count; first += sizeof(uint64_t)) {
    uint64_t eight;  // states; the array is slightly longer than the row
    std::memcpy(&eight, found_row_.states.data() + first, sizeof eight);
    if (eight == 0) continue;
    const bool is_flat = flat_row_ || (ground_ && !is_made(first, first + sizeof eight));
    if (is_flat && eight == kAllNothing) {
      std::memcpy(found_row_.codes.data() + first,
                  frame_.backdrop.data() + first % frame_.backdrop.size(), sizeof eight);
      nothing += std::min(sizeof eight, count - first);
      continue;
    }
    const size_t end = std::min(first + sizeof eight, count);
    for (size_t at = first; at < end; ++at) {
      if (found_row_.states[at] == lookup_kernel::kNothing) {
        found_row_.codes[at] = backdrop_code(row, at);
        ++nothing;
      }
      if (found_row_.states[at] != lookup_kernel::kUnknown) continue;
      if (may_keep && is_unchanged(row, at, between)) {
        found_row_.codes[at] = frame_.kept.frame->row(row)[at];
        ++copied;
        continue;
      }
      add_uncertain(first_row, row, at, between);
      ++unknown;
    }
  }
  counts_.traced_subpixels += unknown;
  counts_.copied_subpixels += copied;
  counts_.interpolated_subpixels += count - unknown - copied;
  band_.counts.seen += static_cast<uint32_t>(count - nothing);
  band_.counts.shaded += static_cast<uint32_t>(unknown + copied);
}

bool AdaptiveWorker::is_rejected(const AuditErrors& retracing, uint64_t noise) const {
  AuditCounts counts = retracing.counts(frame_.plan.options.tolerated_error);
  counts.beyond -= std::min(counts.beyond, noise);
  if (needs_retracing(counts, kMostBeyond)) return true;
  // With soft light, method full itself is off by its noise.
  return !frame_.plan.options.soft.any() &&
         retracing.mean_square() - 2.0 * retracing.standard_error() >
             kMostOfBand * frame_.plan.most_mean_square;
}

bool AdaptiveWorker::is_shading_expensive() const {
  const BandCosts costs = frame_.costs.costs(band_.counts);
  return costs.shading > costs.full;
}

bool AdaptiveWorker::are_lookups_rejected(int first_row) const {
  if (frame_.plan.options.soft.any()) return false;  // noise is subtracted from the audit
  AuditErrors retracing;
  for (const SampledSubpixels::Subpixel& s : sampled_.subpixels()) {
    if (s.draw != Draw::Retracing) continue;
    const uint8_t exact = frame_.encoder.code(s.light);
    retracing.add(s.is_shaded ? exact : frame_.out.row(first_row + s.row)[s.at], exact);
  }
  return is_rejected(retracing);
}

void AdaptiveWorker::write_uncertain(int first_row) {
  for (const UncertainSubpixels::Subpixel& s : uncertain_.subpixels())
    frame_.out.row(first_row + s.row)[s.at] = frame_.encoder.code(s.light);
}

/// Audits a band whose sampled subpixels are traced. `known` holds the results of a copied band, in
/// which all audited subpixels are already exact.
void AdaptiveWorker::audit_band(int first_row, bool given_up, const AdaptiveFrame::Band& known) {
  AuditErrors retracing, evaluation;
  for (const SampledSubpixels::Subpixel& s : sampled_.subpixels()) {
    uint8_t& code = frame_.out.row(first_row + s.row)[s.at];
    const uint8_t exact = frame_.encoder.code(s.light);
    (s.draw == Draw::Retracing ? retracing : evaluation).add(code, exact);
    code = exact;
  }
  if (known.tried) {
    band_ = known;
  } else {
    band_.retracing = retracing;
    band_.evaluation = evaluation;
  }
  band_.retraced = given_up || is_rejected(band_.retracing);
  if (band_.retraced && !given_up && frame_.plan.options.soft.any())
    band_.retraced = is_rejected(band_.retracing, count_noise(first_row));
  frame_.bands[static_cast<size_t>(first_row / kBand)] = band_;
}

bool AdaptiveWorker::is_beyond(uint8_t code, uint8_t exact) const {
  return std::abs(int{code} - int{exact}) > frame_.plan.options.tolerated_error;
}

/// Returns the number of samples of Draw::Retracing whose code under method full exceeds the
/// tolerated error due to sampling noise alone. The audited subpixels are exact in the frame.
uint64_t AdaptiveWorker::count_noise(int first_row) {
  colours_.tracer().tolerate(0.0F);
  colours_.tracer().integrate_area_lights(false);
  sampled_.trace(frame_.scene, first_row, colours_.tracer());
  colours_.tracer().integrate_area_lights(true);
  evaluate_exactly(false);
  uint64_t beyond = 0;
  for (const SampledSubpixels::Subpixel& s : sampled_.subpixels())
    if (s.draw == Draw::Retracing &&
        is_beyond(frame_.encoder.code(s.light), frame_.out.row(first_row + s.row)[s.at]))
      ++beyond;
  return beyond;
}

/// Notes that a band that was not tried has no errors: it is left to method full.
void AdaptiveWorker::audit_untried_band(int first_row) {
  sampled_.clear();
  const int end = std::min(first_row + kBand, frame_.plan.planes.rows());
  for (int row = first_row; row < end; ++row) add_sampled(first_row, row, true);
  frame_.bands[static_cast<size_t>(first_row / kBand)].evaluation.add_exact(
      static_cast<uint64_t>(std::ranges::count(sampled_.subpixels(), Draw::Evaluation,
                                               &SampledSubpixels::Subpixel::draw)));
}

/// Renders a band as method full does.
void AdaptiveWorker::retrace_band(int first_row) {
  if (!full_)
    full_ = std::make_unique<FullTiles::Worker>(frame_.plan.full, frame_.scene, frame_.beams);
  const TilePlan& plan = frame_.plan.tiles;
  const int first_tile = first_row / kBand * plan.per_band();
  for (int n = 0; n < plan.per_band(); ++n) full_->render(plan.tile(first_tile + n), frame_.out);
  const int end = std::min(first_row + kBand, frame_.plan.planes.rows());
  const size_t subpixels =
      static_cast<size_t>(end - first_row) * frame_.plan.planes.row_subpixels();
  counts_.retraced_subpixels += subpixels;
  AdaptiveFrame::Band& band = frame_.bands[static_cast<size_t>(first_row / kBand)];
  band.retraced = true;
  if (!band.tried) counts_.traced_subpixels += subpixels;
}

FrameCounts AdaptiveWorker::counts() {
  FrameCounts counts = counts_;
  counts += colours_.tracer().counts();
  if (full_) counts += full_->counts();
  return counts;
}

}  // namespace lenticule::render
