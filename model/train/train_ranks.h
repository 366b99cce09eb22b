// A training on several processes (runtime/system/ranks.h). Rank 0 has the optimiser, writes all files and reports; the
// other ranks only compute shards of its steps.
#pragma once
#include "model/data/data_set.h"
#include "model/train/training_run.h"
#include "runtime/system/ranks.h"

namespace vsplat {

// Rank 0's messages to the other ranks, which run follow() while it exists.
class RankLeader {
 public:
  explicit RankLeader(Ranks& ranks) : ranks_(ranks) {}
  ~RankLeader();
  RankLeader(const RankLeader&) = delete;
  RankLeader& operator=(const RankLeader&) = delete;

  Ranks& ranks() const { return ranks_; }
  // Starts a training on all ranks and waits until they are ready. Throws the first error of a rank, with its number.
  // Error(usage) if there are more ranks than shards.
  void begin(const Checkpoint& start);
  void begin_step();
  void give_moved(const std::vector<float>& weights, const std::string& kinds);
  // Ends the training; another one may begin.
  void rest();

 private:
  Ranks& ranks_;
};

// The loop of the other ranks; returns when rank 0's RankLeader is destroyed. Errors are sent to rank 0.
void follow(Context& ctx, const DataSet& data, const std::function<TrainOptions(const TrainConfig&)>& options,
            Ranks& ranks);

}  // namespace vsplat
