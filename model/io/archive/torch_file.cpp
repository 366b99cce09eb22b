#include "model/io/archive/torch_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <set>

#include "model/io/archive/pickle.h"
#include "model/io/archive/zip_archive.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/half.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

using pickle::Kind;
using pickle::Pickle;
using pickle::Ref;

constexpr std::uint64_t kLargestPickle = 64u << 20;  // checkpoints have a few hundred KB
constexpr std::uint64_t kPerValue = 160;             // most bytes that a value takes, without its list of items

const pickle::Value* item_of(const Pickle& all, const pickle::Value& dict, std::string_view key) {
  for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2)
    if (all.at(dict.items[i]).kind == Kind::text && all.at(dict.items[i]).text == key)
      return &all.at(dict.items[i + 1]);
  return nullptr;
}

bool holds_tensors(const Pickle& all, const pickle::Value& dict) {
  for (std::size_t i = 1; i < dict.items.size(); i += 2)
    if (all.at(dict.items[i]).kind == Kind::tensor) return true;
  return false;
}

// The key of the state dict in a checkpoint; "" if `top` is a state dict itself.
std::string state_key(const std::string& path, const Pickle& all, const pickle::Value& top) {
  // Used by Lightning, by timm, and by complete DINO checkpoints.
  for (const char* key : {"state_dict", "model", "teacher"})
    if (const pickle::Value* inner = item_of(all, top, key); inner && inner->kind == Kind::dict) return key;
  if (holds_tensors(all, top)) return "";
  std::vector<std::string> found;
  for (std::size_t i = 0; i + 1 < top.items.size(); i += 2) {
    const pickle::Value &key = all.at(top.items[i]), &value = all.at(top.items[i + 1]);
    if (key.kind == Kind::text && value.kind == Kind::dict && holds_tensors(all, value)) found.emplace_back(key.text);
  }
  if (found.size() > 1) {
    std::string names;
    for (const std::string& name : found) names += (names.empty() ? "" : ", ") + printable(name);
    fail(Status::format,
         "{}: {} of its entries hold tensors: {}; one is expected, or one called state_dict or model: save the state "
         "dict alone",
         path, found.size(), names);
  }
  if (found.empty()) return "";
  info("{}: the state dict under \"{}\" is read", path, printable(found[0]));
  return found[0];
}

template <class Stored, class Convert>
void gather(const std::vector<unsigned char>& storage, const pickle::Tensor& tensor, std::vector<float>& out,
            Convert convert) {
  std::vector<std::int64_t> at(tensor.shape.size(), 0);
  std::int64_t element = tensor.offset;
  for (float& value : out) {
    Stored stored;
    std::memcpy(&stored, storage.data() + static_cast<std::size_t>(element) * sizeof(Stored), sizeof stored);
    value = convert(stored);
    for (std::size_t side = at.size(); side-- > 0;) {  // advance; the last side varies fastest
      element += tensor.strides[side];
      if (++at[side] < tensor.shape[side]) break;
      element -= tensor.strides[side] * at[side];
      at[side] = 0;
    }
  }
}

float from_bfloat(std::uint16_t b) { return std::bit_cast<float>(static_cast<std::uint32_t>(b) << 16); }

template <class Stored>
float cast(Stored value) {
  return static_cast<float>(value);
}

void gather(Dtype dtype, const std::vector<unsigned char>& storage, const pickle::Tensor& tensor,
            std::vector<float>& out) {
  switch (dtype) {
    case Dtype::f64:
      return gather<double>(storage, tensor, out, cast<double>);
    case Dtype::f32:
      return gather<float>(storage, tensor, out, cast<float>);
    case Dtype::f16:
      return gather<std::uint16_t>(storage, tensor, out, from_half);
    case Dtype::bf16:
      return gather<std::uint16_t>(storage, tensor, out, from_bfloat);
    case Dtype::i64:
      return gather<std::int64_t>(storage, tensor, out, cast<std::int64_t>);
    case Dtype::i32:
      return gather<std::int32_t>(storage, tensor, out, cast<std::int32_t>);
    case Dtype::i16:
      return gather<std::int16_t>(storage, tensor, out, cast<std::int16_t>);
    case Dtype::i8:
      return gather<std::int8_t>(storage, tensor, out, cast<std::int8_t>);
    default:
      return gather<std::uint8_t>(storage, tensor, out, cast<std::uint8_t>);
  }
}

