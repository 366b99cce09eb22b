#include "model/ops/fit/loss.h"

#include "model/diagnose/selftest/inputs/smooth_pictures.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using selftest::smooth_pictures;

// Some beyond 0 and 1.
std::vector<float> noisy(const std::vector<float>& target, float noise, std::uint32_t seed) {
  auto out = test::random_floats(target.size(), seed, -noise, noise);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += target[i];
  return out;
}

struct Kind {
  ErrorKind error = ErrorKind::squared;
  SimilarityKind similarity = SimilarityKind::automatic;
};

class Loss : public test::FlavourTest {
 protected:
  struct Result {
    std::vector<float> out, gradient;
  };

  Result run(const std::vector<float>& pictures, const std::vector<float>& target, long h, long w, float weight = 0.5f,
             const Kind& kind = {}, long band_pixels = 1L << 20) {
    const Shape shape = {static_cast<long>(pictures.size()) / (h * w * 3), h, w, 3};
    PictureLoss a{ctx().upload(shape, pictures), ctx().upload(shape, target), weight, ctx().upload({3}, test::nans(3)),
                  ctx().upload(shape, test::nans(pictures.size()))};
    a.error = kind.error, a.similarity = kind.similarity, a.band_pixels = band_pixels;
    picture_loss(ctx(), a);
    Result result{ctx().read<float>(a.out), ctx().read<float>(a.dpictures)};
    a.dpictures = {};
    a.out = ctx().upload({3}, test::nans(3));
    picture_loss(ctx(), a);
    EXPECT_EQ(ctx().read<float>(a.out), result.out) << "without the gradient";
    return result;
  }
};
VSPLAT_FLAVOURS(Loss);
VSPLAT_OPERATION(Loss, loss)

// A large picture is computed in bands. The last has all its windows in the one before, or is shorter than a window.
TEST_P(Loss, BandsHaveTheGradientOfTheWhole) {
  for (const auto& [h, w] : {std::array<long, 2>{132, 40}, {203, 33}, {97, 11}})
    for (const SimilarityKind similarity : {SimilarityKind::single_scale, SimilarityKind::none})
      for (const ErrorKind error : {ErrorKind::squared, ErrorKind::absolute}) {
        const auto target = smooth_pictures(1, h, w), pictures = noisy(target, 0.4f, 17);
        const Kind kind{error, similarity};
        const Result whole = run(pictures, target, h, w, 0.3f, kind),
                     bands = run(pictures, target, h, w, 0.3f, kind, 1);
        EXPECT_EQ(bands.gradient, whole.gradient) << h << " x " << w;
        EXPECT_TRUE(test::close(bands.out, std::vector<double>(whole.out.begin(), whole.out.end()), 1e-6));
      }
}

TEST_P(Loss, BandsTakeLessMemory) {
  const long h = 1200, w = 1000;
  const auto planned = [&](long band_pixels) {
    const auto planner = ctx().planner();
    const Tensor picture = planner->tensor({1, h, w, 3});
    PictureLoss a{picture, picture, 0.2f, planner->tensor({3}), picture};
    a.similarity = SimilarityKind::single_scale, a.band_pixels = band_pixels;
    const std::size_t before = planner->memory().live();
    picture_loss(*planner, a);
    return static_cast<double>(planner->memory().peak_live() - before) / static_cast<double>(picture.bytes());
  };
  EXPECT_LT(planned(100 * w), 1.6);
  EXPECT_GT(planned(h * w), 9);
}

