#include "model/tune/search.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "model/tune/tune_case.h"
#include "runtime/clock.h"
#include "runtime/fail.h"
#include "runtime/folder_lock.h"
#include "runtime/log.h"
#include "runtime/private_folder.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr double kBetter = 0.97;  // of what the best so far takes
constexpr double kSample = 4e-3;  // seconds of a time that is taken
constexpr double kRace = 0.25;    // seconds of a race, or three rounds
constexpr int kMostRounds = 15;
constexpr double kHopeless = 2.0;  // times what the best takes: one look is enough

double now_s() { return static_cast<double>(now_ns()) * 1e-9; }

double median(std::vector<double> times) {
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  return *middle;
}

// A set that is ready to run.
struct Runner {
  std::shared_ptr<const Tuning> tuning;
  std::function<void()> run;
};

std::shared_ptr<const Tuning> forced(TunedOp op, const TunedValues& values) {
  Tuning out;
  out.force(op, values);
  return std::make_shared<const Tuning>(out);
}

Runner make_ready(Context& ctx, TuneCase& of, TunedOp op, const TunedValues& values) {
  Runner out{forced(op, values), {}};
  ctx.use_tuning(out.tuning);
  out.run = of.ready(ctx);
  return out;
}

// Seconds of one of `times` runs in a row.
double seconds_of(Context& ctx, const Runner& runner, int times) {
  ctx.use_tuning(runner.tuning);
  const double begun = now_s();
  for (int i = 0; i < times; ++i) runner.run();
  ctx.finish();
  return (now_s() - begun) / times;
}

// Medians of both, by turns, and the least of both: other load makes times longer, and never shorter.
struct Race {
  double best, other;
  double least_best, least_other;
  bool won() const { return other < kBetter * best && least_other < kBetter * least_best; }
};
Race race(Context& ctx, const Runner& best, const Runner& other) {
  const double first = seconds_of(ctx, best, 1), second = seconds_of(ctx, other, 1);
  if (second > kHopeless * first && second > kHopeless * seconds_of(ctx, best, 1))
    return {first, second, first, second};
  const int times = std::clamp(static_cast<int>(kSample / std::max(1e-7, std::min(first, second))), 1, 1000);
  std::vector<double> of_best, of_other;
  const double begun = now_s();
  for (int round = 0; round < kMostRounds && (round < 3 || now_s() - begun < kRace); ++round) {
    const bool turned = round % 2 != 0;
    const double one = seconds_of(ctx, turned ? other : best, times),
                 two = seconds_of(ctx, turned ? best : other, times);
    of_best.push_back(turned ? two : one);
    of_other.push_back(turned ? one : two);
  }
  return {median(of_best), median(of_other), *std::min_element(of_best.begin(), of_best.end()),
          *std::min_element(of_other.begin(), of_other.end())};
}

// The worst error of what it computes, by the tolerance.
double share_of_tolerance(Context& ctx, TuneCase& of, const Runner& runner, double* error) {
  of.spoil(ctx);
  ctx.use_tuning(runner.tuning);
  runner.run();
  *error = of.error(ctx);
  if (!std::isfinite(*error)) return INFINITY;
  if (of.tolerance() > 0) return *error / of.tolerance();
  return *error > 0 ? INFINITY : 0.0;
}

// What is worth more of the time: operations of all calls.
struct Task {
  TunedShape shape, exact;
  long calls = 0;
  double weight = 0;
};

double weight_of(const TunedShape& shape, long calls) {
  const auto size = [&](int i) { return static_cast<double>(shape.sizes[static_cast<std::size_t>(i)]); };
  double flops = 0;
  switch (shape.op) {
    case TunedOp::gemm:
    case TunedOp::gemm_transposed:
      flops = 2 * size(0) * size(1) * size(2);
      break;
    case TunedOp::conv3d:
    case TunedOp::conv3d_winograd:
    case TunedOp::conv3d_weights:
      flops = 54 * size(0) * size(1) * size(2);
      break;
    case TunedOp::conv3d_method:
      flops = 54 * 4096 * size(0) * size(1);
      break;
    case TunedOp::attention_forward:
    case TunedOp::attention_backward:
      flops = 4 * size(0) * size(1) * size(1) * size(2);
      break;
    case TunedOp::radix_sort:
      flops = 10 * size(0) * size(1);
      break;
    case TunedOp::rasterize_forward:
      flops = 39.0 * 64 * size(1);  // a quarter of the pixels of a tile, as a guess
      break;
  }
  return flops * static_cast<double>(calls);
}

