#include <gtest/gtest.h>

#include <cmath>

#include "model/ops/rasterize_surfels.h"
#include "model/selftest/reference/rasterize_surfels.h"
#include "tests/support/compare.h"
#include "tests/support/counted.h"
#include "tests/support/device.h"
#include "tests/support/surfel_records.h"

namespace vsplat {
namespace {

constexpr std::size_t kNumbers = 20;  // of a record, and of a row

// Derivatives of a loss by the maps; one without values is none.
struct Cotangent {
  std::vector<float> colour, alpha, depth, normal, distortion;

  static Cotangent random(int width, int height) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    return {test::random_floats(3 * pixels, 5), test::random_floats(pixels, 6), test::random_floats(pixels, 7),
            test::random_floats(3 * pixels, 8), test::random_floats(pixels, 9, -20.0f, 20.0f)};
  }

  double loss(const ref::SurfelFrame& f) const {
    double sum = 0;
    const auto add = [&sum](const std::vector<double>& map, const std::vector<float>& by) {
      for (std::size_t i = 0; i < by.size(); ++i) sum += map[i] * by[i];
    };
    add(f.colour, colour), add(f.alpha, alpha), add(f.depth, depth), add(f.normal, normal);
    add(f.distortion, distortion);
    return sum;
  }
};

class RasterizeSurfelsBackward : public test::FlavourTest {
 protected:
  static SurfelRevision revision_of(const ref::SurfelOptions& o) {
    return o.current ? SurfelRevision::current : SurfelRevision::lara;
  }

  ref::SurfelOptions options(bool current) const {
    ref::SurfelOptions o{{}, current};
    for (std::size_t i = 0; i < 3; ++i) o.options.background[i] = background[i];
    return o;
  }

  // Rows in the order of ids, zeros where none was written.
  std::vector<float> run(const test::Records& c, int width, int height, const Cotangent& by,
                         const ref::SurfelOptions& o) {
    const auto upload = [&](const std::vector<float>& v, const Shape& shape) {
      return v.empty() ? Tensor() : ctx().upload(shape, v);
    };
    const auto upload_u32 = [&](const std::vector<std::uint32_t>& v) {
      return ctx().upload({static_cast<long>(v.size())}, v, Type::u32);
    };
    Projected p;
    p.records = ctx().upload({static_cast<long>(c.records.size() / kNumbers), kNumbers}, c.records);
    Binned b;
    b.ids = upload_u32(c.ids);
    b.starts = upload_u32(c.starts);
    const std::vector<std::uint32_t> slots = test::slots_of(c, kNumbers);
    b.slots = upload_u32(slots);
    const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
    const float near = static_cast<float>(o.options.near);
    const DevicePicture picture =
        make_picture(ctx(), width, height, {!by.normal.empty(), false, !by.distortion.empty()});
    rasterize_surfels_forward(ctx(), {p, b, whole, background, picture, near, revision_of(o)});
    const PictureGradient gradient{upload(by.colour, {height, width, 3}), upload(by.alpha, {height, width}),
                                   upload(by.depth, {height, width}), upload(by.normal, {height, width, 3}),
                                   upload(by.distortion, {height, width})};
    const IntersectionGradients got =
        rasterize_surfels_backward(ctx(), {p, b, whole, background, picture, gradient, near, revision_of(o)});
    const auto rows = ctx().read<float>(got.rows);
    const auto touched = ctx().read<std::uint8_t>(got.touched);
    std::vector<float> out(rows.size(), 0.0f);
    for (std::size_t i = 0; i < slots.size(); ++i)
      for (std::size_t col = 0; col < kNumbers && touched[slots[i]]; ++col)
        out[kNumbers * i + col] = rows[kNumbers * slots[i] + col];
    return out;
  }

  // What the rows say of the records' numbers (see cl/rasterize_surfels_backward.cl): all but the reaches.
  static std::vector<double> by_records(const test::Records& c, const std::vector<float>& rows) {
    std::vector<double> out(c.records.size());
    for (std::size_t n = 0; n < c.ids.size(); ++n) {
      const float* row = &rows[kNumbers * n];
      const float* r = &c.records[kNumbers * std::size_t{c.ids[n]}];
      double* by = &out[kNumbers * std::size_t{c.ids[n]}];
      by[0] += r[4] * row[1] + r[6] * row[2] + r[8] * row[3] + row[10];
      by[1] += r[5] * row[1] + r[7] * row[2] + r[9] * row[3] + row[11];
      by[2] += std::log(2.0) * row[0];
      by[3] += row[12];
      for (std::size_t i = 0; i < 8; ++i) by[4 + i] += row[4 + i];
      for (std::size_t i = 0; i < 3; ++i) by[12 + i] += row[13 + i], by[16 + i] += row[16 + i];
    }
    return out;
  }

