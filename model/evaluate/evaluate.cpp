#include "model/evaluate/evaluate.h"

#include <algorithm>
#include <mutex>
#include <optional>

#include "model/evaluate/evaluator.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/share_out.h"

namespace vsplat {

namespace {

// An evaluation in progress, shared by all workers.
class Evaluated {
 public:
  // `own`: number of objects of this process.
  Evaluated(const DataSet& data, const EvaluateOptions& options, std::size_t own)
      : data_(data), options_(options), own_(own), found_(data.objects.size()) {}

  // Called by one worker, in parallel with others.
  void score(const Evaluator& evaluator, std::size_t item) {
    const DataObject& listed = data_.objects[item];
    if (options_.progress) {
      const std::lock_guard lock(telling_);
      options_.progress(listed.name, static_cast<double>(std::min(begun_++, own_)) / static_cast<double>(own_));
    }
    EvaluationObject object;
    std::vector<std::string> skipped, missing;
    try {
      object = evaluator.load(listed, skipped, missing);
    } catch (const Error& e) {
      if (!options_.skip_bad || !is_about_data(e)) throw;
      warn("an object is left out: {}", e.what());
      return;
    }
    for (const std::string& text : missing) warn("object {}: {}", listed.name, text);
    for (const std::string& text : skipped) warn("a view is left out: {}", text);
    const Scores s = evaluator.score(object);
    verbose("{}: PSNR {:.2f} dB (coarse {:.2f}, white {:.2f}, nearest view {:.2f}), {:.1f} % of the voxels selected",
            object.name, s.psnr, s.psnr_coarse, s.psnr_white, s.psnr_nearest, 100 * s.selected);
    found_[item] = ObjectScores{object.name, s};
  }
  // Sends this rank's results of its items to rank 0, and receives them there.
  void put(MessageOut& out, const std::vector<std::size_t>& items) const {
    for (const std::size_t item : items) {
      out.add(found_[item].has_value());
      if (found_[item]) out.add(found_[item]->name).add(found_[item]->scores);
    }
  }
  void take(MessageIn& from, const std::vector<std::size_t>& items) {
    for (const std::size_t item : items) {
      if (!from.take<bool>()) continue;
      const std::string name = from.take_text();
      found_[item] = ObjectScores{name, from.take<Scores>()};
    }
  }
  // Called in the data set's order.
  void add(std::size_t item) {
    if (!found_[item]) {
      ++out_.skipped;
      return;
    }
    evaluated_.push_back(&data_.objects[item]);
    out_.objects.push_back(*found_[item]);
    if (options_.on_object && (!options_.ranks || options_.ranks->rank() == 0)) {
      const std::lock_guard lock(telling_);
      options_.on_object(out_.objects.back());
    }
  }
  // Result of a rank other than 0; empty if it failed, which rank 0 reports.
  Evaluation own_result(bool whole) {
    if (whole && !out_.objects.empty()) out_.mean = mean_of(out_.objects);
    return std::move(out_);
  }
  Evaluation result(const Evaluator& evaluator) {
    if (out_.objects.empty()) fail(Status::input, "none of the {} objects could be evaluated", data_.objects.size());
    out_.mean = mean_of(out_.objects);
    if (options_.sheet) {
      // Renders again, since keeping every object's pictures would need unbounded memory.
      std::vector<const DataObject*> shown;
      for (const std::size_t i : typical(out_.objects)) shown.push_back(evaluated_[i]);
      out_.sheet = evaluator.sheet(shown);
    }
    return std::move(out_);
  }