std::vector<Task> tasks_of(const NotedShapes& shapes) {
  std::vector<Task> out;
  for (const auto& [shape, noted] : shapes) {
    const auto& sizes = noted.largest.sizes;
    if (sizes[0] < 1 || sizes[1] < 1) continue;
    out.push_back({shape, noted.largest, noted.calls, weight_of(noted.largest, noted.calls)});
  }
  std::stable_sort(out.begin(), out.end(), [](const Task& a, const Task& b) { return a.weight > b.weight; });
  return out;
}

// How many sets a search of a shape looks at, at the most.
long sets_of(const TunedDeclaration& of, bool full) {
  long all = 1, each = 1;
  for (const TunedParameter& p : of.parameters) {
    all *= static_cast<long>(p.values.size());
    each += static_cast<long>(p.values.size()) - 1;
  }
  return full ? all : each;
}

std::string today() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
}

class Search {
 public:
  Search(Context& ctx, const TuneRequest& request)
      : own_(ctx.stream()), ctx_(*own_), request_(request), begun_(now_s()) {
    table_.of = tuning_subject(ctx.device(), ctx.flavour());
    out_.path = request.path.empty() ? tuning_path(table_.of) : request.path;
    if (out_.path.empty())
      fail(Status::usage,
           "there is no folder to keep the table in (VSPLAT_CACHE_DIR is off, or others may write to the cache's "
           "folder): vsplat_tune_options.path names a file");
    // Two searches at once would take each other's time, and each would lose what the other has tried.
    if (request.path.empty()) hold_folder(fs::path(out_.path).parent_path().string());
    take_up();
    table_.measured = today();
  }

  TuneResult run() {
    const std::vector<Task> tasks = tasks_of(request_.shapes);
    for (const Task& task : tasks)
      if (const TunedDeclaration* of = declaration(task)) {
        out_.shapes.push_back(task.shape);
        all_ += sets_of(*of, request_.full);
      }
    for (const Task& task : tasks)
      if (const TunedDeclaration* of = declaration(task)) {
        const long before = done_;
        search(task, *of);
        done_ = before + sets_of(*of, request_.full);
      }
    keep();
    if (const std::string hash = table_.choice.hash(); !hash.empty() && request_.path.empty())
      write_tuning(kept_tuning_path(hash), table_);
    out_.table = table_;
    out_.seconds = now_s() - begun_;
    return out_;
  }

 private:
  const TunedDeclaration* declaration(const Task& task) const {
    return tuned_declaration(task.shape.op, ctx_.flavour());
  }

  // What an earlier search has found; what it has replaced is kept by its hash.
  void take_up() {
    std::error_code error;
    if (!fs::exists(out_.path, error)) return;
    TuningTable before;
    try {
      before = read_tuning(out_.path);
    } catch (const Error& e) {
      if (!request_.path.empty()) throw;  // a file of the caller's, which may be anything
      warn("the search begins anew: {}", e.what());
      return;
    }
    if (before.of != table_.of) {
      if (!request_.path.empty())
        fail(Status::usage, "{}: a table of another device, driver or other kernels; name another file", out_.path);
      return;
    }
    out_.before = before.choice.hash();
    if (!out_.before.empty() && request_.path.empty()) write_tuning(kept_tuning_path(out_.before), before);
    if (request_.again) return;
    table_.choice = before.choice;
    table_.trials = before.trials;
  }