// Takes out what DataParallel and torch.compile put into names, wherever they wrapped a module: net.module.x is net.x.
// Leaves all names as they are if two would become equal.
void unwrap_names(std::vector<TensorEntry>& tensors) {
  std::vector<std::string> names;
  for (const TensorEntry& entry : tensors) {
    std::string name = "." + entry.name;
    for (const std::string wrapper : {".module.", "._orig_mod."})
      for (std::size_t at = 0; (at = name.find(wrapper, at)) != std::string::npos;) name.erase(at, wrapper.size() - 1);
    names.push_back(name.substr(1));
  }
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) return;
  for (std::size_t i = 0; i < names.size(); ++i) tensors[i].name = names[i];
}

}  // namespace

// Location of a tensor's values.
struct TorchFile::Layout {
  std::string entry;  // name of the storage's entry in the archive
  pickle::Tensor tensor;
};

// The zip archive and the storage read last, which may also hold the next tensor.
class TorchFile::Archive {
 public:
  explicit Archive(const std::string& path) : path_(path), zip_(path) {
    constexpr std::string_view pickle = "/data.pkl";
    for (const auto& [name, entry] : zip_.entries()) {
      if (!name.ends_with(pickle) || name.find('/') != name.size() - pickle.size()) continue;
      if (!folder_.empty()) fail(Status::format, "{}: its archive holds two data.pkl, one is expected", path);
      folder_ = name.substr(0, name.size() - pickle.size() + 1);
    }
    if (folder_.empty()) fail(Status::format, "{}: its archive holds no data.pkl: not a file of torch.save", path);
    const auto order = zip_.entries().find(folder_ + "byteorder");
    if (order == zip_.entries().end()) return;  // older files lack it and were written on little-endian machines
    const std::vector<unsigned char> said =
        order->second.bytes <= 16 ? zip_.read(order->first, order->second) : std::vector<unsigned char>();
    const std::string text(said.begin(), said.end());
    if (text != "little") fail(Status::format, "{}: byteorder is \"{}\", expected \"little\"", path, printable(text));
  }

  const ZipArchive& zip() const { return zip_; }
  // The entry name of a storage. Fails unless the entry exists with the size that its elements take.
  std::string storage(const pickle::Storage& storage) const {
    std::string name = folder_ + "data/" + std::string(storage.key);
    const auto found = zip_.entries().find(name);
    if (found == zip_.entries().end()) fail(Status::format, "{}: its archive holds no {}", path_, printable(name));
    if (found->second.bytes != storage.count * size_of(storage.dtype))
      fail(Status::format, "{}: entry {} has {} bytes, expected {} for {} elements of {}", path_, printable(name),
           found->second.bytes, storage.count * size_of(storage.dtype), storage.count, name_of(storage.dtype));
    return name;
  }
  std::vector<unsigned char> pickle_bytes() const {
    const std::string name = folder_ + "data.pkl";
    const ZipArchive::Entry entry = zip_.entries().at(name);
    if (entry.bytes > kLargestPickle)
      fail(Status::format, "{}: data.pkl has {} bytes, at most {} are expected", path_, entry.bytes, kLargestPickle);
    return zip_.read(name, entry);
  }
  const std::vector<unsigned char>& storage_bytes(const std::string& name) {
    if (name == last_) return bytes_;
    const ZipArchive::Entry entry = zip_.entries().at(name);
    bytes_.clear();
    bytes_.shrink_to_fit();
    last_.clear();
    memory_ = HostMemory();
    memory_ = HostMemory(fmt::format("{}: reading {}", path_, printable(name)), static_cast<double>(entry.bytes));
    bytes_ = zip_.read(name, entry);
    last_ = name;
    return bytes_;
  }

 private:
  std::string path_;
  ZipArchive zip_;
  std::string folder_;  // with a trailing slash
  std::string last_;
  std::vector<unsigned char> bytes_;
  HostMemory memory_;
};

