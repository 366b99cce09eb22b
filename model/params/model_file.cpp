#include "model/params/model_file.h"

#include <fmt/format.h>

#include <cmath>

#include "model/params/match_tensors.h"
#include "model/params/params.h"
#include "runtime/fail.h"
#include "runtime/half.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr const char* kFormat = "vsplat-model";
constexpr const char* kVersion = "1";
constexpr const char* kReserved[] = {"format", "version", "config", "sha256"};

const std::string& metadata_at(const SafetensorsFile& file, const std::string& key) {
  const auto it = file.metadata().find(key);
  if (it == file.metadata().end())
    fail(Status::format, "{}: its metadata have no {}: not a model file of vsplat", file.path(), key);
  return it->second;
}

Config read_config(const SafetensorsFile& file) {
  if (const std::string& format = metadata_at(file, "format"); format != kFormat)
    fail(Status::format, "{}: metadata format is \"{}\", expected \"{}\"", file.path(), printable(format), kFormat);
  if (const std::string& version = metadata_at(file, "version"); version != kVersion)
    fail(Status::format, "{}: metadata version is \"{}\", expected \"{}\": made for another vsplat", file.path(),
         printable(version), kVersion);
  try {
    return config_from_json(metadata_at(file, "config"));
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", file.path(), e.what());
  }
}

// A classification head that DINO files carry along; the network has no use for it.
bool is_harmless(const std::string& name) {
  return name.starts_with("encoder.model.head.") || name.starts_with("encoder.model.fc_norm.");
}

// With or without "net."; complains of tensors that the configuration does not have, too.
std::vector<const TensorEntry*> match_model(const SafetensorsFile& file, const Config& config) {
  const std::vector<const TensorEntry*> found = match_tensors(file, parameters(config), {"", "net."});
  std::vector<std::string> unexpected;
  for (const std::string& name : beside(file, found))
    if (!is_harmless(name.starts_with("net.") ? name.substr(4) : name)) unexpected.push_back(name);
  if (!unexpected.empty())
    fail(Status::format, "{}: {} tensors that this configuration does not have: {}", file.path(), unexpected.size(),
         list_of(unexpected));
  return found;
}

HashState checked_hash(const SafetensorsFile& file) {
  const HashState state = file.check_hash();
  if (state == HashState::differs)
    fail(Status::format, "{}: its content does not match its sha256 {}: the file is damaged", file.path(),
         file.metadata().at("sha256"));
  return state;
}

std::vector<std::uint16_t> halves_of(const std::string& path, const std::string& name,
                                     const std::vector<float>& values) {
  std::vector<std::uint16_t> out;
  out.reserve(values.size());
  for (const float value : values) {
    const std::uint16_t half = to_half(value);
    if (std::isfinite(value) && std::isinf(from_half(half)))
      fail(Status::input, "{}: tensor {} holds {}, and F16 ends at {}: write F32", path, name, value, kLargestHalf);
    out.push_back(half);
  }
  return out;
}

}  // namespace

Weights read_weights(const SafetensorsFile& file, const Config& config, const std::string& prefix) {
  const std::vector<Parameter> expected = parameters(config);
  return read_values(file, expected, match_tensors(file, expected, {prefix}));
}

ModelFile load_model(const SafetensorsFile& file) {
  // Before anything that damage could have changed is believed, or complained of.
  checked_hash(file);
  const Config config = read_config(file);
  return {config, read_values(file, parameters(config), match_model(file, config)), file.metadata()};
}

ModelFile load_model(const std::string& path) { return load_model(SafetensorsFile(path)); }

void save_model(const std::string& path, const Config& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance, Dtype dtype) {
  if (dtype != Dtype::f32 && dtype != Dtype::f16)
    fail(Status::usage, "{}: a model is written as F32 or F16, not as {}", path, name_of(dtype));
  check(config);
  std::map<std::string, std::string> metadata = provenance;
  for (const char* key : kReserved)
    if (metadata.count(key) != 0) fail(Status::usage, "{}: provenance cannot be called {}", path, key);
  metadata["format"] = kFormat;
  metadata["version"] = kVersion;
  metadata["config"] = to_json(config);
  std::vector<TensorToWrite> tensors;
  std::vector<std::vector<std::uint16_t>> halves;
  for (const Parameter& parameter : parameters(config)) {
    const HostTensor& tensor = weights.at(parameter.name);
    if (tensor.shape != parameter.shape || static_cast<long>(tensor.data.size()) != parameter.count())
      fail(Status::internal, "{}: tensor {} has shape {}, expected {}", path, parameter.name, text_of(tensor.shape),
           text_of(parameter.shape));
    const void* values = tensor.data.data();
    if (dtype == Dtype::f16) values = halves.emplace_back(halves_of(path, parameter.name, tensor.data)).data();
    tensors.push_back({parameter.name, dtype, tensor.shape, values});
  }
  write_safetensors(path, tensors, metadata, true);
}

ModelInfo model_info(const SafetensorsFile& file) {
  ModelInfo info;
  info.config = read_config(file);
  const std::vector<Parameter> expected = parameters(info.config);
  const auto entries = match_model(file, info.config);
  info.tensors = expected.size();
  info.parameters = parameter_count(info.config);
  info.file_bytes = file.bytes();
  for (const TensorEntry* entry : entries) ++info.dtypes[name_of(entry->dtype)];
  info.provenance = file.metadata();
  if (const auto it = info.provenance.find("sha256"); it != info.provenance.end()) info.sha256 = it->second;
  for (const char* key : kReserved) info.provenance.erase(key);
  return info;
}

ModelInfo model_info(const std::string& path) { return model_info(SafetensorsFile(path)); }

HashState verify_model(const SafetensorsFile& file) {
  const HashState state = checked_hash(file);
  for (const TensorEntry* entry : match_model(file, read_config(file))) finite_values(file, *entry);
  return state;
}

HashState verify_model(const std::string& path) { return verify_model(SafetensorsFile(path)); }

}  // namespace vsplat
