#include "model/base/resample.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

#include "model/base/lens.h"

namespace vsplat {
namespace {

// Weights of the samples first, first + 1, ... along one axis. Their sum is the covered fraction of the result pixel.
struct Taps {
  int first = 0;
  std::vector<float> weights;
};

double radius_of(double scale) { return 0.5 * (std::max(scale, 1.0) + 1); }

// The part of the result pixel that the picture covers, in source pixels; the picture has `size` of them.
double covered_of(double at, double scale, int size) {
  return std::min(at + 0.5 * scale, static_cast<double>(size)) - std::max(at - 0.5 * scale, 0.0);
}

// The first sample that find_taps() weights, if any is covered.
int first_tap(double at, double scale) {
  return static_cast<int>(std::max(std::ceil(at - radius_of(scale) - 0.5), 0.0));
}

// `at`: centre of the result pixel; `scale`: its width; both in source pixels. The source has `size` pixels. A sample's
// weight is the overlap of its pixel with the result pixel, which is widened to at least one source pixel.
void find_taps(double at, double scale, int size, Taps& out) {
  out.weights.clear();
  const double covered = covered_of(at, scale, size);
  if (!(covered > 0)) return;
  const double radius = radius_of(scale);
  const double low = std::ceil(at - radius - 0.5), high = std::floor(at + radius - 0.5);
  const int first = first_tap(at, scale), last = static_cast<int>(std::min(high, size - 1.0));
  out.first = first;
  double sum = 0, moment = 0, spread = 0;
  for (int i = first; i <= last; ++i) {
    const double d = i + 0.5 - at, w = std::clamp(radius - std::abs(d), 0.0, 1.0);
    out.weights.push_back(static_cast<float>(w));
    sum += w;
    moment += w * d;
    spread += w * d * d;
  }
  // w (a + b d) has sum 1 and centre 0, which reproduces linear ramps. At the picture's border that would extrapolate,
  // so the weights are only normalised to sum 1.
  const double determinant = sum * spread - moment * moment;
  double a = 1 / sum, b = 0;
  if (low >= 0 && high <= size - 1 && determinant > 1e-9 * sum * spread) {
    a = spread / determinant;
    b = -moment / determinant;
  }
  const double share = std::min(1.0, covered / scale);
  for (int i = first; i <= last; ++i) {
    float& w = out.weights[static_cast<std::size_t>(i - first)];
    w = static_cast<float>(share * w * (a + b * (i + 0.5 - at)));
  }
}

void accumulate(float* out, const float* in, float weight) {
  for (int c = 0; c < 4; ++c) out[c] += weight * in[c];
}

// Positions in the distorted picture of the corners of the result pixels.
class CornerMap {
 public:
  CornerMap(const Window& window, const Camera& camera)
      : side_(window.size + 1), points_(static_cast<std::size_t>(side_) * (window.height() + 1)) {
    const double step = window.side / window.size;
    double farthest = 0;
    for (const double u : {window.x0, window.x0 + window.side})
      for (const double v : {window.y0, window.y0 + window.height() * step})
        farthest = std::max(farthest, std::hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy));
    const Lens lens(camera.distortion, farthest);
    for (int j = 0; j <= window.height(); ++j)
      for (int i = 0; i < side_; ++i) {
        Point& p = points_[static_cast<std::size_t>(j) * side_ + i];
        double x = 0, y = 0;
        p.seen = lens.distort((window.x0 + i * step - camera.cx) / camera.fx,
                              (window.y0 + j * step - camera.cy) / camera.fy, x, y);
        p.u = camera.fx * x + camera.cx;
        p.v = camera.fy * y + camera.cy;
      }
  }

  // Centre and size of the result pixel's footprint; false if it is not visible or the lens flips it.
  bool footprint(int i, int j, double& u, double& v, double& width, double& height) const {
    const Point &a = at(i, j), &b = at(i + 1, j), &c = at(i, j + 1), &d = at(i + 1, j + 1);
    if (!a.seen || !b.seen || !c.seen || !d.seen) return false;
    u = 0.25 * (a.u + b.u + c.u + d.u);
    v = 0.25 * (a.v + b.v + c.v + d.v);
    const double ui = 0.5 * (b.u + d.u - a.u - c.u), uj = 0.5 * (c.u + d.u - a.u - b.u);
    const double vi = 0.5 * (b.v + d.v - a.v - c.v), vj = 0.5 * (c.v + d.v - a.v - b.v);
    width = std::hypot(ui, uj);
    height = std::hypot(vi, vj);
    return ui * vj - uj * vi > 0 && std::isfinite(width) && std::isfinite(height);
  }

