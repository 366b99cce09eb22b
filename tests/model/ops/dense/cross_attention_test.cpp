#include "model/ops/dense/cross_attention.h"

#include <fmt/format.h>

#include <array>
#include <numeric>

#include "model/diagnose/selftest/reference/cross_attention.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

struct CrossAttentionCase {
  long groups, l, s, heads, width;
  bool mapped;  // rows of a group are anywhere, else one after the other
};

std::string text_of(const CrossAttentionCase& c) {
  return fmt::format("{} groups of {} and {}, {} x {}{}", c.groups, c.l, c.s, c.heads, c.width,
                     c.mapped ? " mapped" : "");
}

class CrossAttention : public test::FlavourTest {
 protected:
  void make(const CrossAttentionCase& c, float spread) {
    const auto rows = [&](long n, std::uint32_t seed, float most) {
      return test::random_floats(static_cast<std::size_t>(n * c.heads * c.width), seed, -most, most);
    };
    q_ = rows(c.groups * c.l, 1, spread), k_ = rows(c.groups * c.s, 2, spread), v_ = rows(c.groups * c.s, 3, 1);
    dout_ = rows(c.groups * c.l, 4, 1);
    want_ = {};
    want_.heads = static_cast<std::size_t>(c.heads), want_.width = static_cast<std::size_t>(c.width);
    want_.q.assign(q_.begin(), q_.end()), want_.k.assign(k_.begin(), k_.end()), want_.v.assign(v_.begin(), v_.end());
    in_ = {};
    in_.heads = c.heads;
    in_.groups.l = c.l, in_.groups.s = c.s;
    want_.queries = lists(c.groups, c.l, c.mapped, in_.groups.queries);
    want_.keys = lists(c.groups, c.s, c.mapped, in_.groups.keys);
    const auto upload = [&](const std::vector<float>& x) {
      return ctx().upload({static_cast<long>(x.size()) / (c.heads * c.width), c.heads * c.width}, x);
    };
    in_.q = upload(q_), in_.k = upload(k_), in_.v = upload(v_);
    in_.out = upload(test::nans(q_.size()));
    in_.stats = ctx().upload({c.groups * c.l, c.heads}, test::nans(static_cast<std::size_t>(c.groups * c.l * c.heads)));
  }

  // Every row in one group; the order is turned round where they are mapped, so that a map that is not used shows.
  std::vector<std::vector<int>> lists(long groups, long each, bool mapped, Tensor& map) {
    std::vector<int> rows(static_cast<std::size_t>(groups * each));
    std::iota(rows.begin(), rows.end(), 0);
    if (mapped) {
      std::shuffle(rows.begin(), rows.end(), std::mt19937(7));
      map = ctx().upload({groups, each}, rows, Type::i32);
    }
    std::vector<std::vector<int>> out;
    for (auto at = rows.begin(); at != rows.end(); at += each) out.emplace_back(at, at + each);
    return out;
  }

  void check_backward() {
    const Tensor dout = ctx().upload(in_.q.shape(), dout_);
    const auto gap = [&](const Tensor& x) {
      return ctx().upload(x.shape(), test::nans(static_cast<std::size_t>(x.count())));
    };
    const Tensor dq = gap(in_.q), dk = gap(in_.k), dv = gap(in_.v);
    cross_attention_backward(ctx(), {in_.q, in_.k, in_.v, in_.heads, in_.groups, in_.out, in_.stats, dout, dq, dk, dv});
    // A softmax of one key, whose weight is 1 whatever it is, has no gradient by queries and keys.
    const bool one = want_.keys[0].size() == 1;
    const auto expect = [&](const Tensor& got, std::vector<double> want) {
      if (one) std::fill(want.begin(), want.end(), 0.0);
      EXPECT_TRUE(test::close(ctx().read<float>(got), want, 1e-5, one));
    };
    expect(dq, want_.gradient(&ref::CrossAttentionCase::q, dout_));
    expect(dk, want_.gradient(&ref::CrossAttentionCase::k, dout_));
    EXPECT_TRUE(test::close(ctx().read<float>(dv), want_.gradient(&ref::CrossAttentionCase::v, dout_), 1e-5));
  }

  std::vector<float> q_, k_, v_, dout_;
  ref::CrossAttentionCase want_;
  CrossAttentionForward in_;
};
VSPLAT_FLAVOURS(CrossAttention);
VSPLAT_OPERATION(CrossAttention, cross_attention)

TEST_P(CrossAttention, OneKeyHasAllTheWeight) {
  for (const CrossAttentionCase& c : {CrossAttentionCase{1, 1, 1, 1, 1, false}, {5, 2, 1, 1, 17, true}}) {
    SCOPED_TRACE(text_of(c));
    make(c, 1);
    cross_attention_forward(ctx(), in_);
    EXPECT_TRUE(test::close(ctx().read<float>(in_.out), want_.forward(), 1e-6));
    check_backward();
  }
}