// loss() of the PyTorch specification and autograd, in float64.
TEST_P(Loss, MatchesPyTorch) {
  struct LossCase {
    long n, h, w;
    double loss, similarity, norm;
    std::vector<std::size_t> at;
    std::vector<double> slopes;
  };
  const LossCase cases[] = {{2,
                             13,
                             24,
                             0.0273964149,
                             0.959030217,
                             0.0220792904,
                             {0, 1, 267, 624, 937, 1253, 1871},
                             {0, -0.000146115, 0.0003496026, 0.0001799104, -4.741943e-05, 0, 2.298644e-05}},
                            {2,
                             161,
                             174,
                             0.0954331726,
                             0.823007416,
                             0.00918075313,
                             {0, 1, 24012, 56028, 84043, 112061, 168083},
                             {0, -1.627129e-06, 8.58379e-07, 2.723843e-05, 0, -4.033372e-06, 1.448386e-06}}};
  for (const LossCase& c : cases) {
    std::vector<float> target, pictures;
    for (long i = 0; i < c.n * c.h * c.w * 3; ++i) {
      target.push_back(static_cast<float>(i * 7919 % 1009) / 1009.0f);
      pictures.push_back(target.back() + 0.3f * (static_cast<float>(i * 104729 % 997) / 997.0f - 0.5f));
    }
    const Result got = run(pictures, target, c.h, c.w);
    EXPECT_NEAR(got.out[0], c.loss, 1e-6);
    EXPECT_NEAR(got.out[2], c.similarity, 1e-6);
    std::vector<float> slopes;
    slopes.reserve(c.at.size());
    double squares = 0;
    for (const std::size_t at : c.at) slopes.push_back(got.gradient[at]);
    for (const float g : got.gradient) squares += static_cast<double>(g) * static_cast<double>(g);
    EXPECT_TRUE(test::close(slopes, c.slopes, 1e-5)) << c.h << " x " << c.w;
    EXPECT_NEAR(std::sqrt(squares), c.norm, 1e-5 * c.norm);
  }
}

TEST_P(Loss, EqualPicturesHaveNone) {
  for (const long h : {20L, 165L}) {
    const auto target = smooth_pictures(1, h, h);
    const Result got = run(target, target, h, h);
    EXPECT_EQ(got.out, (std::vector<float>{0, 0, 1}));
    EXPECT_EQ(got.gradient, std::vector<float>(target.size(), 0.0f));
    for (const SimilarityKind similarity : {SimilarityKind::single_scale, SimilarityKind::none}) {
      const Result other = run(target, target, h, h, 0.5f, {ErrorKind::absolute, similarity});
      EXPECT_EQ(other.out, (std::vector<float>{0, 0, similarity == SimilarityKind::none ? 0.0f : 1.0f}));
      EXPECT_EQ(other.gradient, got.gradient) << "an absolute error of 0 has no slope";
    }
  }
}

// Beyond white is white: no loss, and nothing that pulls it back.
TEST_P(Loss, ClampsFirst) {
  const std::vector<float> white(16 * 16 * 3, 1.0f), beyond(16 * 16 * 3, 1.5f), below(16 * 16 * 3, -0.5f);
  Result got = run(beyond, white, 16, 16);
  EXPECT_EQ(got.out, (std::vector<float>{0, 0, 1}));
  got = run(below, white, 16, 16);
  EXPECT_NEAR(got.out[1], 1, 1e-7);
  EXPECT_EQ(got.gradient, std::vector<float>(white.size(), 0.0f));
  got = run(std::vector<float>(white.size(), 0.0f), white, 16, 16);  // the ends of the interval count
  for (const float g : got.gradient) EXPECT_LT(g, 0);
  for (const SimilarityKind similarity : {SimilarityKind::automatic, SimilarityKind::none}) {
    got = run(below, white, 16, 16, 0.5f, {ErrorKind::absolute, similarity});
    EXPECT_NEAR(got.out[1], 1, 1e-7);
    EXPECT_EQ(got.gradient, std::vector<float>(white.size(), 0.0f));
  }
}

// Contrast turned round at every scale: similarity 0, and the gradient is that of the squares.
TEST_P(Loss, NegativeSimilarityOfScalesCountsAsZero) {
  const auto target = test::random_floats(161 * 161 * 3, 10, 0, 1);
  auto pictures = target;
  for (float& x : pictures) x = 1 - x;
  const Result got = run(pictures, target, 161, 161);
  EXPECT_EQ(got.out[2], 0.0f);
  std::vector<double> want;
  for (std::size_t i = 0; i < target.size(); ++i)
    want.push_back(2.0 * (static_cast<double>(pictures[i]) - static_cast<double>(target[i])) /
                   static_cast<double>(target.size()));
  EXPECT_TRUE(test::close(got.gradient, want, 1e-6));
}

