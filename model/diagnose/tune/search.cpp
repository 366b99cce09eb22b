#include "model/diagnose/tune/search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/base/statistics.h"
#include "model/diagnose/tune/check_chosen.h"
#include "model/diagnose/tune/tried_table.h"
#include "model/diagnose/tune/tune_case.h"
#include "runtime/clock.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

using namespace tuning;

constexpr double kBetter = 0.97;  // factor on the best time that counts as an improvement
constexpr double kSample = 4e-3;  // seconds of one timing
constexpr double kRace = 0.25;    // seconds of a comparison, or three rounds
constexpr int kMostRounds = 15;
constexpr double kHopeless = 2.0;  // factor on the best time: beyond it one timing is enough

double now_s() { return static_cast<double>(now_ns()) * 1e-9; }

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

// Seconds per run, over `times` consecutive runs.
double seconds_of(Context& ctx, const Runner& runner, int times) {
  ctx.use_tuning(runner.tuning);
  const double begun = now_s();
  for (int i = 0; i < times; ++i) runner.run();
  ctx.finish();
  return (now_s() - begun) / times;
}

// Medians and minima of both, timed alternately: other load only makes times longer.
struct Race {
  double best, other;
  double least_best, least_other;
  bool won() const { return other < kBetter * best && least_other < kBetter * least_best; }
};
Race race_of(Context& ctx, const Runner& best, const Runner& other, const std::function<void()>& each_round) {
  const double first = seconds_of(ctx, best, 1), second = seconds_of(ctx, other, 1);
  if (second > kHopeless * first && second > kHopeless * seconds_of(ctx, best, 1))
    return {first, second, first, second};
  const int times = std::clamp(static_cast<int>(kSample / std::max(1e-7, std::min(first, second))), 1, 1000);
  std::vector<double> of_best, of_other;
  const double begun = now_s();
  for (int round = 0; round < kMostRounds && (round < 3 || now_s() - begun < kRace); ++round) {
    each_round();
    const bool turned = round % 2 != 0;
    const double one = seconds_of(ctx, turned ? other : best, times),
                 two = seconds_of(ctx, turned ? best : other, times);
    of_best.push_back(turned ? two : one);
    of_other.push_back(turned ? one : two);
  }
  return {median(of_best), median(of_other), *std::min_element(of_best.begin(), of_best.end()),
          *std::min_element(of_other.begin(), of_other.end())};
}

// Largest error of its results, relative to the tolerance.
double share_of_tolerance(Context& ctx, TuneCase& of, const Runner& runner, double* error) {
  of.spoil(ctx);
  ctx.use_tuning(runner.tuning);
  runner.run();
  *error = of.error(ctx);
  if (!std::isfinite(*error)) return INFINITY;
  if (of.tolerance() > 0) return *error / of.tolerance();
  return *error > 0 ? INFINITY : 0.0;
}

// Weight of a shape for the search time: operations of all calls.
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
      flops = 39.0 * 64 * size(1);  // assumes a quarter of a tile's pixels
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

// Maximum number of sets that the search of a shape tries.
long sets_of(const TunedDeclaration& of, bool full) {
  long all = 1, each = 1;
  for (const TunedParameter& p : of.parameters) {
    all *= static_cast<long>(p.values.size());
    each += static_cast<long>(p.values.size()) - 1;
  }
  return full ? all : each;
}

class Search {
 public:
  Search(Context& ctx, const TuneRequest& request)
      : own_(ctx.stream()),
        ctx_(*own_),
        request_(request),
        begun_(now_s()),
        table_(tuning_subject(ctx.device(), ctx.flavour()), request.path) {
    ctx_.stop_with(ctx);
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
    table_.keep();  // even if there was no time for a trial: the reported path must hold a table
    out_.path = table_.path();
    out_.before = table_.before();
    out_.table = table_.table();
    out_.seconds = now_s() - begun_;
    return out_;
  }

 private:
  const TunedDeclaration* declaration(const Task& task) const {
    return tuned_declaration(task.shape.op, ctx_.flavour());
  }