  void hold_folder(const std::string& folder) {
    make_private_folder(folder);
    lock_.emplace(folder, folder + ", where tuned parameters are kept");
    lock_->keep_folders();
  }

  void keep() { write_tuning(out_.path, table_); }

  TunedTrial* tried(const TunedShape& shape, const TunedValues& values) {
    for (TunedTrial& t : table_.trials)
      if (t.shape == shape && t.values == values) return &t;
    return nullptr;
  }

  bool out_of_time() const { return !request_.full && now_s() - begun_ > request_.seconds; }

  void next(const Task& task, const TunedValues& values) {
    const std::string what = fmt::format("{}, {}", text_of(*values.of, task.shape), text_of(values));
    const double by_sets = all_ > 0 ? static_cast<double>(done_) / static_cast<double>(all_) : 1;
    const double by_time = request_.full ? 0 : (now_s() - begun_) / request_.seconds;
    if (request_.progress && !request_.progress(what, std::min(0.999, std::max(by_sets, by_time))))
      fail(Status::cancelled, "stopped; what was found so far is in {}", out_.path);
  }

  void search(const Task& task, const TunedDeclaration& of) {
    case_.reset();
    odd_.reset();
    const TunedValues first = default_values(of);
    TunedValues best = first;
    if (const auto it = table_.choice.chosen().find(task.shape); it != table_.choice.chosen().end()) best = it->second;
    bool right = try_set(task, best, nullptr), won = false;
    if (!right && best != first) right = try_set(task, best = first, nullptr);
    const auto consider = [&](const TunedValues& values) {
      if (values == best) return;
      if (try_set(task, values, right ? &best : nullptr)) best = values, right = won = true;
    };
    if (request_.full) {
      for (const TunedValues& values : all_values(of)) consider(values);
    } else {
      for (std::size_t p = 0; p < of.parameters.size(); ++p)
        for (const long value : of.parameters[p].values) {
          TunedValues values = best;
          values.values[p] = value;
          consider(values);
        }
    }
    if (won) confirm(task, first, best);
    if (!right && tried(task.shape, first)) {
      out_.not_right.push_back(text_of(of, task.shape));
      warn("{}: no set of parameters is right on this device", text_of(of, task.shape));
    }
  }

  // Whether that set is the one to run from now on: it is right, and beats `best`, where there is one.
  bool try_set(const Task& task, const TunedValues& values, const TunedValues* best) {
    const bool first = best == nullptr;
    if (const TunedTrial* known = tried(task.shape, values); known && known->verdict.rfind("begun", 0) != 0) {
      ++done_;
      const bool was_right = known->verdict == "default" || known->verdict == "best" || known->verdict == "slower";
      return first && was_right;
    }
    if (out_of_time()) {
      ++out_.left;
      return false;
    }
    next(task, values);
    TunedTrial& trial = begin(task.shape, values);
    if (trial.verdict == "failed") return false;
    try {
      judge(task, values, best, trial);
    } catch (const Error& e) {
      if (e.status() == Status::cancelled) {
        table_.trials.pop_back();
        keep();
        throw;
      }
      trial.verdict = "failed";
      trial.why = std::string(e.what()).substr(0, 500);
      case_.reset();
      odd_.reset();
    }
    const bool wins = trial.verdict == "default" || trial.verdict == "best";
    if (trial.verdict == "best") table_.choice.set(task.shape, values);
    if (trial.verdict == "wrong" || trial.verdict == "failed") refuse(task, values, trial);
    ++done_;
    ++out_.tried;
    keep();
    return wins;
  }

  // In the file before it runs: a set that ends the process twice is not tried a third time.
  TunedTrial& begin(const TunedShape& shape, const TunedValues& values) {
    std::string verdict = "begun";
    std::vector<TunedTrial>& all = table_.trials;
    const auto known = std::find_if(all.begin(), all.end(),
                                    [&](const TunedTrial& t) { return t.shape == shape && t.values == values; });
    if (known != all.end()) {
      verdict = known->verdict == "begun" ? "begun again" : "failed";
      all.erase(known);
    }
    TunedTrial trial;
    trial.shape = shape, trial.values = values, trial.verdict = verdict;
    if (verdict == "failed") trial.why = "the process has ended twice while it was tried";
    all.push_back(trial);
    keep();
    return all.back();
  }