 private:
  const DataSet& data_;
  const EvaluateOptions& options_;
  const std::size_t own_;
  std::mutex telling_;
  std::size_t begun_ = 0;
  std::vector<std::optional<ObjectScores>> found_;
  std::vector<const DataObject*> evaluated_;
  Evaluation out_;
};

// Items of a rank: every count-th, so that the ranks have equal numbers.
std::vector<std::size_t> items_of(const DataSet& data, int count, int rank) {
  std::vector<std::size_t> out;
  for (auto i = static_cast<std::size_t>(rank); i < data.objects.size(); i += static_cast<std::size_t>(count))
    out.push_back(i);
  return out;
}

// Runs on the other ranks; returns whether all their items are done.
template <class F>
bool sent_to_rank_0(Ranks& ranks, const F& evaluate_own, const Evaluated& evaluated,
                    const std::vector<std::size_t>& own) {
  MessageOut out;
  bool whole = false;
  try {
    evaluate_own();
    out.add(Status::ok);
    evaluated.put(out, own);
    whole = true;
  } catch (const Error& e) {
    out.add(e.status()).add(std::string(e.what()));
  }
  ranks.send(0, out.bytes());
  return whole;
}

// Runs on rank 0: evaluates its own items and collects the others', reported in order up to the first missing one. Its
// own error takes precedence.
template <class F>
void gather(Ranks& ranks, const F& evaluate_own, Evaluated& evaluated, const DataSet& data) {
  std::exception_ptr failed;
  std::vector<bool> is_there(data.objects.size());
  const auto take_note = [&](int rank) {
    for (const std::size_t item : items_of(data, ranks.count(), rank)) is_there[item] = true;
  };
  try {
    evaluate_own();
    take_note(0);
  } catch (...) {
    failed = std::current_exception();
  }
  for (int rank = 1; rank < ranks.count(); ++rank) {
    MessageIn message(ranks.receive(rank));
    if (const auto status = message.take<Status>(); status != Status::ok) {
      if (!failed)
        failed = std::make_exception_ptr(Error(status, fmt::format("rank {}: {}", rank, message.take_text())));
      continue;
    }
    evaluated.take(message, items_of(data, ranks.count(), rank));
    take_note(rank);
  }
  for (std::size_t i = 0; i < is_there.size() && (is_there[i] || !failed); ++i) evaluated.add(i);
  if (failed) std::rethrow_exception(failed);
}

}  // namespace

Evaluation evaluate(Context& ctx, const Network& network, const DataSet& data, const EvaluateOptions& options) {
  return evaluate({{ctx, network}}, data, options);
}

Evaluation evaluate(const std::vector<Evaluating>& workers, const DataSet& data, const EvaluateOptions& options,
                    const std::function<void(std::size_t worker, const Error& error)>& lost) {
  std::vector<Evaluator> evaluators;
  evaluators.reserve(workers.size());
  for (const Evaluating& worker : workers) evaluators.emplace_back(worker, options);
  for (const Evaluator& evaluator : evaluators) evaluator.check();
  std::vector<bool> gone(workers.size());
  const bool alone = !options.ranks || options.ranks->count() == 1;
  const int rank = alone ? 0 : options.ranks->rank();
  const std::vector<std::size_t> own = items_of(data, alone ? 1 : options.ranks->count(), rank);
  Evaluated evaluated(data, options, own.size());
  const auto evaluate_own = [&] {
    share_out({.items = own.size(),
               .workers = workers.size(),
               .ahead = own.size(),  // results are only numbers
               .work = [&](std::size_t worker, std::size_t i) { evaluated.score(evaluators[worker], own[i]); },
               .done =
                   [&](std::size_t i) {
                     if (alone || rank > 0) evaluated.add(own[i]);
                   },
               .lost =
                   [&](std::size_t worker, std::size_t, const Error& error) {
                     gone[worker] = true;
                     if (lost) lost(worker, error);
                   }});
  };
  if (alone)
    evaluate_own();
  else if (rank > 0)
    return evaluated.own_result(sent_to_rank_0(*options.ranks, evaluate_own, evaluated, own));
  else
    gather(*options.ranks, evaluate_own, evaluated, data);
  return evaluated.result(
      evaluators[static_cast<std::size_t>(std::find(gone.begin(), gone.end(), false) - gone.begin())]);
}

}  // namespace vsplat
