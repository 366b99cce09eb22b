#include "model/data/data_set.h"

#include <algorithm>

#include "model/data/object_names.h"
#include "runtime/error.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr int deepest = 4;

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

std::vector<fs::path> sorted_entries(const fs::path& folder) {
  std::vector<fs::path> out;
  std::error_code problem;
  for (auto at = fs::directory_iterator(folder, problem); !problem && at != fs::directory_iterator();
       at.increment(problem))
    if (at->path().filename().string().front() != '.') out.push_back(at->path());
  if (problem) fail(Status::file, "{}: the folder cannot be read: {}", folder.string(), problem.message());
  std::sort(out.begin(), out.end());
  return out;
}

void find_objects(const fs::path& folder, int depth, std::vector<DataObject>& out) {
  if (holds_views(folder)) {
    out.push_back({folder_name(folder.string()), DataLayout::folder, folder});
    return;
  }
  if (depth == deepest) return;
  std::error_code ignored;
  for (const fs::path& entry : sorted_entries(folder))
    if (fs::is_directory(entry, ignored)) find_objects(entry, depth + 1, out);
}

// What is wrong with a view beyond its pose; intrinsics are filled in.
void check_view(Photographs& photographs, int index) {
  ListedView& view = photographs.set.views[index];
  if (view.picture.empty()) fail(Status::file, "its picture is not there");
  if (view.mask && !is_file(*view.mask)) fail(Status::file, "its mask is not there: {}", view.mask->string());
  view = resolved_view(photographs, index);
}

Photographs listed(const DataObject& object) {
  return {read_views(object.path, {.pictures_dir = {}, .need_pictures = false}), {}};
}

}  // namespace

const char* name_of(DataLayout) { return "folder"; }

bool is_about_data(const Error& error) {
  return error.status() == Status::file || error.status() == Status::format || error.status() == Status::input;
}

DataSet open_data_set(const std::vector<std::string>& paths) {
  DataSet out;
  for (const std::string& path : paths) {
    std::error_code ignored;
    if (!fs::is_directory(path, ignored)) fail(Status::file, "{}: no such folder; a data set is expected", path);
    const std::size_t before = out.objects.size();
    find_objects(path, 0, out.objects);
    if (out.objects.size() == before)
      fail(Status::input,
           "{}: no object in it: folders with transforms.json, cameras.json or a COLMAP model are expected", path);
  }
  std::vector<std::string> names;
  names.reserve(out.objects.size());
  for (const DataObject& object : out.objects) names.push_back(object.name);
  names = numbered(std::move(names));
  for (std::size_t i = 0; i < names.size(); ++i) out.objects[i].name = names[i];
  return out;
}

Photographs open_object(const DataObject& object, std::vector<std::string>* skipped) {
  Photographs all;
  try {
    all = listed(object);
  } catch (const Error& e) {
    fail(e.status(), "object {}: {}", object.name, e.what());
  }
  std::vector<ListedView> good;
  std::string first;
  for (std::size_t i = 0; i < all.set.views.size(); ++i) {
    try {
      check_view(all, static_cast<int>(i));
      good.push_back(all.set.views[i]);
    } catch (const Error& e) {
      const std::string text =
          fmt::format("object {}: view {} ({}): {}", object.name, i, printable(all.set.views[i].name), e.what());
      if (!skipped || !is_about_data(e)) throw Error(e.status(), text);
      skipped->push_back(text);
      if (first.empty()) first = text;
    }
  }
  if (good.empty()) fail(Status::input, "object {}: no view of it is left; {}", object.name, first);
  all.set.views = std::move(good);
  return all;
}

}  // namespace vsplat
