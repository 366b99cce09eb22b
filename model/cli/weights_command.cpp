// vsplat weights: shows a model file, verifies it, checks its quality, converts its value type, and imports PyTorch
// files.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"
#include "session.h"

namespace command {
namespace {

struct WeightsOptions {
  Common common;
  std::string model, dtype, output, checkpoint, config;
  std::vector<std::string> fields;
  int view_count = 0, passes = 0;  // 0: unchanged
  double merge_cell = -1;          // below 0: unchanged
  int fit_epochs = -1;             // likewise

  // As the C interface takes it: NULL for the built-in model.
  const char* path() const { return model.empty() ? nullptr : model.c_str(); }
  std::string name() const { return model.empty() ? "built-in model" : model; }
};

void info(const WeightsOptions& o) {
  set_up_library(o.common);
  char* out = nullptr;
  vsplat::check(vsplat_model_inspect(o.path(), nullptr, &out));
  const std::string text = vsplat::text(out);
  if (o.common.json) {
    std::printf("%s\n", text.c_str());
    return;
  }
  const nlohmann::ordered_json all = nlohmann::ordered_json::parse(text);
  const auto value = [](const nlohmann::ordered_json& v) {
    return for_terminal(v.is_string() ? v.get<std::string>() : v.dump());
  };
  std::printf("%s: %s bytes\n", for_terminal(o.name()).c_str(), all["file_bytes"].dump().c_str());
  std::printf("  %-20s %s in %s tensors\n", "parameters", all["parameters"].dump().c_str(),
              all["tensors"].dump().c_str());
  for (const auto& [dtype, count] : all["dtypes"].items())
    std::printf("  %-20s %s tensors\n", dtype.c_str(), count.dump().c_str());
  const std::string hash = value(all["sha256"]);
  std::printf("  %-20s %s\n", "sha256", hash.empty() ? "none stated" : hash.c_str());
  std::printf("  %-20s %s\n", "system", value(all["system"]).c_str());
  std::printf("configuration\n");
  for (const auto& [name, field] : all["config"].items())
    std::printf("  %-20s %s\n", for_terminal(name).c_str(), value(field).c_str());
  if (!all["provenance"].empty()) std::printf("provenance\n");
  for (const auto& [name, field] : all["provenance"].items())
    std::printf("  %-20s %s\n", for_terminal(name).c_str(), value(field).c_str());
}

void verify(const WeightsOptions& o) {
  set_up_library(o.common);
  vsplat_hash_state state = VSPLAT_HASH_ABSENT;
  vsplat::check(vsplat_model_verify(o.path(), &state));
  const bool verified = state == VSPLAT_HASH_VERIFIED;
  if (o.common.json)
    print_json(nlohmann::ordered_json{{"model", o.name()}, {"structure", "ok"}, {"hash", verified ? "ok" : "absent"}});
  else
    std::printf("%s: header, configuration, tensors and their values are right; %s\n", for_terminal(o.name()).c_str(),
                verified ? "the SHA-256 matches" : "no SHA-256 is stated, so damage to the values would go unseen");
}

void check(const WeightsOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.model);
  for (const std::string& path : {o.common.profile, o.common.trace}) outputs.expect(path);
  const vsplat::Model model = load_model(o.model);
  Session session(o.common);
  session.about("command", "weights check");
  session.about("model", model_name(o.model));
  session.start("reconstructing");
  vsplat_check_options options = VSPLAT_CHECK_OPTIONS_INIT;
  options.progress = Session::on_progress;
  options.user = &session;
  const nlohmann::ordered_json found =
      nlohmann::ordered_json::parse(vsplat::check_model(session.device(), model, options));
  session.write_profile(outputs);
  outputs.commit();
  clear_progress();
  const auto decibels = [](const nlohmann::ordered_json& value) {
    char text[32] = "not a number";
    if (value.is_number()) std::snprintf(text, sizeof text, "%.2f dB", value.get<double>());
    return std::string(text);
  };
  nlohmann::ordered_json warning;  // null
  if (found["below_nearest"].get<bool>())
    warning = "the drawn input views reach " + decibels(found["psnr"]) +
              ", but the nearest other view in place of each reaches " + decibels(found["psnr_nearest"]) +
              ": the weights are untrained, damaged, or were not imported as they were trained";
  if (o.common.json) {
    nlohmann::ordered_json out{{"model", o.name()}};
    out.update(found);
    out["warning"] = warning;
    print_json(out);
  } else {
    const std::string edge = found["image"].dump();
    std::printf("%s on the object '%s': its input views of %s x %s pixels, drawn again\n",
                for_terminal(o.name()).c_str(), for_terminal(found["object"].get<std::string>()).c_str(), edge.c_str(),
                edge.c_str());
    const auto line = [&](const std::string& name, const nlohmann::ordered_json& of) {
      std::printf("  %-20s %s (nearest other view: %s)\n", for_terminal(name).c_str(), decibels(of["psnr"]).c_str(),
                  decibels(of["psnr_nearest"]).c_str());
    };
    for (const nlohmann::ordered_json& view : found["views"]) line(view["name"].get<std::string>(), view);
    line("mean", found);
  }
  if (!warning.is_null()) warn(warning.get<std::string>());
}

void convert(const WeightsOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.model);
  outputs.expect(o.output);
  vsplat::Model model = load_model(o.model);
  if (o.view_count) model = model.with_use_views(o.view_count);
  if (o.passes || o.merge_cell >= 0 || o.fit_epochs >= 0) {
    const vsplat_model_info info = model.info();
    model = model.with_passes(o.passes ? o.passes : info.passes, o.merge_cell >= 0 ? o.merge_cell : info.merge_cell,
                              o.fit_epochs >= 0 ? o.fit_epochs : info.fit_epochs);
  }
  try {
    model.save(outputs.begin(o.output), o.dtype == "f16" ? VSPLAT_DTYPE_F16 : VSPLAT_DTYPE_F32);
  } catch (const vsplat::Error& e) {  // a value that does not fit: the message names only the output
    if (e.status() != VSPLAT_ERROR_INPUT) throw;
    throw vsplat::Error(e.status(), (o.name() + " as " + e.what()).c_str());
  }
  outputs.commit();
  const auto bytes = std::filesystem::file_size(o.output);
  say(o.common, o.output + ": " + o.name() + " as " + o.dtype + ", " + bytes_text(bytes));
  if (o.common.json) print_json(nlohmann::ordered_json{{"output", o.output}, {"dtype", o.dtype}, {"bytes", bytes}});
}

