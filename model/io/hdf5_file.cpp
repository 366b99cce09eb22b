#include "model/io/hdf5_file.h"

#include <hdf5.h>

#include <algorithm>
#include <filesystem>
#include <mutex>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

// The library as Debian builds it may be used by one thread at a time. While this lives, that is ours, and the library
// prints nothing of its own.
class Library {
 public:
  Library() : lock_(mutex()) {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Library() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  std::lock_guard<std::mutex> lock_;
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

// A handle of the library's, closed at the end.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  hid_t id() const { return id_; }
  bool good() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// What the library says is wrong: the innermost of its messages.
std::string reason() {
  std::string text;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* error, void* out) -> herr_t {
        auto& first = *static_cast<std::string*>(out);
        if (first.empty() && error->desc) first = error->desc;
        return 0;
      },
      &text);
  return text.empty() ? "no reason given" : printable(text);
}

std::string place(const std::string& path, const std::string& in_file) { return path + ": " + printable(in_file); }

std::vector<long> shape_of(const Handle& dataset, const std::string& where) {
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const int sides = space.good() ? H5Sget_simple_extent_ndims(space.id()) : -1;
  if (sides < 0 || sides > 8) fail(Status::format, "{}: an array of at most 8 sides is expected", where);
  hsize_t size[8] = {};
  if (H5Sget_simple_extent_dims(space.id(), size, nullptr) < 0)
    fail(Status::format, "{}: its shape cannot be read: {}", where, reason());
  std::vector<long> out;
  out.reserve(8);
  for (int i = 0; i < sides; ++i) out.push_back(static_cast<long>(std::min<hsize_t>(size[i], hsize_t{1} << 62)));
  return out;
}

Handle open_dataset(std::int64_t file, const std::string& dataset, const std::string& where) {
  const hid_t id = H5Dopen2(file, dataset.c_str(), H5P_DEFAULT);
  if (id < 0) fail(Status::format, "{}: is not there, or is no array: {}", where, reason());
  return {id, H5Dclose};
}

enum class Kind { bytes, numbers };

// Into `out`, which has room for what `shape` says.
void read_all(std::int64_t file, const std::string& dataset, const std::string& where, const std::vector<long>& shape,
              Kind kind, void* out) {
  const Handle data = open_dataset(file, dataset, where);
  const std::vector<long> found = shape_of(data, where);
  if (found != shape)
    fail(Status::format, "{}: its shape is {}, {} is expected", where, shape_text(found), shape_text(shape));
  const Handle type(H5Dget_type(data.id()), H5Tclose);
  const H5T_class_t is = type.good() ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  const bool fits = kind == Kind::bytes
                        ? is == H5T_INTEGER && H5Tget_size(type.id()) == 1 && H5Tget_sign(type.id()) == H5T_SGN_NONE
                        : is == H5T_INTEGER || is == H5T_FLOAT;
  if (!fits)
    fail(Status::format, "{}: {} are expected, it holds something else", where,
         kind == Kind::bytes ? "unsigned integers of 8 bits" : "numbers");
  const hid_t as = kind == Kind::bytes ? H5T_NATIVE_UINT8 : H5T_NATIVE_DOUBLE;
  if (H5Dread(data.id(), as, H5S_ALL, H5S_ALL, H5P_DEFAULT, out) < 0)
    fail(Status::format, "{}: cannot be read: {}", where, reason());
}

std::size_t count_of(const std::vector<long>& shape) {
  std::size_t count = 1;
  for (const long side : shape) count *= static_cast<std::size_t>(side);
  return count;
}

// The file that an external link leads to.
std::string external_file(hid_t group, const char* name, std::size_t size) {
  std::vector<char> value(size);
  const char *file = nullptr, *object = nullptr;
  unsigned flags = 0;
  if (H5Lget_val(group, name, value.data(), size, H5P_DEFAULT) < 0 ||
      H5Lunpack_elink_val(value.data(), size, &flags, &file, &object) < 0)
    return "";
  return file;
}

}  // namespace

std::string shape_text(const std::vector<long>& shape) {
  if (shape.empty()) return "a single value";
  std::string out;
  for (const long side : shape) out += (out.empty() ? "" : " x ") + std::to_string(side);
  return out;
}

Hdf5File::Hdf5File(const std::string& path) : path_(path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) fail(Status::file, "{}: no such file", path);
  const Library library;
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
#if H5_VERSION_GE(1, 10, 7)
  H5Pset_file_locking(access.id(), false, true);  // a file that is only read needs no lock, which some disks refuse
#endif
  file_ = H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id());
  if (file_ < 0) fail(Status::format, "{}: is not an HDF5 file, or damaged: {}", path, reason());
}

Hdf5File::~Hdf5File() {
  const Library library;
  H5Fclose(file_);
}

std::vector<Hdf5File::Link> Hdf5File::links(const std::string& group) const {
  const Library library;
  const Handle opened(H5Gopen2(file_, group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!opened.good()) fail(Status::format, "{}: is not there, or is no group: {}", place(path_, group), reason());
  std::vector<Link> out;
  const auto add = [](hid_t in, const char* name, const H5L_info_t* info, void* list) -> herr_t {
    const bool elsewhere = info->type == H5L_TYPE_EXTERNAL;
    static_cast<std::vector<Link>*>(list)->push_back(
        {name, elsewhere ? external_file(in, name, info->u.val_size) : std::string()});
    return 0;
  };
  if (H5Literate(opened.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &out) < 0)
    fail(Status::format, "{}: cannot be listed: {}", place(path_, group), reason());
  return out;
}

std::vector<long> Hdf5File::shape(const std::string& dataset) const {
  const Library library;
  const std::string where = place(path_, dataset);
  return shape_of(open_dataset(file_, dataset, where), where);
}

std::vector<std::uint8_t> Hdf5File::bytes(const std::string& dataset, const std::vector<long>& shape) const {
  const Library library;
  std::vector<std::uint8_t> out(count_of(shape));
  read_all(file_, dataset, place(path_, dataset), shape, Kind::bytes, out.data());
  return out;
}

std::vector<double> Hdf5File::numbers(const std::string& dataset, const std::vector<long>& shape) const {
  const Library library;
  std::vector<double> out(count_of(shape));
  read_all(file_, dataset, place(path_, dataset), shape, Kind::numbers, out.data());
  return out;
}

}  // namespace vsplat