  // By differences of the reference's maps, tile by tile: what a record does elsewhere is not asked.
  static std::vector<double> differences(const test::Records& c, int width, int height, const Cotangent& by,
                                         const ref::SurfelOptions& o) {
    std::vector<double> records(c.records.begin(), c.records.end()), out(records.size());
    const auto loss = [&] { return by.loss(ref::blend_surfels(records, c.ids, c.starts, width, height, o)); };
    for (std::size_t i = 0; i < records.size(); ++i) {
      if (i % kNumbers == 15 || i % kNumbers == 19) continue;
      const double base = records[i];
      const auto slope = [&](double h) {
        records[i] = base + h;
        const double above = loss();
        records[i] = base - h;
        const double below = loss();
        records[i] = base;
        return (above - below) / (2 * h);
      };
      const double step = 1e-4 * std::max(std::abs(base), 1e-2);
      out[i] = (4 * slope(step / 2) - slope(step)) / 3;
    }
    return out;
  }

  // A few surfels, all of which every pixel sees, none near a threshold: large, faint, on one side of the low pass.
  static test::Records smooth(int width, int height, int count, bool low_pass) {
    test::Records c;
    const std::vector<float> at = test::random_floats(1000, 44);
    const int tiles_x = (width + 15) / 16, tiles = tiles_x * ((height + 15) / 16);
    for (int i = 0; i < count; ++i) {
      const float* r = &at[static_cast<std::size_t>(30 * i)];
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
    for (int tile = 0; tile < tiles; ++tile) {
      c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
      for (int i = 0; i < count; ++i) c.ids.push_back(static_cast<std::uint32_t>(i));
    }
    c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
    return c;
  }

  void check(const test::Records& c, int width, int height, bool current, double tolerance) {
    const ref::SurfelOptions o = options(current);
    const Cotangent by = Cotangent::random(width, height);
    const std::vector<double> got = by_records(c, run(c, width, height, by, o)),
                              want = differences(c, width, height, by, o);
    for (std::size_t number = 0; number < kNumbers; ++number) {
      SCOPED_TRACE("number " + std::to_string(number));
      std::vector<double> g, w;
      for (std::size_t i = number; i < want.size(); i += kNumbers) g.push_back(got[i]), w.push_back(want[i]);
      const bool zero = std::all_of(w.begin(), w.end(), [](double x) { return x == 0; });
      EXPECT_TRUE(test::close(g, w, tolerance, zero));
    }
  }

  const std::array<float, 3> background{0.25f, 0.5f, 1};
};

// In a profiled run, and drawing does, too; results are the same to the bit.
TEST_P(RasterizeSurfelsBackward, CountsWhatItBlendsInAProfiledRun) {
  const int width = 53, height = 40;
  const ref::SurfelOptions o = options(false);
  const test::Records c = test::make_surfel_records(width, height, 60, 0.8f, 3, o);
  std::uint64_t pairs = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      ref::SurfelPixel pixel;
      const auto tile = static_cast<std::size_t>(y / 16 * ((width + 15) / 16) + x / 16);
      for (std::uint32_t i = c.starts[tile]; i < c.starts[tile + 1]; ++i) {
        const ref::Meeting at = ref::meet_record(&c.records[kNumbers * std::size_t{c.ids[i]}], x + 0.5, y + 0.5, o);
        if (!(at.alpha > 0)) continue;
        if (!pixel.add(at, {0, 0, 0}, {0, 0, 0}, o.options.near)) break;
        ++pairs;
      }
    }
  Cotangent by = Cotangent::random(width, height);
  for (const bool maps : {true, false}) {
    if (!maps) by.normal.clear(), by.distortion.clear();
    const std::vector<float> plain = run(c, width, height, by, o);
    for (const char* direction : {"rasterize_surfels_forward", "rasterize_surfels_backward"}) {
      std::vector<float> counted;
      const ProfileRow row = test::profiled_row(ctx(), direction, [&] { counted = run(c, width, height, by, o); });
      EXPECT_EQ(plain, counted);
      EXPECT_EQ(row.counted, pairs) << direction;
      EXPECT_GT(row.flops, 50.0 * static_cast<double>(row.counted));
    }
  }
}

TEST_P(RasterizeSurfelsBackward, MatchesDifferences) {
  for (const auto& [width, height] : {std::pair{1, 1}, {17, 3}, {13, 11}, {16, 33}, {31, 7}})
    for (const bool current : {false, true}) {
      SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height) + (current ? ", current" : ""));
      check(smooth(width, height, 7, false), width, height, current, 2e-5);
    }
}

TEST_P(RasterizeSurfelsBackward, MatchesDifferencesWhereTheLowPassDecides) {
  for (const bool current : {false, true}) {
    SCOPED_TRACE(current ? "current" : "lara");
    check(smooth(2, 2, 5, true), 2, 2, current, 2e-5);
  }
}