void import(const WeightsOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.checkpoint);
  outputs.input(o.config);
  outputs.expect(o.output);
  std::vector<const char*> fields;
  for (const std::string& field : o.fields) fields.push_back(field.c_str());
  vsplat_import_options options = VSPLAT_IMPORT_OPTIONS_INIT;
  options.config_file = o.config.empty() ? nullptr : o.config.c_str();
  options.fields = fields.data();
  options.num_fields = fields.size();
  std::string report;
  const vsplat::Model model = vsplat::Model::imported(o.checkpoint, options, &report);
  model.save(outputs.begin(o.output));
  outputs.commit();
  nlohmann::ordered_json all = nlohmann::ordered_json::parse(report);
  for (const auto& name : all["left_out"]) say(o.common, "left out: " + name.get<std::string>());
  if (all["encoder_alone"].get<bool>())
    say(o.common,
        "only an encoder: the rest of the model has random weights (seed 0) and must be trained, as with vsplat train "
        "--init");
  const std::string shapes =
      all["named"].is_null() ? "of no named configuration" : "as " + all["named"].get<std::string>();
  say(o.common, o.output + ": " + std::to_string(model.info().parameters) + " parameters, shapes " + shapes + ", " +
                    bytes_text(std::filesystem::file_size(o.output)));
  if (!all["encoder_alone"].get<bool>()) say(o.common, "next, check that it works: vsplat weights check " + o.output);
  if (!o.common.json) return;
  nlohmann::ordered_json out{{"output", o.output}, {"parameters", model.info().parameters}};
  out.update(all);
  print_json(out);
}

CLI::App* add_action(CLI::App& parent, Run& run, const std::shared_ptr<WeightsOptions>& o, const char* name,
                     const char* what, void (*action)(const WeightsOptions&), const Takes& takes) {
  CLI::App* sub = parent.add_subcommand(name, what);
  sub->add_option("model", o->model, "A model file (default: the built-in model)")->type_name("MODEL");
  add_common(*sub, o->common, takes);
  sub->callback([o, action, &run] { run = [o, action] { action(*o); }; });
  return sub;
}

// Options of actions that only read the file.
constexpr Takes kOfFile{.device = false, .profile = false, .overwrite = false, .outside = false};

