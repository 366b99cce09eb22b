// Pickles of torch.save, read and never run: what state dicts are made of becomes values, and everything else is
// refused by its name and place. No class is looked up, nothing is called, and nothing recurses.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/files/safetensors.h"

namespace vsplat::pickle {

// An index into Pickle::values. Values may be shared, and may even hold themselves.
using Ref = std::uint32_t;

enum class Kind : std::uint8_t {
  none,
  boolean,
  integer,
  real,  // its number is not kept
  text,
  tuple,
  list,
  dict,
  global,   // of those that are known: `text` is "module name"
  storage,  // `number` is its index in Pickle::storages
  tensor,   // `number` is its index in Pickle::tensors
  inert     // made by a global that is known to stand beside state dicts (`text`); what it is of is not looked at
};

struct Value {
  Kind kind = Kind::none;
  std::int64_t number = 0;
  std::string_view text;   // of the pickle's bytes
  std::vector<Ref> items;  // of a dict: keys and values in turn
};

// An array of the archive, by the persistent id that names it.
struct Storage {
  Dtype dtype = Dtype::f32;
  std::string_view key;  // decimal digits
  std::uint64_t count = 0;
};

// A view of a storage, all of which lies inside of it; offset and strides are in elements.
struct Tensor {
  std::size_t storage = 0;
  std::int64_t offset = 0;
  Shape shape;
  std::vector<std::int64_t> strides;

  std::uint64_t count() const;
};

struct Pickle {
  std::vector<Value> values;
  std::vector<Storage> storages;
  std::vector<Tensor> tensors;
  Ref root = 0;

  const Value& at(Ref ref) const { return values[ref]; }
};

// More than any checkpoint has: an optimiser's takes some ten thousand values.
inline constexpr std::size_t most_values = std::size_t{1} << 20;

// `what` as an error begins: "a.ckpt: data.pkl". `bytes` must outlive what is returned. Error(format) otherwise.
Pickle read(const std::string& what, std::span<const unsigned char> bytes);

}  // namespace vsplat::pickle
