#include "model/base/resample.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
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
  const double begin = at - radius_of(scale) - 0.5;
  if (begin <= 0) return 0;
  const int whole = static_cast<int>(begin);
  return whole + (begin > whole ? 1 : 0);
}

// `at`: centre of the result pixel; `scale`: its width; both in source pixels. The source has `size` pixels. A sample's
// weight is the overlap of its pixel with the result pixel, which is widened to at least one source pixel.
void find_taps(double at, double scale, int size, Taps& out) {
  out.weights.clear();
  const double covered = covered_of(at, scale, size);
  if (!(covered > 0)) return;
  const double radius = radius_of(scale), end = at + radius - 0.5;
  const int first = first_tap(at, scale), last = end >= size ? size - 1 : static_cast<int>(end);
  const bool inside = at - radius - 0.5 > -1 && end < size;
  const std::size_t count = static_cast<std::size_t>(last - first) + 1;
  out.first = first;
  out.weights.resize(count);
  const double from = first + 0.5 - at, to = last + 0.5 - at;  // where the first and the last sample are
  const double left = std::clamp(radius - std::abs(from), 0.0, 1.0);
  const double right = last > first ? std::clamp(radius - std::abs(to), 0.0, 1.0) : 0;
  // All between the two weigh 1: they are at from + k, k = 1 ... between.
  const double between = std::max(last - first - 1, 0), by_k = between * (between + 1) / 2;
  const double sum = left + right + between;
  const double moment = left * from + right * to + between * from + by_k;
  const double spread =
      left * from * from + right * to * to + between * from * from + 2 * from * by_k + by_k * (2 * between + 1) / 3;
  // w (a + b d) has sum 1 and centre 0, which reproduces linear ramps. At the picture's border that would extrapolate,
  // so the weights are only normalised to sum 1.
  const double determinant = sum * spread - moment * moment, share = covered < scale ? covered / scale : 1;
  const bool centred = inside && determinant > 1e-9 * sum * spread;
  const double over = share / (centred ? determinant : sum);
  const double a = centred ? over * spread : over, b = centred ? -over * moment : 0;
  for (std::size_t k = 0; k < count; ++k) out.weights[k] = static_cast<float>(a + b * (from + static_cast<double>(k)));
  out.weights.front() *= static_cast<float>(left);
  if (count > 1) out.weights.back() *= static_cast<float>(right);
}

// A pixel of four channels.
Eigen::Map<const Eigen::Vector4f> pixel_at(const float* p) { return Eigen::Map<const Eigen::Vector4f>(p); }

void accumulate(float* out, const float* in, float weight) {
  Eigen::Map<Eigen::Vector4f>(out) += weight * pixel_at(in);
}

// Where a result pixel lies in the distorted picture: its centre and its size.
struct Footprint {
  double u = 0, v = 0, width = 0, height = 0;
  bool seen = false;  // not if the lens flips it
};

// The footprints of the result's rows, in any order. A row after the one before it computes half as much.
class Footprints {
 public:
  Footprints(const Window& window, const Camera& camera)
      : window_(window),
        camera_(camera),
        step_(window.side / window.size),
        lens_(camera.distortion, farthest()),
        upper_(static_cast<std::size_t>(window.size) + 1),
        lower_(upper_.size()),
        row_(static_cast<std::size_t>(window.size)) {}

  const std::vector<Footprint>& row(int j) {
    if (j == below_)
      std::swap(upper_, lower_);
    else
      find_corners(j, upper_);
    find_corners(j + 1, lower_);
    below_ = j + 1;
    for (std::size_t i = 0; i < row_.size(); ++i)
      row_[i] = footprint(upper_[i], upper_[i + 1], lower_[i], lower_[i + 1]);
    return row_;
  }

 private:
  struct Corner {
    double u = 0, v = 0;
    bool seen = false;
  };

  double farthest() const {
    double out = 0;
    for (const double u : {window_.x0, window_.x0 + window_.side})
      for (const double v : {window_.y0, window_.y0 + window_.height() * step_})
        out = std::max(out, std::hypot((u - camera_.cx) / camera_.fx, (v - camera_.cy) / camera_.fy));
    return out;
  }

  // The corners of the result's pixels along the upper edge of row j, in the distorted picture.
  void find_corners(int j, std::vector<Corner>& out) const {
    const double down = (window_.y0 + j * step_ - camera_.cy) / camera_.fy;
    for (std::size_t i = 0; i < out.size(); ++i) {
      double x = 0, y = 0;
      const double right = (window_.x0 + static_cast<double>(i) * step_ - camera_.cx) / camera_.fx;
      out[i].seen = lens_.distort(right, down, x, y);
      out[i].u = camera_.fx * x + camera_.cx;
      out[i].v = camera_.fy * y + camera_.cy;
    }
  }

  static Footprint footprint(const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
    const double ui = 0.5 * (b.u + d.u - a.u - c.u), uj = 0.5 * (c.u + d.u - a.u - b.u);
    const double vi = 0.5 * (b.v + d.v - a.v - c.v), vj = 0.5 * (c.v + d.v - a.v - b.v);
    Footprint out{0.25 * (a.u + b.u + c.u + d.u), 0.25 * (a.v + b.v + c.v + d.v), std::sqrt(ui * ui + uj * uj),
                  std::sqrt(vi * vi + vj * vj), false};
    out.seen = a.seen && b.seen && c.seen && d.seen && ui * vj - uj * vi > 0 && std::isfinite(out.width) &&
               std::isfinite(out.height);
    return out;
  }

  const Window& window_;
  const Camera& camera_;
  double step_;
  Lens lens_;
  std::vector<Corner> upper_, lower_;
  std::vector<Footprint> row_;
  int below_ = -1;  // the row whose upper corners are in lower_
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
        rows_.erase(rows_.begin());
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
  std::vector<std::vector<float>> rows_;
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
  Footprints footprints(window, camera);
  const int height = window.height();
  // For each result row, the first source row that it or any later result row needs.
  std::vector<int> first(static_cast<std::size_t>(height) + 1, in.height);
  for (int j = 0; j < height; ++j)
    for (const Footprint& at : footprints.row(j))
      if (at.seen && covered_of(at.v, at.height, in.height) > 0)
        first[j] = std::min(first[j], first_tap(at.v, at.height));
  for (int j = height - 1; j >= 0; --j) first[j] = std::min(first[j], first[j + 1]);
  BufferedRows kept(in);
  Image out(window.size, height, 4);
  Taps columns, rows;
  for (int j = 0; j < height; ++j) {
    kept.drop_before(first[j]);
    float* to = out.at(0, j);
    for (const Footprint& at : footprints.row(j)) {
      float* const pixel = to;
      to += 4;
      if (!at.seen) continue;
      find_taps(at.v, at.height, in.height, rows);
      if (rows.weights.empty()) continue;
      find_taps(at.u, at.width, in.width, columns);
      Eigen::Vector4f sum = Eigen::Vector4f::Zero();
      for (std::size_t y = 0; y < rows.weights.size(); ++y) {
        const float* row = kept.row(rows.first + static_cast<int>(y)) + 4 * static_cast<std::size_t>(columns.first);
        for (std::size_t x = 0; x < columns.weights.size(); ++x)
          sum += rows.weights[y] * columns.weights[x] * pixel_at(row + 4 * x);
      }
      Eigen::Map<Eigen::Vector4f>{pixel} = sum;
    }
  }
  kept.drop_before(in.height);
  return out;
}

}  // namespace vsplat
