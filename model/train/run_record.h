// Facts about a training that no other file of its folder holds: the devices it ran on and the data it learnt from.
// Stored beside log.csv as record.json, which only the run page reads.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "model/data/data_set.h"

namespace vsplat {

class RunRecord {
 public:
  // Steps computed on one device, in one or several runs.
  struct Part {
    std::string device, driver, kernels;
    std::string tuning;                 // hash of its table of tuned parameters; empty: default parameters
    std::string switched_off;           // kernels that a self-test disabled, in words
    std::uint64_t limit = 0, peak = 0;  // bytes of its memory: allowed, and the peak
    long first = 0, last = 0;           // steps done before and after this part
    long starts = 1;
    double seconds = 0;

    bool same_device(const Part& other) const;
  };

  // Record of a training that continues after `step` steps. Keeps what the file says of the steps before. Unreadable
  // content is dropped, since a training does not need it.
  RunRecord(std::string path, long step, Part now);

  void set_data(const DataSet& data, const std::string& textures);
  // Updates the current run: its last step, duration and peak memory, and the number of data items skipped.
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
  std::vector<Part> parts_;  // the last one is in progress
  double seconds_ = 0;       // of the last part, in earlier runs
  std::uint64_t peak_ = 0;
  std::vector<Folder> data_;
  std::string textures_;
  int bad_ = 0;
};

}  // namespace vsplat
