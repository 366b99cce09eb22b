// Surfels whose blending is smooth in their numbers, and a loss on what comes of it, with its derivatives.
#pragma once
#include <algorithm>
#include <cmath>

#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/inputs/surfel_records.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/ops/render/project_surfels.h"

namespace vsplat::selftest {

inline SurfelRevision revision_of(const ref::SurfelOptions& o) {
  return o.current ? SurfelRevision::current : SurfelRevision::lara;
}

constexpr std::size_t kSurfelNumbers = 20;  // of a record, and of a row

// A few surfels, all of which every pixel sees, none near a threshold: large, faint, on one side of the low pass.
inline Records smooth_surfels(int width, int height, int count, bool low_pass) {
  Records c;
  const std::vector<float> at = random_floats(1000, 44);
  const int tiles = (width + 15) / 16 * ((height + 15) / 16);
  for (int i = 0; i < count; ++i) {
    const float* r = &at[30 * static_cast<std::size_t>(i)];
    // On the surfel: far from its box's centre in pixels, near in deviations. By the low pass: the other way round.
    const float m = low_pass ? 40.0f : 0.03f, jitter = low_pass ? 0.3f : 2.0f;
    for (const float v : {0.5f * static_cast<float>(width) + jitter * r[0],
                          0.5f * static_cast<float>(height) + jitter * r[1],
                          std::log2(0.35f + 0.2f * r[2]),
                          1.5f + 0.1f * static_cast<float>(i) + 0.05f * r[3],
                          m * (1 + 0.5f * r[4]),
                          0.3f * m * r[5],
                          0.3f * m * r[6],
                          m * (1 + 0.5f * r[7]),
                          0.005f * r[8],
                          0.005f * r[9],
                          low_pass ? 0.2f * r[10] : 90 + 5 * r[10],
                          low_pass ? 0.2f * r[11] : 60 + 5 * r[11],
                          0.5f + 0.4f * r[12],
                          0.5f + 0.4f * r[13],
                          0.5f + 0.4f * r[14],
                          1e30f,
                          r[15],
                          r[16],
                          r[17],
                          1e30f})
      c.records.push_back(v);
  }
  for (int tile = 0; tile <= tiles; ++tile) {
    c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
    for (int i = 0; tile < tiles && i < count; ++i) c.ids.push_back(static_cast<std::uint32_t>(i));
  }
  return c;
}

// Derivatives of a loss by the maps; one without values is none.
struct SurfelCotangent {
  std::vector<float> colour, alpha, depth, normal, distortion;

  static SurfelCotangent random(int width, int height) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    return {random_floats(3 * pixels, 5), random_floats(pixels, 6), random_floats(pixels, 7),
            random_floats(3 * pixels, 8), random_floats(pixels, 9, -20.0f, 20.0f)};
  }
  double loss(const ref::SurfelFrame& f) const {
    return ref::weighed(f.colour, colour) + ref::weighed(f.alpha, alpha) + ref::weighed(f.depth, depth) +
           ref::weighed(f.normal, normal) + ref::weighed(f.distortion, distortion);
  }
};

// Values of the rows, in the order of ids, for the records' numbers (see cl/render/rasterize_surfels_backward.cl): all
// but the reaches.
inline std::vector<double> by_surfel_records(const Records& c, const std::vector<float>& rows) {
  std::vector<double> out(c.records.size());
  for (std::size_t n = 0; n < c.ids.size(); ++n) {
    const float* row = &rows[kSurfelNumbers * n];
    const float* r = &c.records[kSurfelNumbers * std::size_t{c.ids[n]}];
    double* by = &out[kSurfelNumbers * std::size_t{c.ids[n]}];
    by[0] += r[4] * row[1] + r[6] * row[2] + r[8] * row[3] + row[10];
    by[1] += r[5] * row[1] + r[7] * row[2] + r[9] * row[3] + row[11];
    by[2] += std::log(2.0) * row[0];
    by[3] += row[12];
    for (std::size_t i = 0; i < 8; ++i) by[4 + i] += row[4 + i];
    for (std::size_t i = 0; i < 3; ++i) by[12 + i] += row[13 + i], by[16 + i] += row[16 + i];
  }
  return out;
}

// The same by differences of the reference's maps.
inline std::vector<double> surfel_differences(const Records& c, int width, int height, const SurfelCotangent& by,
                                              const ref::SurfelOptions& o) {
  std::vector<double> records(c.records.begin(), c.records.end()), out(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (i % kSurfelNumbers == 15 || i % kSurfelNumbers == 19) continue;
    out[i] = ref::derivative_by(records[i], 1e-4 * std::max(std::abs(records[i]), 1e-2), [&] {
      return by.loss(ref::blend_surfels(records, c.ids, c.starts, width, height, o));
    });
  }
  return out;
}

}  // namespace vsplat::selftest
