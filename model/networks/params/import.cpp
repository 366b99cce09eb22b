#include "model/networks/params/import.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "model/base/json_fields.h"
#include "model/io/archive/torch_file.h"
#include "model/networks/params/deduced_config.h"
#include "model/networks/params/init.h"
#include "model/networks/params/load_encoder.h"
#include "model/networks/params/match_tensors.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/json_text.h"
#include "runtime/option.h"
#include "runtime/printable.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

bool has_part(const TorchFile& file, std::string_view part) {
  return std::any_of(file.tensors().begin(), file.tensors().end(),
                     [part](const TensorEntry& entry) { return entry.name.find(part) != std::string::npos; });
}

// True also for GenDen's, whose backbone it is.
bool is_lara(const TorchFile& file) { return has_part(file, "vol_decoder.pos_embed"); }
bool has_densifier(const TorchFile& file) { return has_part(file, "dec.0.up."); }

// Networks that are recognised by their tensors but not supported.
void refuse_others(const TorchFile& file) {
  const char* other = nullptr;
  if (has_part(file, "share.transformer."))
    other = "a VS-Splat network with predicted Plücker maps";
  else if (has_part(file, "register_tokens"))
    other = "DINOv3's encoder in Hugging Face's naming (timm's and Meta's are read)";
  if (other != nullptr) fail(Status::format, "{}: {}, which is not read yet", file.path(), other);
}

// The prefix of the network's tensor names.
template <class S>
std::string network_prefix(const TorchFile& file) {
  for (const char* prefix : {"", "net.", "model.", "model.net."})
    if (file.find(std::string(prefix) + S::mark) != nullptr) return prefix;
  fail(Status::format, "{}: no tensor {}, with or without the prefix net.: not {} ({} tensors: {})", file.path(),
       S::mark, S::network, file.tensors().size(), list_of(beside(file, {})));
}

std::string read_text(const std::string& path) {
  constexpr std::size_t kMost = 1 << 20;
  std::vector<unsigned char> bytes;
  InputFile(path).read(kMost + 1, bytes);
  if (bytes.size() > kMost) fail(Status::format, "{}: more than {} bytes, a configuration is expected", path, kMost);
  return {bytes.begin(), bytes.end()};
}

// Converts {"densify": {"top_k": 9}} to {"densify.top_k": 9}.
void add_flat(const nlohmann::json& object, const std::string& before, nlohmann::json& out) {
  for (const auto& [name, value] : object.items()) {
    const std::string whole = before + name;
    if (value.is_object() && !value.empty())  // an empty one is refused by the reader
      add_flat(value, whole + ".", out);
    else if (out.contains(whole))
      fail(Status::format, "the configuration has {} twice", json_fields::shown(whole));
    else
      out[whole] = value;
  }
}

// A configuration as fields with dotted names. It may be written with nested objects. It may also be the member
// "config" of a larger object: as in the output of vsplat_model_inspect, or, as text, in a model file's metadata.
std::string flat_fields(const std::string& text) {
  nlohmann::json given = parse_json("the configuration", text);
  if (given.is_object() && given.contains("config")) {
    nlohmann::json inner = given["config"];
    given = inner.is_string() ? parse_json("its config", inner.get<std::string>()) : std::move(inner);
  }
  if (!given.is_object()) return given.dump();  // refused by the reader
  nlohmann::json out = nlohmann::json::object();
  add_flat(given, "", out);
  return out.dump();
}

// Sets the requested fields in `config`; returns their names.
template <class Config>
std::set<std::string> set_given(Config& config, const ImportOptions& options) {
  std::set<std::string> given;
  if (!options.config_file.empty()) {
    const std::string text = read_text(options.config_file);
    try {
      for (std::string& name : set_fields_from_json(config, flat_fields(text))) given.insert(std::move(name));
    } catch (const Error& e) {
      fail(e.status(), "{}: {}", options.config_file, e.what());
    }
  }
  for (const std::string& assignment : options.fields) {
    set_field(config, assignment);
    given.insert(assignment.substr(0, assignment.find('=')));
  }
  return given;
}

template <class Config>
void copy_field(Config& to, const Config& from, const std::string& field) {
  set_fields_from_json(to, "{\"" + field + "\": " + field_text(from, field) + "}");
}