  bool out_of_time() const { return !request_.full && now_s() - begun_ > request_.seconds; }

  // Reports progress, and asks whether to continue.
  void tell() {
    const double by_sets = all_ > 0 ? static_cast<double>(done_) / static_cast<double>(all_) : 1;
    const double by_time = request_.full ? 0 : (now_s() - begun_) / request_.seconds;
    if (request_.progress && !request_.progress(now_, std::min(0.999, std::max(by_sets, by_time))))
      fail(Status::cancelled, "stopped; what was found so far is in {}", table_.path());
  }

  void search(const Task& task, const TunedDeclaration& of) {
    case_.reset();
    odd_.reset();
    out_of_memory_ = false;
    if (request_.again && out_of_time()) {
      out_.left += sets_of(of, request_.full);
      return;
    }
    if (request_.again) table_.forget(task.shape);
    const TunedValues first = default_values(of);
    std::optional<TunedValues> best;  // among the right ones
    const auto consider = [&](const TunedValues& values) {
      if (values != best && takes_the_lead(task, values, best)) best = values;
    };
    if (const TunedTrial* won = table_.best(task.shape)) consider(TunedValues(won->values));
    consider(first);
    consider(table_.chosen(task.shape, of));
    if (request_.full) {
      for (const TunedValues& values : all_values(of)) consider(values);
    } else {
      for (std::size_t p = 0; p < of.parameters.size(); ++p)
        for (const long value : of.parameters[p].values) {
          TunedValues values = best.value_or(first);
          values.values[p] = value;
          consider(values);
        }
    }
    if (best) {
      settle(task, first, *best);
    } else if (const TunedTrial* trial = table_.find(task.shape, first); trial && is_refused(*trial)) {
      out_.not_right.push_back(text_of(of, task.shape));
      warn("{}: no set of parameters is right on this device", text_of(of, task.shape));
    }
  }

  // Whether that set is right, and faster than `best`, if there is one.
  bool takes_the_lead(const Task& task, const TunedValues& values, const std::optional<TunedValues>& best) {
    if (const TunedTrial* known = table_.find(task.shape, values); known && !is_begun(*known)) {
      ++done_;
      return !best && !is_refused(*known);
    }
    if (out_of_memory_ || out_of_time()) {
      ++out_.left;
      return false;
    }
    now_ = name_of_set(task, values);
    tell();
    TunedTrial& trial = table_.begin(task.shape, values);
    if (!is_refused(trial) && !attempt(task, values, best, trial)) return false;
    ++done_;
    if (is_refused(trial)) refuse(task, values, trial);
    return trial.verdict == "default" || trial.verdict == "right" || trial.verdict == "best";
  }

  // False if there was not enough memory to try it, so nothing is known of it.
  bool attempt(const Task& task, const TunedValues& values, const std::optional<TunedValues>& best, TunedTrial& trial) {
    try {
      compare(task, values, best, trial);
    } catch (const Error& e) {
      if (!tells_of_the_device(e)) {
        table_.drop(task.shape, values);
        if (e.status() != Status::memory) throw;
        out_of_memory_ = !case_ || !odd_;
        ++out_.left;
        warn("{}: not tried: {}", out_of_memory_ ? text_of(*values.of, task.shape) : now_, e.what());
        return false;
      }
      trial.verdict = "failed";
      trial.why = std::string(e.what()).substr(0, 500);
      case_.reset();
      odd_.reset();
    } catch (...) {
      table_.drop(task.shape, values);
      throw;
    }
    ++out_.tried;
    table_.end(trial);
    return true;
  }

  static std::string name_of_set(const Task& task, const TunedValues& values) {
    return fmt::format("{}, {}", text_of(*values.of, task.shape), text_of(values));
  }

