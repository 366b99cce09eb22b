#include "model/data/hdf5_objects.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <set>

#include "model/io/archive/hdf5_file.h"
#include "model/io/picture/image_formats.h"
#include "model/io/views/view_checks.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

std::string real_path(const fs::path& path) {
  std::error_code problem;
  const fs::path out = fs::canonical(path, problem);
  return (problem ? path : out).string();
}

// The names in a group.
std::set<std::string> fields_of(const Hdf5File& file, const std::string& group) {
  std::set<std::string> out;
  for (const Hdf5File::Link& link : file.links(group)) out.insert(link.name);
  return out;
}

// One more than the largest I of image_I, c2w_I, fov_I; 0 if there is none.
int count_views(const std::set<std::string>& fields) {
  int count = 0;
  for (const std::string& field : fields)
    for (const std::string stem : {"image_", "c2w_", "fov_"}) {
      if (field.rfind(stem, 0) != 0) continue;
      int index = -1;
      const char* end = field.data() + field.size();
      const auto [last, error] = std::from_chars(field.data() + stem.size(), end, index);
      if (error == std::errc() && last == end && index >= 0 && index < 100'000) count = std::max(count, index + 1);
    }
  return count;
}

ListedView read_view(const Hdf5File& file, const Hdf5Object& object, const std::set<std::string>& fields, int index) {
  // Does not query the file for missing fields, of which there may be a hundred thousand.
  const auto name = [&](const char* field) {
    const std::string wanted = fmt::format("{}_{}", field, index);
    if (fields.count(wanted) == 0) fail(Status::format, "{}: is not there", wanted);
    return object.group + "/" + wanted;
  };
  ListedView view;
  Camera& camera = view.camera;
  view.name = camera.file = fmt::format("image_{}", index);
  view.picture = object.file + "/" + name("image");
  const std::vector<long> shape = file.shape(name("image"));
  if (shape.size() != 3 || shape[2] != 4)
    fail(Status::format, "image_{}: its shape is {}, height x width x 4 is expected", index, shape_text(shape));
  check_image_size(fmt::format("image_{}", index), shape[1], shape[0]);
  camera.height = static_cast<int>(shape[0]), camera.width = static_cast<int>(shape[1]);

  const std::vector<double> pose = file.numbers(name("c2w"), {4, 4}), fov = file.numbers(name("fov"), {2});
  Eigen::Matrix4d c2w;
  for (int i = 0; i < 16; ++i) {
    if (!std::isfinite(pose[i])) fail(Status::input, "c2w_{}: holds {}, finite numbers are expected", index, pose[i]);
    c2w(i / 4, i % 4) = pose[i];
  }
  camera.w2c =
      rigid_inverse(checked_rigid(object.file + ": " + object.group, fmt::format("c2w_{}", index).c_str(), c2w));
  for (const double angle : fov)
    if (!(angle > 1e-4 && angle < 3.14))
      fail(Status::input, "fov_{}: holds {}, angles between 0 and pi (radians) are expected", index, angle);
  camera.fx = 0.5 * camera.width / std::tan(0.5 * fov[0]);
  camera.fy = 0.5 * camera.height / std::tan(0.5 * fov[1]);
  camera.cx = 0.5 * camera.width, camera.cy = 0.5 * camera.height;
  return view;
}

Image read_picture(const Hdf5Object& object, const ListedView& view) {
  const Camera& camera = view.camera;
  const std::vector<std::uint8_t> bytes =
      Hdf5File(object.file).bytes(object.group + "/" + view.name, {camera.height, camera.width, 4});
  Image out(camera.width, camera.height, 4);
  for (std::size_t i = 0; i < bytes.size(); ++i) out.data[i] = static_cast<float>(bytes[i]) / 255.0f;
  return out;
}

}  // namespace

bool is_hdf5_name(const std::string& path) {
  const std::string ending = fs::path(path).extension().string();
  return ending == ".h5" || ending == ".hdf5";
}

std::vector<Hdf5Object> hdf5_objects(const std::vector<std::string>& files) {
  std::set<std::string> given;
  for (const std::string& file : files) given.insert(real_path(file));
  std::vector<Hdf5Object> out;
  for (const std::string& file : files)
    for (const Hdf5File::Link& link : Hdf5File(file).links("/")) {
      if (link.name == "splits") continue;
      const fs::path beside = fs::path(file).parent_path() / link.external;
      if (!link.external.empty() && given.count(real_path(beside)) != 0) continue;
      out.push_back({file, link.name});
    }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.group < b.group; });
  return out;
}

Photographs open_hdf5_object(const Hdf5Object& object,
                             const std::function<void(int view, const std::string& name, const Error& error)>& bad) {
  const Hdf5File file(object.file);
  Photographs out;
  out.set.source = object.file + "/" + object.group;
  out.set.convention = PoseConvention::opencv_c2w;
  const std::set<std::string> fields = fields_of(file, object.group);
  const int views = count_views(fields);
  if (views == 0) fail(Status::format, "{}: has no image_0, c2w_0, fov_0", out.set.source.string());
  for (int i = 0; i < views; ++i) {
    try {
      out.set.views.push_back(read_view(file, object, fields, i));
    } catch (const Error& e) {
      bad(i, fmt::format("image_{}", i), e);
    }
  }
  out.picture = [object, views = out.set.views](int view) { return read_picture(object, views.at(view)); };
  return out;
}

}  // namespace vsplat