  void refuse(const Task& task, const TunedValues& values, const TunedTrial& trial) {
    const std::string name = fmt::format("{}, {}", text_of(*values.of, task.shape), text_of(values));
    if (trial.verdict == "wrong")
      warn("{}: refused: off by {:.2g} of the largest value, at most {:.2g} expected", name, trial.error, tolerance_);
    else
      warn("{}: refused: {}", name, trial.why);
    if (const auto& chosen = table_.choice.chosen(); chosen.count(task.shape) && chosen.at(task.shape) == values)
      table_.choice.set(task.shape, default_values(*values.of));
  }

  void judge(const Task& task, const TunedValues& values, const TunedValues* best, TunedTrial& trial) {
    if (!case_) case_ = tune_case(ctx_, task.exact);
    if (!odd_) odd_ = tune_case(ctx_, odd_shape(task.exact));
    tolerance_ = case_->tolerance();
    const TunedOp op = task.shape.op;
    for (TuneCase* each : {odd_.get(), case_.get()}) {
      const Runner runner = make_ready(ctx_, *each, op, values);
      double error = 0;
      const double share = share_of_tolerance(ctx_, *each, runner, &error);
      if (!(error <= trial.error)) trial.error = error;
      if (share > 1) {
        trial.verdict = "wrong";
        return;
      }
    }
    Runner runner = make_ready(ctx_, *case_, op, values);
    if (!best) {
      trial.seconds = trial.against = race(ctx_, runner, runner).other;
      trial.verdict = values == default_values(*values.of) ? "default" : "best";
      return;
    }
    const Runner other = make_ready(ctx_, *case_, op, *best);
    Race found = race(ctx_, other, runner);
    if (found.won()) found = race(ctx_, other, runner);  // twice, so that chance does not decide
    trial.seconds = found.other, trial.against = found.best;
    trial.verdict = found.won() ? "best" : "slower";
  }

  // What has won, step by step, against the default in one race: it is chosen where it wins that, too.
  void confirm(const Task& task, const TunedValues& first, const TunedValues& best) {
    TunedTrial* trial = tried(task.shape, best);
    const TunedTrial* of_first = tried(task.shape, first);
    if (!trial || !case_ || best == first || !of_first || of_first->verdict != "default") return;
    const Runner runner = make_ready(ctx_, *case_, task.shape.op, best),
                 other = make_ready(ctx_, *case_, task.shape.op, first);
    const Race found = race(ctx_, other, runner);
    trial->seconds = found.other, trial->against = found.best;
    if (!found.won()) {
      trial->verdict = "slower";
      table_.choice.set(task.shape, first);
    } else {
      info("{}: {} is {:.2f} times as fast as {}", text_of(*best.of, task.shape), text_of(best),
           found.best / found.other, text_of(first));
    }
    keep();
  }

  std::optional<FolderLock> lock_;
  std::unique_ptr<Context> own_;
  Context& ctx_;
  const TuneRequest& request_;
  double begun_, tolerance_ = 0;
  long all_ = 0, done_ = 0;
  TuningTable table_;
  TuneResult out_;
  std::unique_ptr<TuneCase> case_, odd_;
};

}  // namespace

TuneResult tune(Context& ctx, const TuneRequest& request) { return Search(ctx, request).run(); }

double error_of(Context& of, const TunedShape& shape, const TunedValues& values) {
  const auto ctx = of.stream();
  double worst = 0;
  for (const TunedShape& each : {odd_shape(shape), shape}) {
    const auto one = tune_case(*ctx, each);
    double error = 0;
    const double share = share_of_tolerance(*ctx, *one, make_ready(*ctx, *one, shape.op, values), &error);
    if (!(share <= worst)) worst = share;
  }
  return worst;
}

}  // namespace vsplat
