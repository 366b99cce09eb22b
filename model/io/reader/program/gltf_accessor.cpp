#include "model/io/reader/program/gltf_accessor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "runtime/printable.h"

namespace vsplat::read {
namespace {

// A component type: its size in bytes, and the divisor of normalised values.
struct Component {
  std::uint64_t code;
  std::size_t bytes;
  float most;
};

constexpr Component components[] = {{5120, 1, 127},   {5121, 1, 255}, {5122, 2, 32767},
                                    {5123, 2, 65535}, {5125, 4, 1},   {5126, 4, 1}};

Component component_of(const Field& code) {
  const std::uint64_t found = code.whole();
  for (const Component& known : components)
    if (known.code == found) return known;
  code.wrong(fmt::format("is {}; 5120, 5121, 5122, 5123, 5125 or 5126 is expected", found));
}

template <class T>
T value_at(const unsigned char* at) {
  T out;
  std::memcpy(&out, at, sizeof out);
  return out;
}

double value_of(const Component& component, const unsigned char* at) {
  switch (component.code) {
    case 5120:
      return value_at<std::int8_t>(at);
    case 5121:
      return value_at<std::uint8_t>(at);
    case 5122:
      return value_at<std::int16_t>(at);
    case 5123:
      return value_at<std::uint16_t>(at);
    case 5125:
      return value_at<std::uint32_t>(at);
    default:
      return static_cast<double>(value_at<float>(at));
  }
}

// Rows of components in a buffer view.
struct Rows {
  Bytes bytes;
  std::size_t stride = 0;
  Component component{};

  double value(std::size_t row, std::size_t column) const {
    return value_of(component, bytes.data() + row * stride + column * component.bytes);
  }
};

// `count` rows of `width` components, at the bufferView and byteOffset of `by`.
Rows rows_of(GltfFile& file, const Field& by, const Component& component, std::size_t count, std::size_t width) {
  const Bytes view = file.view(by["bufferView"]);
  const std::size_t row = width * component.bytes;
  const std::uint64_t stride = by["bufferView"].in(file.list("bufferViews"))["byteStride"].whole(row);
  const std::uint64_t offset = by["byteOffset"].whole(0);
  if (stride < row) by.wrong(fmt::format("its buffer view's byteStride is {}, an element has {} bytes", stride, row));
  const bool fits = count == 0 || (offset <= view.size() && row <= view.size() - offset &&
                                   (count - 1) <= (view.size() - offset - row) / stride);
  if (!fits)
    by.wrong(fmt::format("{} elements of {} bytes, {} apart, from byte {} on are beyond its buffer view's {} bytes",
                         count, row, stride, offset, view.size()));
  if (count == 0) return {{}, row, component};
  return {view.subspan(static_cast<std::size_t>(offset)), static_cast<std::size_t>(stride), component};
}

Field accessor_of(const GltfFile& file, const Field& number) { return number.in(file.list("accessors")); }

// Calls `take(row, column, value)` for every value of an accessor, the values of its sparse part last.
template <class Take>
void for_values(GltfFile& file, const Field& accessor, std::size_t count, std::size_t width, const Take& take) {
  const Component component = component_of(accessor["componentType"]);
  if (accessor["bufferView"].there()) {
    const Rows rows = rows_of(file, accessor, component, count, width);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t c = 0; c < width; ++c) take(i, c, rows.value(i, c));
  }
  const Field sparse = accessor["sparse"];
  if (!sparse.there()) return;
  const std::size_t changed = sparse["count"].whole();
  const Component type = component_of(sparse["indices"]["componentType"]);
  const Rows places = rows_of(file, sparse["indices"], type, changed, 1);
  const Rows values = rows_of(file, sparse["values"], component, changed, width);
  for (std::size_t i = 0; i < changed; ++i) {
    const double at = places.value(i, 0);
    if (!(at >= 0) || !(at < static_cast<double>(count)))
      sparse["indices"].wrong(fmt::format("element {} is {}; the accessor has {} elements", i, at, count));
    for (std::size_t c = 0; c < width; ++c) take(static_cast<std::size_t>(at), c, values.value(i, c));
  }
}

}  // namespace

std::size_t accessor_width(const Field& accessor) {
  static const std::pair<const char*, std::size_t> widths[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                                                               {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
  const std::string type = accessor["type"].text();
  for (const auto& [name, width] : widths)
    if (type == name) return width;
  accessor["type"].wrong(
      fmt::format("\"{}\" is not known: SCALAR, VEC2, VEC3, VEC4 or MAT4 is expected", printable(type)));
}

float accessor_scale(const Field& accessor) {
  const Component component = component_of(accessor["componentType"]);
  return accessor["normalized"].flag(false) ? 1 / component.most : 1;
}

Numbers read_numbers(GltfFile& file, const Field& number, const std::vector<std::size_t>& widths) {
  const Field accessor = accessor_of(file, number);
  Numbers out;
  out.count = accessor["count"].whole();
  out.width = accessor_width(accessor);
  if (std::find(widths.begin(), widths.end(), out.width) == widths.end())
    accessor["type"].wrong(fmt::format("is {}; {} numbers each are expected for {}", accessor["type"].text(),
                                       fmt::join(widths, " or "), number.place()));
  const float scale = accessor_scale(accessor);
  const float least = scale == 1 ? -HUGE_VALF : -1.0f;  // signed types have one more value below 0
  out.values.resize(out.count * out.width);
  for_values(file, accessor, out.count, out.width, [&](std::size_t row, std::size_t column, double value) {
    out.values[row * out.width + column] = std::max(least, static_cast<float>(value) * scale);
  });
  return out;
}

std::vector<std::uint32_t> read_wholes(GltfFile& file, const Field& number, std::size_t width) {
  const Field accessor = accessor_of(file, number);
  const std::size_t count = accessor["count"].whole();
  const std::uint64_t type = accessor["componentType"].whole();
  if (type != 5121 && type != 5123 && type != 5125)
    accessor["componentType"].wrong(fmt::format("is {}; 5121, 5123 or 5125 is expected for {}", type, number.place()));
  if (accessor_width(accessor) != width)
    accessor["type"].wrong(
        fmt::format("is {}; {} numbers each are expected for {}", accessor["type"].text(), width, number.place()));
  std::vector<std::uint32_t> out(count * width);
  for_values(file, accessor, count, width, [&](std::size_t row, std::size_t column, double value) {
    out[row * width + column] = static_cast<std::uint32_t>(value);
  });
  return out;
}

}  // namespace vsplat::read