// Fields that no shape shows, but the order of the tensors does.
template <class Config>
void take_order(Config&, const Config&) {}
void take_order(GendenConfig& config, const GendenConfig& deduced) {
  config.densify.residual = deduced.densify.residual;
}
void take_order(VsplatGendenConfig& config, const VsplatGendenConfig& deduced) {
  config.densify.residual = deduced.densify.residual;
}
template <class Config>
bool same_order(const Config&, const Config&) {
  return true;
}
bool same_order(const GendenConfig& config, const GendenConfig& deduced) {
  return config.densify.residual == deduced.densify.residual;
}

// The named configuration with all values that the shapes show; if there are several, the order of the tensors decides.
template <class S>
std::string name_of_shapes(const Deduced<typename S::Config>& deduced) {
  std::string by_shapes;
  for (const std::string& name : S::names()) {
    const typename S::Config named = S::named(name);
    if (!differing_fields(named, deduced.config, deduced.fields).empty()) continue;
    if (same_order(named, deduced.config)) return name;
    if (by_shapes.empty()) by_shapes = name;
  }
  return by_shapes;
}

template <class S>
typename S::Config complete(const std::string& path, const Deduced<typename S::Config>& deduced,
                            const std::string& named, const ImportOptions& options, bool encoder_alone = false) {
  typename S::Config config = named.empty() ? deduced.config : S::named(named);
  take_order(config, deduced.config);
  for (const std::string& field : deduced.kinds) copy_field(config, deduced.config, field);
  config.negate_camera_centre = !encoder_alone;
  const std::set<std::string> given = set_given(config, options);
  std::vector<std::string> known = deduced.fields;
  known.insert(known.end(), deduced.kinds.begin(), deduced.kinds.end());
  for (const std::string& field : differing_fields(config, deduced.config, known))
    fail(Status::usage, "{}: its shapes determine {}, which is {}, but {} was asked for", path, field,
         field_text(deduced.config, field), field_text(config, field));
  std::vector<std::string> missing;
  for (const std::string& field : deduced.unknown)
    if (given.count(field) == 0) missing.push_back(field);
  if (named.empty() && !missing.empty())
    fail(Status::usage,
         "{}: its shapes belong to no named configuration, and shapes do not determine {}: give each as FIELD=VALUE "
         "({}) or in a JSON file ({})",
         path, fmt::join(missing, ", "), Option::import_fields, Option::import_config);
  try {
    check(config);
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", path, e.what());
  }
  return config;
}

template <class S>
bool in_network(std::string_view name) {
  return std::any_of(std::begin(S::modules), std::end(S::modules),
                     [name](const char* module) { return name.starts_with(module); });
}

// The densifier's frequencies, a buffer: "dec.0.up.frequencies".
bool is_frequencies(std::string_view name) { return name.starts_with("dec.") && name.ends_with(".up.frequencies"); }

// The frequencies must be powers of two, as in the published code.
void check_frequencies(const TorchFile& file, const std::string& prefix) {
  for (const TensorEntry& entry : file.tensors()) {
    if (!entry.name.starts_with(prefix) || !is_frequencies(std::string_view(entry.name).substr(prefix.size())))
      continue;
    float want = 1;
    for (const float found : file.floats(entry)) {
      if (found != want)
        fail(Status::format, "{}: tensor {} has {} where {} is expected: its waves are not powers of two", file.path(),
             printable(entry.name), found, want);
      want *= 2;
    }
  }
}

// Refuses tensors that the published network computes with and ours does not: without them it would be another network.
template <class S>
void refuse_more(const TorchFile& file, const std::string& prefix, const std::vector<std::string>& names) {
  std::vector<std::string> more;
  for (const std::string& name : names) {
    const std::string_view bare = std::string_view(name).substr(name.starts_with(prefix) ? prefix.size() : 0);
    const std::string encoder(S::mark, std::string_view(S::mark).rfind('.') + 1);  // "encoder.model."
    if (bare.starts_with(encoder + "head.") || bare.starts_with(encoder + "fc_norm.")) continue;
    if (is_frequencies(bare)) continue;  // checked by check_frequencies()
    if (name.starts_with(prefix) && in_network<S>(bare)) more.push_back(name);
  }
  if (!more.empty())
    fail(Status::format, "{}: {} tensors that {} does not have: {}", file.path(), more.size(), S::network,
         list_of(more));
}

