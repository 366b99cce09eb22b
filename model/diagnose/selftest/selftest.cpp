#include "model/diagnose/selftest/selftest.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/journal.h"
#include "model/diagnose/selftest/stages.h"
#include "runtime/fail.h"
#include "runtime/kernel_files.h"
#include "runtime/log.h"
#include "runtime/system/environment.h"
#include "runtime/tuning/stored_finding.h"

namespace vsplat::selftest {
namespace {

// Error relative to the tolerance; without a tolerance, a result is right or infinitely wrong.
double excess(const Finding& f) {
  if (f.tolerance > 0 && (f.right || f.error > f.tolerance)) return f.error / f.tolerance;
  return f.right ? 0 : INFINITY;
}

// A flavour is given up after so many cases ended their process; after a feature was disabled, one is enough: what
// hangs takes minutes each time.
constexpr int kMostEnds = 4;

struct Findings {
  std::vector<Finding> all;
  std::set<NamedKernel> launched;
  std::vector<std::string> wrong_cases;
  int ends = 0;  // number of cases that ended a process
};

// Items that ended a process before, which are not run again.
Finding ended_finding(const std::string& what, const std::string& how) {
  Finding out;
  out.what = what;
  out.error = INFINITY;
  out.right = false;
  out.trouble = how;
  return out;
}

// State shared by all runs of a self-test.
class Runner {
 public:
  Runner(const std::string& device, const Options& options, Journal& journal)
      : device_(device), options_(options), journal_(journal) {}

  std::unique_ptr<Context> open(Flavour flavour, const SwitchedOff& off, const Variant* variant) const {
    ContextOptions options = to_open(flavour, off);
    options.tuning = std::make_shared<Tuning>();  // the defaults; a table's choices are tested separately
    if (variant) variant->choose(options);
    return std::make_unique<Context>(options);
  }

  ContextOptions to_open(Flavour flavour, const SwitchedOff& off) const {
    ContextOptions out;
    out.device = device_;
    out.kernels = name_of(flavour);
    out.off = off;
    // The processor's instructions for pairs, if it has them; matrix units of GPUs have a trial of their own
    // (runtime/tuning/matrix_probe.h).
    const std::vector<MatrixUnit> units = choose_device(device_).matrix_units;
    const auto best = std::find_if(units.begin(), units.end(), is_of_processor);
    if (flavour == Flavour::cpu && !off.mixed && best != units.end()) out.matrix_unit = *best;
    out.on_compile = [this](const std::string& kernel, int compiled) {
      journal_.compiles(kernel);
      if (options_.on_compile) options_.on_compile(kernel, compiled);
    };
    return out;
  }

  // How the item ended a process before; "" if it did not, in which case it is now in progress.
  std::string begins(const std::string& doing) const {
    std::string how = journal_.ended_by(doing);
    if (how.empty()) journal_.begins(doing);
    return how;
  }

  // The selected cases; an empty list means all.
  Findings run(Context& ctx, const std::vector<std::string>& cases, const std::string& stage, double from, double to,
               int most_ends = kMostEnds) {
    Findings out;
    std::vector<Case> those = options_.cases;
    if (those.empty()) those = all_cases(), those.push_back(stages_case());
    if (!cases.empty())
      those.erase(
          std::remove_if(those.begin(), those.end(),
                         [&](const Case& one) { return std::count(cases.begin(), cases.end(), one.name) == 0; }),
          those.end());
    double done = 0;
    for (const Case& one : those) {
      if (out.ends >= most_ends) break;
      if (options_.progress &&
          !options_.progress(stage, from + (to - from) * done++ / static_cast<double>(those.size())))
        fail(Status::cancelled, "the self-test was stopped in {}: {}", stage, one.name);
      if (const std::string how = begins(stage + ": " + one.name); !how.empty()) {
        out.all.push_back(ended_finding(one.name, how));
        out.wrong_cases.emplace_back(one.name);
        ++out.ends;
        continue;
      }
      Checks checks(ctx, options_.quick ? Sizes::quick : Sizes::selftest);
      checks.run(one.name, one.run);
      bool right = true;
      for (const Finding& f : checks.findings()) right = right && f.right;
      if (!right) out.wrong_cases.emplace_back(one.name);
      out.all.insert(out.all.end(), checks.findings().begin(), checks.findings().end());
      out.launched.insert(checks.launched().begin(), checks.launched().end());
    }
    return out;
  }

