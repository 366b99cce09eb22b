#include "model/base/resample.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/lens.h"

namespace vsplat {
namespace {

// Weights of the samples first, first + 1, ... along one axis. Their sum is the share of the result pixel that is
// covered.
struct Taps {
  int first = 0;
  std::vector<float> weights;
};

// `at`: the result pixel's centre; `scale`: its width; both in source pixels. `size` source pixels there are. A sample
// weighs as much as its pixel shares with the result's (widened to one source pixel where it is smaller).
void find_taps(double at, double scale, int size, Taps& out) {
  out.weights.clear();
  const double covered = std::min(at + 0.5 * scale, static_cast<double>(size)) - std::max(at - 0.5 * scale, 0.0);
  if (!(covered > 0)) return;
  const double radius = 0.5 * (std::max(scale, 1.0) + 1);
  const double low = std::ceil(at - radius - 0.5), high = std::floor(at + radius - 0.5);
  const int first = static_cast<int>(std::max(low, 0.0)), last = static_cast<int>(std::min(high, size - 1.0));
  out.first = first;
  double sum = 0, moment = 0, spread = 0;
  for (int i = first; i <= last; ++i) {
    const double d = i + 0.5 - at, w = std::clamp(radius - std::abs(d), 0.0, 1.0);
    out.weights.push_back(static_cast<float>(w));
    sum += w;
    moment += w * d;
    spread += w * d * d;
  }
  // w (a + b d) has sum 1 and centre 0: a linear ramp is reproduced. At the picture's border, where that would
  // extrapolate, the weights are only brought to sum 1.
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

// Where the corners of the result's pixels are in the distorted picture.
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

  // Centre and widths of the result pixel's footprint; false where it is not seen or the lens turns it over.
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

  int side_;  // points in a row
  std::vector<Point> points_;
};

}  // namespace

Image premultiplied(const Image& picture, const Image* mask) {
  Image out(picture.width, picture.height, 4);
  const std::size_t pixels = static_cast<std::size_t>(picture.width) * picture.height;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* p = &picture.data[i * picture.channels];
    const float a = (picture.channels == 4 ? p[3] : 1.0f) * (mask ? mask->data[i] : 1.0f);
    for (int c = 0; c < 3; ++c) out.data[4 * i + c] = p[c] * a;
    out.data[4 * i + 3] = a;
  }
  return out;
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

Image resample(const Image& in, const Window& window) {
  const int size = window.size, height = window.height();
  const double step = window.side / size;
  std::vector<Taps> columns(static_cast<std::size_t>(size)), rows(static_cast<std::size_t>(height));
  int top = in.height, bottom = 0;
  for (int i = 0; i < size; ++i) find_taps(window.x0 + (i + 0.5) * step, step, in.width, columns[i]);
  for (int i = 0; i < height; ++i) {
    find_taps(window.y0 + (i + 0.5) * step, step, in.height, rows[i]);
    if (rows[i].weights.empty()) continue;
    top = std::min(top, rows[i].first);
    bottom = std::max(bottom, rows[i].first + static_cast<int>(rows[i].weights.size()));
  }
  Image narrow(size, std::max(bottom - top, 0), 4), out(size, height, 4);
  for (int y = top; y < bottom; ++y)
    for (int i = 0; i < size; ++i)
      for (std::size_t k = 0; k < columns[i].weights.size(); ++k)
        accumulate(narrow.at(i, y - top), in.at(columns[i].first + static_cast<int>(k), y), columns[i].weights[k]);
  for (int j = 0; j < height; ++j)
    for (std::size_t k = 0; k < rows[j].weights.size(); ++k)
      for (int i = 0; i < size; ++i)
        accumulate(out.at(i, j), narrow.at(i, rows[j].first + static_cast<int>(k) - top), rows[j].weights[k]);
  return out;
}

Image resample_undistorted(const Image& in, const Window& window, const Camera& camera) {
  const CornerMap map(window, camera);
  Image out(window.size, window.height(), 4);
  Taps columns, rows;
  for (int j = 0; j < window.height(); ++j)
    for (int i = 0; i < window.size; ++i) {
      double u = 0, v = 0, width = 0, height = 0;
      if (!map.footprint(i, j, u, v, width, height)) continue;
      find_taps(v, height, in.height, rows);
      if (rows.weights.empty()) continue;
      find_taps(u, width, in.width, columns);
      float sum[4] = {};
      for (std::size_t y = 0; y < rows.weights.size(); ++y)
        for (std::size_t x = 0; x < columns.weights.size(); ++x)
          accumulate(sum, in.at(columns.first + static_cast<int>(x), rows.first + static_cast<int>(y)),
                     rows.weights[y] * columns.weights[x]);
      std::copy_n(sum, 4, out.at(i, j));
    }
  return out;
}

}  // namespace vsplat
