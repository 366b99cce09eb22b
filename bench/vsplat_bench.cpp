// vsplat-bench: what `vsplat bench` runs, with the command's own arguments. It reaches into the library, which it has
// inside. Compares operations, drawing, training and the network with the device's limits, with other libraries and
// with an earlier run.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>

#include "bench/bench.h"
#include "bench/earlier_run.h"
#include "model/cli/arguments.h"
#include "model/cli/bench_options.h"
#include "model/cli/carry_out.h"
#include "model/cli/outputs.h"

namespace {

using namespace command;

// Progress of a long run: a line from time to time if no terminal shows every step.
class Telling {
 public:
  explicit Telling(const Common& common) : common_(common) {}

  void tell(const vsplat::bench::CaseProgress& p) {
    if (interrupted()) throw std::runtime_error("stopped");
    last_ = std::to_string(p.at + 1) + " of " + std::to_string(p.all) + ": " + p.name + ", ";
    left_ = p.left_s < 0 ? "" : ", about " + seconds_text(p.left_s) + " left";
    show_progress(common_, last_ + p.doing + left_);
    if (common_.quiet || progress_is_shown()) return;
    const auto now = std::chrono::steady_clock::now();
    if (now - said_ < std::chrono::seconds(10)) return;
    said_ = now;
    say(common_, "bench: " + last_ + p.doing + left_);
  }
  void compiling(const std::string& kernel, int compiled) const {
    show_progress(common_, last_ + "preparing kernels: " + std::to_string(compiled + 1) + " (" + kernel + ")" + left_);
  }

 private:
  const Common& common_;
  std::string last_, left_;
  std::chrono::steady_clock::time_point said_ = std::chrono::steady_clock::now();
};

vsplat::ContextOptions context_options(const Common& common, const Telling& telling) {
  vsplat::ContextOptions out;
  out.device = common.device;
  out.kernels = common.kernels;
  out.gemm = common.gemm == "own"       ? vsplat::GemmChoice::own
             : common.gemm == "clblast" ? vsplat::GemmChoice::clblast
                                        : vsplat::GemmChoice::auto_;
  out.max_memory_gib = common.max_memory;
  out.precision = common.precision == "mixed" ? vsplat::Precision::mixed : vsplat::Precision::fp32;
  out.on_compile = [&telling](const std::string& kernel, int compiled) { telling.compiling(kernel, compiled); };
  return out;
}

// Throws if a case is slower by more than its noise and by more than `limit`.
void hold_against(const vsplat::bench::Comparison& compared, const std::string& asked, double limit) {
  std::string slower;
  for (const vsplat::bench::ComparedCase& c : compared.cases) {
    if (c.verdict != "slower" || !(c.slower_by > limit)) continue;
    char by[32];
    std::snprintf(by, sizeof by, " %+.1f %%", 100 * c.slower_by);
    slower += (slower.empty() ? " " : ", ") + c.suite + "/" + c.name + by;
  }
  if (!slower.empty()) throw std::runtime_error("slower by more than " + asked + ":" + slower);
}

void bench(const BenchOptions& o) try {
  if (!o.fail_above.empty() && o.compare.empty())
    throw UsageError("--fail-above says how much slower a case may be than one of --compare, which is not given");
  const double limit = o.fail_above.empty() ? HUGE_VAL : percentage("--fail-above", o.fail_above);
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : {o.model, o.selection, o.compare}) outputs.input(path);
  std::optional<vsplat::bench::EarlierReport> before;
  if (!o.compare.empty()) before = vsplat::bench::read_report(o.compare);
  outputs.input_cameras(o.cameras);
  outputs.expect(o.common.profile);
  outputs.expect(o.common.trace);
  Telling telling(o.common);
  vsplat::Context ctx(context_options(o.common, telling));
  say(o.common,
      "device " + std::to_string(ctx.device().index) + ": " + ctx.device().name + ", driver " + ctx.device().driver +
          ", " + vsplat::name_of(ctx.flavour()) + " kernels" +
          (ctx.precision() == vsplat::Precision::mixed
               ? std::string(", mixed precision (") + vsplat::name_of(ctx.matrix_unit()) + ")"
               : "") +
          (ctx.device().lowered.empty() ? "" : ", lowered by VSPLAT_LIMITS=" + ctx.device().lowered) +
          (ctx.switched_off().any() ? ", not used since its self-test: " + vsplat::in_words(ctx.switched_off()) : ""));
  if (!o.common.profile.empty() || !o.common.trace.empty()) vsplat::bench::record(ctx);
  vsplat::bench::Options options;
  options.suites = o.suites;
  options.filter = o.filter;
  options.seconds = o.seconds;
  options.references = o.references;
  options.scenes = o.scenes;
  options.model = o.model;
  options.cameras = o.cameras;
  options.selection = o.selection;
  options.on_progress = [&telling](const vsplat::bench::CaseProgress& p) { telling.tell(p); };
  vsplat::bench::Report report = vsplat::bench::run(ctx, options);
  clear_progress();
  if (before) report.compared = vsplat::bench::compare(*before, report);
  const std::string text = o.common.json ? vsplat::bench::json(report) : vsplat::bench::table(report);
  std::printf("%s%s", text.c_str(), text.empty() || text.back() == '\n' ? "" : "\n");
  const auto [profile, page, trace] = vsplat::bench::recorded(ctx);
  if (!o.common.profile.empty())
    write_text(outputs.begin(o.common.profile), o.common.profile.ends_with(".html") ? page : profile);
  if (!o.common.trace.empty()) write_text(outputs.begin(o.common.trace), trace);
  outputs.commit();
  if (report.compared) hold_against(*report.compared, o.fail_above, limit);
} catch (const vsplat::Error& e) {
  if (e.status() == vsplat::Status::usage) throw UsageError(e.what());
  throw;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs vsplat bench.", "vsplat");
  app.require_subcommand(1);
  Run run;
  BenchOptions options;
  add_bench_options(app, options)->callback([&] { run = [&] { bench(options); }; });
  return carry_out(app, run, {argv + std::min(argc, 1), argv + argc});
}
