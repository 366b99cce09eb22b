#include "model/io/hdf5_file.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <utility>

#include "runtime/fail.h"
#include "runtime/file.h"
#include "runtime/printable.h"
#include "runtime/roots.h"

namespace vsplat {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

// The library as Debian builds it may be used by one thread at a time. While this lives, that is ours, and the library
// prints nothing of its own.
class Library {
 public:
  Library() : lock_(mutex()) {
    H5PLset_loading_state(0);  // a file may name any filter, and its plug-in would be code
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
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;
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

// How to open what may lie behind an external link, which the library follows to whatever it names.
class Access {
 public:
  Access(hid_t kind, const std::string& path) : list_(H5Pcreate(kind), H5Pclose) {
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    roots_.add(folder.empty() ? "." : folder);
    H5Pset_elink_cb(list_.id(), check, this);
  }
  Access(const Access&) = delete;
  Access& operator=(const Access&) = delete;
  hid_t id() const { return list_.id(); }
  // Why a link was not followed, if one was not.
  void complain(const std::string& where) const {
    if (!refused_.empty()) fail(Status::format, "{}: {}", where, refused_);
  }

 private:
  // -1: not to this file.
  static herr_t check(const char* parent, const char*, const char* child, const char*, unsigned*, hid_t, void* access) {
    auto& self = *static_cast<Access*>(access);
    try {
      const std::filesystem::path file = std::filesystem::path(parent).parent_path() / child;
      self.roots_.need(file, "its external link to");
      open_regular(file.string());
      return 0;
    } catch (const std::exception& e) {
      self.refused_ = e.what();
      return -1;
    }
  }

  Handle list_;
  Roots roots_;
  std::string refused_;
};

// What is stored elsewhere by the array itself: raw files, or pieces of other files' arrays.
void refuse_stored_elsewhere(const Handle& dataset, const std::string& where) {
  const Handle made(H5Dget_create_plist(dataset.id()), H5Pclose);
  if (!made.good()) fail(Status::format, "{}: how it is stored cannot be told: {}", where, reason());
  if (H5Pget_external_count(made.id()) > 0)
    fail(Status::format, "{}: its values are stored in other files (external storage), which are not read", where);
  if (H5Pget_layout(made.id()) == H5D_VIRTUAL)
    fail(Status::format, "{}: is a virtual data set, made of other files' arrays, which are not read", where);
}

Handle open_dataset(std::int64_t file, const std::string& path, const std::string& dataset, const std::string& where) {
  const Access access(H5P_DATASET_ACCESS, path);
  const hid_t id = H5Dopen2(file, dataset.c_str(), access.id());
  if (id < 0) access.complain(where);
  if (id < 0) fail(Status::format, "{}: is not there, or is no array: {}", where, reason());
  Handle out(id, H5Dclose);
  refuse_stored_elsewhere(out, where);
  return out;
}

enum class Kind { bytes, numbers };

// Into `out`, which has room for what `shape` says.
void read_all(std::int64_t file, const std::string& path, const std::string& dataset, const std::vector<long>& shape,
              Kind kind, void* out) {
  const std::string where = place(path, dataset);
  const Handle data = open_dataset(file, path, dataset, where);
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

// Room for what the shape says.
template <class T>
std::vector<T> room_for(const std::string& where, const std::vector<long>& shape) try {
  return std::vector<T>(count_of(shape));
} catch (const std::exception&) {  // bad_alloc, length_error
  fail(Status::memory, "{}: not enough host memory for its {} values", where, shape_text(shape));
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
  const Access access(H5P_GROUP_ACCESS, path_);
  const Handle opened(H5Gopen2(file_, group.c_str(), access.id()), H5Gclose);
  if (!opened.good()) access.complain(place(path_, group));
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
  return shape_of(open_dataset(file_, path_, dataset, where), where);
}

std::vector<std::uint8_t> Hdf5File::bytes(const std::string& dataset, const std::vector<long>& shape) const {
  const Library library;
  std::vector<std::uint8_t> out = room_for<std::uint8_t>(place(path_, dataset), shape);
  read_all(file_, path_, dataset, shape, Kind::bytes, out.data());
  return out;
}

std::vector<double> Hdf5File::numbers(const std::string& dataset, const std::vector<long>& shape) const {
  const Library library;
  std::vector<double> out = room_for<double>(place(path_, dataset), shape);
  read_all(file_, path_, dataset, shape, Kind::numbers, out.data());
  return out;
}

}  // namespace vsplat
