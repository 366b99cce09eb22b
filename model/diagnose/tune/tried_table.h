// The table of a search as its file: what is tried is in it at once, what is chosen when that is sure.
#pragma once
#include <optional>
#include <string>

#include "runtime/files/folder_lock.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::tuning {

class TriedTable {
 public:
  // With what an earlier search has left there. `path` empty: the device's table in the cache's folder, of which every
  // choice is kept by its hash, too. Error(usage) where there is no such folder, or the file is another subject's;
  // Error(file) where another process searches.
  TriedTable(const TuningSubject& of, const std::string& path);

  const std::string& path() const { return path_; }
  const TuningTable& table() const { return table_; }
  const std::string& before() const { return before_; }  // the hash that it had

  const TunedTrial* find(const TunedShape& shape, const TunedValues& values) const;
  // The trial of a shape that has won all races.
  const TunedTrial* best(const TunedShape& shape) const;
  // What the table chooses; the default where it chooses nothing.
  TunedValues chosen(const TunedShape& shape, const TunedDeclaration& of) const;

  // Each change is in the file when it returns. A set's trial is, before it runs: of one that ends the process twice
  // the verdict is "failed".
  TunedTrial& begin(const TunedShape& shape, const TunedValues& values);
  void end(const TunedTrial& trial);
  void replace(const TunedTrial& trial);
  void drop(const TunedShape& shape, const TunedValues& values);
  void forget(const TunedShape& shape);  // all trials; what is chosen stays
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