TEST_P(RasterizeSurfelsBackward, HandlesAnyNumberPerTile) {
  for (const int count : {0, 1, 63, 64, 65}) {
    const test::Records c = test::make_surfel_records(33, 20, count, 0.3f, 3, options(false));
    const Cotangent by = Cotangent::random(33, 20);
    const std::vector<float> rows = run(c, 33, 20, by, options(false));
    EXPECT_EQ(rows.size(), kNumbers * c.ids.size());
    EXPECT_TRUE(std::all_of(rows.begin(), rows.end(), [](float v) { return std::isfinite(v); }));
    // The sum over all of w dcolour is that over all pixels of dcolour times alpha.
    double sum = 0, want = 0;
    for (std::size_t i = 0; i < c.ids.size(); ++i) sum += rows[kNumbers * i + 13];
    const ref::SurfelFrame f = ref::blend_surfels(c.records, c.ids, c.starts, 33, 20, options(false));
    for (std::size_t i = 0; i < f.alpha.size(); ++i) want += f.alpha[i] * by.colour[3 * i];
    EXPECT_NEAR(sum, want, 1e-4 * (1 + std::abs(want)));
  }
}

TEST_P(RasterizeSurfelsBackward, TakesWhatIsNoneAsZeros) {
  const int width = 20, height = 33;
  const ref::SurfelOptions o = options(false);
  const test::Records c = test::make_surfel_records(width, height, 20, 0.8f, 4, o);
  const Cotangent all = Cotangent::random(width, height);
  for (std::vector<float> Cotangent::*map :
       {&Cotangent::colour, &Cotangent::alpha, &Cotangent::depth, &Cotangent::normal, &Cotangent::distortion}) {
    Cotangent none = all, zeros = all;
    (none.*map).clear();
    std::fill((zeros.*map).begin(), (zeros.*map).end(), 0.0f);
    EXPECT_EQ(run(c, width, height, none, o), run(c, width, height, zeros, o));
  }
}

TEST_P(RasterizeSurfelsBackward, GivesTheSameBitsAgain) {
  const ref::SurfelOptions o = options(true);
  const test::Records c = test::make_surfel_records(70, 50, 40, 0.6f, 9, o);
  const Cotangent by = Cotangent::random(70, 50);
  const std::vector<float> first = run(c, 70, 50, by, o);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(run(c, 70, 50, by, o), first);
}

// Alpha held at 0.99 does not move with the surfel; its colour, depth and normal do.
TEST_P(RasterizeSurfelsBackward, HoldsAlphaAtItsLimit) {
  test::Records c;
  c.records = {8, 8, 0, 2, 1e-6f, 0, 0, 1e-6f, 0, 0, 50, 50, 1, 1, 1, 1e30f, 0, 0, -1, 1e30f};
  c.ids = {0};
  c.starts = {0, 1};
  Cotangent by;
  by.colour.assign(768, 1.0f), by.depth.assign(256, 2.0f), by.normal.assign(768, 3.0f);
  const std::vector<float> got = run(c, 16, 16, by, options(false));
  EXPECT_EQ(got[0], 0.0f);
  EXPECT_NEAR(got[12], 2 * 256 * 0.99, 1e-3);
  for (std::size_t i = 13; i < 16; ++i) EXPECT_NEAR(got[i], 256 * 0.99, 1e-3);
  for (std::size_t i = 16; i < 19; ++i) EXPECT_NEAR(got[i], 3 * 256 * 0.99, 2e-3);
}

TEST_P(RasterizeSurfelsBackward, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({5, kNumbers});
  Binned b;
  b.ids = ctx().tensor({5}, Type::u32);
  b.starts = ctx().tensor({2}, Type::u32);
  b.slots = ctx().tensor({5}, Type::u32);
  DevicePicture picture = make_picture(ctx(), 16, 16, {true, false, true});
  const auto run_with = [&](const PictureGradient& gradient, const Part& part) {
    rasterize_surfels_backward(ctx(), {p, b, part, background, picture, gradient});
  };
  const Part whole{0, 0, 1, 1};
  EXPECT_THROW(run_with({ctx().tensor({16, 15, 3}), {}, {}}, whole), Error);
  EXPECT_THROW(run_with({{}, {}, {}, {}, ctx().tensor({15, 16})}, whole), Error);
  EXPECT_THROW(run_with({}, Part{1, 0, 2, 1}), Error);
  picture.moments = Tensor();
  EXPECT_THROW(run_with({{}, {}, {}, {}, ctx().tensor({16, 16})}, whole), Error);
  b.slots = ctx().tensor({4}, Type::u32);
  EXPECT_THROW(run_with({}, whole), Error);
}

VSPLAT_FLAVOURS(RasterizeSurfelsBackward);

}  // namespace
}  // namespace vsplat
