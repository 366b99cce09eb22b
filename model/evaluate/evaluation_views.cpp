#include "model/evaluate/evaluation_views.h"

#include <algorithm>
#include <numeric>

#include "model/base/rng.h"
#include "model/data/random.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr int kNovelGroups = 4, kRandomViews = 10;
constexpr std::uint32_t kStream = 0x6576616cu;

bool holds(const std::vector<int>& list, int value) { return std::find(list.begin(), list.end(), value) != list.end(); }

std::vector<int> random_views(std::size_t count, const std::vector<int>& inputs, Random random) {
  std::vector<int> rest;
  for (int i = 0; i < static_cast<int>(count); ++i)
    if (!holds(inputs, i)) rest.push_back(i);
  // The first steps of a shuffle.
  const std::size_t wanted = std::min<std::size_t>(rest.size(), kRandomViews);
  for (std::size_t i = 0; i < wanted; ++i)
    std::swap(rest[i], rest[i + static_cast<std::size_t>(random.below(static_cast<int>(rest.size() - i)))]);
  rest.resize(wanted);
  std::sort(rest.begin(), rest.end());
  return rest;
}

}  // namespace

EvaluationViews evaluation_views(std::span<const Eigen::Vector3d> positions, int inputs, Protocol protocol,
                                 std::uint64_t seed, const std::string& object) {
  EvaluationViews out;
  for (const Group& group : kmeans(positions, inputs)) out.inputs.push_back(group.members.front());
  if (protocol == Protocol::random10)
    out.novel = random_views(positions.size(), out.inputs, Random(seed, stream_of(object), kStream));
  else
    for (const Group& group : kmeans(positions, kNovelGroups))
      if (!holds(out.inputs, group.members.back())) out.novel.push_back(group.members.back());
  if (out.novel.empty())
    fail(Status::input, "object {}: {} views, all of which are inputs: none is left to compare with", object,
         positions.size());
  return out;
}

EvaluationViews evaluation_views_of_parts(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& to_test,
                                          int inputs, Protocol protocol, std::uint64_t seed,
                                          const std::string& object) {
  std::vector<int> train, test;
  std::vector<Eigen::Vector3d> train_positions, test_positions;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    (to_test[i] ? test : train).push_back(static_cast<int>(i));
    (to_test[i] ? test_positions : train_positions).push_back(positions[i]);
  }
  if (train.empty() || test.empty())
    fail(Status::input, "object {}: {} views to train on and {} for tests: some of both are needed", object,
         train.size(), test.size());
  EvaluationViews out;
  for (const Group& group : kmeans(train_positions, inputs))
    out.inputs.push_back(train[static_cast<std::size_t>(group.members.front())]);
  if (protocol == Protocol::random10)
    out.novel = random_views(test.size(), {}, Random(seed, stream_of(object), kStream));
  else
    for (const Group& group : kmeans(test_positions, kNovelGroups)) out.novel.push_back(group.members.back());
  for (int& view : out.novel) view = test[static_cast<std::size_t>(view)];
  return out;
}

int nearest_view(std::span<const Eigen::Vector3d> positions, std::span<const int> views,
                 const Eigen::Vector3d& position, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d direction = (position - centre).stableNormalized();
  int nearest = views.front();
  double most = -2;
  for (const int view : views) {
    const double cosine = (positions[static_cast<std::size_t>(view)] - centre).stableNormalized().dot(direction);
    if (cosine > most) most = cosine, nearest = view;
  }
  return nearest;
}

}  // namespace vsplat
