#include "bench_options.h"

#include <sstream>

#include "arguments.h"

namespace command {
namespace {

std::vector<std::string> words(const std::string& text) {
  std::istringstream from(text);
  return {std::istream_iterator<std::string>(from), {}};
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

// (The operations are those that bench/CMakeLists.txt lists.)
std::vector<std::string> bench_suites() {
  return words("gemm conv3d render train fit model sparse " VSPLAT_BENCH_OPERATIONS);
}

CLI::App* add_bench_options(CLI::App& app, BenchOptions& options) {
  BenchOptions* o = &options;
  CLI::App* sub =
      app.add_subcommand("bench", "Time operations, drawing, the network and training against what the device can do");
  sub->add_option("suites", o->suites, "Which suites (default: all)")
      ->check(one_of(bench_suites()))
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
      lines_of(words(VSPLAT_BENCH_OPERATIONS)));
  return sub;
}

}  // namespace command
