#include "model/views/view_choice.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <numeric>
#include <utility>

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Tolerance for ties: distances that differ only by rounding, which depends on the world's origin. The first camera
// wins.
constexpr double kTie = 1e-6;  // of a squared distance

std::vector<int> farthest_first(std::span<const Eigen::Vector3d> p, int k) {
  std::vector<int> out = {0};
  std::vector<double> apart(p.size(), std::numeric_limits<double>::infinity());
  while (static_cast<int>(out.size()) < k) {
    int next = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      apart[i] = std::min(apart[i], (p[i] - p[out.back()]).squaredNorm());
      if (apart[i] > (1 + kTie) * apart[next]) next = static_cast<int>(i);
    }
    if (apart[next] == 0) break;
    out.push_back(next);
  }
  return out;
}

// The names that match a view, the closest to the listing first.
std::vector<std::string> names_of(const ListedView& view) {
  const fs::path path = fs::path(view.name).lexically_normal();
  return {view.name, path.string(), fs::path(path).replace_extension().string(), path.filename().string(),
          path.stem().string()};
}

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 1; j <= b.size(); ++j)
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])}));
  }
  return row[b.size()];
}

std::string suggestions(const ViewSet& set, const std::string& name) {
  std::vector<std::pair<std::size_t, std::string>> near;
  if (name.size() > 255) return "";
  for (const ListedView& view : set.views) {
    if (view.picture.empty()) continue;
    const std::vector<std::string> names = names_of(view);
    std::size_t best = std::numeric_limits<std::size_t>::max();
    for (const std::string& n : names)
      if (n.size() <= 255) best = std::min(best, edit_distance(name, n));
    if (best <= std::max<std::size_t>(2, name.size() / 3)) near.emplace_back(best, view.name);
  }
  std::stable_sort(near.begin(), near.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  if (near.size() > 3) near.resize(3);
  std::string out;
  for (const auto& [distance, n] : near) out += (out.empty() ? "; near it: " : ", ") + n;
  return out;
}

int find_view(const ViewSet& set, const std::string& name, Option option) {
  const int count = static_cast<int>(set.views.size());
  if (name.size() > 1 && name[0] == '@') {
    int index = -1;
    const auto [end, error] = std::from_chars(name.data() + 1, name.data() + name.size(), index);
    if (error != std::errc() || end != name.data() + name.size() || index < 0 || index >= count)
      fail(Status::usage, "{} {}: {} lists {} views, @0 to @{}", option, name, set.source.string(), count, count - 1);
    return index;
  }
  const std::string normal = fs::path(name).lexically_normal().string();
  for (std::size_t level = 0; level < 5; ++level) {
    std::vector<int> found;
    for (int i = 0; i < count; ++i)
      if (names_of(set.views[i])[level] == (level == 0 ? name : normal)) found.push_back(i);
    if (found.size() == 1) return found[0];
    if (found.size() > 1)
      fail(Status::usage,
           "{} {}: {} views of {} have that name: {} (@{}) and {} (@{}); give the path as listed, or @INDEX", option,
           name, found.size(), set.source.string(), set.views[found[0]].name, found[0], set.views[found[1]].name,
           found[1]);
  }
  fail(Status::usage, "{} {}: no such view among the {} that {} lists{}", option, name, count, set.source.string(),
       suggestions(set, name));
}

std::vector<int> named_views(const ViewSet& set, const std::vector<std::string>& names, Option option) {
  std::vector<int> out;
  for (const std::string& name : names) {
    const int index = find_view(set, name, option);
    need_good(set.views[index]);
    if (set.views[index].picture.empty())
      fail(Status::usage, "{} {}: {} lists {} but its picture is not there", option, name, set.source.string(),
           set.views[index].name);
    if (std::find(out.begin(), out.end(), index) != out.end())
      fail(Status::usage, "{} {}: {} is named twice", option, name, set.views[index].name);
    out.push_back(index);
  }
  return out;
}

std::vector<int> with_pictures(const ViewSet& set) {
  std::vector<int> out;
  for (std::size_t i = 0; i < set.views.size(); ++i) {
    if (!set.leaves_out_bad) need_good(set.views[i]);
    if (!set.views[i].picture.empty()) out.push_back(static_cast<int>(i));
  }
  if (out.empty()) fail(Status::input, "{}: no view is left that has a picture", set.source.string());
  return out;
}

// Error(file) if a view lists a mask that does not exist.
void need_masks(const ViewSet& set, const std::vector<int>& views) {
  std::error_code error;
  for (const int i : views)
    if (const auto& mask = set.views[i].mask; mask && !fs::is_regular_file(*mask, error))
      fail(Status::file,
           "{}: no such file; it is the mask of {}{}{}: make the masks that are missing, or {} to use none, or leave "
           "these pictures out ({})",
           mask->string(), set.views[i].name, set.masks_found.empty() ? "" : "; ", set.masks_found,
           set.lists_masks ? "take mask_path out of the list" : "give the folder of masks another name",
           Option::skip_bad_views);
}

void tell_left_over(std::size_t used, int found) {
  if (used < max_views)
    info("{} of {} pictures used; {} {} uses more", used, found, Option::view_count, std::min(found, max_views));
  else
    info("{} of {} pictures used, as many as the network takes", used, found);
}

}  // namespace

