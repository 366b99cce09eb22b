#include "model/data/data_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "model/data/hdf5_objects.h"
#include "model/data/object_names.h"
#include "runtime/fail.h"
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

struct Found {
  fs::path given;
  std::vector<DataObject> objects;
  std::vector<std::string> hdf5_files;
};

void find_objects(const fs::path& folder, int depth, Found& out) {
  if (holds_views(folder)) {
    const bool gso = is_file(folder / "transforms.json") && is_file(folder / "r_000.png");
    out.objects.push_back(
        {folder_name(folder.string()), gso ? DataLayout::gso : DataLayout::folder, folder, {}, out.given});
    return;
  }
  std::error_code ignored;
  for (const fs::path& entry : sorted_entries(folder)) {
    if (is_hdf5_name(entry.string()) && is_file(entry)) out.hdf5_files.push_back(entry.string());
    if (depth < deepest && fs::is_directory(entry, ignored)) find_objects(entry, depth + 1, out);
  }
}

std::vector<DataObject> objects_of(const std::string& path) {
  std::error_code ignored;
  Found found{path, {}, {}};
  if (fs::is_directory(path, ignored)) {
    find_objects(path, 0, found);
  } else if (is_file(path) && is_hdf5_name(path)) {
    found.hdf5_files.push_back(path);
  } else if (is_file(path)) {  // a list of one object's views, under any name
    const fs::path folder = fs::absolute(path, ignored).parent_path();
    found.objects.push_back({folder_name(folder.string()), DataLayout::folder, path, {}, folder});
  } else {
    fail(Status::file, "{}: no such folder, list of views or HDF5 file; a data set is expected", path);
  }
  for (const Hdf5Object& object : hdf5_objects(found.hdf5_files))
    found.objects.push_back({object.group, DataLayout::hdf5, object.file, object.group});
  if (found.objects.empty())
    fail(Status::input,
         "{}: holds no object: folders with transforms.json, cameras.json or a COLMAP model, or HDF5 files in LaRa's "
         "layout, are expected",
         path);
  return std::move(found.objects);
}

using Bad = std::function<void(int view, const std::string& name, const Error& error)>;

// Checks a view beyond its pose, and returns it with all intrinsics.
ListedView checked(const Photographs& photographs, int index) {
  const ListedView& view = photographs.set.views[index];
  need_good(view);
  if (view.picture.empty())
    fail(Status::file, "its picture is missing{}",
         view.name == photographs.set.first_missing ? fmt::format(" ({})", photographs.set.looked_for) : "");
  if (view.mask && !is_file(*view.mask)) fail(Status::file, "its mask is missing: {}", view.mask->string());
  return resolved_view(photographs, index);
}

Photographs open_folder(const DataObject& object, const Bad& bad, std::vector<std::string>* missing, bool to_train_on) {
  ReadOptions how{.need_pictures = false, .bad = BadViews::keep, .all_splits = true, .tell = false};
  if (std::error_code ignored; fs::is_directory(object.given, ignored)) how.roots = {object.given};
  Photographs out{read_views(object.path, how), {}};
  if (to_train_on)
    std::erase_if(out.set.views,
                  [](const ListedView& view) { return view.split == Split::val || view.split == Split::test; });
  if (out.set.views.empty()) fail(Status::input, "has no views to train on: all are for validation or tests");
  std::vector<ListedView> good;
  std::vector<std::string> absent;
  for (std::size_t i = 0; i < out.set.views.size(); ++i) {
    if (missing && out.set.views[i].picture.empty() && out.set.views[i].problem.empty()) {
      absent.push_back(printable(out.set.views[i].name));
      continue;
    }
    try {
      good.push_back(checked(out, static_cast<int>(i)));
    } catch (const Error& e) {
      bad(static_cast<int>(i), out.set.views[i].name, e);
    }
  }
  if (!absent.empty()) {
    missing->push_back(fmt::format("{} of {} listed frames have no picture and are skipped ({} first){}", absent.size(),
                                   out.set.views.size(), absent.front(),
                                   out.set.looked_for.empty() ? "" : "; " + out.set.looked_for));
    if (good.empty()) fail(Status::input, "{}", missing->back());
  }
  out.set.views = std::move(good);
  return out;
}

}  // namespace

const char* name_of(DataLayout layout) {
  switch (layout) {
    case DataLayout::gso:
      return "gso";
    case DataLayout::hdf5:
      return "hdf5";
    default:
      return "folder";
  }
}

bool is_about_data(const Error& error) {
  return error.status() == Status::file || error.status() == Status::format || error.status() == Status::input;
}

std::string label_of(const DataObject& object) {
  return object.layout == DataLayout::hdf5 ? fmt::format("object {} of {}", object.name, object.path.string())
                                           : "object " + object.name;
}

DataSet open_data_set(const std::vector<std::string>& paths) {
  DataSet out;
  for (const std::string& path : paths)
    for (DataObject& object : objects_of(path)) out.objects.push_back(std::move(object));
  std::vector<std::string> names;
  names.reserve(out.objects.size());
  for (const DataObject& object : out.objects) names.push_back(object.name);
  names = numbered(std::move(names));
  for (std::size_t i = 0; i < names.size(); ++i) out.objects[i].name = names[i];
  return out;
}

Photographs open_object(const DataObject& object, std::vector<std::string>* skipped, std::vector<std::string>* missing,
                        bool to_train_on) {
  std::string first;
  const Bad bad = [&](int view, const std::string& name, const Error& e) {
    const std::string text = fmt::format("view {} ({}): {}", view, printable(name), e.what());
    if (!skipped || !is_about_data(e)) throw Error(e.status(), text);
    skipped->push_back(fmt::format("{}: {}", label_of(object), text));
    if (first.empty()) first = text;
  };
  try {
    Photographs out = object.layout == DataLayout::hdf5 ? open_hdf5_object({object.path.string(), object.group}, bad)
                                                        : open_folder(object, bad, missing, to_train_on);
    if (out.set.views.empty()) fail(Status::input, "no view of it is left; {}", first);
    if (object.layout != DataLayout::folder) {  // LaRa's objects are in this cube
      if (!out.set.aabb_center) out.set.aabb_center = Eigen::Vector3d::Zero();
      if (!out.set.aabb_half) out.set.aabb_half = 0.5;
    }
    return out;
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", label_of(object), e.what());
  }
}

}  // namespace vsplat
