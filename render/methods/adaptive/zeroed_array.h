// SPDX-License-Identifier: Apache-2.0
// ZeroedArray is an array of zeros that takes memory only where it is used.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace lenticule::render {

/// ZeroedArray holds elements whose bytes are zero at first. Large arrays are pages of the kernel
/// that cost nothing until an element is accessed.
template <class Element>
class ZeroedArray {
  static_assert(std::is_trivially_copyable_v<Element>);

 public:
  ZeroedArray() = default;
  /// Throws std::bad_alloc.
  explicit ZeroedArray(size_t size)
      : elements_(static_cast<Element*>(std::calloc(std::max<size_t>(size, 1), sizeof(Element)))),
        size_(size) {
    if (!elements_) throw std::bad_alloc();
  }

  [[nodiscard]] size_t size() const { return size_; }
  [[nodiscard]] Element* data() { return elements_.get(); }
  [[nodiscard]] const Element* data() const { return elements_.get(); }
  [[nodiscard]] Element* begin() { return data(); }
  [[nodiscard]] const Element* begin() const { return data(); }
  [[nodiscard]] Element* end() { return data() + size_; }
  [[nodiscard]] const Element* end() const { return data() + size_; }
  [[nodiscard]] Element& operator[](size_t n) { return elements_.get()[n]; }
  [[nodiscard]] const Element& operator[](size_t n) const { return elements_.get()[n]; }

 private:
  struct Free {
    void operator()(Element* elements) const { std::free(elements); }
  };
  std::unique_ptr<Element, Free> elements_;
  size_t size_ = 0;
};

}  // namespace lenticule::render
