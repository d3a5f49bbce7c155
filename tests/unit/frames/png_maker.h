// SPDX-License-Identifier: Apache-2.0
// Makes PNG files of every colour type byte by byte, with stored (uncompressed) data, so that the
// reader is not tested with its own writer's files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace lenticule::test {

enum class PngColour : uint8_t { Grey = 0, Rgb = 2, Palette = 3, GreyAlpha = 4, Rgba = 6 };

class PngMaker {
 public:
  PngMaker(uint32_t width, uint32_t height, int bit_depth, PngColour colour,
           bool interlaced = false) {
    const std::string signature = "\x89PNG\r\n\x1a\n";
    file_.assign(signature.begin(), signature.end());
    std::vector<uint8_t> header;
    put_32(header, width);
    put_32(header, height);
    header.insert(header.end(), {static_cast<uint8_t>(bit_depth), static_cast<uint8_t>(colour), 0,
                                 0, static_cast<uint8_t>(interlaced)});
    chunk("IHDR", header);
  }

  PngMaker& chunk(const std::string& type, const std::vector<uint8_t>& data) {
    put_32(file_, static_cast<uint32_t>(data.size()));
    const size_t begin = file_.size();
    file_.insert(file_.end(), type.begin(), type.end());
    file_.insert(file_.end(), data.begin(), data.end());
    put_32(file_, crc(begin));
    return *this;
  }

  /// Appends rows in the file's form: each starts with its filter byte.
  PngMaker& rows(const std::vector<uint8_t>& filtered_rows) {
    std::vector<uint8_t> zlib = {0x78, 0x01, 0x01};
    const auto n = static_cast<uint16_t>(filtered_rows.size());
    const auto inverse = static_cast<uint16_t>(~n);
    for (const uint16_t length : {n, inverse})
      zlib.insert(zlib.end(),
                  {static_cast<uint8_t>(length & 0xFF), static_cast<uint8_t>(length >> 8)});
    zlib.insert(zlib.end(), filtered_rows.begin(), filtered_rows.end());
    uint32_t a = 1, b = 0;  // Adler-32
    for (const uint8_t byte : filtered_rows) {
      a = (a + byte) % 65521;
      b = (b + a) % 65521;
    }
    put_32(zlib, b << 16 | a);
    return chunk("IDAT", zlib);
  }

  [[nodiscard]] std::vector<uint8_t> finish() {
    chunk("IEND", {});
    return file_;
  }

 private:
  static void put_32(std::vector<uint8_t>& out, uint32_t v) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<uint8_t>(v >> shift));
  }

  [[nodiscard]] uint32_t crc(size_t begin) const {
    uint32_t c = 0xFFFFFFFF;
    for (size_t i = begin; i < file_.size(); ++i) {
      c ^= file_[i];
      for (int k = 0; k < 8; ++k) c = (c & 1) ? 0xEDB88320 ^ (c >> 1) : c >> 1;
    }
    return ~c;
  }

  std::vector<uint8_t> file_;
};

}  // namespace lenticule::test
