// vsplat bench: the network's dense kernels at their real shapes, every single operation, the drawing of whole scenes,
// a step of training and one of refinement, checked, timed and held against the device's limits. The one sub-command
// that is not on the public header: it runs the cases of bench/.
#include "bench/bench.h"

#include <cstdio>

#include "arguments.h"
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
};

vsplat::ContextOptions context_options(const Common& common) {
  vsplat::ContextOptions out;
  out.device = common.device;
  out.kernels = common.kernels;
  out.gemm = common.gemm == "own"       ? vsplat::GemmChoice::own
             : common.gemm == "clblast" ? vsplat::GemmChoice::clblast
                                        : vsplat::GemmChoice::auto_;
  out.max_memory_gib = common.max_memory;
  out.on_compile = [&common](const std::string& kernel, int compiled) {
    show_progress(common, "preparing kernels: " + std::to_string(compiled + 1) + " (" + kernel + ")");
  };
  return out;
}

void bench(const BenchOptions& o) try {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : {o.model, o.selection}) outputs.input(path);
  outputs.input_cameras(o.cameras);
  outputs.expect(o.common.profile);
  outputs.expect(o.common.trace);
  vsplat::Context ctx(context_options(o.common));
  say(o.common,
      "device " + std::to_string(ctx.device().index) + ": " + ctx.device().name + ", driver " + ctx.device().driver +
          ", " + vsplat::name_of(ctx.flavour()) + " kernels" +
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
  options.on_case = [&o](const std::string& name) {
    if (interrupted()) throw std::runtime_error("stopped");
    show_progress(o.common, name);
  };
  const vsplat::bench::Report report = vsplat::bench::run(ctx, options);
  clear_progress();
  const std::string text = o.common.json ? vsplat::bench::json(report) : vsplat::bench::table(report);
  std::printf("%s%s", text.c_str(), text.empty() || text.back() == '\n' ? "" : "\n");
  const auto [profile, page, trace] = vsplat::bench::recorded(ctx);
  if (!o.common.profile.empty())
    write_text(outputs.begin(o.common.profile), o.common.profile.ends_with(".html") ? page : profile);
  if (!o.common.trace.empty()) write_text(outputs.begin(o.common.trace), trace);
  outputs.commit();
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
  CLI::App* sub = app.add_subcommand("bench", "Time operations, drawing and training against what the device can do");
  sub->add_option("suites", o->suites, "Which suites (default: all)")
      ->check(one_of(vsplat::bench::suite_names()))
      ->type_name("SUITE");
  sub->add_option("--run", o->filter, "Only cases whose suite/name contains this")->type_name("TEXT");
  sub->add_option("--seconds", o->seconds, "Time spent on each case")->check(positive())->type_name("S");
  sub->add_flag("--references", o->references, "Other libraries' kernels, too (CLBlast compiles for long on a CPU)");
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
  add_common(*sub, o->common, {.outside = false});
  sub->footer(
      "Examples:\n"
      "  vsplat bench gemm conv3d\n"
      "  vsplat bench conv3d --run 48 --json\n"
      "  vsplat bench attention layernorm\n"
      "  vsplat bench render --run small\n"
      "  vsplat bench train --run network\n"
      "  vsplat bench refine --run object\n"
      "Scenes are small-5k (128 x 128 pixels), object-190k (512 x 512) and slab-1m (1280 x 720), each forward and "
      "backward\n"
      "(which draws once more). A frame is timed from the call until the device is done, by 8 cameras in turn; the "
      "stages'\n"
      "shares of it include the host's. A step of training is that of one object, four input and four more views: its\n"
      "network's forward and backward, and the whole of it with both levels drawn, loss and optimiser.\n"
      "Every case's result is checked before it is timed, of single operations only that there is one; the peaks are\n"
      "measured in the same run.\n"
      "Suites: gemm, conv3d, render, train, refine, and of single operations:\n" +
      lines_of(vsplat::bench::operation_names()));
  sub->callback([o, &run] { run = [o] { bench(*o); }; });
}

}  // namespace command