void add_convert(CLI::App& parent, Run& run) {
  auto o = std::make_shared<WeightsOptions>();
  CLI::App* sub = add_action(parent, run, o, "convert", "Write the model with values of another type", convert,
                             {.device = false, .profile = false, .outside = false});
  sub->add_option("--dtype", o->dtype,
                  "Type of the values: f16 takes half the space and rounds to nearest, ties to even")
      ->required()
      ->check(one_of({"f16", "f32"}))
      ->type_name("f16|f32");
  sub->add_option("--view-count", o->view_count,
                  "Store in the file how many pictures reconstruct uses by default, 1 to 16")
      ->check(CLI::Range(1, 16).description(""))
      ->type_name("N");
  sub->add_option("--passes", o->passes, "Store in the file how many passes reconstruct runs by default, 1 to 16")
      ->check(CLI::Range(1, 16).description(""))
      ->type_name("N");
  sub->add_option("--merge-cell", o->merge_cell,
                  "Store in the file in which cells reconstruct merges Gaussians by default: their edge in voxels, 0 "
                  "to 16; 0: none")
      ->check(CLI::Range(0.0, 16.0).description(""))
      ->type_name("E");
  sub->add_option("--fit-epochs", o->fit_epochs,
                  "Store in the file how many epochs reconstruct fits its result to the inputs by default, 0 to 1000")
      ->check(CLI::Range(0, 1000).description(""))
      ->type_name("N");
  sub->add_option("-o,--output", o->output, "The model file to write")->required()->type_name("FILE");
  sub->footer("Example:\n  vsplat weights convert model.safetensors --dtype f16 --output half.safetensors");
}

void add_import(CLI::App& parent, Run& run) {
  auto o = std::make_shared<WeightsOptions>();
  CLI::App* sub = parent.add_subcommand(
      "import", "Make a model file from a checkpoint of VS-Splat, LaRa or GenDen, or from a DINO or DINOv3 encoder");
  sub->add_option("checkpoint", o->checkpoint, "A checkpoint of Lightning (.ckpt), or a state dict (.pth, .pt)")
      ->required()
      ->type_name("FILE");
  sub->add_option("-o,--output", o->output, "The model file to write")->required()->type_name("MODEL.safetensors");
  sub->add_option("--config", o->config,
                  "Fields of the configuration that shapes do not determine, with dotted names or as objects; or the "
                  "output of `vsplat weights info --json`")
      ->type_name("FILE.json");
  sub->add_option("--set", o->fields, "One such field; it overrides --config")->type_name("FIELD=VALUE");
  add_common(*sub, o->common, {.device = false, .profile = false, .outside = false});
  sub->callback([o, &run] { run = [o] { import(*o); }; });
  sub->footer(
      "Nothing in the file is run: what a state dict does not need is refused by name. Sizes come from the tensors'\n"
      "shapes; the rest (heads, groups, windows, the pictures' and the volume's size) comes from the named\n"
      "configuration with all of these shapes, or else must be given. An encoder alone, DINO's or DINOv3's in timm's\n"
      "or Meta's naming, becomes a model whose other weights are random, as the start of a training.\n"
      "Examples:\n"
      "  vsplat weights import epoch=49.ckpt --output model.safetensors\n"
      "  vsplat weights import own.ckpt --output own.safetensors --set vit_heads=6 --set groups=16 --set image=256 \\\n"
      "    --set volume=32");
}

}  // namespace

void add_weights(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand("weights", "Show, check, convert or import a model file");
  sub->require_subcommand(1);
  add_action(*sub, run, std::make_shared<WeightsOptions>(), "info", "Configuration, size, tensors and origin", info,
             kOfFile)
      ->footer("Examples:\n  vsplat weights info\n  vsplat weights info model.safetensors");
  add_action(*sub, run, std::make_shared<WeightsOptions>(), "verify",
             "Check the whole file: structure, every tensor's shape and values, and the hash if one is stated", verify,
             kOfFile)
      ->footer("Example:\n  vsplat weights verify model.safetensors");
  add_action(*sub, run, std::make_shared<WeightsOptions>(), "check",
             "Reconstruct a built-in object, and measure how well its input views are reproduced", check,
             {.outside = false})
      ->footer(
          "The object is random, but the same for every model, in as many views as the model is trained with.\n"
          "Each view's PSNR is printed beside what the nearest other input view reaches in its place; a mean below\n"
          "that gives a warning, and the exit code stays 0.\n"
          "Examples:\n"
          "  vsplat weights check\n"
          "  vsplat weights check model.safetensors --json");
  add_convert(*sub, run);
  add_import(*sub, run);
  sub->footer(
      "Examples:\n"
      "  vsplat weights info\n"
      "  vsplat weights verify model.safetensors\n"
      "  vsplat weights check model.safetensors\n"
      "  vsplat weights convert model.safetensors --dtype f16 --output half.safetensors\n"
      "  vsplat weights import epoch=49.ckpt --output model.safetensors");
}

}  // namespace command
