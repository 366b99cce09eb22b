#include "model/diagnose/tune/tried_table.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/files/private_folder.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat::tuning {
namespace {

namespace fs = std::filesystem;

std::string day_of_search() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
}

auto with(const TunedShape& shape, const TunedValues& values) {
  return [&](const TunedTrial& t) { return t.shape == shape && t.values == values; };
}

}  // namespace

bool is_refused(const TunedTrial& trial) { return trial.verdict == "wrong" || trial.verdict == "failed"; }
bool is_begun(const TunedTrial& trial) { return trial.verdict.rfind("begun", 0) == 0; }

TriedTable::TriedTable(const TuningSubject& of, const std::string& path)
    : of_cache_(path.empty()), path_(of_cache_ ? tuning_path(of) : path) {
  table_.of = of;
  if (path_.empty())
    fail(Status::usage,
         "there is no folder to keep the table in (VSPLAT_CACHE_DIR is off, or others may write to the cache's "
         "folder): {} names a file",
         Option::tune_table);
  // Parallel searches would distort each other's times and overwrite each other's trials.
  const fs::path file(path_), folder = file.parent_path();
  if (of_cache_) {
    make_private_folder(folder.string());
    lock_.emplace(folder.string(), folder.string() + ", where tuned parameters are kept");
    lock_->keep_folders();
  } else {
    const std::string held = (folder / ("." + file.filename().string() + ".search")).string();
    lock_.emplace(held, held + ", which stands for a search that writes " + path_);
  }
  take_up();
  table_.measured = day_of_search();
}

// Keeps the replaced table by its hash.
void TriedTable::take_up() {
  std::error_code error;
  if (!fs::exists(path_, error)) {
    if (fs::is_symlink(fs::symlink_status(path_, error)))
      fail(Status::file, "{} is a link to {}, which is not there", path_, fs::read_symlink(path_, error).string());
    return;
  }
  TuningTable before;
  try {
    before = read_tuning(path_);
  } catch (const Error& e) {
    if (!of_cache_) throw;  // the caller's file, which may be anything
    warn("the search begins again: {}", e.what());
    return;
  }
  if (before.of != table_.of) {
    if (!of_cache_)
      fail(Status::usage, "{}: a table of another device, driver or other kernels; name another file", path_);
    return;
  }
  before_ = before.choice.hash();
  if (!before_.empty() && of_cache_) write_tuning(stored_tuning_path(before_), before);
  table_.choice = before.choice;
  table_.trials = before.trials;
}

void TriedTable::keep() { write_tuning(path_, table_); }

const TunedTrial* TriedTable::find(const TunedShape& shape, const TunedValues& values) const {
  const auto it = std::find_if(table_.trials.begin(), table_.trials.end(), with(shape, values));
  return it == table_.trials.end() ? nullptr : &*it;
}

const TunedTrial* TriedTable::best(const TunedShape& shape) const {
  for (const TunedTrial& t : table_.trials)
    if (t.shape == shape && t.verdict == "best") return &t;
  return nullptr;
}

TunedValues TriedTable::chosen(const TunedShape& shape, const TunedDeclaration& of) const {
  const auto it = table_.choice.chosen().find(shape);
  return it == table_.choice.chosen().end() ? default_values(of) : it->second;
}

TunedTrial& TriedTable::begin(const TunedShape& shape, const TunedValues& values) {
  TunedTrial trial;
  trial.shape = shape, trial.values = values, trial.verdict = "begun";
  if (const TunedTrial* known = find(shape, values)) {
    trial.verdict = known->verdict == "begun" ? "begun again" : "failed";
    if (trial.verdict == "failed") trial.why = "the process has ended twice while it was tried";
    std::erase_if(table_.trials, with(shape, values));
  }
  table_.trials.push_back(trial);
  keep();
  return table_.trials.back();
}

// It beat the previous winner, so that one lost; and sets that beat it won.
void TriedTable::end(const TunedTrial& trial) {
  for (TunedTrial& t : table_.trials) {
    if (&t == &trial || t.shape != trial.shape) continue;
    if (trial.verdict == "best" && (t.verdict == "best" || t.verdict == "right")) t.verdict = "slower";
    if (trial.verdict == "slower" && t.verdict == "right") t.verdict = "best";
  }
  keep();
}

void TriedTable::replace(const TunedTrial& trial) {
  for (TunedTrial& t : table_.trials)
    if (t.shape == trial.shape && t.values == trial.values) t = trial;
  keep();
}

void TriedTable::drop(const TunedShape& shape, const TunedValues& values) {
  std::erase_if(table_.trials, with(shape, values));
  keep();
}

void TriedTable::forget(const TunedShape& shape) {
  if (std::erase_if(table_.trials, [&](const TunedTrial& t) { return t.shape == shape; }) > 0) keep();
}

void TriedTable::choose(const TunedShape& shape, const TunedValues& values) {
  if (chosen(shape, *values.of) == values) return;
  table_.choice.set(shape, values);
  // Runs that start now record the table by its hash.
  if (const std::string hash = table_.choice.hash(); of_cache_ && !hash.empty())
    write_tuning(stored_tuning_path(hash), table_);
  keep();
}

}  // namespace vsplat::tuning
