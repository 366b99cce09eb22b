#include "model/io/picture/contact_sheet.h"

#include <algorithm>
#include <cmath>

#include "model/io/picture/image_file.h"
#include "model/io/picture/text.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr float ink = 0.15f;
constexpr int largest_cell = 4096, usual_cell = 256, smallest_cell = 24;
constexpr double usual_pixels = 256.0 * usual_cell * usual_cell;  // limit for all cells together; cells shrink to keep
                                                                  // it

int cell_of(const SheetOptions& options) {
  if (options.cell > 0) return options.cell;
  const double fitting = std::sqrt(usual_pixels / std::max(options.expected, 1));
  return std::clamp(static_cast<int>(fitting), smallest_cell, usual_cell);
}

// The pixels of `from` that pixel `i` of `to` covers, along one axis.
struct Span {
  int first, last;
  double head, tail;  // weights of the first and the last pixel
};
Span span_of(int i, int from, int to) {
  const double begin = static_cast<double>(i) * from / to, end = static_cast<double>(i + 1) * from / to;
  Span out{};
  out.first = std::min(static_cast<int>(begin), from - 1);
  out.last = std::clamp(static_cast<int>(std::ceil(end)) - 1, out.first, from - 1);
  out.head = out.first == out.last ? end - begin : out.first + 1 - begin;
  out.tail = end - out.last;
  return out;
}
double weight(const Span& span, int at) { return at == span.first ? span.head : at == span.last ? span.tail : 1.0; }

}  // namespace

Image shrunk(const Image& picture, int width, int height) {
  ImageRows rows(picture);
  return shrunk(rows, width, height);
}

Image shrunk(PixelRows& picture, int width, int height) {
  if (width < 1 || height < 1 || width > picture.width || height > picture.height)
    fail(Status::internal, "shrunk: {} x {} to {} x {}", picture.width, picture.height, width, height);
  if (width == picture.width && height == picture.height) return image_of(picture);
  const std::size_t channels = static_cast<std::size_t>(picture.channels);
  Image out(width, height, picture.channels);
  std::vector<float> row(picture.row_size());
  int read = 0;  // rows read so far; the last is in `row`, because two result rows may share it
  for (int y = 0; y < height; ++y) {
    std::vector<double> sum(width * channels), area(static_cast<std::size_t>(width));
    const Span rows = span_of(y, picture.height, height);
    for (int v = rows.first; v <= rows.last; ++v) {
      for (; read <= v; ++read) picture.next(row.data());
      for (int x = 0; x < width; ++x) {
        const Span columns = span_of(x, picture.width, width);
        for (int u = columns.first; u <= columns.last; ++u) {
          const double w = weight(rows, v) * weight(columns, u);
          area[x] += w;
          for (std::size_t c = 0; c < channels; ++c)
            sum[x * channels + c] += w * static_cast<double>(row[u * channels + c]);
        }
      }
    }
    for (int x = 0; x < width; ++x)
      for (std::size_t c = 0; c < channels; ++c) out.at(x, y)[c] = static_cast<float>(sum[x * channels + c] / area[x]);
  }
  return out;
}

ContactSheet::ContactSheet(const SheetOptions& options) : options_(options), cell_(cell_of(options)) {
  if (options.cell < 0 || options.cell > largest_cell || options.columns < 0 || options.expected < 0)
    fail(Status::usage, "a contact sheet with cells of {} pixels, {} columns, for {} pictures; cells have at most {}",
         options.cell, options.columns, options.expected, largest_cell);
}

void ContactSheet::add(const Image& picture, const std::string& label) {
  if (picture.empty() || picture.channels != 3)
    fail(Status::internal, "a contact sheet takes 3 channels, not {} x {} x {}", picture.width, picture.height,
         picture.channels);
  const double scale = std::min(1.0, static_cast<double>(cell_) / std::max(picture.width, picture.height));
  const auto scaled = [&](int side) { return std::max(1, static_cast<int>(std::lround(side * scale))); };
  Image small = shrunk(picture, scaled(picture.width), scaled(picture.height));
  for (float& v : small.data) v = v > 0 ? std::min(v, 1.0f) : 0.0f;
  cells_.emplace_back(std::move(small), label);
}

Image ContactSheet::sheet() const {
  if (cells_.empty()) fail(Status::usage, "a contact sheet of no pictures");
  long width = 0, height = 0;
  const bool labelled =
      std::any_of(cells_.begin(), cells_.end(), [](const auto& cell) { return !cell.second.empty(); });
  const int below = margin + (labelled ? label_height : 0);
  for (const auto& [cell, label] : cells_) {
    width = std::max<long>(width, cell.width + margin);
    height = std::max<long>(height, cell.height + below);
  }
  const auto n = static_cast<long>(cells_.size());
  const double balanced = std::sqrt(4.0 / 3.0 * static_cast<double>(n * height) / static_cast<double>(width));
  const long columns = std::clamp(options_.columns > 0 ? options_.columns : std::lround(balanced), 1L, n);
  const long rows = (n + columns - 1) / columns;
  const long sheet_width = columns * width + margin, sheet_height = rows * height + margin;
  if (sheet_width > max_image_side || sheet_height > max_image_side || sheet_width > max_image_pixels / sheet_height)
    fail(Status::input,
         "a contact sheet of {} pictures would have {} x {} pixels: take smaller cells or fewer pictures", n,
         sheet_width, sheet_height);
  Image out(static_cast<int>(sheet_width), static_cast<int>(sheet_height), 3, paper);
  for (long i = 0; i < n; ++i) {
    const auto& [cell, label] = cells_[static_cast<std::size_t>(i)];
    const int left = static_cast<int>(margin + i % columns * width),
              top = static_cast<int>(margin + i / columns * height), space = static_cast<int>(width) - margin,
              tall = static_cast<int>(height) - below;
    const int x = left + (space - cell.width) / 2, y = top + (tall - cell.height) / 2;
    for (int v = 0; v < cell.height; ++v) std::copy_n(cell.at(0, v), 3 * cell.width, out.at(x, y + v));
    const std::string text = fitted_text(label, space);
    draw_text(out, left + (space - glyph_width * static_cast<int>(text.size())) / 2,
              top + tall + label_height - glyph_height, text, ink);
  }
  return out;
}

}  // namespace vsplat
