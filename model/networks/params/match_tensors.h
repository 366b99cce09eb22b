// Finds a model's parameters in a file of tensors: a SafetensorsFile or a TorchFile.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "model/networks/params/weights.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/printable.h"

namespace vsplat {

// The first few of them, for a message.
inline std::string list_of(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 5;
  std::string out;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) out += (i ? ", " : "") + printable(names[i]);
  if (names.size() > kMost) out += fmt::format(" and {} more", names.size() - kMost);
  return out;
}

// Whether a tensor has a parameter's name, below any prefix.
inline void require_weights(const std::string& path, const TensorEntry& entry, const Parameter& parameter) {
  if (entry.shape != parameter.shape)
    fail(Status::format, "{}: tensor {} has shape {}, expected {} for this configuration", path, printable(entry.name),
         printable(text_of(entry.shape)), text_of(parameter.shape));
  if (entry.dtype != Dtype::f64 && entry.dtype != Dtype::f32 && entry.dtype != Dtype::f16 && entry.dtype != Dtype::bf16)
    fail(Status::format, "{}: tensor {} is {}, expected F64, F32, F16 or BF16", path, printable(entry.name),
         name_of(entry.dtype));
}

// Returns the entry of each expected[i], found under its name with one of `prefixes`. Refuses tensors that are missing,
// have the wrong shape or occur twice.
template <class File>
std::vector<const TensorEntry*> match_tensors(const File& file, const std::vector<Parameter>& expected,
                                              const std::vector<std::string>& prefixes) {
  std::vector<const TensorEntry*> found;
  std::vector<std::string> missing;
  for (const Parameter& parameter : expected) {
    const TensorEntry* entry = nullptr;
    for (const std::string& prefix : prefixes) {
      const TensorEntry* candidate = file.find(prefix + parameter.name);
      if (candidate == nullptr) continue;
      if (entry != nullptr)
        fail(Status::format, "{}: tensor {} is there twice, also as {}", file.path(), entry->name, candidate->name);
      entry = candidate;
    }
    found.push_back(entry);
    if (entry == nullptr)
      missing.push_back(parameter.name);
    else
      require_weights(file.path(), *entry, parameter);
  }
  if (!missing.empty())
    fail(Status::format, "{}: {} of {} expected tensors missing: {}", file.path(), missing.size(), expected.size(),
         list_of(missing));
  return found;
}

// The names of the file's other tensors.
template <class File>
std::vector<std::string> beside(const File& file, const std::vector<const TensorEntry*>& used) {
  const std::set<const TensorEntry*> known(used.begin(), used.end());
  std::vector<std::string> out;
  for (const TensorEntry& entry : file.tensors())
    if (known.count(&entry) == 0) out.push_back(entry.name);
  return out;
}

// A network with a single NaN may still give plausible pictures, or none.
template <class File>
std::vector<float> finite_values(const File& file, const TensorEntry& entry) {
  std::vector<float> out = file.floats(entry);
  const auto bad = std::find_if(out.begin(), out.end(), [](float value) { return !std::isfinite(value); });
  if (bad != out.end())
    fail(Status::format,
         "{}: tensor {} holds {} at element {} of {}; finite numbers are expected: the model is damaged", file.path(),
         printable(entry.name), *bad, bad - out.begin(), out.size());
  return out;
}

template <class File>
Weights read_values(const File& file, const std::vector<Parameter>& expected,
                    const std::vector<const TensorEntry*>& entries) {
  Weights weights;
  for (std::size_t i = 0; i < expected.size(); ++i)
    weights.set(expected[i].name, {expected[i].shape, finite_values(file, *entries[i])});
  return weights;
}

}  // namespace vsplat
