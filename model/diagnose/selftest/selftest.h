// Whether a device with its driver computes rightly: every kernel of both flavours on numbers made here, held against
// scalar implementations on the host, and the network's stages against PyTorch's. What is wrong is switched off where
// there is something else for it.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/diagnose/selftest/checks.h"
#include "model/diagnose/tune/check_chosen.h"
#include "runtime/context.h"
#include "runtime/tuning/verdict.h"

namespace vsplat::selftest {

// What is tried beside the defaults: contexts are made by these options, and those cases run again. For parameter sets
// that a tuner has found: a variant whose findings are wrong is not to be used, and the verdict does not fall for it.
struct Variant {
  std::string name;
  std::function<void(ContextOptions&)> choose;
  std::vector<std::string> cases;  // empty: all
};

struct Options {
  bool quick = false;       // fewer sizes
  bool forget = false;      // a table's wrong choices stay in it
  std::string ended;        // how the process ended that the last self-test ran in; empty: not known (journal.h)
  std::vector<Case> cases;  // none: all of them
  std::vector<Variant> variants;
  // What is done now, and how much of all; false stops: Error(cancelled).
  std::function<bool(const std::string& stage, double done)> progress;
  std::function<void(const std::string& kernel, int compiled)> on_compile;
};

enum class KernelVerdict { right, wrong, in_doubt };
const char* name_of(KernelVerdict verdict);

// A kernel with its defines, over all the results that it had a part in.
struct KernelResult {
  NamedKernel kernel;
  KernelVerdict verdict =
      KernelVerdict::right;  // in doubt: no result is right that it had a part in, others are blamed
  int results = 0, wrong = 0;
  std::string what;                 // the worst of them: that furthest beyond its tolerance, or nearest to it
  double error = 0, tolerance = 0;  // of that one
};

struct FlavourResult {
  Flavour flavour = Flavour::cpu;
  std::string variant;  // empty: the defaults
  bool usable = true;   // with what is switched off
  SwitchedOff off;      // of the defaults
  int results = 0;
  std::vector<KernelResult> kernels;
  std::vector<CheckedChoice> chosen;  // of the device\'s table
  std::vector<Finding> wrong;         // as the defaults left it, and what is switched off of both flavours
  std::vector<NamedKernel> untested;  // that no case has launched
};

struct Report {
  DeviceInfo device;
  bool quick = false;
  Verdict verdict;
  std::vector<FlavourResult> flavours;
};

Report run(const std::string& device, const Options& options);

// Of what was found, each kernel's part. One is wrong where it is in a wrong result that no smaller one explains: of
// the fewest kernels, those that are in no right one, or else all of them.
std::vector<KernelResult> by_kernel(const std::vector<Finding>& findings);

}  // namespace vsplat::selftest
