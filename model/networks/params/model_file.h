// Model files: safetensors with the configuration in the metadata. Tensors go by the names of parameters(), a leading
// "net." is accepted; F32, F16 and BF16 become float.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/networks/params/systems.h"
#include "runtime/files/safetensors.h"

namespace vsplat {

// What a training's checkpoint (model/train/checkpoint.h) calls itself in its metadata's `format`: easily taken for a
// model, whose reader says so.
constexpr const char* kCheckpointFormat = "vsplat-checkpoint";

// Everything is checked: the file's structure, format and version, the network that it is of (its metadata's `system`,
// VS-Splat's where there is none), the configuration, the hash where one is given, and that the tensors are those of
// the configuration, each in its shape. Errors name path, tensor or field, found and expected.
AnyModel load_any_model(const SafetensorsFile& file);
// Of VS-Splat's network: Error(format) names another one.
ModelFile load_model(const SafetensorsFile& file);
ModelFile load_model(const std::string& path);

// Writes the tensors in the order of parameters(), with format, version, config sha256 and, but for VS-Splat's,
// system; `provenance` is free-form (data set, steps, seed, commit) and may not hold those five. `dtype` is f32, or
// f16: each value rounded to nearest, ties to even, and one beyond its range an Error(input).
void save_model(const std::string& path, const Config& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance = {}, Dtype dtype = Dtype::f32);
void save_model(const std::string& path, const LaraConfig& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance = {}, Dtype dtype = Dtype::f32);
void save_model(const std::string& path, const GendenConfig& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance = {}, Dtype dtype = Dtype::f32);
void save_model(const std::string& path, const VsplatGendenConfig& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance = {}, Dtype dtype = Dtype::f32);

// For `weights info` and `weights verify`: what the header says. The tensors' names and shapes are checked, values not
// read.
struct ModelInfo {
  AnyModel model;  // without weights
  std::string system;
  std::string config;  // as JSON, with every field
  std::size_t tensors = 0;
  long parameters = 0;  // trained values; buffers aside
  std::uint64_t file_bytes = 0;
  std::map<std::string, std::size_t> dtypes;      // "F32" -> how many tensors
  std::string sha256;                             // as stated; empty where there is none
  std::map<std::string, std::string> provenance;  // the rest of the metadata
};
ModelInfo model_info(const SafetensorsFile& file);
ModelInfo model_info(const std::string& path);

// As load_model, keeping nothing: the structure, the shapes, the values, which are finite, and the hash. `absent` says
// that the file has no hash, so that damage to its values cannot be seen; a hash that differs is an Error(format).
HashState verify_model(const SafetensorsFile& file);
HashState verify_model(const std::string& path);

// The part of load_model that golden vectors share: tensors called prefix + name for each of parameters().
Weights read_weights(const SafetensorsFile& file, const Config& config, const std::string& prefix);

}  // namespace vsplat
