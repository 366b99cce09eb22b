// Parses pickles of torch.save without executing them. The contents of state dicts become values; anything else is
// refused by name and position. No class is looked up, nothing is called, and nothing recurses.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/files/safetensors.h"

namespace vsplat::pickle {

// Index into Pickle::values. Values may be shared and may even contain themselves.
using Ref = std::uint32_t;

enum class Kind : std::uint8_t {
  none,
  boolean,
  integer,
  real,  // the number is not stored
  text,
  tuple,
  list,
  dict,
  global,   // a known global; `text` is "module name"
  storage,  // `number` is its index in Pickle::storages
  tensor,   // `number` is its index in Pickle::tensors
  inert     // made by a known global (`text`) that occurs beside state dicts; the contents are ignored
};

struct Value {
  Kind kind = Kind::none;
  std::int64_t number = 0;
  std::string_view text;   // points into the pickle's bytes
  std::vector<Ref> items;  // for a dict: keys and values alternate
};

// An array of the archive, named by its persistent id.
struct Storage {
  Dtype dtype = Dtype::f32;
  std::string_view key;  // decimal digits
  std::uint64_t count = 0;
};

// A view that lies completely inside a storage; offset and strides are in elements.
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

// Limit on the number of values, more than any checkpoint has: an optimiser's state has about ten thousand.
inline constexpr std::size_t most_values = std::size_t{1} << 20;

// `what` begins every error message: "a.ckpt: data.pkl". `bytes` must outlive the result. Error(format) for any pickle
// that is not a state dict's.
Pickle read(const std::string& what, std::span<const unsigned char> bytes);

}  // namespace vsplat::pickle