std::vector<Group> kmeans(std::span<const Eigen::Vector3d> p, int k) {
  if (p.empty()) return {};
  std::vector<Group> groups;
  for (const int seed : farthest_first(p, k)) groups.push_back({{}, p[seed]});
  std::vector<int> of(p.size(), -1);
  bool changed = true;
  for (int step = 0; changed && step < 1000; ++step) {  // limits the steps, because rounding could cause an endless
                                                        // cycle
    changed = false;
    for (std::size_t i = 0; i < p.size(); ++i) {
      int best = 0;
      for (std::size_t g = 1; g < groups.size(); ++g)
        if ((p[i] - groups[g].mean).squaredNorm() < (1 - kTie) * (p[i] - groups[best].mean).squaredNorm())
          best = static_cast<int>(g);
      changed |= of[i] != best;
      of[i] = best;
    }
    for (Group& g : groups) g.members.clear();
    for (std::size_t i = 0; i < p.size(); ++i) groups[of[i]].members.push_back(static_cast<int>(i));
    for (Group& g : groups) {
      if (g.members.empty()) continue;  // keeps its mean
      g.mean.setZero();
      for (const int i : g.members) g.mean += p[i];
      g.mean /= static_cast<double>(g.members.size());
    }
  }
  std::erase_if(groups, [](const Group& g) { return g.members.empty(); });
  std::sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) { return a.members[0] < b.members[0]; });
  return groups;
}

std::vector<int> nearest_members(std::span<const Eigen::Vector3d> p, std::span<const Group> groups) {
  std::vector<int> out;
  for (const Group& g : groups) {
    int best = g.members[0];
    for (const int i : g.members)
      if ((p[i] - g.mean).squaredNorm() < (1 - kTie) * (p[best] - g.mean).squaredNorm()) best = i;
    out.push_back(best);
  }
  return out;
}

std::vector<int> spread_views(const ViewSet& set, std::span<const int> among, int wanted) {
  if (static_cast<int>(among.size()) <= wanted) return {among.begin(), among.end()};
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(among.size());
  for (const int i : among) positions.push_back(set.views[i].camera.centre());
  std::vector<int> out = nearest_members(positions, kmeans(positions, wanted));
  for (int i = 0; static_cast<int>(out.size()) < wanted; ++i)  // several views at one place
    if (std::find(out.begin(), out.end(), i) == out.end()) out.push_back(i);
  for (int& i : out) i = among[i];
  return out;
}

std::vector<int> choose_views(const ViewSet& set, const ViewRequest& request) {
  if (request.names.empty() && (request.wanted < 1 || request.wanted > max_views))
    fail(Status::usage, "{} is {}, the network takes 1 to {}", Option::view_count, request.wanted, max_views);
  if (request.names.size() > max_views)
    fail(Status::usage, "{} has {} views, the network takes 1 to {}", Option::views, request.names.size(), max_views);
  if (!request.names.empty()) return listed_views(set, request.names);
  const std::vector<int> all = with_pictures(set);
  std::vector<int> out = spread_views(set, all, request.wanted);
  const int found = static_cast<int>(all.size());
  if (found > request.wanted)
    tell_left_over(out.size(), found);
  else if (found < request.least)
    warn("{}: {} views have a picture, {} are expected: these are used", set.source.string(), found, request.least);
  need_masks(set, out);
  return out;
}

std::vector<int> listed_views(const ViewSet& set, const std::vector<std::string>& names, Option option) {
  std::vector<int> out = names.empty() ? with_pictures(set) : named_views(set, names, option);
  need_masks(set, out);
  return out;
}

}  // namespace vsplat
