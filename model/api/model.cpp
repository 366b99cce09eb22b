#include "model/api/model.h"

#include <nlohmann/json.hpp>

#include "model/networks/genden/densifier.h"
#include "model/networks/params/built_in_model.h"
#include "model/networks/params/import.h"
#include "model/networks/params/init.h"
#include "model/networks/params/load_encoder.h"
#include "model/networks/params/params.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

vsplat_model_info describe(const LaraConfig& config, vsplat_hash_state hash) {
  vsplat_model_info out = VSPLAT_MODEL_INFO_INIT;
  out.image = config.image;
  out.views = out.use_views = config.views;
  out.max_views = config.view_slots;
  out.volume = config.grid();
  out.sh_degree = config.sh_degree;
  out.max_gaussians = static_cast<uint64_t>(config.most_primitives());
  out.parameters = static_cast<uint64_t>(parameter_count(config));
  out.hash = hash;
  return out;
}

vsplat_model_info describe(const GendenConfig& config, vsplat_hash_state hash) {
  vsplat_model_info out = describe(static_cast<const LaraConfig&>(config), hash);
  out.max_gaussians = static_cast<uint64_t>(densified_count(config.densify, config.most_primitives()));
  out.parameters = static_cast<uint64_t>(parameter_count(config));
  return out;
}

vsplat_model_info describe(const Config& config, vsplat_hash_state hash) {
  vsplat_model_info out = VSPLAT_MODEL_INFO_INIT;
  out.image = config.image;
  out.views = config.views;
  out.max_views = config.most_views();
  out.volume = config.volume;
  out.sh_degree = config.sh_degree;
  out.max_gaussians = static_cast<uint64_t>(VsplatModel::most_gaussians(config));
  out.parameters = static_cast<uint64_t>(parameter_count(config));
  out.hash = hash;
  out.use_views = config.views_to_use();
  out.passes = config.passes;
  out.merge_cell = config.merge_cell;
  out.fit_epochs = config.fit_epochs;
  return out;
}

vsplat_model_info describe(const VsplatGendenConfig& config, vsplat_hash_state hash) {
  vsplat_model_info out = describe(static_cast<const Config&>(config), hash);
  out.max_gaussians = static_cast<uint64_t>(densified_count(config.densify, VsplatModel::most_gaussians(config)));
  out.parameters = static_cast<uint64_t>(parameter_count(config));
  return out;
}

SafetensorsFile opened(const char* path) { return path ? SafetensorsFile(path) : open_built_in_model(); }