 private:
  struct Point {
    double u, v;
    bool seen;
  };
  const Point& at(int i, int j) const { return points_[static_cast<std::size_t>(j) * side_ + i]; }

  int side_;  // points per row
  std::vector<Point> points_;
};

// Buffers the rows of a picture that are still needed.
class BufferedRows {
 public:
  explicit BufferedRows(PixelRows& from) : from_(from) {}

  const float* row(int y) {
    while (first_ + static_cast<int>(rows_.size()) <= y) rows_.push_back(read());
    return rows_[static_cast<std::size_t>(y - first_)].data();
  }

  // Also reads the rows that it skips.
  void drop_before(int y) {
    for (; first_ < y; ++first_) {
      if (rows_.empty()) {
        unused_ = read();
      } else {
        unused_ = std::move(rows_.front());
        rows_.pop_front();
      }
    }
  }

 private:
  std::vector<float> read() {
    std::vector<float> row;
    row.swap(unused_);
    row.resize(from_.row_size());
    from_.next(row.data());
    return row;
  }

  PixelRows& from_;
  std::deque<std::vector<float>> rows_;
  std::vector<float> unused_;
  int first_ = 0;  // index of the row in rows_[0], or of the next row to read
};

}  // namespace

PremultipliedRows::PremultipliedRows(PixelRows& picture, PixelRows* mask)
    : PixelRows(picture.width, picture.height, 4),
      picture_(picture),
      mask_(mask),
      pixels_(picture.row_size()),
      masks_(mask ? mask->row_size() : 0) {}

void PremultipliedRows::next(float* row) {
  picture_.next(pixels_.data());
  if (mask_) mask_->next(masks_.data());
  const float* p = pixels_.data();
  for (int x = 0; x < width; ++x, p += picture_.channels, row += 4) {
    if (mask_) brightest_ = std::max(brightest_, masks_[x]);
    const float a = (picture_.channels == 4 ? p[3] : 1.0f) * (mask_ ? masks_[x] : 1.0f);
    for (int c = 0; c < 3; ++c) row[c] = p[c] * a;
    row[3] = a;
  }
}

bool is_same_shape(int width, int height, int other_width, int other_height) {
  if (width > other_width || (width == other_width && height > other_height)) {
    std::swap(width, other_width);
    std::swap(height, other_height);
  }
  const double x = static_cast<double>(other_width) / width, y = static_cast<double>(other_height) / height;
  return std::abs(other_height / x - height) < 1 || std::abs(other_width / y - width) < 1;
}

struct ResizedRows::State {
  BufferedRows rows;
  int source_height, channels, next_row = 0;
  std::vector<Taps> columns;
};

ResizedRows::ResizedRows(PixelRows& from, int to_width, int to_height)
    : PixelRows(to_width, to_height, from.channels),
      state_(new State{BufferedRows(from), from.height, from.channels, 0,
                       std::vector<Taps>(static_cast<std::size_t>(to_width))}) {
  const double step = static_cast<double>(from.width) / width;
  for (int i = 0; i < width; ++i)
    find_taps((i + 0.5) * step, step, from.width, state_->columns[static_cast<std::size_t>(i)]);
}

ResizedRows::~ResizedRows() = default;

void ResizedRows::next(float* row) {
  const double step = static_cast<double>(state_->source_height) / height;
  Taps down;
  find_taps((state_->next_row++ + 0.5) * step, step, state_->source_height, down);
  state_->rows.drop_before(down.first);
  std::fill(row, row + row_size(), 0.0f);
  const auto n = static_cast<std::size_t>(channels);
  for (std::size_t y = 0; y < down.weights.size(); ++y) {
    const float* from = state_->rows.row(down.first + static_cast<int>(y));
    for (std::size_t i = 0; i < state_->columns.size(); ++i) {
      const Taps& across = state_->columns[i];
      for (std::size_t x = 0; x < across.weights.size(); ++x)
        for (std::size_t c = 0; c < n; ++c)
          row[n * i + c] +=
              down.weights[y] * across.weights[x] * from[n * (static_cast<std::size_t>(across.first) + x) + c];
    }
  }
}

