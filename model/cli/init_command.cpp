// vsplat init: makes a new model with random weights.
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "outputs.h"

namespace command {
namespace {

struct InitOptions {
  Common common;
  std::string config, system = "vsplat", encoder, output, seed;
  std::vector<std::string> fields;
};

void init(const InitOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.encoder);
  outputs.expect(o.output);
  std::vector<const char*> fields;
  for (const std::string& field : o.fields) fields.push_back(field.c_str());
  vsplat_model_options options = VSPLAT_MODEL_OPTIONS_INIT;
  options.config = o.config.c_str();
  options.system = o.system.c_str();
  options.fields = fields.data();
  options.num_fields = fields.size();
  options.seed = seed_value("--seed", o.seed);
  options.encoder = o.encoder.empty() ? nullptr : o.encoder.c_str();
  const vsplat::Model model = vsplat::Model::init(options);
  model.save(outputs.begin(o.output));
  outputs.commit();
  const vsplat_model_info info = model.info();
  say(o.common, o.output + ": " + o.config + ", " + std::to_string(info.parameters) + " parameters, seed " + o.seed);
  if (o.common.json)
    print_json(nlohmann::ordered_json{{"output", o.output}, {"parameters", info.parameters}, {"image", info.image}});
}

}  // namespace

void add_init(CLI::App& app, Run& run) {
  auto o = std::make_shared<InitOptions>();
  CLI::App* sub = app.add_subcommand("init", "Make a model file with random weights, for tests and measurements");
  sub->add_option("config", o->config, "Named configuration")
      ->required()
      ->check(one_of({"paper", "published", "published_residual", "small", "tiny", "micro"}))
      ->type_name("paper|small|tiny|micro");
  sub->add_option("--system", o->system,
                  "Which network (default: vsplat); for lara and genden, paper is called published")
      ->check(one_of({"vsplat", "lara", "genden", "vsplat+genden"}))
      ->type_name("vsplat|lara|genden|vsplat+genden");
  sub->add_option("-o,--output", o->output, "The model file to write")->required()->type_name("MODEL.safetensors");
  sub->add_option("--seed", o->seed, "Seed of the random numbers; the same seed gives the same file on every machine")
      ->required()
      ->type_name("S");
  sub->add_option("--encoder", o->encoder,
                  "DINO ViT weights for the encoder, in timm's naming (DINOv3's also in Meta's), as safetensors or "
                  "from torch.save")
      ->type_name("FILE");
  sub->add_option("--set", o->fields, "Change a field of the configuration")->type_name("FIELD=VALUE");
  add_common(*sub, o->common, {.device = false, .profile = false, .outside = false});
  sub->footer(
      "A model with random weights takes as long as a trained one, and its scenes are meaningless. `vsplat train`\n"
      "starts from random weights by itself, and `vsplat reconstruct` has a trained model built in.\n"
      "Examples:\n"
      "  vsplat init small --seed 1 --output small.safetensors\n"
      "  vsplat init tiny --seed 7 --set fine_count=1 --set selection=sigmoid --output m.safetensors\n"
      "  vsplat init published --system lara --seed 1 --output lara.safetensors\n"
      "  vsplat init paper --seed 1 --encoder dino_vitb16.safetensors --output start.safetensors");
  sub->callback([o, &run] { run = [o] { init(*o); }; });
}

}  // namespace command