std::string json_of(const ModelInfo& info) {
  nlohmann::ordered_json out;
  out["system"] = info.system;
  out["config"] = nlohmann::ordered_json::parse(info.config);
  out["tensors"] = info.tensors;
  out["parameters"] = info.parameters;
  out["file_bytes"] = info.file_bytes;
  out["dtypes"] = info.dtypes;
  out["sha256"] = info.sha256;
  out["provenance"] = nlohmann::ordered_json::object();
  for (const auto& [name, value] : info.provenance) out["provenance"][name] = value;
  return out.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string json_of(const ImportedModel& imported) {
  nlohmann::ordered_json out;
  out["system"] = system_of(imported.model);
  out["config"] = nlohmann::ordered_json::parse(
      std::visit([](const auto& model) { return to_json(model.config); }, imported.model));
  out["named"] = nullptr;
  if (!imported.named.empty()) out["named"] = imported.named;
  out["left_out"] = imported.left_out;
  out["encoder_alone"] = imported.encoder_alone;
  return out.dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::unique_ptr<vsplat_model_impl> handle_of(AnyModel model) {
  auto out = std::make_unique<vsplat_model_impl>();
  out->file = std::make_shared<const AnyModel>(std::move(model));
  return out;
}

template <class Visit>
auto with_file(vsplat_model model, const Visit& visit) {
  return std::visit(visit, *model->file);
}

std::vector<std::string> texts(const char* const* given, size_t count, const char* what) {
  need_array(given, count, what);
  std::vector<std::string> out;
  for (size_t i = 0; i < count; ++i) {
    need(given[i], (std::string("an element of ") + what).c_str());
    out.emplace_back(given[i]);
  }
  return out;
}

void save_as(vsplat_model model, const std::string& path, const vsplat_dtype& dtype) {
  const int as = value_of(dtype);
  if (as != VSPLAT_DTYPE_F32 && as != VSPLAT_DTYPE_F16)
    fail(Status::usage, "dtype is {}, not a value of vsplat_dtype", as);
  with_file(model, [&](const auto& file) {
    std::map<std::string, std::string> provenance = file.metadata;
    for (const char* own : {"format", "version", "config", "sha256", "system"}) provenance.erase(own);
    save_model(path, file.config, file.weights, provenance, as == VSPLAT_DTYPE_F16 ? Dtype::f16 : Dtype::f32);
  });
}

}  // namespace

const ModelFile& vsplat::api::vsplat_file(vsplat_model model) {
  if (const auto* own = std::get_if<ModelFile>(model->file.get())) return *own;
  fail(Status::usage, "{}the model is of {}, but this call needs a model of {}",
       model->path.empty() ? "" : printable(model->path) + ": ", network_of(*model->file), VsplatSystem::network);
}

AnyConfig vsplat::api::config_of(vsplat_model model) {
  return with_file(model, [](const auto& file) { return AnyConfig(file.config); });
}

const Weights& vsplat::api::weights_of(vsplat_model model) {
  return *with_file(model, [](const auto& file) { return &file.weights; });
}

vsplat_status vsplat_model_init(const vsplat_model_options* options, vsplat_model* out_model) {
  return guarded([&] {
    need(out_model, "out_model");
    const vsplat_model_options o = taken(options, VSPLAT_MODEL_OPTIONS_INIT, "options");
    need(o.config, "options.config");
    const AnyConfig config = with_fields(named_any_config(o.system ? o.system : VsplatSystem::name, o.config),
                                         texts(o.fields, o.num_fields, "options.fields"));
    AnyModel made = config.visit([&](const auto& c) {
      ModelOf<std::decay_t<decltype(c)>> file{c, initial_weights(c, o.seed), {}};
      file.metadata["seed"] = std::to_string(o.seed);
      file.metadata["origin"] = std::string("random weights, vsplat ") + VSPLAT_VERSION_STRING;
      if (o.encoder) {
        load_encoder(file.weights, c, o.encoder);
        file.metadata["origin"] += ", encoder from a file";
      }
      return AnyModel(std::move(file));
    });
    *out_model = handle_of(std::move(made)).release();
  });
}

namespace {

auto loaded(const SafetensorsFile& from) {
  auto model = handle_of(load_any_model(from));
  // load_any_model() checks the hash if there is one.
  const bool stated = with_file(model.get(), [](const auto& file) { return file.metadata.count("sha256") != 0; });
  model->hash = stated ? VSPLAT_HASH_VERIFIED : VSPLAT_HASH_ABSENT;
  return model;
}

}  // namespace

vsplat_status vsplat_model_load_memory(const void* bytes, size_t size, vsplat_model* out_model) {
  return guarded([&] {
    need(bytes, "bytes");
    need(out_model, "out_model");
    const std::span content(static_cast<const std::byte*>(bytes), size);
    *out_model = loaded(SafetensorsFile("the model in memory", content)).release();
  });
}

vsplat_status vsplat_model_load(const char* path, vsplat_model* out_model) {
  return guarded([&] {
    need(out_model, "out_model");
    auto model = loaded(opened(path));
    if (path) model->path = path;
    *out_model = model.release();
  });
}

vsplat_status vsplat_model_import(const char* path, const vsplat_import_options* options, vsplat_model* out_model,
                                  char** out_text) {
  return guarded([&] {
    need(path, "path");
    need(out_model, "out_model");
    const vsplat_import_options o = taken(options, VSPLAT_IMPORT_OPTIONS_INIT, "options");
    ImportOptions how;
    if (o.config_file) how.config_file = o.config_file;
    how.fields = texts(o.fields, o.num_fields, "options.fields");
    ImportedModel imported = import_model(path, how);
    const std::string origin =
        std::string(imported.encoder_alone ? "encoder from a PyTorch file, all else random (seed 0)"
                                           : "imported from a PyTorch checkpoint") +
        ", vsplat " + VSPLAT_VERSION_STRING;
    std::visit([&](auto& made) { made.metadata["origin"] = origin; }, imported.model);
    const std::string report = json_of(imported);
    auto model = handle_of(std::move(imported.model));
    if (out_text) *out_text = new_text(report);
    *out_model = model.release();
  });
}

vsplat_status vsplat_model_save(vsplat_model model, const char* path) {
  return vsplat_model_save_as(model, path, VSPLAT_DTYPE_F32);
}

vsplat_status vsplat_model_save_as(vsplat_model model, const char* path, vsplat_dtype dtype) {
  return guarded([&] {
    need(model, "model");
    need(path, "path");
    save_as(model, path, dtype);
  });
}

vsplat_status vsplat_model_save_memory(vsplat_model model, vsplat_dtype dtype, char** out_bytes, size_t* out_size) {
  return guarded([&] {
    need(model, "model");
    give_bytes([&](const std::string& name) { save_as(model, name, dtype); }, "the model", out_bytes, out_size);
  });
}

vsplat_status vsplat_model_with_use_views(vsplat_model model, int32_t use_views, vsplat_model* out_model) {
  return guarded([&] {
    need(model, "model");
    need(out_model, "out_model");
    if (use_views < 1 || use_views > max_views)
      fail(Status::usage, "use_views is {}: 1 to {} expected", use_views, max_views);
    ModelFile file = vsplat_file(model);
    file.config.use_views = use_views;
    *out_model = handle_of(std::move(file)).release();
  });
}

vsplat_status vsplat_model_with_passes(vsplat_model model, int32_t passes, double merge_cell, int32_t fit_epochs,
                                       vsplat_model* out_model) {
  return guarded([&] {
    need(model, "model");
    need(out_model, "out_model");
    ModelFile file = vsplat_file(model);
    file.config.passes = passes;
    file.config.merge_cell = merge_cell;
    file.config.fit_epochs = fit_epochs;
    check(file.config);
    *out_model = handle_of(std::move(file)).release();
  });
}

void vsplat_model_retain(vsplat_model model) { retain(model); }
void vsplat_model_release(vsplat_model model) { release(model); }

vsplat_status vsplat_model_get_info(vsplat_model model, vsplat_model_info* out_info) {
  return guarded([&] {
    need(model, "model");
    give(out_info, with_file(model, [&](const auto& file) { return describe(file.config, model->hash); }), "out_info");
  });
}

vsplat_status vsplat_model_inspect(const char* path, vsplat_model_info* out_info, char** out_text) {
  return guarded([&] {
    if (out_info) check_size(*out_info, "out_info");
    const ModelInfo info = model_info(opened(path));
    const vsplat_hash_state hash = info.sha256.empty() ? VSPLAT_HASH_ABSENT : VSPLAT_HASH_STATED;
    if (out_info)
      give(out_info, std::visit([hash](const auto& model) { return describe(model.config, hash); }, info.model),
           "out_info");
    if (out_text) *out_text = new_text(json_of(info));
  });
}

vsplat_status vsplat_model_verify(const char* path, vsplat_hash_state* out_state) {
  return guarded([&] {
    need(out_state, "out_state");
    *out_state = verify_model(opened(path)) == HashState::matches ? VSPLAT_HASH_VERIFIED : VSPLAT_HASH_ABSENT;
  });
}
