// A training of several processes (runtime/system/ranks.h): rank 0 trains, writes and tells; the others compute parts of its
// steps. Nobody but rank 0 has the optimiser or writes a file.
#pragma once
#include "model/data/data_set.h"
#include "model/train/train.h"
#include "runtime/system/ranks.h"

namespace vsplat {

// What rank 0 says to the others, who follow() from its construction to its end.
class RankLeader {
 public:
  explicit RankLeader(Ranks& ranks) : ranks_(ranks) {}
  ~RankLeader();
  RankLeader(const RankLeader&) = delete;
  RankLeader& operator=(const RankLeader&) = delete;

  Ranks& ranks() const { return ranks_; }
  // A training begins there. Waits until all are ready; Error of the first that cannot, naming its rank, and Error
  // (usage) where there are more ranks than parts.
  void begin(const Checkpoint& start);
  void begin_step();
  void give_moved(const std::vector<float>& weights, const std::string& kinds);
  // The training has ended; another one may begin.
  void rest();

 private:
  Ranks& ranks_;
};

// What the other ranks do, until rank 0 says that it is over. Errors are rank 0's.
void follow(Context& ctx, const DataSet& data, const std::function<TrainOptions(const TrainConfig&)>& options,
            Ranks& ranks);

}  // namespace vsplat