// What comes without statistics is the same.
TEST_P(CrossAttention, WithoutStatistics) {
  const CrossAttentionCase c{211, 8, 4, 4, 4, true};
  make(c, 1);
  cross_attention_forward(ctx(), in_);
  const auto got = ctx().read<float>(in_.out);
  in_.stats = {};
  in_.out = ctx().upload(in_.out.shape(), test::nans(got.size()));
  cross_attention_forward(ctx(), in_);
  EXPECT_EQ(ctx().read<float>(in_.out), got);
}

// As in the ray predictor's windows: each key is in several groups, at a different position each time, and some are
// masked.
TEST_P(CrossAttention, KeysOfSeveralGroupsAndStrangers) {
  for (const auto& [groups, l, keys, each, width] :
       {std::array<long, 5>{3, 2, 4, 2, 3}, {4, 7, 13, 3, 17}, {2, 3, 5, 2, 16}, {5, 1, 3, 4, 8}}) {
    SCOPED_TRACE(fmt::format("{} groups, {} queries, {} keys in {} groups, {} wide", groups, l, keys, each, width));
    if (keys * each % groups != 0) continue;
    const long s = keys * each / groups;
    make({groups, l, s, 1, width, true}, 1);
    std::vector<int> rows(static_cast<std::size_t>(groups * s)), places(rows.size()), query_parts, key_parts;
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(i / static_cast<std::size_t>(each));
    std::shuffle(rows.begin(), rows.end(), std::mt19937(3));
    std::vector<std::size_t> found(static_cast<std::size_t>(keys), 0);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto key = static_cast<std::size_t>(rows[i]);
      places[key * static_cast<std::size_t>(each) + found[key]++] = static_cast<int>(i);
    }
    for (long i = 0; i < groups * l; ++i) query_parts.push_back(static_cast<int>(i % 3));
    for (long i = 0; i < groups * s; ++i) key_parts.push_back(static_cast<int>(i * 7 % 3));
    in_.groups.keys = ctx().upload({groups, s}, rows, Type::i32);
    in_.groups.places = ctx().upload({keys, each}, places, Type::i32);
    in_.groups.query_parts = ctx().upload({groups, l}, query_parts, Type::i32);
    in_.groups.key_parts = ctx().upload({groups, s}, key_parts, Type::i32);
    k_.resize(static_cast<std::size_t>(keys * width)), v_.resize(k_.size());
    in_.k = ctx().upload({keys, width}, k_), in_.v = ctx().upload({keys, width}, v_);
    want_.k.assign(k_.begin(), k_.end()), want_.v.assign(v_.begin(), v_.end());
    want_.keys.clear();
    for (long g = 0; g < groups; ++g) {
      want_.keys.emplace_back(rows.begin() + g * s, rows.begin() + (g + 1) * s);
      want_.query_parts.emplace_back(query_parts.begin() + g * l, query_parts.begin() + (g + 1) * l);
      want_.key_parts.emplace_back(key_parts.begin() + g * s, key_parts.begin() + (g + 1) * s);
    }
    cross_attention_forward(ctx(), in_);
    EXPECT_TRUE(test::close(ctx().read<float>(in_.out), want_.forward(), 1e-6));
    check_backward();
  }
}

// Scores whose exponentials no float holds, the largest first, last and between.
TEST_P(CrossAttention, LargeScores) {
  make({40, 3, 5, 2, 6, false}, 20);
  cross_attention_forward(ctx(), in_);
  EXPECT_TRUE(test::close(ctx().read<float>(in_.out), want_.forward(), 1e-4));
}

TEST_P(CrossAttention, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0, 6}), x = ctx().tensor({4, 6}), y = ctx().tensor({8, 6});
  cross_attention_forward(ctx(), {none, none, none, 2, {{}, {}, 1, 4}, none, {}});
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 4, {{}, {}, 1, 2}, x, {}}), Error) << "6 channels in 4 heads";
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, {{}, {}, 1, 3}, x, {}}), Error) << "8 keys in threes";
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, x, 2, {{}, {}, 1, 2}, x, {}}), Error);
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, {{}, {}, 1, 2}, y, {}}), Error);
  const Tensor places = ctx().upload({8, 2}, std::vector<int>(16), Type::i32);
  AttentionGroups shared{{}, {}, 1, 4, places, {}, {}};
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, shared, x, {}}), Error) << "places without a map";
  shared = {{}, {}, 1, 2, {}, ctx().upload({4, 1}, std::vector<int>(4), Type::i32), {}};
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, shared, x, {}}), Error) << "parts of queries alone";
  const Tensor stats = ctx().tensor({4, 2});
  EXPECT_THROW(cross_attention_backward(ctx(), {x, y, y, 2, {{}, {}, 1, 2}, x, stats, x, x, x, y}), Error);
}

}  // namespace
}  // namespace vsplat
