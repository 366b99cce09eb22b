// The table of a search as a file: trials are written immediately, choices once they are final.
#pragma once
#include <optional>
#include <string>

#include "runtime/files/folder_lock.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::tuning {

class TriedTable {
 public:
  // Reads what an earlier search left there. `path` empty: the device's table in the cache folder, which also keeps
  // every choice by its hash. Error(usage) if there is no such folder, or if the file belongs to another subject;
  // Error(file) if another process is searching.
  TriedTable(const TuningSubject& of, const std::string& path);

  const std::string& path() const { return path_; }
  const TuningTable& table() const { return table_; }
  const std::string& before() const { return before_; }  // the previous hash

  const TunedTrial* find(const TunedShape& shape, const TunedValues& values) const;
  // The trial of a shape that won all comparisons.
  const TunedTrial* best(const TunedShape& shape) const;
  // The table's choice; the default if it has none.
  TunedValues chosen(const TunedShape& shape, const TunedDeclaration& of) const;

  // Each change is in the file when the call returns. A trial is recorded before it runs: if it ends the process twice,
  // its verdict is "failed".
  TunedTrial& begin(const TunedShape& shape, const TunedValues& values);
  void end(const TunedTrial& trial);
  void replace(const TunedTrial& trial);
  void drop(const TunedShape& shape, const TunedValues& values);
  void forget(const TunedShape& shape);  // removes all trials; the choice stays
  void choose(const TunedShape& shape, const TunedValues& values);

  void keep();

 private:
  void take_up();

  bool of_cache_;
  std::string path_, before_;
  std::optional<FolderLock> lock_;
  TuningTable table_;
};

bool is_refused(const TunedTrial& trial);
bool is_begun(const TunedTrial& trial);

}  // namespace vsplat::tuning
