// vsplat weights: what is in a model file, and whether it is whole.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {
namespace {

struct Options {
  Common common;
  std::string model;
};

void info(const Options& o) {
  start_log(o.common);
  char* out = nullptr;
  vsplat::check(vsplat_model_inspect(o.model.c_str(), nullptr, &out));
  const std::string text = vsplat::text(out);
  if (o.common.json) {
    std::printf("%s\n", text.c_str());
    return;
  }
  const nlohmann::ordered_json all = nlohmann::ordered_json::parse(text);
  const auto value = [](const nlohmann::ordered_json& v) { return v.is_string() ? v.get<std::string>() : v.dump(); };
  std::printf("%s: %s bytes\n", o.model.c_str(), all["file_bytes"].dump().c_str());
  std::printf("  %-20s %s in %s tensors\n", "parameters", all["parameters"].dump().c_str(),
              all["tensors"].dump().c_str());
  for (const auto& [dtype, count] : all["dtypes"].items())
    std::printf("  %-20s %s tensors\n", dtype.c_str(), count.dump().c_str());
  const std::string hash = value(all["sha256"]);
  std::printf("  %-20s %s\n", "sha256", hash.empty() ? "none stated" : hash.c_str());
  std::printf("configuration\n");
  for (const auto& [name, field] : all["config"].items())
    std::printf("  %-20s %s\n", name.c_str(), value(field).c_str());
  if (!all["provenance"].empty()) std::printf("provenance\n");
  for (const auto& [name, field] : all["provenance"].items())
    std::printf("  %-20s %s\n", name.c_str(), value(field).c_str());
}

void verify(const Options& o) {
  start_log(o.common);
  vsplat_hash_state state = VSPLAT_HASH_ABSENT;
  vsplat::check(vsplat_model_verify(o.model.c_str(), &state));
  const bool verified = state == VSPLAT_HASH_VERIFIED;
  if (o.common.json)
    std::printf("%s\n",
                nlohmann::ordered_json{{"model", o.model}, {"structure", "ok"}, {"hash", verified ? "ok" : "absent"}}
                    .dump(1)
                    .c_str());
  else
    std::printf("%s: header, configuration and tensors are right; %s\n", o.model.c_str(),
                verified ? "the SHA-256 matches" : "no SHA-256 is stated, so damage to the values would go unseen");
}

void add_action(CLI::App& parent, Run& run, const char* name, const char* what, void (*action)(const Options&)) {
  auto o = std::make_shared<Options>();
  CLI::App* sub = parent.add_subcommand(name, what);
  sub->add_option("model", o->model, "A model file")->required()->type_name("MODEL");
  add_common(*sub, o->common);
  sub->footer(std::string("Example:\n  vsplat weights ") + name + " model.safetensors");
  sub->callback([o, action, &run] { run = [o, action] { action(*o); }; });
}

}  // namespace

void add_weights(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand("weights", "Look into a model file");
  sub->require_subcommand(1);
  add_action(*sub, run, "info", "Configuration, size, tensors and origin", info);
  add_action(*sub, run, "verify", "Read all of it: structure, every tensor's shape, and the hash where one is stated",
             verify);
  sub->footer("Examples:\n  vsplat weights info model.safetensors\n  vsplat weights verify model.safetensors");
}

}  // namespace command
