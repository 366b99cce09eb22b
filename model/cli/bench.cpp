// vsplat bench: checks and times the network's dense kernels at their real shapes, every single operation, the drawing
// of whole scenes, the whole network, a training step and a fitting step. Compares them with the device's limits, with
// other libraries and with an earlier run. The only sub-command that does not use just the public header: it runs the
// cases of bench/.
#include "bench/bench.h"

#include <chrono>
#include <cmath>
#include <cstdio>

#include "arguments.h"
#include "bench/compare.h"
#include "command.h"
#include "outputs.h"

namespace command {
namespace {

struct BenchOptions {
  Common common;
  std::vector<std::string> suites;
  std::string filter;
  double seconds = 1.0;
  bool references = false;
  std::string scenes;
  std::string model, cameras, selection;
  std::string compare, fail_above;
};

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

// Names in lines of at most 100 columns.
std::string lines_of(const std::vector<std::string>& names) {
  std::string out, line;
  for (const std::string& name : names) {
    if (line.size() + name.size() > 96) out += line + "\n", line.clear();
    line += (line.empty() ? "  " : " ") + name;
  }
  return out + line;
}

}  // namespace

void add_bench(CLI::App& app, Run& run) {
  auto o = std::make_shared<BenchOptions>();
  CLI::App* sub =
      app.add_subcommand("bench", "Time operations, drawing, the network and training against what the device can do");
  sub->add_option("suites", o->suites, "Which suites (default: all)")
      ->check(one_of(vsplat::bench::suite_names()))
      ->type_name("SUITE");
  sub->add_option("--run", o->filter, "Only cases whose suite/name contains this")->type_name("TEXT");
  sub->add_option("--seconds", o->seconds, "Time spent on each case")->check(positive())->type_name("S");
  sub->add_flag(
      "--references", o->references,
      "Other libraries, too, by turns: OpenBLAS and oneDNN on a CPU, where they were there when this was built, "
      "and CLBlast, which compiles for long there");
  sub->add_option("--compare", o->compare,
                  "Say of each case whether it is slower or faster than in this earlier --json")
      ->check(CLI::ExistingFile)
      ->type_name("OLD.json");
  sub->add_option("--fail-above", o->fail_above,
                  "End with 1 where a case is slower than that by more, and by more than its noise")
      ->type_name("P%");
  sub->add_option("--scenes", o->scenes,
                  "Draw every NAME.ply by its NAME.cameras.json of this folder (default: scenes made here)")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  sub->add_option("--model", o->model, "Train this model (default: random weights of the size small)")
      ->type_name("MODEL.safetensors");
  sub->add_option("--cameras", o->cameras,
                  "Train on these four views, posed in the object's frame (default: a scene drawn here)")
      ->type_name("CAMERAS.json");
  sub->add_option("--selection", o->selection, "Train with these voxels selected (default: a tenth, nearest a sphere)")
      ->type_name("FILE");
  add_common(*sub, o->common, {.outside = false, .precision = true});
  sub->footer(
      "Examples:\n"
      "  vsplat bench gemm conv3d\n"
      "  vsplat bench conv3d --run 48 --json\n"
      "  vsplat bench attention layernorm\n"
      "  vsplat bench gemm conv3d --references\n"
      "  vsplat bench model --run paper --json > before.json\n"
      "  vsplat bench model --run paper --compare before.json --fail-above 5%\n"
      "  vsplat bench render --run small\n"
      "  vsplat bench train --run network\n"
      "  vsplat bench fit --run object\n"
      "Scenes are small-5k (128 x 128 pixels), object-190k (512 x 512) and slab-1m (1280 x 720), each forward and "
      "backward\n"
      "(which draws once more). A frame is timed from the call until the device is done, by 8 cameras in turn; the "
      "stages'\n"
      "shares of it include the host's. A step of training is that of one object, four input and four more views: its\n"
      "network's forward and backward, and the whole of it with both levels drawn, loss and optimiser.\n"
      "A case of the suite model is a whole forward of the network, of which each stage stands against what its "
      "kernels\n"
      "could be done in. A case takes --seconds, or three runs, but no more than 30 times as long.\n"
      "Every case's result is checked before it is timed, of most single operations only that there is one; the peaks\n"
      "are measured in the same run.\n"
      "Suites: gemm, conv3d, render, train, fit, model, sparse, and of single operations:\n" +
      lines_of(vsplat::bench::operation_names()));
  sub->callback([o, &run] { run = [o] { bench(*o); }; });
}

}  // namespace command