 private:
  const std::string& device_;
  const Options& options_;
  Journal& journal_;
};

std::vector<NamedKernel> untested(Flavour flavour, const std::set<NamedKernel>& launched) {
  std::set<std::string> there;
  for (const NamedKernel& kernel : launched) there.insert(kernel.file + "\n" + kernel.name);
  std::vector<NamedKernel> out;
  for (const KernelFile& file : kernel_files()) {
    if (!file.targets.empty()) continue;  // only one vendor's compilers can read it
    for (const std::string& kernel : file.kernels)
      if ((flavour == Flavour::gpu ? is_of_gpu(file, kernel) : is_of_cpu(file, kernel)) &&
          there.count(file.name + "\n" + kernel) == 0)
        out.push_back({file.name, kernel, ""});
  }
  return out;
}

// Features that a flavour can do without, tried in order of increasing loss.
std::vector<bool SwitchedOff::*> choices_of(const Context& ctx) {
  std::vector<bool SwitchedOff::*> out;
  out.push_back(&SwitchedOff::winograd);
  if (ctx.flavour() == Flavour::gpu) out.push_back(&SwitchedOff::large_tiles);
  if (ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4) out.push_back(&SwitchedOff::vectors);
  if (ctx.device().type == DeviceType::gpu) out.push_back(&SwitchedOff::clblast);
  if (ctx.device().sub_group > 0) out.push_back(&SwitchedOff::sub_groups);
  out.push_back(&SwitchedOff::mixed);
  return out;
}

FlavourResult flavour_result(Flavour flavour, const Findings& found) {
  FlavourResult out;
  out.flavour = flavour;
  out.results = static_cast<int>(found.all.size());
  out.kernels = by_kernel(found.all);
  for (const Finding& f : found.all)
    if (!f.right) out.wrong.push_back(f);
  out.untested = untested(flavour, found.launched);
  return out;
}

// Reruns what is wrong with the defaults with one more feature disabled, and continues with what is still wrong.
FlavourResult test_flavour(Runner& runner, Flavour flavour, double from, double to) {
  const std::string stage = fmt::format("{} kernels", name_of(flavour));
  if (const std::string how = runner.begins(stage + ": opening the device"); !how.empty()) {
    FlavourResult out;
    out.flavour = flavour;
    out.usable = false;
    out.wrong.push_back(ended_finding("opening the device", how));
    return out;
  }
  auto ctx = runner.open(flavour, {}, nullptr);
  const Findings found = runner.run(*ctx, {}, stage, from, to);
  FlavourResult out = flavour_result(flavour, found);
  const auto choices = choices_of(*ctx);
  std::vector<std::string> wrong = found.wrong_cases;
  for (bool SwitchedOff::*choice : choices) {
    if (wrong.empty() || found.ends >= kMostEnds) break;
    SwitchedOff off = out.off;
    off.*choice = true;
    ctx = runner.open(flavour, off, nullptr);
    const Findings again = runner.run(*ctx, wrong, stage + " without " + in_words(off), to, to, 1);
    if (again.ends > 0 || again.wrong_cases.size() >= wrong.size()) continue;
    wrong = again.wrong_cases;
    out.off = off;
  }
  out.usable = wrong.empty();
  if (!out.usable) out.off = {};
  return out;
}

// Features disabled in both usable flavours.
SwitchedOff all_off(const std::vector<FlavourResult>& flavours) {
  SwitchedOff out;
  for (const FlavourResult& f : flavours)
    for (const SwitchName& one : switch_names())
      if (f.usable && f.off.*one.which) out.*one.which = true;
  return out;
}

// Disabled features make other kernels run, in both flavours: with all of them disabled, each kernel must be right or
// unused.
SwitchedOff hold_what_is_left(Runner& runner, std::vector<FlavourResult>& flavours) {
  for (;;) {
    const SwitchedOff off = all_off(flavours);
    if (!off.any()) return off;
    bool right = true;
    for (FlavourResult& f : flavours) {
      if (!f.usable) continue;
      const auto ctx = runner.open(f.flavour, off, nullptr);
      const double done = f.flavour == Flavour::cpu ? 0.5 : 1;
      const Findings found =
          runner.run(*ctx, {}, fmt::format("{} kernels without {}", name_of(f.flavour), in_words(off)), done, done);
      if (found.wrong_cases.empty()) continue;
      f.usable = right = false;
      f.off = {};
      for (const Finding& one : found.all)
        if (!one.right) f.wrong.push_back(one);
      for (KernelResult& kernel : by_kernel(found.all))
        if (kernel.verdict != KernelVerdict::right) f.kernels.push_back(std::move(kernel));
    }
    if (right) return off;
  }
}

// A table named by the environment belongs to one flavour.
bool names_a_table_of_another(Flavour flavour) {
  const std::string asked = environment("VSPLAT_TUNING");
  return !asked.empty() && asked != "off" && read_tuning(asked).of.flavour != name_of(flavour);
}

// Tests the choices in the device's table; removes wrong ones from it.
void check_table(const Runner& runner, const Options& options, const SwitchedOff& off, FlavourResult& flavour) {
  if (!flavour.usable || names_a_table_of_another(flavour.flavour)) return;
  Context ctx(runner.to_open(flavour.flavour, off));
  if (ctx.tuning().chosen().empty()) return;
  std::vector<CheckedChoice> wrong;
  const std::string how = runner.begins(fmt::format("{} kernels: tuned", name_of(flavour.flavour)));
  flavour.chosen = how.empty() ? check_chosen(ctx) : unchecked_chosen(ctx, how);
  for (const CheckedChoice& one : flavour.chosen)
    if (!one.right()) wrong.push_back(one);
  if (wrong.empty()) return;
  flavour.off.tuned = true;
  if (!options.forget) refuse_chosen(ctx, wrong);
}

// Describes wrong results for which no kernel can be named.
std::string unnamed_of(const FlavourResult& flavour) {
  for (const Finding& f : flavour.wrong)
    if (f.kernels.empty() && !f.trouble.empty())
      return fmt::format("{} ({} kernels): {}", f.what, name_of(flavour.flavour), f.trouble);
  return "";
}

// Describes the kernel with the largest error.
std::string worst_of(const FlavourResult& flavour) {
  const KernelResult* worst = nullptr;
  const auto beyond = [](const KernelResult& k) { return k.tolerance > 0 ? k.error / k.tolerance : INFINITY; };
  for (const KernelResult& k : flavour.kernels)
    if (k.verdict == KernelVerdict::wrong && (!worst || beyond(k) > beyond(*worst))) worst = &k;
  if (!worst) {
    if (const std::string text = unnamed_of(flavour); !text.empty()) return text;
    for (const CheckedChoice& one : flavour.chosen)
      if (!one.right())
        return fmt::format("the tuned parameters of {} ({} kernels): an error {:.2g} times what is allowed {}",
                           one.name, name_of(flavour.flavour), one.error, one.why);
    return "";
  }
  std::string text = fmt::format("kernel {} (cl/{}.cl, {} kernels) in {}", worst->kernel.name, worst->kernel.file,
                                 name_of(flavour.flavour), worst->what);
  if (!std::isfinite(worst->error)) return text + ": no numbers";
  return text + fmt::format(": an error of {:.2g}, {:.2g} allowed", worst->error, worst->tolerance);
}

// Earlier wrong verdicts stay, unless the kernel is right now.
std::vector<std::string> refused_by(const DeviceInfo& device, const std::vector<FlavourResult>& flavours) {
  std::set<std::string> out;
  if (const auto before = remembered_verdict(device)) out.insert(before->refused.begin(), before->refused.end());
  for (const FlavourResult& flavour : flavours)
    for (const CheckedChoice& one : flavour.chosen) {
      const std::string name = name_of_choice(one.shape, one.values);
      if (one.right())
        out.erase(name);
      else
        out.insert(name);
    }
  return {out.begin(), out.end()};
}

Verdict verdict_of(const std::vector<FlavourResult>& flavours) {
  Verdict out;
  out.date = today();
  bool any = false;
  for (const FlavourResult& f : flavours) {
    if (!f.variant.empty()) continue;
    any = any || f.usable;
    if (!f.usable) out.off.*(f.flavour == Flavour::cpu ? &SwitchedOff::cpu : &SwitchedOff::gpu) = true;
    for (const SwitchName& one : switch_names())
      if (f.off.*one.which) out.off.*one.which = true;
    if (out.worst.empty()) out.worst = worst_of(f);
  }
  out.fitness = !any ? Fitness::unusable : out.off.any() ? Fitness::degraded : Fitness::ok;
  return out;
}

}  // namespace

const char* name_of(KernelVerdict verdict) {
  return verdict == KernelVerdict::right ? "ok" : verdict == KernelVerdict::wrong ? "wrong" : "in doubt";
}

std::vector<KernelResult> by_kernel(const std::vector<Finding>& findings) {
  std::map<NamedKernel, KernelResult> all;
  std::map<NamedKernel, double> worst;
  std::set<NamedKernel> in_right;
  std::vector<const Finding*> wrong;
  for (const Finding& f : findings) {
    if (!f.right) wrong.push_back(&f);
    for (const NamedKernel& kernel : f.kernels) {
      KernelResult& k = all[kernel];
      k.kernel = kernel;
      k.wrong += !f.right;
      if (f.right) in_right.insert(kernel);
      if (k.results++ > 0 && excess(f) <= worst[kernel]) continue;
      worst[kernel] = excess(f);
      k.what = f.trouble.empty() ? f.what : f.what + " (" + f.trouble + ")";
      k.error = f.error, k.tolerance = f.tolerance;
    }
  }
  std::stable_sort(wrong.begin(), wrong.end(),
                   [](const Finding* a, const Finding* b) { return a->kernels.size() < b->kernels.size(); });
  for (const Finding* f : wrong) {
    const auto is_wrong = [&](const NamedKernel& k) { return all[k].verdict == KernelVerdict::wrong; };
    const bool explained = std::any_of(f->kernels.begin(), f->kernels.end(), is_wrong);
    const bool some =
        std::any_of(f->kernels.begin(), f->kernels.end(), [&](const auto& k) { return !in_right.count(k); });
    for (const NamedKernel& k : f->kernels) {
      KernelResult& one = all[k];
      if (one.verdict == KernelVerdict::wrong) continue;
      if (!explained && (!some || !in_right.count(k)))
        one.verdict = KernelVerdict::wrong;
      else if (!in_right.count(k))
        one.verdict = KernelVerdict::in_doubt;
    }
  }
  std::vector<KernelResult> out;
  out.reserve(all.size());
  for (auto& [kernel, result] : all) out.push_back(std::move(result));
  return out;
}

Report run(const std::string& device, const Options& options) {
  Report out;
  out.device = choose_device(device);
  out.quick = options.quick;
  const std::string index = std::to_string(out.device.index);
  Journal journal(Journal::folder_of(out.device), options.ended);
  Runner runner(index, options, journal);
  const double each = 1.0 / (2 + static_cast<double>(options.variants.size()) * 2);
  double from = 0;
  for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
    out.flavours.push_back(test_flavour(runner, flavour, from, from + each));
    from += each;
  }
  const SwitchedOff off = hold_what_is_left(runner, out.flavours);
  for (FlavourResult& flavour : out.flavours) check_table(runner, options, off, flavour);
  // A kernel without a flavour in its name belongs to the flavour that launches it.
  for (std::size_t i = 0; i < 2; ++i) {
    const std::vector<KernelResult>& others = out.flavours[1 - i].kernels;
    std::erase_if(out.flavours[i].untested, [&](const NamedKernel& k) {
      return std::any_of(others.begin(), others.end(), [&](const KernelResult& other) {
        return other.kernel.file == k.file && other.kernel.name == k.name;
      });
    });
  }
  for (const Variant& variant : options.variants)
    for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
      const auto ctx = runner.open(flavour, {}, &variant);
      const std::string stage = fmt::format("{}, {} kernels", variant.name, name_of(flavour));
      FlavourResult one = flavour_result(flavour, runner.run(*ctx, variant.cases, stage, from, from + each));
      one.variant = variant.name, one.usable = one.wrong.empty(), one.untested.clear();
      out.flavours.push_back(std::move(one));
      from += each;
    }
  out.verdict = verdict_of(out.flavours);
  out.verdict.refused = refused_by(out.device, out.flavours);
  journal.done();
  if (options.progress) (void)options.progress("done", 1);
  return out;
}

}  // namespace vsplat::selftest
