// SPDX-License-Identifier: Apache-2.0
// JpegMaker encodes JPEG files of every kind.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <vector>

// Follows <cstdio>, which it needs.
#include <jpeglib.h>

namespace lenticule::test {

struct JpegKind {
  J_COLOR_SPACE pixels = JCS_RGB;  ///< colours of the samples; all but RGB are stored unchanged
  J_COLOR_SPACE stored = JCS_YCbCr;
  int across = 1, down = 1;  ///< subsampling of the colours
  bool progressive = false;
  bool arithmetic = false;
  unsigned restart_rows = 0;
  int x_density = 1, y_density = 1;
  std::vector<uint8_t> exif;  ///< a TIFF block
};

/// Returns a picture of waves with noise.
inline std::vector<uint8_t> jpeg_of(int width, int height, const JpegKind& kind = {}) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* out = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): the library's type
  jpeg_mem_dest(&jpeg, &out, &size);
  jpeg.image_width = static_cast<JDIMENSION>(width);
  jpeg.image_height = static_cast<JDIMENSION>(height);
  jpeg.in_color_space = kind.pixels;
  jpeg.input_components = kind.pixels == JCS_GRAYSCALE ? 1 : kind.pixels == JCS_CMYK ? 4 : 3;
  jpeg_set_defaults(&jpeg);
  jpeg_set_colorspace(&jpeg, kind.stored);
  jpeg_set_quality(&jpeg, 85, TRUE);
  jpeg.comp_info[0].h_samp_factor = kind.across;
  jpeg.comp_info[0].v_samp_factor = kind.down;
  if (kind.progressive) jpeg_simple_progression(&jpeg);
  jpeg.arith_code = kind.arithmetic ? TRUE : FALSE;
  jpeg.restart_in_rows = static_cast<int>(kind.restart_rows);
  if (jpeg.write_JFIF_header) {
    jpeg.X_density = static_cast<UINT16>(kind.x_density);
    jpeg.Y_density = static_cast<UINT16>(kind.y_density);
  }
  jpeg_start_compress(&jpeg, TRUE);
  if (!kind.exif.empty()) {
    std::vector<uint8_t> marker = {'E', 'x', 'i', 'f', 0, 0};
    marker.insert(marker.end(), kind.exif.begin(), kind.exif.end());
    jpeg_write_marker(&jpeg, JPEG_APP0 + 1, marker.data(), static_cast<unsigned>(marker.size()));
  }
  std::vector<uint8_t> row(static_cast<size_t>(width) * static_cast<size_t>(jpeg.input_components));
  uint32_t noise = 1;
  for (int y = 0; y < height; ++y) {
    for (size_t n = 0; n < row.size(); ++n) {
      noise = noise * 1664525 + 1013904223;
      row[n] = static_cast<uint8_t>((n * 3 + static_cast<size_t>(y) * 5 + (noise >> 27)) & 255U);
    }
    JSAMPROW line = row.data();
    jpeg_write_scanlines(&jpeg, &line, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::vector<uint8_t> bytes(out, out + size);
  std::free(out);
  return bytes;
}

/// Returns a TIFF block, as EXIF has it, with an orientation and densities across and down in
/// hundredths.
inline std::vector<uint8_t> exif_of(uint8_t orientation, uint16_t across = 0, uint16_t down = 0,
                                    bool big_endian = false) {
  std::vector<uint8_t> block;
  const auto put = [&](uint32_t value, int bytes) {
    for (int k = 0; k < bytes; ++k)
      block.push_back(static_cast<uint8_t>(value >> (8 * (big_endian ? bytes - 1 - k : k))));
  };
  block.assign(2, big_endian ? 'M' : 'I');
  put(42, 2);
  put(8, 4);
  const uint32_t after = 8 + 2 + 3 * 12 + 4;
  put(3, 2);
  put(0x0112, 2), put(3, 2), put(1, 4), put(orientation, 2), put(0, 2);
  put(0x011A, 2), put(5, 2), put(1, 4), put(after, 4);
  put(0x011B, 2), put(5, 2), put(1, 4), put(after + 8, 4);
  put(0, 4);
  for (const uint16_t density : {across, down}) put(density, 4), put(100, 4);
  return block;
}

}  // namespace lenticule::test
