#include "model/data/drawn_views.h"

#include <algorithm>

#include "model/views/view_choice.h"

namespace vsplat {
namespace {

void shuffle(std::vector<int>& values, Random& random) {
  for (std::size_t i = values.size(); i > 1; --i)
    std::swap(values[i - 1], values[static_cast<std::size_t>(random.below(static_cast<int>(i)))]);
}

int one_of(const std::vector<int>& from, const std::vector<bool>& taken, Random& random) {
  std::vector<int> free;
  for (const int i : from)
    if (!taken[static_cast<std::size_t>(i)]) free.push_back(i);
  return free.empty() ? -1 : free[static_cast<std::size_t>(random.below(static_cast<int>(free.size())))];
}

// Appends `count` views to `out` and marks them as taken; fewer if all are taken.
void draw(std::span<const Eigen::Vector3d> positions, int count, Random& random, std::vector<bool>& taken,
          std::vector<int>& out) {
  const std::vector<Group> groups = kmeans(positions, count);
  std::vector<int> order(groups.size()), all(positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  shuffle(order, random);
  for (int i = 0; i < count; ++i) {
    int view = -1;
    if (static_cast<std::size_t>(i) < order.size())
      view = one_of(groups[static_cast<std::size_t>(order[static_cast<std::size_t>(i)])].members, taken, random);
    if (view < 0) view = one_of(all, taken, random);
    if (view < 0) return;
    taken[static_cast<std::size_t>(view)] = true;
    out.push_back(view);
  }
}

// The first member of each group of a random half of the views that are free, or of all of these if half is too few.
void draw_first(std::span<const Eigen::Vector3d> positions, int count, Random& random, std::vector<bool>& taken,
                std::vector<int>& out) {
  std::vector<int> free;
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (!taken[i]) free.push_back(static_cast<int>(i));
  shuffle(free, random);
  free.resize(std::max(free.size() / 2, std::min(free.size(), static_cast<std::size_t>(2 * count))));
  std::sort(free.begin(), free.end());
  std::vector<Eigen::Vector3d> among;
  among.reserve(free.size());
  for (const int view : free) among.push_back(positions[static_cast<std::size_t>(view)]);
  for (const Group& group : kmeans(among, count)) out.push_back(free[static_cast<std::size_t>(group.members.front())]);
  shuffle(out, random);
  for (const int view : out) taken[static_cast<std::size_t>(view)] = true;
}

// A bijection of 0 .. 2^(2 bits) - 1: a Feistel network with Philox as its round function.
std::uint64_t mixed(std::uint64_t value, int bits, const std::array<std::uint32_t, 2>& key, std::uint32_t round) {
  const std::uint64_t mask = (std::uint64_t{1} << bits) - 1;
  std::uint64_t left = value >> bits, right = value & mask;
  for (std::uint32_t step = 0; step < 6; ++step) {
    const std::uint64_t f = philox4x32_10({static_cast<std::uint32_t>(right), round, order_stream, step}, key)[0];
    left ^= f & mask;
    std::swap(left, right);
  }
  return left << bits | right;
}

}  // namespace

std::uint64_t shuffled(std::uint64_t index, std::uint64_t count, std::uint64_t seed, std::uint32_t round) {
  int bits = 1;
  while ((std::uint64_t{1} << (2 * bits)) < count) ++bits;
  const std::array<std::uint32_t, 2> key = rng_key(seed);
  do index = mixed(index, bits, key, round);
  while (index >= count);  // follows a cycle that started below `count`, so it returns below it
  return index;
}

DrawnViews draw_views(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& excluded, int inputs,
                      int novel, bool first, Random& random) {
  DrawnViews out;
  if (std::count(excluded.begin(), excluded.end(), false) < inputs) return out;
  std::vector<bool> taken = excluded;
  if (first) draw_first(positions, inputs, random, taken, out.inputs);
  if (const int more = inputs - static_cast<int>(out.inputs.size()); more > 0)
    draw(positions, more, random, taken, out.inputs);
  draw(positions, novel, random, taken, out.novel);
  while (static_cast<int>(out.novel.size()) < novel) {
    taken = excluded;
    draw(positions, novel - static_cast<int>(out.novel.size()), random, taken, out.novel);
  }
  return out;
}

}  // namespace vsplat
