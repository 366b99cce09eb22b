#include "model/networks/params/model_file.h"

#include <fmt/format.h>

#include <cmath>

#include "model/networks/params/match_tensors.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/half.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr const char* kFormat = "vsplat-model";
constexpr const char* kVersion = "1";
constexpr const char* kReserved[] = {"format", "version", "config", "sha256", "system"};

const std::string& metadata_at(const SafetensorsFile& file, const char* key) {
  const auto it = file.metadata().find(key);
  if (it == file.metadata().end())
    fail(Status::format, "{}: its metadata have no {}: not a model file of vsplat", file.path(), key);
  return it->second;
}

std::string read_system(const SafetensorsFile& file) {
  if (const std::string& format = metadata_at(file, "format"); format != kFormat)
    fail(Status::format, "{}: metadata format is \"{}\", expected \"{}\"{}", file.path(), printable(format), kFormat,
         format == kCheckpointFormat ? ": this is a training's state; the weights are in model.safetensors beside it"
                                     : "");
  if (const std::string& version = metadata_at(file, "version"); version != kVersion)
    fail(Status::format, "{}: metadata version is \"{}\", expected \"{}\": made for another version of vsplat",
         file.path(), printable(version), kVersion);
  const auto found = file.metadata().find("system");
  return found == file.metadata().end() ? VsplatSystem::name : found->second;
}

// Calls `read` and puts the file's path before its error messages.
template <class Result, class Read>
Result of_file(const SafetensorsFile& file, const Read& read) {
  try {
    return read();
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", file.path(), e.what());
  }
}

template <class S>
typename S::Config read_config(const SafetensorsFile& file) {
  const std::string& text = metadata_at(file, "config");
  return of_file<typename S::Config>(file, [&] { return S::from_json(text); });
}

// The model that the header describes, without its weights.
AnyModel read_header(const SafetensorsFile& file) {
  const std::string system = read_system(file);
  const auto found = file.metadata().find("system");
  if (found != file.metadata().end())
    of_file<bool>(file, [&] { return Systems::of<bool>(system, [](auto) { return true; }); });
  return Systems::of<AnyModel>(system, [&](auto s) {
    using S = decltype(s);
    return AnyModel(ModelOf<typename S::Config>{read_config<S>(file), {}, file.metadata()});
  });
}

std::vector<Parameter> parameters_of(const AnyModel& model) {
  return std::visit([](const auto& m) { return parameters(m.config); }, model);
}

// A classification head in DINO files, which the network does not use.
bool is_harmless(const std::string& name) {
  return name.starts_with("encoder.model.head.") || name.starts_with("encoder.model.fc_norm.");
}

// Accepts names with or without "net."; also refuses tensors that the configuration does not have.
std::vector<const TensorEntry*> match_model(const SafetensorsFile& file, const std::vector<Parameter>& expected) {
  const std::vector<const TensorEntry*> found = match_tensors(file, expected, {"", "net."});
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
      fail(Status::input, "{}: tensor {} holds {}, but the largest number of F16 is {}: write F32", path, name, value,
           kLargestHalf);
    out.push_back(half);
  }
  return out;
}

}  // namespace

Weights read_weights(const SafetensorsFile& file, const AnyConfig& config, const std::string& prefix) {
  const std::vector<Parameter> expected = parameters(config);
  return read_values(file, expected, match_tensors(file, expected, {prefix}));
}

AnyModel load_any_model(const SafetensorsFile& file) {
  // Checks the hash before it uses, or complains about, content that may be damaged.
  checked_hash(file);
  AnyModel out = read_header(file);
  const std::vector<Parameter> expected = parameters_of(out);
  Weights weights = read_values(file, expected, match_model(file, expected));
  std::visit([&](auto& model) { model.weights = std::move(weights); }, out);
  return out;
}

ModelFile load_model(const SafetensorsFile& file) {
  AnyModel model = load_any_model(file);
  if (ModelFile* own = std::get_if<ModelFile>(&model)) return std::move(*own);
  fail(Status::format, "{}: a model of {}, but {} is expected here", file.path(), network_of(model),
       VsplatSystem::network);
}

ModelFile load_model(const std::string& path) { return load_model(SafetensorsFile(path)); }

void save_model(const std::string& path, const AnyConfig& config, const Weights& weights,
                const std::map<std::string, std::string>& provenance, Dtype dtype) {
  if (dtype != Dtype::f32 && dtype != Dtype::f16)
    fail(Status::usage, "{}: a model is written as F32 or F16, not as {}", path, name_of(dtype));
  check(config);
  std::map<std::string, std::string> metadata = provenance;
  for (const char* key : kReserved)
    if (metadata.count(key) != 0) fail(Status::usage, "{}: an entry of the provenance cannot be called {}", path, key);
  metadata["format"] = kFormat;
  metadata["version"] = kVersion;
  metadata["config"] = config.visit([](const auto& c) { return to_json(c); });
  // omitted for VS-Splat, so that its files do not change
  if (config.system() != VsplatSystem::name) metadata["system"] = config.system();
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
  info.model = read_header(file);
  info.system = system_of(info.model);
  info.config = std::visit([](const auto& model) { return to_json(model.config); }, info.model);
  const std::vector<Parameter> expected = parameters_of(info.model);
  const auto entries = match_model(file, expected);
  info.tensors = expected.size();
  for (const Parameter& parameter : expected)
    if (parameter.trained) info.parameters += parameter.count();
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
  for (const TensorEntry* entry : match_model(file, parameters_of(read_header(file)))) finite_values(file, *entry);
  return state;
}

HashState verify_model(const std::string& path) { return verify_model(SafetensorsFile(path)); }

}  // namespace vsplat
