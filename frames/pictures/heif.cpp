// SPDX-License-Identifier: Apache-2.0
#include "frames/pictures/heif.h"

#include <libheif/heif.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "base/owned.h"

namespace lenticule::frames::pictures {
namespace {

using Bytes = std::span<const uint8_t>;

/// Returns the number of `bytes` bytes at the start; the caller checks that there are as many.
uint64_t big_endian(Bytes in, size_t bytes) {
  uint64_t value = 0;
  for (const uint8_t byte : in.first(bytes)) value = value << 8 | byte;
  return value;
}

/// Returns the content of the first box of that type; empty if there is none.
Bytes box_in(Bytes in, std::string_view type) {
  constexpr size_t kHead = 8, kLongHead = 16;
  while (in.size() >= kHead) {
    uint64_t size = big_endian(in, 4);
    const bool is_long = size == 1;  // the size follows in 8 bytes
    if (is_long && in.size() < kLongHead) return {};
    if (is_long) size = big_endian(in.subspan(kHead), 8);
    if (size == 0) size = in.size();  // up to the end
    const size_t head = is_long ? kLongHead : kHead;
    if (size < head || size > in.size()) return {};
    if (std::ranges::equal(in.subspan(4, 4), type)) return in.subspan(head, size - head);
    in = in.subspan(size);
  }
  return {};
}

using Context = Owned<heif_context, heif_context_free>;
using Handle = Owned<heif_image_handle, heif_image_handle_release>;
using Options = Owned<heif_decoding_options, heif_decoding_options_free>;
using Image = Owned<heif_image, heif_image_release>;

class HeifReader final : public OIIO::ImageInput {
 public:
  explicit HeifReader(Bytes file) : file_(file) {}

  [[nodiscard]] const char* format_name() const override { return "heif"; }
  [[nodiscard]] int current_subimage() const override { return picture_; }

  bool open(const std::string& /*name*/, OIIO::ImageSpec& spec) override {
    context_.reset(heif_context_alloc());
    heif_context_set_max_decoding_threads(context_.get(), 0);  // in this thread
    items_.resize(1);
    if (failed(heif_context_read_from_memory_without_copy(context_.get(), file_.data(),
                                                          file_.size(), nullptr)) ||
        failed(heif_context_get_primary_image_ID(context_.get(), items_.data())))
      return false;
    if (const auto eyes = eyes_in_heif(file_))
      items_.insert(items_.end(), eyes->begin(), eyes->end());
    if (!seek_subimage(kHeifPrimary, 0)) return false;
    spec = m_spec;
    return true;
  }

  bool seek_subimage(int picture, int level) override {
    if (level != 0 || picture < 0 || picture >= std::ssize(items_)) return false;
    if (handle_ && picture == picture_) return true;
    heif_image_handle* handle = nullptr;
    if (failed(heif_context_get_image_handle(context_.get(), items_[static_cast<size_t>(picture)],
                                             &handle)))
      return false;
    handle_.reset(handle);
    image_.reset();
    picture_ = picture;
    const bool alpha = heif_image_handle_has_alpha_channel(handle) != 0;
    m_spec =
        OIIO::ImageSpec(heif_image_handle_get_width(handle), heif_image_handle_get_height(handle),
                        alpha ? 4 : 3, OIIO::TypeDesc::UINT8);
    return true;
  }

  bool read_native_scanline(int picture, int level, int y, int /*z*/, void* data) override {
    if (!seek_subimage(picture, level) || (!image_ && !decode())) return false;
    const size_t row = m_spec.scanline_bytes();
    std::copy_n(pixels_ + static_cast<size_t>(y) * stride_, row, static_cast<uint8_t*>(data));
    return true;
  }

  bool close() override { return true; }

 private:
  bool failed(const heif_error& error) {
    if (error.code != heif_error_Ok) errorfmt("{}", error.message);
    return error.code != heif_error_Ok;
  }

  bool decode() {
    const Options options(heif_decoding_options_alloc());
    options->convert_hdr_to_8bit = 1;
    heif_image* image = nullptr;
    const bool alpha = m_spec.nchannels == 4;
    if (failed(heif_decode_image(handle_.get(), &image, heif_colorspace_RGB,
                                 alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB,
                                 options.get())))
      return false;
    image_.reset(image);
    int stride = 0;
    pixels_ = heif_image_get_plane_readonly(image, heif_channel_interleaved, &stride);
    stride_ = static_cast<size_t>(stride);
    const bool as_stated = pixels_ != nullptr &&
                           heif_image_get_width(image, heif_channel_interleaved) == m_spec.width &&
                           heif_image_get_height(image, heif_channel_interleaved) == m_spec.height;
    if (as_stated) return true;
    errorfmt("its pixels are not as many as its header states");
    image_.reset();
    return false;
  }

  Bytes file_;
  Context context_;
  std::vector<heif_item_id> items_;  ///< items of the pictures, by HeifPicture
  int picture_ = -1;
  Handle handle_;
  Image image_;  ///< decoded pixels of the picture, if any
  const uint8_t* pixels_ = nullptr;
  size_t stride_ = 0;
};

}  // namespace

void prepare_heif() { (void)heif_init(nullptr); }

std::optional<std::array<uint32_t, 2>> eyes_in_heif(Bytes file) {
  // The box `meta` begins with a version. In `ster` come, in 4 bytes each, a version, the group's
  // number, the number of pictures, and the pictures' numbers.
  constexpr size_t kVersion = 4, kCount = 8, kLeft = 12, kRight = 16, kEnd = 20;
  const Bytes meta = box_in(file, "meta");
  if (meta.size() < kVersion) return std::nullopt;
  const Bytes group = box_in(box_in(meta.subspan(kVersion), "grpl"), "ster");
  if (group.size() < kEnd || big_endian(group.subspan(kCount), 4) != 2) return std::nullopt;
  const auto item = [&](size_t at) {
    return static_cast<uint32_t>(big_endian(group.subspan(at), 4));
  };
  return std::array{item(kLeft), item(kRight)};
}

std::unique_ptr<OIIO::ImageInput> heif_reader(Bytes file) {
  return std::make_unique<HeifReader>(file);
}

}  // namespace lenticule::frames::pictures
