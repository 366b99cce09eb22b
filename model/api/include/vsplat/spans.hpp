// The caller's memory for C++: the library reads from it and writes to it in place, without a copy. Part of vsplat.hpp,
// which includes this file.
#ifndef VSPLAT_SPANS_HPP
#define VSPLAT_SPANS_HPP

#include <vsplat/vsplat.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vsplat/handle.hpp>

namespace vsplat {
inline namespace cxx {

// Contiguous elements of any container: a std::vector, a std::array, a std::span. Owns nothing.
template <class T>
class Span {
 public:
  constexpr Span() = default;
  constexpr Span(T* data, std::size_t size) : data_(data), size_(size) {}
  template <std::size_t N>
  constexpr Span(T (&array)[N]) : data_(array), size_(N) {}
  // Accepts containers of T itself, const or not. Elements of a class derived from T are further apart, so those are
  // excluded.
  template <class Container, class Element = std::remove_pointer_t<decltype(std::declval<Container&>().data())>,
            class = std::enable_if_t<std::is_convertible_v<Element (*)[], T (*)[]> &&
                                     !std::is_same_v<std::decay_t<Container>, Span>>>
  constexpr Span(Container&& container) : data_(container.data()), size_(container.size()) {}

  constexpr T* data() const { return data_; }
  constexpr std::size_t size() const { return size_; }
  constexpr bool empty() const { return size_ == 0; }
  constexpr T* begin() const { return data_; }
  constexpr T* end() const { return data_ + size_; }
  constexpr T& operator[](std::size_t at) const { return data_[at]; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

namespace detail {

// A pointer to memory that is only read, for a struct used both ways; NULL if the span is empty. Throws Error if it has
// fewer than `expected` elements.
template <class T>
std::remove_const_t<T>* pointer(Span<T> span, std::size_t expected, const char* name) {
  if (span.empty() && expected > 0) return nullptr;
  if (span.size() < expected)
    throw Error(VSPLAT_ERROR_USAGE, (std::string(name) + " has room for " + std::to_string(span.size()) + " values; " +
                                     std::to_string(expected) + " are expected")
                                        .c_str());
  return const_cast<std::remove_const_t<T>*>(span.data());
}

inline std::size_t values_of_sh(int degree) {
  return 3 * static_cast<std::size_t>(degree + 1) * static_cast<std::size_t>(degree + 1);
}

}  // namespace detail

// Gaussians in the caller's memory: float to write, const float to read. [K][3], [K][3], [K][4], [K], [K][S][3]. An
// empty span is not wanted, or leaves the values unchanged.
template <class T>
struct BasicGaussianSpans {
  Span<T> means, scales, rotations, opacities, sh;

  // For `count` Gaussians. Throws Error if a span holds fewer.
  vsplat_gaussians arrays(std::size_t count, int sh_degree) const {
    vsplat_gaussians out = VSPLAT_GAUSSIANS_INIT;
    out.capacity = count;
    out.means = detail::pointer(means, 3 * count, "means");
    out.scales = detail::pointer(scales, 3 * count, "scales");
    out.rotations = detail::pointer(rotations, 4 * count, "rotations");
    out.opacities = detail::pointer(opacities, count, "opacities");
    out.sh = detail::pointer(sh, detail::values_of_sh(sh_degree) * count, "sh");
    return out;
  }
};
using GaussianSpans = BasicGaussianSpans<float>;
using ConstGaussianSpans = BasicGaussianSpans<const float>;

// A picture's values in the caller's memory: [height][width][3], [height][width], [height][width], then the surface
// maps as in vsplat_picture. An empty span is not wanted.
template <class T>
struct BasicPictureSpans {
  Span<T> colour = {}, alpha = {}, depth = {};
  Span<T> expected = {}, median = {}, normal = {};
  Span<std::conditional_t<std::is_const_v<T>, const int32_t, int32_t>> ids = {};

  vsplat_picture arrays(int width, int height) const {
    const std::size_t pixels =
        width > 0 && height > 0 ? static_cast<std::size_t>(width) * static_cast<std::size_t>(height) : 0;
    vsplat_picture out = VSPLAT_PICTURE_INIT;
    out.capacity = pixels;
    out.colour = detail::pointer(colour, 3 * pixels, "colour");
    out.alpha = detail::pointer(alpha, pixels, "alpha");
    out.depth = detail::pointer(depth, pixels, "depth");
    out.expected = detail::pointer(expected, pixels, "expected");
    out.median = detail::pointer(median, pixels, "median");
    out.normal = detail::pointer(normal, 3 * pixels, "normal");
    out.ids = detail::pointer(ids, pixels, "ids");
    return out;
  }
};
using PictureSpans = BasicPictureSpans<float>;
using ConstPictureSpans = BasicPictureSpans<const float>;

}  // namespace cxx
}  // namespace vsplat

#endif
