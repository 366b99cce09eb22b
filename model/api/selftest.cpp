// The self-test, and its stored verdict.
#include "model/diagnose/selftest/selftest.h"

#include <fmt/format.h>
#include <vsplat/selftest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "model/api/handle.h"
#include "model/api/selected.h"
#include "model/evaluate/model_check.h"
#include "model/networks/network.h"
#include "model/networks/params/built_in_model.h"
#include "model/networks/params/model_file.h"
#include "model/networks/params/systems.h"
#include "runtime/fail.h"
#include "runtime/log.h"

using namespace vsplat;
using namespace vsplat::api;
using Json = nlohmann::ordered_json;

namespace {

Json number_of(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json names_of(const SwitchedOff& off) {
  Json out = Json::array();
  for (const SwitchName& one : switch_names())
    if (off.*one.which) out.push_back(one.name);
  return out;
}

Json names_of(const std::vector<NamedKernel>& kernels) {
  Json out = Json::array();
  for (const NamedKernel& k : kernels) out.push_back(k.name);
  return out;
}

Json json_of(const selftest::FlavourResult& f) {
  Json out;
  out["flavour"] = name_of(f.flavour);
  if (!f.variant.empty()) out["variant"] = f.variant;
  out["usable"] = f.usable;
  out["off"] = names_of(f.off);
  out["results"] = f.results;
  out["kernels"] = Json::array();
  for (const selftest::KernelResult& k : f.kernels)
    out["kernels"].push_back({{"kernel", k.kernel.name},
                              {"file", k.kernel.file},
                              {"options", k.kernel.defines},
                              {"verdict", name_of(k.verdict)},
                              {"results", k.results},
                              {"wrong", k.wrong},
                              {"what", k.what},
                              {"error", number_of(k.error)},
                              {"tolerance", k.tolerance}});
  out["wrong"] = Json::array();
  for (const selftest::Finding& w : f.wrong)
    out["wrong"].push_back({{"what", w.what},
                            {"kernels", names_of(w.kernels)},
                            {"error", number_of(w.error)},
                            {"tolerance", w.tolerance},
                            {"trouble", w.trouble}});
  out["tuned"] = Json::array();
  for (const CheckedChoice& one : f.chosen)
    out["tuned"].push_back(
        {{"what", one.name}, {"error", number_of(one.error)}, {"right", one.right()}, {"why", one.why}});
  out["untested"] = names_of(f.untested);
  return out;
}

// dB; NaN without matrix units.
double measured_mixed_loss(const selftest::Report& report, const selftest::Options& options) {
  const AnyModel model = load_any_model(open_built_in_model());
  const AnyConfig config = std::visit([](const auto& m) -> AnyConfig { return m.config; }, model);
  const Weights& weights = std::visit([](const auto& m) -> const Weights& { return m.weights; }, model);
  const auto psnr = [&](Context& ctx) {
    ForwardOptions forward;
    forward.planned_selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config, "selected");
    return check_model(ctx, *make_network(ctx, config, weights), forward).psnr;
  };
  ContextOptions how;
  how.device = fmt::to_string(report.device.index);
  how.on_compile = options.on_compile;
  how.off = report.verdict.off;
  how.precision = Precision::mixed;
  Context mixed(how);
  if (mixed.matrix_unit() == MatrixUnit::emulated) return std::numeric_limits<double>::quiet_NaN();
  how.precision = Precision::fp32;
  Context exact(how);
  return psnr(exact) - psnr(mixed);
}

// What the built-in object loses in mixed precision on a sound device with matrix units, dB; of a quick self-test what
// is stored.
std::optional<double> mixed_loss_of(const selftest::Report& report, const selftest::Options& options) {
  if (report.verdict.fitness != Fitness::ok || built_in_model().empty()) return std::nullopt;
  if (report.quick) {
    const std::optional<Verdict> before = remembered_verdict(report.device);
    return before ? before->mixed_loss : std::nullopt;
  }
  if (options.progress && !options.progress("mixed precision", 1)) fail(Status::cancelled, "stopped");
  try {
    const double loss = measured_mixed_loss(report, options);
    if (std::isfinite(loss)) return loss;
  } catch (const Error& e) {  // such as too little memory for the network: the verdict stands without it
    if (e.status() == Status::cancelled) throw;
    verbose("what mixed precision loses is not measured: {}", e.what());
  }
  return std::nullopt;
}

// Stores the verdict: "now", "before" if a worse one stays, "no" if it is not stored.
std::string remember(const selftest::Report& report, bool forget) {
  if (forget) return "no";
  if (report.quick)
    if (const auto before = remembered_verdict(report.device); before && before->fitness > report.verdict.fitness)
      return "before";
  return vsplat::remember(report.device, report.verdict) ? "now" : "no";
}

}  // namespace

vsplat_status vsplat_selftest(const vsplat_selftest_options* options, vsplat_fitness* out_fitness, char** out_text) {
  return guarded([&] {
    need(out_fitness, "out_fitness");
    const vsplat_selftest_options o = taken(options, VSPLAT_SELFTEST_OPTIONS_INIT, "options");
    selftest::Options to;
    to.quick = o.quick != 0;
    to.forget = o.forget != 0;
    to.ended = o.ended ? o.ended : "";
    if (o.progress)
      to.progress = [&](const std::string& stage, double done) { return o.progress(o.user, stage.c_str(), done) != 0; };
    if (o.on_compile)
      to.on_compile = [&](const std::string& kernel, int compiled) { o.on_compile(o.user, kernel.c_str(), compiled); };
    selftest::Report report = selftest::run(o.device ? o.device : "", to);
    report.verdict.mixed_loss = mixed_loss_of(report, to);
    Json out;
    out["verdict"] = name_of(report.verdict.fitness);
    out["off"] = names_of(report.verdict.off);
    out["off_in_words"] = in_words(report.verdict.off);
    out["worst"] = report.verdict.worst;
    out["date"] = report.verdict.date;
    out["device"] = report.device.name;
    out["driver"] = report.device.driver;
    out["quick"] = report.quick;
    out["mixed_loss"] = report.verdict.mixed_loss ? number_of(*report.verdict.mixed_loss) : Json();
    out["remembered"] = remember(report, o.forget != 0);
    out["flavours"] = Json::array();
    for (const selftest::FlavourResult& f : report.flavours) out["flavours"].push_back(json_of(f));
    if (out_text) *out_text = new_text(out.dump(-1, ' ', false, Json::error_handler_t::replace));
    *out_fitness = static_cast<vsplat_fitness>(report.verdict.fitness);
  });
}