Image premultiplied(const Image& picture) {
  ImageRows pixels(picture);
  PremultipliedRows rows(pixels);
  return image_of(rows);
}

Image over(const Image& premultiplied, const std::array<float, 3>& background) {
  Image out(premultiplied.width, premultiplied.height, 3);
  for (std::size_t i = 0; i < out.data.size() / 3; ++i) {
    const float* p = &premultiplied.data[4 * i];
    for (int c = 0; c < 3; ++c) out.data[3 * i + c] = std::clamp(p[c] + (1.0f - p[3]) * background[c], 0.0f, 1.0f);
  }
  return out;
}

Image on_white(const Image& premultiplied) { return over(premultiplied, {1, 1, 1}); }

Image resample(PixelRows& in, const Window& window) {
  const int size = window.size, height = window.height();
  const double step = window.side / size;
  std::vector<Taps> columns(static_cast<std::size_t>(size)), rows(static_cast<std::size_t>(height));
  for (int i = 0; i < size; ++i) find_taps(window.x0 + (i + 0.5) * step, step, in.width, columns[i]);
  for (int i = 0; i < height; ++i) find_taps(window.y0 + (i + 0.5) * step, step, in.height, rows[i]);
  const auto ended = [&](int j, int y) { return rows[j].first + static_cast<int>(rows[j].weights.size()) <= y; };
  Image out(size, height, 4);
  std::vector<float> row(in.row_size()), narrow(4 * static_cast<std::size_t>(size));
  int open = 0;  // rows of the result before this one are complete
  for (int y = 0; y < in.height; ++y) {
    in.next(row.data());
    while (open < height && ended(open, y)) ++open;
    if (open == height || rows[open].first > y) continue;
    std::fill(narrow.begin(), narrow.end(), 0.0f);
    for (int i = 0; i < size; ++i)
      for (std::size_t k = 0; k < columns[i].weights.size(); ++k)
        accumulate(&narrow[4 * static_cast<std::size_t>(i)], &row[4 * (columns[i].first + k)], columns[i].weights[k]);
    for (int j = open; j < height && rows[j].first <= y; ++j) {
      if (ended(j, y)) continue;
      const float weight = rows[j].weights[static_cast<std::size_t>(y - rows[j].first)];
      for (int i = 0; i < size; ++i) accumulate(out.at(i, j), &narrow[4 * static_cast<std::size_t>(i)], weight);
    }
  }
  return out;
}

Image resample_undistorted(PixelRows& in, const Window& window, const Camera& camera) {
  const CornerMap map(window, camera);
  const int height = window.height();
  double u = 0, v = 0, wide = 0, high = 0;
  // For each result row, the first source row that it or any later result row needs.
  std::vector<int> first(static_cast<std::size_t>(height) + 1, in.height);
  for (int j = height - 1; j >= 0; --j) {
    first[j] = first[j + 1];
    for (int i = 0; i < window.size; ++i)
      if (map.footprint(i, j, u, v, wide, high) && covered_of(v, high, in.height) > 0)
        first[j] = std::min(first[j], first_tap(v, high));
  }
  BufferedRows kept(in);
  Image out(window.size, height, 4);
  Taps columns, rows;
  for (int j = 0; j < height; ++j) {
    kept.drop_before(first[j]);
    for (int i = 0; i < window.size; ++i) {
      if (!map.footprint(i, j, u, v, wide, high)) continue;
      find_taps(v, high, in.height, rows);
      if (rows.weights.empty()) continue;
      find_taps(u, wide, in.width, columns);
      float sum[4] = {};
      for (std::size_t y = 0; y < rows.weights.size(); ++y) {
        const float* row = kept.row(rows.first + static_cast<int>(y)) + 4 * static_cast<std::size_t>(columns.first);
        for (std::size_t x = 0; x < columns.weights.size(); ++x)
          accumulate(sum, row + 4 * x, rows.weights[y] * columns.weights[x]);
      }
      std::copy_n(sum, 4, out.at(i, j));
    }
  }
  kept.drop_before(in.height);
  return out;
}

}  // namespace vsplat