// Refuses tensors that represent many values with few bytes, by strides or shared arrays; a saved model stores every
// value.
void refuse_repeated(const TorchFile& file, const std::vector<const TensorEntry*>& entries) {
  std::uint64_t bytes = 0;
  for (const TensorEntry* entry : entries) bytes += entry->bytes;
  if (bytes > file.stored_bytes())
    fail(Status::format,
         "{}: the network's tensors have {} bytes in an archive of {}: several values share parts of it", file.path(),
         bytes, file.stored_bytes());
}

// Deduces the configuration; an error about a missing tensor also says what the file was taken for.
template <class S>
Deduced<typename S::Config> deduced_as(const TorchFile& file, const std::string& prefix) {
  try {
    return S::deduced(file, prefix);
  } catch (const Error& e) {
    fail(e.status(), "{} (its tensors are those of {})", e.what(), S::network);
  }
}

template <class S>
ImportedModel import_as(const TorchFile& file, const ImportOptions& options) {
  using Config = typename S::Config;
  const std::string prefix = network_prefix<S>(file);
  const Deduced<Config> deduced = deduced_as<S>(file, prefix);
  const std::vector<Parameter> expected = parameters(deduced.config);  // with the shapes of the deduced fields
  const std::vector<const TensorEntry*> entries = match_tensors(file, expected, {prefix});

  ImportedModel out;
  out.left_out = beside(file, entries);
  refuse_more<S>(file, prefix, out.left_out);
  out.left_out.insert(out.left_out.end(), file.others().begin(), file.others().end());
  out.named = name_of_shapes<S>(deduced);
  ModelOf<Config> model;
  model.config = complete<S>(file.path(), deduced, out.named, options);

  refuse_repeated(file, entries);
  double bytes = 0;
  for (const Parameter& parameter : expected) bytes += static_cast<double>(parameter.count()) * sizeof(float);
  const HostMemory memory(file.path() + ": reading its values", bytes);
  file.verify();
  check_frequencies(file, prefix);
  model.weights = read_values(file, expected, entries);
  out.model = std::move(model);
  return out;
}

// Makes a VS-Splat model around the encoder in the file.
ImportedModel import_encoder(const TorchFile& file, const ImportOptions& options) {
  DeducedConfig deduced = deduced_encoder(file);
  deduced.kinds = {"encoder", "vit_registers", "vit_qkv_bias"};
  ImportedModel out;
  out.encoder_alone = true;
  out.named = name_of_shapes<VsplatSystem>(deduced);
  ModelFile model;
  model.config = complete<VsplatSystem>(file.path(), deduced, out.named, options, true);
  const std::string periods = encoder_periods(file, model.config);
  if (!periods.empty()) model.config.vit_rope_periods = periods;
  std::vector<const TensorEntry*> all;
  for (const TensorEntry& entry : file.tensors()) all.push_back(&entry);
  refuse_repeated(file, all);
  double bytes = static_cast<double>(file.stored_bytes());
  for (const Parameter& parameter : parameters(model.config))
    bytes += static_cast<double>(parameter.count()) * sizeof(float);
  const HostMemory memory(file.path() + ": a model about its encoder", bytes);
  file.verify();
  Weights encoder;  // read first, since the other weights take long to make
  out.left_out = load_encoder(encoder, model.config, file);
  model.weights = initial_weights(model.config, 0);
  for (const auto& [name, tensor] : encoder.all()) model.weights.set(name, tensor);
  out.left_out.insert(out.left_out.end(), file.others().begin(), file.others().end());
  out.model = std::move(model);
  return out;
}

}  // namespace

ImportedModel import_model(const std::string& path, const ImportOptions& options) {
  const TorchFile file(path);
  refuse_others(file);
  const bool whole = has_part(file, VsplatSystem::mark) && has_part(file, "volume_network.");
  if (!is_lara(file) && !whole && has_encoder(file)) return import_encoder(file, options);
  if (has_densifier(file))
    return is_lara(file) ? import_as<GendenSystem>(file, options) : import_as<VsplatGendenSystem>(file, options);
  return is_lara(file) ? import_as<LaraSystem>(file, options) : import_as<VsplatSystem>(file, options);
}

}  // namespace vsplat