// Pictures one by one, each for its share, as a training does that draws them one by one.
TEST_P(Loss, OneByOneWithAScaleIsAllTogether) {
  for (const long edge : {17L, 165L}) {
    const auto target = smooth_pictures(2, edge, edge);
    const auto pictures = noisy(target, 0.2f, 5);
    const Result all = run(pictures, target, edge, edge);
    const std::size_t half = target.size() / 2;
    std::vector<float> gradient;
    double loss = 0;
    for (const std::size_t first : {std::size_t{0}, half}) {
      const auto part = [&](const std::vector<float>& x) {
        const auto from = x.begin() + static_cast<std::ptrdiff_t>(first);
        return ctx().upload({1, edge, edge, 3}, std::vector<float>(from, from + static_cast<std::ptrdiff_t>(half)));
      };
      PictureLoss a{part(pictures), part(target), 0.5f, ctx().tensor({3}), ctx().tensor({1, edge, edge, 3}), 0.5f};
      picture_loss(ctx(), a);
      loss += 0.5 * static_cast<double>(ctx().read<float>(a.out)[0]);
      for (const float v : ctx().read<float>(a.dpictures)) gradient.push_back(v);
    }
    EXPECT_NEAR(loss, all.out[0], 1e-6);
    EXPECT_TRUE(test::close(gradient, all.gradient, 1e-5));
  }
}

TEST_P(Loss, NanStaysNan) {
  const Shape shape = {1, 15, 15, 3};
  const auto target = smooth_pictures(1, 15, 15);
  auto pictures = target;
  pictures[300] = test::nans(1)[0];
  for (const ErrorKind error : {ErrorKind::squared, ErrorKind::absolute})
    for (const SimilarityKind similarity :
         {SimilarityKind::automatic, SimilarityKind::single_scale, SimilarityKind::none}) {
      PictureLoss a{ctx().upload(shape, pictures), ctx().upload(shape, target), 0.5f, ctx().tensor({3}),
                    ctx().tensor(shape)};
      a.error = error, a.similarity = similarity;
      picture_loss(ctx(), a);
      EXPECT_TRUE(std::isnan(ctx().read<float>(a.out)[0]));
      EXPECT_TRUE(std::isnan(ctx().read<float>(a.dpictures)[300]));
    }
}

TEST_P(Loss, RejectsWhatDoesNotFit) {
  const Tensor good = ctx().tensor({1, 11, 12, 3}), low = ctx().tensor({1, 10, 12, 3}), three = ctx().tensor({3});
  const Tensor none = ctx().tensor({0, 11, 12, 3}), grey = ctx().tensor({1, 11, 12, 1});
  EXPECT_THROW(picture_loss(ctx(), {good, low, 0.5f, three, {}}), Error);
  EXPECT_THROW(picture_loss(ctx(), {good, good, 0.5f, good, {}}), Error);
  EXPECT_THROW(picture_loss(ctx(), {good, good, 0.5f, three, low}), Error);
  EXPECT_THROW(picture_loss(ctx(), {low, low, 0.5f, three, {}}), Error);
  EXPECT_THROW(picture_loss(ctx(), {none, none, 0.5f, three, {}}), Error);
  EXPECT_THROW(picture_loss(ctx(), {grey, grey, 0.5f, three, {}}), Error);
  PictureLoss alone{none, none, 0.5f, three, {}, 1, ErrorKind::squared, SimilarityKind::none};
  EXPECT_THROW(picture_loss(ctx(), alone), Error);
  alone.pictures = alone.target = ctx().tensor({1, 0, 12, 3});
  EXPECT_THROW(picture_loss(ctx(), alone), Error);
}

}  // namespace
}  // namespace vsplat