  void refuse(const Task& task, const TunedValues& values, const TunedTrial& trial) {
    const std::string name = name_of_set(task, values);
    if (trial.why.empty())
      warn("{}: refused: off by {:.2g} of the largest value, at most {:.2g} expected", name, trial.error, tolerance_);
    else
      warn("{}: refused: {}", name, trial.why);
    if (table_.chosen(task.shape, *values.of) == values) table_.choose(task.shape, default_values(*values.of));
  }

  void make_cases(const Task& task) {
    if (!case_) case_ = tune_case(ctx_, task.exact);
    if (!odd_) odd_ = tune_case(ctx_, odd_shape(task.exact));
    tolerance_ = case_->tolerance();
  }

  void compare(const Task& task, const TunedValues& values, const std::optional<TunedValues>& best, TunedTrial& trial) {
    make_cases(task);
    const TunedOp op = task.shape.op;
    for (TuneCase* each : {odd_.get(), case_.get()}) {
      const Runner runner = make_ready(ctx_, *each, op, values);
      double error = 0;
      const double share = share_of_tolerance(ctx_, *each, runner, &error);
      tell();
      trial.error = std::max(trial.error, error);
      if (share > 1) {
        trial.verdict = "wrong";
        if (!std::isfinite(trial.error)) trial.why = "some values are no numbers";
        return;
      }
    }
    const Runner runner = make_ready(ctx_, *case_, op, values);
    if (!best) {
      trial.seconds = trial.against = race(runner, runner).other;
      trial.verdict = values == default_values(*values.of) ? "default" : "right";
      return;
    }
    const Runner other = make_ready(ctx_, *case_, op, *best);
    Race found = race(other, runner);
    if (found.won()) found = race(other, runner);  // repeated, so that chance does not decide
    trial.seconds = found.other, trial.against = found.best;
    trial.verdict = found.won() ? "best" : "slower";
  }

  // Each choice won a comparison: step by step, and finally against the default. If it turns out to be wrong, the best
  // right set has lost no comparison.
  void settle(const Task& task, const TunedValues& first, const TunedValues& best) {
    const TunedValues chosen = table_.chosen(task.shape, *best.of);
    const TunedTrial *of_best = table_.find(task.shape, best), *of_first = table_.find(task.shape, first);
    if (best == chosen || !of_first || is_begun(*of_first)) return;
    if (best == first) {  // the previous choice was retried, or was not reached
      if (const TunedTrial* known = table_.find(task.shape, chosen); known && !is_begun(*known))
        table_.choose(task.shape, first);
      return;
    }
    if (is_refused(*of_first)) {
      if (of_best->verdict == "best" || of_first->verdict == "wrong") table_.choose(task.shape, best);
      return;
    }
    if (!case_ && out_of_time()) return;
    confirm(task, first, best, *of_best);
  }

  void confirm(const Task& task, const TunedValues& first, const TunedValues& best, TunedTrial trial) {
    now_ = name_of_set(task, best);
    try {
      make_cases(task);
      const Runner runner = make_ready(ctx_, *case_, task.shape.op, best),
                   other = make_ready(ctx_, *case_, task.shape.op, first);
      const Race found = race(other, runner);
      trial.seconds = found.other, trial.against = found.best;
      trial.verdict = found.won() ? "best" : "slower";
    } catch (const Error& e) {
      if (e.status() != Status::memory) throw;
      warn("{}: not chosen yet: {}", now_, e.what());
      return;
    }
    table_.replace(trial);
    if (trial.verdict == "best")
      info("{}: {} is {:.2f} times as fast as {}", text_of(*best.of, task.shape), text_of(best),
           trial.against / trial.seconds, text_of(first));
    table_.choose(task.shape, trial.verdict == "best" ? best : first);
  }

  Race race(const Runner& best, const Runner& other) {
    return race_of(ctx_, best, other, [&] { tell(); });
  }

  std::unique_ptr<Context> own_;
  Context& ctx_;
  const TuneRequest& request_;
  double begun_, tolerance_ = 0;
  long all_ = 0, done_ = 0;
  bool out_of_memory_ = false;
  std::string now_;  // set under trial
  TriedTable table_;
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
