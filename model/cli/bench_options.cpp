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
  return words("gemm conv3d render train fit model sparse formats " VSPLAT_BENCH_OPERATIONS);
}

CLI::App* add_bench_options(CLI::App& app, BenchOptions& options) {
  BenchOptions* o = &options;
  CLI::App* sub =
      app.add_subcommand("bench", "Time operations, drawing, the network and training against what the device can do");
  sub->add_option("suites", o->suites, "Which suites (default: all)")
      ->check(one_of(bench_suites()))
      ->type_name("SUITE");
  sub->add_option("--run", o->filter, "Only cases whose suite/name contains this")->type_name("TEXT");
  sub->add_option("--seconds", o->seconds, "Time spent on each case (default: 1)")->check(positive())->type_name("S");
  sub->add_flag(
      "--references", o->references,
      "Also time other libraries, in turn: on a CPU OpenBLAS and oneDNN, if this was built with them, and CLBlast, "
      "which compiles for a long time there; and the network in PyTorch, if python3 has it, in fp32 and bf16");
  sub->add_option("--compare", o->compare,
                  "Say for each case whether it is slower or faster than in this earlier --json")
      ->check(CLI::ExistingFile)
      ->type_name("OLD.json");
  sub->add_option("--fail-above", o->fail_above,
                  "With --compare: exit with 1 if a case is slower by more than this and by more than its noise")
      ->type_name("P%");
  sub->add_option(
         "--scenes", o->scenes,
         "Draw every NAME.ply of this folder from the cameras in its NAME.cameras.json (default: scenes made here)")
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
      "  vsplat bench formats --run slab-1m\n"
      "Scenes are small-5k (128 x 128 pixels), object-190k (512 x 512) and slab-1m (1280 x 720), each forward and\n"
      "backward (which draws once more). A frame is timed from the call until the device is done, from 8 cameras in\n"
      "turn; the shares of its stages include the host's time. A step of training has one object with four input "
      "views\n"
      "and four more: the network's forward and backward alone, and the whole step with drawing, loss and optimiser.\n"
      "A case of the suite model is a whole forward of the network; each stage is compared with the least time that\n"
      "its kernels could take. A case takes --seconds, or three runs, but no more than 30 times as long.\n"
      "Every result is checked before it is timed: single operations against their references at small sizes; at\n"
      "the size that is timed, most are only checked for values that are not finite. The peaks are measured in the\n"
      "same run.\n"
      "Suites: gemm, conv3d, render, train, fit, model, sparse, formats, and of single operations:\n" +
      lines_of(words(VSPLAT_BENCH_OPERATIONS)));
  return sub;
}

}  // namespace command
