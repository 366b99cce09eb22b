#include "model/evaluate/evaluation_views.h"

#include <algorithm>
#include <numeric>

#include "model/base/rng.h"
#include "model/data/random.h"
#include "model/input/view_choice.h"
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
