// Tests whether a device and its driver compute correctly. Every kernel of both flavours runs on generated numbers and
// is compared with scalar implementations on the host; the network's stages are compared with PyTorch's. Features with
// wrong results are disabled if there is a replacement.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/diagnose/selftest/checks.h"
#include "model/diagnose/tune/check_chosen.h"
#include "runtime/context.h"
#include "runtime/tuning/verdict.h"

namespace vsplat::selftest {

// Additional variants to test: contexts made with these options, on which those cases run again. For parameter sets
// found by a tuner: a variant with wrong results must not be used, but does not affect the verdict.
struct Variant {
  std::string name;
  std::function<void(ContextOptions&)> choose;
  std::vector<std::string> cases;  // empty: all
};

struct Options {
  bool quick = false;       // uses fewer sizes
  bool forget = false;      // true: wrong choices stay in the device's table
  std::string ended;        // how the process of the last self-test ended; empty: unknown (journal.h)
  std::vector<Case> cases;  // empty: all of them
  std::vector<Variant> variants;
  // Receives what is tested now, and the share that is done; on false throws Error(cancelled).
  std::function<bool(const std::string& stage, double done)> progress;
  std::function<void(const std::string& kernel, int compiled)> on_compile;
};

enum class KernelVerdict { right, wrong, in_doubt };
const char* name_of(KernelVerdict verdict);

// A kernel with its defines, summarised over all results that it contributed to.
struct KernelResult {
  NamedKernel kernel;
  KernelVerdict verdict = KernelVerdict::right;  // doubtful: it contributed to no right result, but others are to blame
  int results = 0, wrong = 0;
  std::string what;                 // the result that is furthest beyond its tolerance, or nearest to it
  double error = 0, tolerance = 0;  // of that result
};

struct FlavourResult {
  Flavour flavour = Flavour::cpu;
  std::string variant;  // empty: the defaults
  bool usable = true;   // with the disabled features
  SwitchedOff off;      // for the defaults
  int results = 0;
  std::vector<KernelResult> kernels;
  std::vector<CheckedChoice> chosen;  // from the device's table
  std::vector<Finding> wrong;         // with the defaults, and with the disabled features, in both flavours
  std::vector<NamedKernel> untested;  // kernels that no case launched
};

struct Report {
  DeviceInfo device;
  bool quick = false;
  Verdict verdict;
  std::vector<FlavourResult> flavours;
};

Report run(const std::string& device, const Options& options);

// Per-kernel verdicts. Blames the smallest sets of kernels that explain the wrong results: within a wrong result that
// no smaller one explains, those kernels that have no right result, or else all of them.
std::vector<KernelResult> by_kernel(const std::vector<Finding>& findings);

}  // namespace vsplat::selftest
