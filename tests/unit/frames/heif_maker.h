// SPDX-License-Identifier: Apache-2.0
// Makes HEIF and AVIF files in memory, also with the pictures of two eyes.
#pragma once

#include <gtest/gtest.h>
#include <libheif/heif.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "frames/frame.h"

namespace lenticule::test {

inline void require(const heif_error& error) {
  if (error.code != heif_error_Ok) throw std::runtime_error(error.message);
}

/// Returns a file of pictures, the first of which is the main one; with transparent pixels if
/// `alpha` is below 255.
inline std::vector<uint8_t> heif_of(const std::vector<frames::WovenFrame>& pictures,
                                    heif_compression_format format = heif_compression_HEVC,
                                    uint8_t alpha = 255) {
  heif_context* const context = heif_context_alloc();
  heif_encoder* encoder = nullptr;
  require(heif_context_get_encoder_for_format(context, format, &encoder));
  require(heif_encoder_set_lossy_quality(encoder, 95));
  for (const frames::WovenFrame& picture : pictures) {
    heif_image* image = nullptr;
    require(heif_image_create(picture.width(), picture.height(), heif_colorspace_RGB,
                              heif_chroma_interleaved_RGBA, &image));
    require(heif_image_add_plane(image, heif_channel_interleaved, picture.width(), picture.height(),
                                 32));
    int stride = 0;
    uint8_t* const plane = heif_image_get_plane(image, heif_channel_interleaved, &stride);
    for (int y = 0; y < picture.height(); ++y)
      for (int x = 0; x < picture.width(); ++x) {
        uint8_t* const rgba = plane + y * stride + 4 * x;
        std::copy_n(picture.row(y) + 3 * x, 3, rgba);
        rgba[3] = alpha;
      }
    heif_encoding_options* const options = heif_encoding_options_alloc();
    options->save_alpha_channel = alpha < 255 ? 1 : 0;
    heif_image_handle* handle = nullptr;
    require(heif_context_encode_image(context, image, encoder, options, &handle));
    heif_image_handle_release(handle);
    heif_encoding_options_free(options);
    heif_image_release(image);
  }
  std::vector<uint8_t> file;
  heif_writer writer{.writer_api_version = 1,
                     .write = [](heif_context*, const void* data, size_t size, void* to) {
                       const auto* const bytes = static_cast<const uint8_t*>(data);
                       static_cast<std::vector<uint8_t>*>(to)->assign(bytes, bytes + size);
                       return heif_error{heif_error_Ok, heif_suberror_Unspecified, ""};
                     }};
  require(heif_context_write(context, &writer, &file));
  heif_encoder_release(encoder);
  heif_context_free(context);
  return file;
}

/// Returns the items of the pictures in the order in which they were encoded.
inline std::vector<heif_item_id> items_of(const std::vector<uint8_t>& file) {
  heif_context* const context = heif_context_alloc();
  require(heif_context_read_from_memory_without_copy(context, file.data(), file.size(), nullptr));
  std::vector<heif_item_id> items(
      static_cast<size_t>(heif_context_get_number_of_top_level_images(context)));
  (void)heif_context_get_list_of_top_level_image_IDs(context, items.data(),
                                                     static_cast<int>(items.size()));
  heif_context_free(context);
  std::ranges::sort(items);
  return items;
}

/// HeifBoxes finds and changes numbers in a file.
class HeifBoxes {
 public:
  explicit HeifBoxes(std::vector<uint8_t>& file) : file_(file) {}

  /// Returns where the box begins: its size, and its type.
  [[nodiscard]] size_t find(std::string_view type) const {
    const auto at = std::search(file_.begin(), file_.end(), type.begin(), type.end());
    if (at == file_.end()) throw std::runtime_error("no such box");
    return static_cast<size_t>(at - file_.begin()) - 4;
  }
  [[nodiscard]] uint32_t number(size_t at, size_t bytes) const {
    uint32_t value = 0;
    for (size_t i = 0; i < bytes; ++i) value = value << 8 | file_.at(at + i);
    return value;
  }
  void add(size_t at, uint32_t more) {
    const uint32_t value = number(at, 4) + more;
    for (size_t i = 0; i < 4; ++i) file_.at(at + i) = static_cast<uint8_t>(value >> (24 - 8 * i));
  }

 private:
  std::vector<uint8_t>& file_;
};

/// Returns a file whose items of these numbers are the left and the right eye's picture: a group of
/// the kind `ster` at the end of the box `meta`, behind which all coded pictures move.
inline std::vector<uint8_t> with_eyes(std::vector<uint8_t> file, heif_item_id left_item,
                                      heif_item_id right_item) {
  const auto left = static_cast<uint8_t>(left_item), right = static_cast<uint8_t>(right_item);
  const std::vector<uint8_t> group = {0,   0,   0,   36,  'g', 'r', 'p', 'l',  0, 0, 0, 28,  //
                                      's', 't', 'e', 'r', 0,   0,   0,   0,    0, 0, 0, 99,  //
                                      0,   0,   0,   2,   0,   0,   0,   left, 0, 0, 0, right};
  const auto more = static_cast<uint32_t>(group.size());
  HeifBoxes boxes(file);
  const size_t meta = boxes.find("meta"), places = boxes.find("iloc");
  const size_t end = meta + boxes.number(meta, 4);
  // Version and flags, sizes of the numbers, and for each item its number, [method,] file, base,
  // and the places of its pieces (ISO/IEC 14496-12, 8.11.3).
  const uint32_t version = boxes.number(places + 8, 1), sizes = boxes.number(places + 12, 2);
  const size_t base_bytes = sizes >> 4 & 15;
  if (version > 1 || sizes >> 8 != 0x44) throw std::runtime_error("other sizes in iloc");
  size_t at = places + 16;
  for (uint32_t item = 0, items = boxes.number(places + 14, 2); item < items; ++item) {
    const bool in_file = version == 0 || boxes.number(at + 2, 2) == 0;
    at += version == 0 ? 4 : 6;
    if (in_file && base_bytes == 4) boxes.add(at, more);
    at += base_bytes;
    const uint32_t pieces = boxes.number(at, 2);
    at += 2;
    for (uint32_t piece = 0; piece < pieces; ++piece, at += 8)
      if (in_file && base_bytes == 0) boxes.add(at, more);
  }
  boxes.add(meta, more);
  file.insert(file.begin() + static_cast<std::ptrdiff_t>(end), group.begin(), group.end());
  return file;
}

/// Returns a picture of grey squares of 16 pixels, from `dark` on by steps of 8.
inline frames::WovenFrame grey_squares(int width, int height, int dark) {
  frames::WovenFrame picture({.width = width, .height = height});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      std::fill_n(picture.row(y) + 3 * x, 3,
                  static_cast<uint8_t>(dark + 8 * (x / 16) + 24 * (y / 16)));
  return picture;
}

/// Expects the picture to begin at column `from` of a larger one, as far as coding kept it.
inline void expect_similar(const frames::WovenFrame& shown, int from,
                           const frames::WovenFrame& picture) {
  ASSERT_EQ(shown.height(), picture.height());
  int most = 0;
  for (int y = 0; y < picture.height(); ++y)
    for (int i = 0; i < 3 * picture.width(); ++i)
      most = std::max(most, std::abs(shown.row(y)[3 * from + i] - picture.row(y)[i]));
  EXPECT_LE(most, 6);
}

}  // namespace lenticule::test
