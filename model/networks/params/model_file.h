// Model files: safetensors with the configuration in the metadata. Tensors have the names of parameters(), optionally
// after "net."; F32, F16 and BF16 are converted to float.
#pragma once
#include <map>
#include <string>

#include "model/networks/params/any_config.h"
#include "runtime/files/safetensors.h"

namespace vsplat {

// The `format` in the metadata of a training's checkpoint (model/train/checkpoint.h). It is easily mistaken for a
// model, so the reader's error says what it is.
constexpr const char* kCheckpointFormat = "vsplat-checkpoint";

// Checks everything: the file's structure, format and version, its architecture (`system` in the metadata, VS-Splat's
// by default), the configuration, the hash if there is one, and that the tensors are those of the configuration, each
// with its shape. Errors name path, tensor or field, found and expected.
AnyModel load_any_model(const SafetensorsFile& file);
// Only VS-Splat's architecture: Error(format) names another one.
ModelFile load_model(const SafetensorsFile& file);
ModelFile load_model(const std::string& path);

// Writes the tensors in the order of parameters(), with format, version, config, sha256 and, except for VS-Splat's,
// system. `provenance` is free-form (data set, steps, seed, commit) and may not contain these five keys. `dtype` is f32
// or f16; f16 rounds each value to nearest, ties to even, and a value beyond its range is an Error(input).
void save_model(const std::string& path, const AnyConfig& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance = {}, Dtype dtype = Dtype::f32);

// For `weights info` and `weights verify`: the content of the header. Checks the tensors' names and shapes, but does
// not read values.
struct ModelInfo {
  AnyModel model;  // without weights
  std::string system;
  std::string config;  // as JSON, with every field
  std::size_t tensors = 0;
  long parameters = 0;  // trained values, without buffers
  std::uint64_t file_bytes = 0;
  std::map<std::string, std::size_t> dtypes;      // "F32" -> number of tensors
  std::string sha256;                             // as stated in the file; empty if there is none
  std::map<std::string, std::string> provenance;  // the rest of the metadata
};
ModelInfo model_info(const SafetensorsFile& file);
ModelInfo model_info(const std::string& path);

// Like load_model, but discards the weights: checks the structure, the shapes, that the values are finite, and the
// hash. `absent` means that the file has no hash, so damage to its values cannot be detected; a wrong hash is an
// Error(format).
HashState verify_model(const SafetensorsFile& file);
HashState verify_model(const std::string& path);

// The part of load_model that golden vectors share: reads the tensors prefix + name for each of parameters().
Weights read_weights(const SafetensorsFile& file, const AnyConfig& config, const std::string& prefix);

}  // namespace vsplat
