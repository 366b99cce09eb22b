#include "model/io/reader/program/hdf5.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "model/io/reader/program/hdf5_driver.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

// RAII handle of an HDF5 object.
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

// The innermost message on HDF5's error stack.
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

std::string text_of(const std::vector<long>& shape) {
  if (shape.empty()) return "a single value";
  std::string out;
  for (const long side : shape) out += (out.empty() ? "" : " x ") + std::to_string(side);
  return out;
}

std::vector<long> shape_of(const Handle& dataset, const std::string& where) {
  const Handle space(H5Dget_space(dataset.id()), H5Sclose);
  const int sides = space.good() ? H5Sget_simple_extent_ndims(space.id()) : -1;
  if (sides < 0 || sides > 8) fail_reading(Status::format, where, "an array of at most 8 sides is expected");
  hsize_t size[8] = {};
  if (H5Sget_simple_extent_dims(space.id(), size, nullptr) < 0)
    fail_reading(Status::format, where, "its shape cannot be read: " + reason());
  std::vector<long> out;
  out.reserve(8);
  for (int i = 0; i < sides; ++i) out.push_back(static_cast<long>(std::min<hsize_t>(size[i], hsize_t{1} << 62)));
  return out;
}

// Refuses arrays whose values are stored elsewhere: in raw files, or in other files' arrays.
void refuse_stored_elsewhere(const Handle& dataset, const std::string& where) {
  const Handle made(H5Dget_create_plist(dataset.id()), H5Pclose);
  if (!made.good()) fail_reading(Status::format, where, "its storage layout cannot be read: " + reason());
  if (H5Pget_external_count(made.id()) > 0)
    fail_reading(Status::format, where, "its values are stored in other files (external storage), which are not read");
  if (H5Pget_layout(made.id()) == H5D_VIRTUAL)
    fail_reading(Status::format, where, "is a virtual data set, made of other files' arrays, which are not read");
}

// Refuses a compression that this HDF5 cannot decode, and names it or gives its number.
void refuse_unknown_filters(const Handle& dataset, const std::string& where) {
  const Handle made(H5Dget_create_plist(dataset.id()), H5Pclose);
  const int count = made.good() ? H5Pget_nfilters(made.id()) : 0;
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    char name[64] = "";
    const H5Z_filter_t id =
        H5Pget_filter2(made.id(), static_cast<unsigned>(i), &flags, &values, nullptr, sizeof name, name, &config);
    if (id < 0 || H5Zfilter_avail(id) > 0) continue;
    static const std::pair<int, const char*> known[] = {{32000, "LZF"},        {32001, "Blosc"}, {32004, "LZ4"},
                                                        {32008, "Bitshuffle"}, {32013, "ZFP"},   {32015, "Zstandard"}};
    std::string called = printable(std::string_view(name, ::strnlen(name, sizeof name)));
    for (const auto& [number, filter] : known)
      if (number == id) called = filter;
    fail_reading(
        Status::format, where,
        fmt::format("its values are compressed with {} (HDF5 filter {}), which is not read; write it again with "
                    "gzip or without compression, for example with h5py: "
                    "create_dataset(..., compression=\"gzip\")",
                    called.empty() ? "a filter without a name" : called, static_cast<int>(id)));
  }
}

Handle open_dataset(std::int64_t file, const std::string& dataset) {
  Handle out(H5Dopen2(file, dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!out.good()) fail_reading(Status::format, dataset, "is not there, or is no array: " + reason());
  refuse_stored_elsewhere(out, dataset);
  return out;
}

void check_type(const Handle& data, const std::string& where, bool bytes) {
  const Handle type(H5Dget_type(data.id()), H5Tclose);
  const H5T_class_t is = type.good() ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  const bool fits = bytes ? is == H5T_INTEGER && H5Tget_size(type.id()) == 1 && H5Tget_sign(type.id()) == H5T_SGN_NONE
                          : is == H5T_INTEGER || is == H5T_FLOAT;
  if (!fits)
    fail_reading(
        Status::format, where,
        fmt::format("{} are expected, it holds something else", bytes ? "unsigned integers of 8 bits" : "numbers"));
}

std::size_t count_of(const std::vector<long>& shape, const std::string& where) {
  std::size_t count = 1;
  for (const long side : shape)
    if (side < 0 || __builtin_mul_overflow(count, static_cast<std::size_t>(side), &count) ||
        count > std::size_t{1} << 40)
      fail_reading(Status::format, where, "not enough memory for its " + text_of(shape) + " values");
  return count;
}

// The target file of an external link.
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

void Hdf5::answer(Kind asked, Unpacker& in) {
  const std::string name = in.text(1 << 16);
  if ((asked == Kind::hdf5) == (file_ >= 0)) throw BadMessage("a file is opened once, and then asked");
  switch (asked) {
    case Kind::hdf5:
      return open(name);
    case Kind::links:
      return links(name);
    case Kind::shape:
      return shape(name);
    case Kind::bytes:
    case Kind::numbers:
      return values(name, in.shape(), asked == Kind::bytes);
    default:
      throw BadMessage("an unknown question");
  }
}

void Hdf5::open(const std::string& path) {
  H5PLset_loading_state(0);  // a file may name any filter, and its plug-in would be code
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  take_files_from(library_, access.id());
  file_ = H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id());
  if (file_ < 0) fail_reading(Status::format, "", "is not an HDF5 file, or damaged: " + reason());
  library_.say(Kind::done);
}

void Hdf5::links(const std::string& group) {
  const Handle opened(H5Gopen2(file_, group.c_str(), H5P_DEFAULT), H5Gclose);
  if (!opened.good()) fail_reading(Status::format, group, "is not there, or is no group: " + reason());
  struct List {
    Packer body;
    std::uint32_t count = 0;
  } list;
  const auto add = [](hid_t in, const char* name, const H5L_info_t* info, void* out) -> herr_t {
    const bool elsewhere = info->type == H5L_TYPE_EXTERNAL;
    auto& to = *static_cast<List*>(out);
    try {
      to.body.text(name).text(elsewhere ? external_file(in, name, info->u.val_size) : "");
    } catch (const std::exception&) {  // memory
      return -1;
    }
    ++to.count;
    return 0;
  };
  if (H5Literate(opened.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add, &list) < 0)
    fail_reading(Status::format, group, "cannot be listed: " + reason());
  library_.say(Kind::listed, Packer().put(list.count).raw(list.body.body().data(), list.body.body().size()));
}

void Hdf5::shape(const std::string& dataset) {
  library_.say(Kind::values, Packer().shape(shape_of(open_dataset(file_, dataset), dataset)));
}

void Hdf5::values(const std::string& dataset, const std::vector<long>& shape, bool bytes) {
  const Handle data = open_dataset(file_, dataset);
  const std::vector<long> found = shape_of(data, dataset);
  if (found != shape)
    fail_reading(Status::format, dataset,
                 fmt::format("its shape is {}, {} is expected", text_of(found), text_of(shape)));
  check_type(data, dataset, bytes);
  std::vector<char> out(count_of(shape, dataset) * (bytes ? 1 : sizeof(double)));
  if (H5Dread(data.id(), bytes ? H5T_NATIVE_UINT8 : H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, out.data()) < 0) {
    const std::string why = reason();
    refuse_unknown_filters(data, dataset);
    fail_reading(Status::format, dataset, "cannot be read: " + why);
  }
  library_.say(Kind::values, Packer(std::move(out)));
}

}  // namespace vsplat::read