bool TorchFile::looks_like(const std::string& path) {
  std::vector<unsigned char> begin;
  try {
    InputFile(path).read(2, begin);
  } catch (const Error&) {
    return false;
  }
  return begin.size() == 2 && ((begin[0] == 'P' && begin[1] == 'K') || (begin[0] == 0x80 && begin[1] == 2));
}

TorchFile::TorchFile(const std::string& path) : path_(path) {
  std::vector<unsigned char> begin;
  InputFile(path).read(2, begin);
  if (begin.size() == 2 && begin[0] == 0x80)
    fail(Status::format,
         "{}: a bare pickle, as torch.save wrote before PyTorch 1.6; a zip archive is expected: save it again with a "
         "newer PyTorch",
         path);
  archive_ = std::make_unique<Archive>(path);
  const std::vector<unsigned char> bytes = archive_->pickle_bytes();
  const HostMemory memory(path + ": reading its data.pkl",
                          static_cast<double>(bytes.size() + kPerValue * std::min(bytes.size(), pickle::most_values)));
  const Pickle all = pickle::read(path + ": data.pkl", bytes);
  const pickle::Value* state = &all.at(all.root);
  if (state->kind != Kind::dict) fail(Status::format, "{}: holds no dict, a state dict is expected", path);
  if (const std::string key = state_key(path, all, *state); !key.empty()) {
    for (std::size_t i = 0; i < state->items.size(); i += 2)
      if (const pickle::Value& other = all.at(state->items[i]); other.kind != Kind::text || other.text != key)
        others_.push_back(other.kind == Kind::text ? printable(other.text) : "?");
    state = item_of(all, *state, key);
  }
  for (const pickle::Storage& storage : all.storages) archive_->storage(storage);
  std::set<std::string_view> seen;
  for (std::size_t i = 0; i < state->items.size(); i += 2) {
    const pickle::Value &key = all.at(state->items[i]), &value = all.at(state->items[i + 1]);
    if (key.kind != Kind::text) fail(Status::format, "{}: its state dict has a key that is no text", path);
    if (!seen.insert(key.text).second)
      fail(Status::format, "{}: {} is twice in its state dict", path, printable(key.text));
    if (value.kind != Kind::tensor) {
      others_.push_back(printable(key.text));
      continue;
    }
    const pickle::Tensor& tensor = all.tensors[static_cast<std::size_t>(value.number)];
    const pickle::Storage& storage = all.storages[tensor.storage];
    tensors_.push_back(
        {std::string(key.text), storage.dtype, tensor.shape, 0, tensor.count() * size_of(storage.dtype)});
    layouts_.push_back({archive_->storage(storage), tensor});
  }
  if (tensors_.empty()) fail(Status::format, "{}: no tensors in it: a state dict is expected", path);
  unwrap_names(tensors_);
  for (std::size_t i = 0; i < tensors_.size(); ++i) index_[tensors_[i].name] = i;
}

TorchFile::~TorchFile() = default;
TorchFile::TorchFile(TorchFile&&) noexcept = default;

const TensorEntry* TorchFile::find(const std::string& name) const {
  const auto it = index_.find(name);
  return it == index_.end() ? nullptr : &tensors_[it->second];
}

const TensorEntry& TorchFile::at(const std::string& name) const {
  const TensorEntry* entry = find(name);
  if (entry == nullptr) fail(Status::format, "{}: no tensor {}", path_, printable(name));
  return *entry;
}

std::vector<float> TorchFile::floats(const TensorEntry& entry) const {
  const Layout& layout = layouts_[index_.at(entry.name)];
  std::vector<float> out(static_cast<std::size_t>(entry.count()));
  gather(entry.dtype, archive_->storage_bytes(layout.entry), layout.tensor, out);
  return out;
}

std::uint64_t TorchFile::stored_bytes() const {
  std::uint64_t out = 0;
  for (const auto& [name, entry] : archive_->zip().entries()) out += entry.bytes;
  return out;
}

void TorchFile::verify() const {
  for (const auto& [name, entry] : archive_->zip().entries()) archive_->zip().verify(name, entry);
}

}  // namespace vsplat
