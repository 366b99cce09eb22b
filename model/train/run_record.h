// What of a training no other file of its folder tells: on which devices it ran, and what it learnt from. Kept beside
// log.csv as record.json, which nothing but a report reads.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "model/data/data_set.h"

namespace vsplat {

class RunRecord {
 public:
  // Steps that were made on one device, in one go or in several.
  struct Part {
    std::string device, driver, kernels;
    std::string tuning;                 // the hash of its table of tuned parameters; empty: none
    std::string switched_off;           // by a self-test, in words
    std::uint64_t limit = 0, peak = 0;  // bytes of its memory: that may be used, and held at the most
    long first = 0, last = 0;           // steps done before it, and after it
    long starts = 1;
    double seconds = 0;

    bool same_device(const Part& other) const;
  };

  // Of a training that begins after `step` steps, in the file: goes on with what is written there of the steps before.
  // What cannot be read is left out: nothing is lost with it that a training needs.
  RunRecord(std::string path, long step, Part now);

  void set_data(const DataSet& data, const std::string& textures);
  // What was done since it was made, so far: the step that is reached, its time, memory, and data passed over.
  void reach(long step, double seconds, std::uint64_t peak, int bad);
  // Error(file).
  void write() const;

 private:
  struct Folder {
    std::string path;
    long objects = 0;
  };

  void read_parts(long step);
  std::string text() const;

  std::string path_;
  std::vector<Part> parts_;  // the last is what goes on
  double seconds_ = 0;       // of the last one, before it went on
  std::uint64_t peak_ = 0;
  std::vector<Folder> data_;
  std::string textures_;
  int bad_ = 0;
};

}  // namespace vsplat
